#include "calipso_fem/world/world.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "world_impl.hpp"

namespace calipso::fem {
namespace {

double smallestDiagonal(const WorldScene& scene) {
  double smallest = scene.objects.empty() ? 1.0 : boundingDiagonal(scene.objects.front().mesh);
  for (const WorldObject& object : scene.objects)
    smallest = std::min(smallest, boundingDiagonal(object.mesh));
  return smallest;
}

ContactParams contactParams(const WorldScene& scene, const WorldParams& params) {
  ContactParams c;
  const double size = smallestDiagonal(scene);
  c.proximity = params.proximity > 0.0 ? params.proximity : 0.02 * size;
  c.iterations = params.contact_iterations;
  c.tolerance = params.contact_tolerance;
  c.allowed_depth = 6e-4 * c.proximity;
  return c;
}

}  // namespace

Material observedMaterial(const WorldObject& object, const ObjectSettings& settings,
                          const Eigen::Vector3d& gravity) {
  Material m = defaultMaterial(boundingDiagonal(object.mesh), gravity.norm());
  m.youngs_modulus = settings.youngs_modulus.value_or(m.youngs_modulus);
  m.poissons_ratio = settings.poissons_ratio.value_or(m.poissons_ratio);
  if (settings.density && std::isfinite(*settings.density)) m.density = *settings.density;
  m.damping = settings.damping.value_or(m.damping);
  return m;
}

void validateScene(const WorldScene& scene) {
  std::set<std::string> names;
  for (const WorldObject& object : scene.objects) {
    if (!names.insert(object.name).second)
      throw std::invalid_argument("two objects are named '" + object.name +
                                  "'; every object needs a name of its own");
    if (object.mesh.triangleCount() == 0)
      throw std::invalid_argument(object.name + ": its mesh has no triangles");
    if (!object.mesh.vertices.allFinite() || !object.world_from_object.matrix().allFinite())
      throw std::invalid_argument(object.name +
                                  ": mesh or pose contains a number that is not finite");
  }
  if (!scene.gravity.allFinite())
    throw std::invalid_argument("the scene's gravity is not finite; give m/s^2 in world axes");
}

World::Impl::Impl(WorldScene scene_in, WorldParams params_in)
    : scene(std::move(scene_in)),
      params(std::move(params_in)),
      contacts(contactParams(scene, params)) {
  validate(params);
  validateScene(scene);
  gravity_now = scene.gravity;
  for (const SupportMesh& mesh : scene.support_meshes)
    support_trees.push_back(std::make_unique<SurfaceTree>(mesh.mesh));
  for (const WorldObject& object : scene.objects) {
    Actor actor(object);
    actor.id = static_cast<int>(actors.size());
    actor.own_supports = ownSupports(object);
    actor.settings = params.settingsOf(object.name);
    actor.observed_material = actor.material =
        observedMaterial(object, actor.settings, scene.gravity);
    actor.immovable = actor.settings.immovable();
    actor.gravity = scene.gravity;
    actors.push_back(std::move(actor));
  }
}

World::World(WorldScene scene, WorldParams params)
    : impl_(std::make_unique<Impl>(std::move(scene), std::move(params))) {}
World::~World() = default;

void World::prepareForEdits() {
  std::vector<TriangleMesh> meshes;
  for (const WorldObject& object : impl_->scene.objects) meshes.push_back(object.mesh);
  impl_->hulls.prepare(meshes);
}

double World::time() const { return impl_->now; }
const WorldScene& World::scene() const { return impl_->scene; }

void World::addObservedMotion(const std::string& object, const ObservedMotion& motion) {
  impl_->known(object, "observed motion").track.add(motion);
}

Actor& World::Impl::known(const std::string& object, const char* what) {
  if (Actor* actor = find(object)) return *actor;
  std::string all;
  for (const std::string& name : names()) all += (all.empty() ? "" : ", ") + name;
  throw std::invalid_argument(std::string(what) + " of '" + object +
                              "': there is no such object; known: " + all);
}

void World::Impl::enqueue(const Edit& edit) {
  // A time that is no number cannot be ordered; the edit is refused with the next frame.
  const auto key = [](const Edit& e) { return std::isfinite(e.time) ? e.time : -1.0; };
  pending.insert(std::upper_bound(pending.begin(), pending.end(), edit,
                                  [&](const Edit& a, const Edit& b) { return key(a) < key(b); }),
                 edit);
}

// Edits that wait for a collision get its instant once it is known. What waits for one that the
// video does not have is handed on as it is, to be refused.
void World::Impl::releaseWaiting() {
  const std::vector<Edit> all = std::move(waiting);
  waiting.clear();
  for (Edit edit : all) {
    const Actor* actor = find(edit.after);
    const bool known = actor && edit.collision >= 1 &&
                       edit.collision <= static_cast<int>(actor->collisions.size());
    if (known) {
      edit.time = actor->collisions[edit.collision - 1] + std::max(0.0, edit.time);
      edit.after.clear();
    } else if (actor && !collisions_known) {
      waiting.push_back(edit);
      continue;
    }
    enqueue(edit);
  }
}

void World::addObservedGravity(const Eigen::Vector3d& gravity, double deviation) {
  std::optional<ObservedGravity>& known = impl_->observed_gravity;
  if (!known || deviation < known->deviation) known = {gravity, deviation};
}

void World::addObservedWind(const std::string& object, const ObservedWind& wind) {
  if (Actor* actor = impl_->find(object)) actor->wind.add(wind);
}

void World::addObservedModes(const std::string& object, const Eigen::MatrixXd& shapes) {
  Actor& actor = impl_->known(object, "observed modes");
  if (shapes.rows() != 3 * actor.object.mesh.vertexCount())
    throw std::invalid_argument(
        "observed modes of '" + object + "' have " + std::to_string(shapes.rows() / 3) +
        " vertices, but its model has " + std::to_string(actor.object.mesh.vertexCount()));
  actor.modes = shapes;
}

void World::addCollision(const std::string& object, double time) {
  if (Actor* actor = impl_->find(object)) actor->collisions.push_back(time);
  impl_->releaseWaiting();
}

void World::allCollisionsKnown() {
  impl_->collisions_known = true;
  impl_->releaseWaiting();
}

void World::submit(const Edit& edit) {
  if (edit.after.empty()) return impl_->enqueue(edit);
  impl_->waiting.push_back(edit);
  impl_->releaseWaiting();
}

std::vector<EditOutcome> World::advanceTo(double time) {
  const auto start = std::chrono::steady_clock::now();
  Impl& w = *impl_;
  w.substeps = 0;
  w.first_touches.clear();
  if (w.started && time > w.now) {
    // Stamps are rounded to nanoseconds; equal steps keep factorisations and compliances valid.
    const double period = w.params.frame_period;
    const double frames = (time - w.now) / period;
    const int whole = std::max(1, static_cast<int>(std::lround(frames)));
    const bool regular = std::abs(frames - whole) < 1e-3;
    const int steps = w.params.most_frames > 0 ? std::min(whole, w.params.most_frames) : whole;
    for (int k = 0; k < steps; ++k) w.stepFrame(regular ? period : (time - w.now) / (whole - k));
  }
  if (!w.started || time > w.now - 1e-3 * w.params.frame_period) w.now = time;
  w.started = true;

  std::vector<EditOutcome> outcomes;
  while (!w.pending.empty() && !(w.pending.front().time > time + 1e-6)) {
    const Edit edit = w.pending.front();
    EditOutcome outcome{edit, time, true, ""};
    try {
      outcome.message = w.apply(edit);
    } catch (const std::exception& error) {
      outcome.accepted = false;
      outcome.message = error.what();
    }
    w.pending.pop_front();
    outcomes.push_back(outcome);
  }
  w.rememberFirstTouches();
  w.step_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return outcomes;
}

void World::Impl::noteTouch(const TouchEvent& touch) {
  for (const TouchEvent& known : first_touches)
    if (std::minmax(known.a, known.b) == std::minmax(touch.a, touch.b)) return;
  first_touches.push_back(touch);
}

void World::Impl::rememberFirstTouches() {
  shown_contacts = rigid.contacts();
  const auto& soft = contacts.contacts();
  shown_contacts.insert(shown_contacts.end(), soft.begin(), soft.end());
  std::set<std::pair<std::string, std::string>> touching_now;
  for (ContactPoint& c : shown_contacts) {
    const auto pair = std::minmax(c.a, c.b);
    c.first_touch = touching.count(pair) == 0 && touching_now.count(pair) == 0;
    if (c.first_touch) noteTouch({c.a, c.b, now, c.position, c.normal, 0.0});
    touching_now.insert(pair);
  }
  // Pairs that met and parted within a frame have been noted by the rigid world.
  first_touches.erase(std::remove_if(first_touches.begin(), first_touches.end(),
                                     [&](const TouchEvent& t) {
                                       return touching.count(std::minmax(t.a, t.b)) > 0;
                                     }),
                      first_touches.end());
  touching = std::move(touching_now);
}

ObjectSnapshot World::Impl::snapshot(const Actor& actor) const {
  ObjectSnapshot s;
  s.name = actor.object.name;
  s.index = actor.object.index;
  s.kind = actor.kind;
  s.edited = actor.edited;
  s.removed = actor.removed;
  s.source = actor.source;
  s.look = actor.look;
  s.world_from_object = poseOf(actor, now);
  const bool in_video = !actor.inserted && actor.source.empty();
  if (in_video && !actor.track.empty() && actor.modes.cols() == 0)
    s.observed = actor.track.at(now).world_from_object;
  if (!actor.edited || actor.removed) return s;
  s.vertices = verticesOf(actor);
  if (actor.inserted && actor.source.empty()) s.triangles = actor.object.mesh.triangles;
  if (actor.soft) {
    s.sleeping = actor.asleep;
    s.von_mises = actor.soft->body().surfaceVonMises();
    s.kinetic_energy = actor.soft->body().kineticEnergy();
    s.elastic_energy = actor.soft->body().elasticEnergy();
  } else if (actor.kind == ObjectKind::kRigid && actor.body) {
    s.sleeping = rigid.sleeping(*actor.body);
    s.kinetic_energy = rigid.kineticEnergy(*actor.body);
  }
  return s;
}

WorldState World::state() const {
  WorldState state;
  state.time = impl_->now;
  for (const Actor& actor : impl_->actors) state.objects.push_back(impl_->snapshot(actor));
  state.contacts = impl_->shown_contacts;
  state.first_touches = impl_->first_touches;
  state.sun = impl_->sun;
  state.step_ms = impl_->step_ms;
  state.substeps = impl_->substeps;
  return state;
}

Actor* World::Impl::find(const std::string& name) {
  for (Actor& actor : actors)
    if (actor.object.name == name) return &actor;
  return nullptr;
}

std::vector<std::string> World::Impl::names() const {
  std::vector<std::string> list;
  for (const Actor& actor : actors) list.push_back(actor.object.name);
  return list;
}

}  // namespace calipso::fem
