#include <algorithm>
#include <stdexcept>

#include "calipso_fem/world/mass_properties.hpp"
#include "fold_test.hpp"
#include "self_proximity.hpp"
#include "world_impl.hpp"

// Objects and pairs of objects, changed while the world runs.
namespace calipso::fem {
namespace {

// A support mesh is an object's own surface when most of it lies on that, facing as it does.
// of the object's diagonal: the alignment's error, and details
constexpr double kOwnSurface = 0.02;
constexpr double kOwnShare = 0.5;  // of the support's area

// Part of the mesh's area whose triangles lie within `reach` of the surface and face the same way.
double shareOn(const SurfaceTree& surface, const TriangleMesh& mesh, double reach) {
  double on = 0.0, all = 0.0;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(t, 0)),
                          b = mesh.vertex(mesh.triangles(t, 1)),
                          c = mesh.vertex(mesh.triangles(t, 2));
    const Eigen::Vector3d across = (b - a).cross(c - a);
    all += across.norm();
    const auto hit = surface.nearest((a + b + c) / 3.0, reach);
    if (hit && hit->normal.dot(across) > 0.5 * across.norm()) on += across.norm();
  }
  return all > 0.0 ? on / all : 0.0;
}

}  // namespace

int World::Impl::idOf(const std::string& name) const {
  for (const Actor& actor : actors)
    if (actor.object.name == name) return actor.id;
  std::vector<std::string> supports_by_id;
  for (const SupportPlane& plane : scene.planes) supports_by_id.push_back(plane.name);
  for (const SupportMesh& mesh : scene.support_meshes) supports_by_id.push_back(mesh.name);
  std::string known;
  for (const std::string& object : names()) known += " " + object;
  for (size_t k = 0; k < supports_by_id.size(); ++k) {
    if (supports_by_id[k] == name) return supportId(k);
    known += " " + supports_by_id[k];
  }
  throw std::invalid_argument("there is no object or support '" + name + "'; there are:" + known);
}

std::optional<RigidWorld::Id> World::Impl::rigidIdOf(int id) const {
  if (id >= 0) return actors[id].body;
  const size_t k = static_cast<size_t>(-1 - id);
  return k < supports.size() ? std::optional<RigidWorld::Id>(supports[k]) : std::nullopt;
}

void World::Impl::setSurface(Actor& actor, const SurfaceSettings& surface) {
  validate(surface, actor.object.name);
  actor.settings.surface = surface;
  if (actor.body) rigid.setSurface(*actor.body, surface);
  wake(actor);
}

bool World::Impl::meet(int a, int b) const {
  const auto found = rules.find(std::minmax({a, b}));
  return found == rules.end() || found->second.contact;
}

std::vector<int> World::Impl::ownSupports(const WorldObject& object) const {
  std::vector<int> own;
  if (scene.support_meshes.empty()) return own;
  const SurfaceTree surface(placed(object.mesh, object.world_from_object));
  const double reach = kOwnSurface * boundingDiagonal(object.mesh);
  for (size_t k = 0; k < scene.support_meshes.size(); ++k)
    if (shareOn(surface, scene.support_meshes[k].mesh, reach) > kOwnShare)
      own.push_back(supportId(scene.planes.size() + k));
  return own;
}

void World::Impl::meetOwnSupports(Actor& actor, bool contact) {
  if (contact) {
    for (const auto& [support, other] : actor.ended_contacts) setPairContact(support, other, true);
    actor.ended_contacts.clear();
    return;
  }
  for (const SupportMesh& mesh : scene.support_meshes) {
    const auto& own = actor.own_supports;
    if (std::find(own.begin(), own.end(), idOf(mesh.name)) == own.end()) continue;
    for (const std::string& other : allBut(mesh.name)) {
      if (!pairRule(mesh.name, other).contact) continue;
      setPairContact(mesh.name, other, false);
      actor.ended_contacts.emplace_back(mesh.name, other);
    }
    const std::string left_out = mesh.name + " is its own surface and is left out; ";
    if (actor.note.find(left_out) == std::string::npos) actor.note += left_out;
  }
}

void World::Impl::keepOwnSupportsOut() {
  for (Actor& actor : actors)
    if (!actor.ended_contacts.empty()) meetOwnSupports(actor, false);
}

void World::Impl::rememberRules(const std::string& object, const std::string& other) {
  for (const std::string& partner : other.empty() ? allBut(object) : std::vector{other})
    rules_before.emplace(std::minmax(object, partner), pairRule(object, partner));
}

void World::Impl::restoreRules(const std::string& object) {
  for (auto it = rules_before.begin(); it != rules_before.end();) {
    const auto& [pair, rule] = *it;
    const bool its_own = pair.first == object || pair.second == object;
    if (its_own) setPairRule(pair.first, pair.second, rule);
    it = its_own ? rules_before.erase(it) : std::next(it);
  }
}

PairRule World::Impl::pairRule(const std::string& a, const std::string& b) const {
  const int ia = idOf(a), ib = idOf(b);
  const auto found = rules.find(std::minmax({ia, ib}));
  if (found != rules.end()) return found->second;
  PairRule rule;
  if (ia == ib && ia >= 0) rule.contact = meetsItself(actors[ia]);
  return rule;
}

void World::Impl::setPairRule(const std::string& a, const std::string& b, const PairRule& rule) {
  validate(rule, a + " and " + b);
  const int ia = idOf(a), ib = idOf(b);
  if (ia == ib && ia < 0)
    throw std::invalid_argument(
        "the support '" + a +
        "' with itself is no pair, it does not deform; name two objects or supports");
  if (ia == ib) return setSelfRule(actors[ia], rule);
  rules[std::minmax({ia, ib})] = rule;
  contacts.setRule(ia, ib, rule);
  const auto ra = rigidIdOf(ia), rb = rigidIdOf(ib);
  if (ra && rb) rigid.setRule(*ra, *rb, rule);
  for (const int id : {ia, ib})
    if (id >= 0) wake(actors[id]);
}

bool World::Impl::meetsItself(const Actor& actor) const {
  const auto rule = rules.find({actor.id, actor.id});
  if (rule != rules.end()) return rule->second.contact;
  const TriangleMesh& mesh = actor.object.mesh;
  return actor.settings.self_contact.value_or(isThin(mesh) && isClosed(mesh) &&
                                              signedVolume(mesh) > 0.0);
}

void World::Impl::setSelfRule(Actor& actor, const PairRule& rule) {
  if (rule.contact && actor.soft) actor.soft->setSelfContact(true);  // throws where it cannot
  rules[{actor.id, actor.id}] = rule;
  contacts.setRule(actor.id, actor.id, rule);
  watchItself(actor);
  wake(actor);
}

void World::Impl::watchItself(Actor& actor) {
  if (!actor.soft) return;
  try {
    actor.soft->setSelfContact(meetsItself(actor));
  } catch (const std::invalid_argument& error) {
    actor.note += std::string(error.what()) + "; ";
    return;
  }
  if (SelfProximity* self = actor.soft->selfProximity())
    if (const int count =
            crossings(actor.soft->tree(), self->shallow(boundingDiagonal(actor.object.mesh))))
      actor.note += "starts passing through itself along " + std::to_string(count) +
                    " edges: there it is one piece and is not held apart; ";
}

std::vector<std::string> World::Impl::allBut(const std::string& name) const {
  std::vector<std::string> others = names();
  for (const SupportPlane& plane : scene.planes) others.push_back(plane.name);
  for (const SupportMesh& mesh : scene.support_meshes) others.push_back(mesh.name);
  others.erase(std::remove(others.begin(), others.end(), name), others.end());
  return others;
}

void World::Impl::setPairContact(const std::string& a, const std::string& b, bool on) {
  for (const std::string& other : b.empty() ? allBut(a) : std::vector<std::string>{b}) {
    PairRule rule = pairRule(a, other);
    rule.contact = on;
    setPairRule(a, other, rule);
  }
}

// Bullet has given the object's body a new id.
void World::Impl::applyRules(const Actor& actor) {
  for (const auto& [pair, rule] : rules) {
    if (pair.first != actor.id && pair.second != actor.id) continue;
    const auto a = rigidIdOf(pair.first), b = rigidIdOf(pair.second);
    if (a && b) rigid.setRule(*a, *b, rule);
  }
}

int World::Impl::freeIndex() const {
  int index = 1;
  for (const Actor& actor : actors) index = std::max(index, actor.object.index + 1);
  return index;
}

// What is new is not held by a video, and has to have a mass.
Actor& World::Impl::addObject(const WorldObject& object, const ObjectSettings& settings) {
  try {
    massProperties(object.mesh, 1.0);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(object.name + ": " + error.what() + "; give it a thickness");
  }
  scene.objects.push_back(object);
  scene.objects.back().in_video = false;
  try {
    validateScene(scene);
  } catch (...) {
    scene.objects.pop_back();
    throw;
  }
  Actor actor(object);
  actor.id = static_cast<int>(actors.size());
  actor.inserted = true;
  actor.settings = settings;
  actor.observed_material = actor.material = observedMaterial(object, settings, scene.gravity);
  actor.immovable = settings.immovable();
  actor.gravity = gravity_now;
  actor.holder = Holder::kNothing;
  actor.edited = true;
  actor.kind = ObjectKind::kKinematic;
  actor.reason = "it was added";
  actors.push_back(std::move(actor));
  addCollider(actors.back());
  keepOwnSupportsOut();
  plan_changed = true;
  return actors.back();
}

Actor& World::Impl::duplicate(const std::string& source_name, const std::string& name,
                              const Eigen::Isometry3d& motion) {
  Actor* found = find(source_name);
  if (!found || found->removed)
    throw std::invalid_argument("there is no object '" + source_name + "' to duplicate");
  Actor& source = *found;
  const BodyMotion moves = motionOf(source);
  WorldObject object = source.object;
  object.name = name;
  object.attachments.clear();
  object.index = freeIndex();
  object.world_from_object = motion * moves.world_from_object;
  Actor& copy = addObject(object, source.settings);
  copy.observed_material = source.observed_material;
  copy.material = source.material;
  copy.stiffness_given = source.stiffness_given;
  copy.immovable = source.immovable;
  copy.gravity = source.gravity;
  copy.air = source.air;
  copy.pressure = source.pressure;
  if (source.holder == Holder::kBuoyancy) {
    copy.holder = source.holder;
    copy.buoyancy = source.buoyancy;
  }
  copy.reason = "it is a copy of " + source_name;
  if (!source.simulated()) return copy;
  const BodyMotion start{object.world_from_object, motion.linear() * moves.linear,
                         motion.linear() * moves.angular};
  if (source.kind == ObjectKind::kRigid)
    enter(copy, bodyOf(copy, object.mesh, ObjectKind::kRigid, start), false);
  else
    copySoft(copy, source, motion);
  return copy;
}

std::unique_ptr<SoftObject> World::Impl::twinOf(const Actor& actor, const TriangleMesh& mesh,
                                                const FemOptions& options) const {
  const DeformableBody& from = actor.soft->body();
  auto twin = std::make_unique<SoftObject>(placed(mesh, actor.soft_from_object),
                                           actor.observed_material, options);
  twin->body().setRestNodes(from.model().mesh().nodes);
  twin->copyPrestress(*actor.soft);
  twin->setGravity(actor.acceleration());
  twin->body().setState(from.positions(), from.velocities());
  twin->changed();
  return twin;
}

// The same grid in the same place, with the original's rest shape; then the state, moved.
void World::Impl::copySoft(Actor& copy, const Actor& source, const Eigen::Isometry3d& motion) {
  removeBodies(copy);
  copy.kind = ObjectKind::kDeformable;
  copy.soft = twinOf(source, copy.object.mesh, source.soft->body().options());
  copy.soft_from_object = source.soft_from_object;
  copy.soft->setMaterial(copy.material);
  copy.soft->body().applyRigidTransform(motion);
  copy.soft->setGravity(copy.acceleration());
  copy.soft->body().setPressure(copy.pressure);
  copy.soft->changed();
  watchItself(copy);
}

void World::setPairContact(const std::string& a, const std::string& b, bool on) {
  impl_->setPairContact(a, b, on);
}

void World::setPairRule(const std::string& a, const std::string& b, const PairRule& rule) {
  impl_->setPairRule(a, b, rule);
}

PairRule World::pairRule(const std::string& a, const std::string& b) const {
  return impl_->pairRule(a, b);
}

void World::setSurface(const std::string& object, const SurfaceSettings& surface) {
  Actor* actor = impl_->find(object);
  if (!actor) impl_->idOf(object);  // says which names there are
  if (!actor)
    throw std::invalid_argument("'" + object + "' is a support; set the surface of an object");
  impl_->setSurface(*actor, surface);
}

void World::addObject(const WorldObject& object, const ObjectSettings& settings) {
  impl_->addObject(object, settings);
}

void World::duplicate(const std::string& source, const std::string& name,
                      const Eigen::Isometry3d& motion) {
  impl_->duplicate(source, name, motion);
}

}  // namespace calipso::fem
