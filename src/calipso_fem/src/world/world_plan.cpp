#include <algorithm>

#include "world_impl.hpp"

// What the user sees of the world besides the objects' motion.
namespace calipso::fem {
namespace {

// kg; 0: it is not simulated.
double massAsSimulated(const Actor& actor) {
  if (actor.soft) return actor.soft->body().totalMass();
  return actor.kind == ObjectKind::kRigid ? massOf(actor) : 0.0;
}

PlanEntry entryOf(const Actor& actor, double time_step) {
  PlanEntry e;
  e.object = actor.object.name;
  e.kind = actor.kind;
  const std::string note = actor.note.substr(0, actor.note.find_last_not_of("; ") + 1);
  e.reason = actor.reason + (note.empty() ? "" : " (" + note + ")");
  e.material = actor.material;
  e.time_step = time_step;
  e.mass = massAsSimulated(actor);
  if (actor.soft) {
    const DeformableBody& body = actor.soft->body();
    e.nodes = body.nodeCount();
    e.elements = body.model().mesh().cellCount();
    e.element = toString(body.options().element);
    e.material_model = toString(body.options().material_model);
    e.solver = toString(body.options().solver);
    e.cell_size = body.grid().cell_size;
    e.ms_per_frame = actor.soft_ms;
  } else if (actor.kind == ObjectKind::kRigid) {
    e.element = "convex hull";
    e.solver = "Bullet";
  }
  return e;
}

// The twelve edges of a hexahedron, or six of a tetrahedron, as corner pairs.
std::vector<std::pair<int, int>> cellEdges(bool tetrahedral) {
  if (tetrahedral) return {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
  return {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3},
          {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
}

void drawGrid(const DeformableBody& body, World::Drawing& drawing) {
  const VolumeMesh& mesh = body.model().mesh();
  std::set<std::pair<int, int>> edges;
  for (int c = 0; c < mesh.cellCount(); ++c)
    for (const auto& [a, b] : cellEdges(mesh.isTetrahedral()))
      edges.insert(std::minmax(mesh.cells(c, a), mesh.cells(c, b)));
  const auto at = [&](int node) { return Eigen::Vector3d(body.positions().segment<3>(3 * node)); };
  for (const auto& [a, b] : edges) {
    drawing.edges.push_back(at(a));
    drawing.edges.push_back(at(b));
  }
  for (int node = 0; node < body.nodeCount(); ++node)
    if (body.isFixed(node)) drawing.fixed.push_back(at(node));
}

}  // namespace

std::vector<PlanEntry> World::plan() const {
  std::vector<PlanEntry> entries;
  const double period = impl_->params.frame_period;
  for (const Actor& actor : impl_->actors) {
    entries.push_back(entryOf(actor, actor.soft ? period / impl_->substepsPerFrame() : period));
    if (actor.kind == ObjectKind::kRigid)
      entries.back().elements = static_cast<int>(impl_->hulls.of(actor.object.mesh).size());
  }
  return entries;
}

bool World::planChanged() { return std::exchange(impl_->plan_changed, false); }

std::vector<World::Drawing> World::drawings() const {
  std::vector<Drawing> drawings;
  for (const Actor& actor : impl_->actors) {
    if (actor.removed || !actor.edited) continue;
    Drawing drawing;
    drawing.object = actor.object.name;
    drawing.mass = massAsSimulated(actor);
    if (actor.soft) drawGrid(actor.soft->body(), drawing);
    for (const Pull& pull : actor.pulls) {
      if (pull.to_target) continue;
      drawing.forces.emplace_back(impl_->poseOf(actor, impl_->now) * pull.anchor,
                                  pull.share(impl_->now) * pull.vector);
    }
    drawings.push_back(std::move(drawing));
  }
  return drawings;
}

}  // namespace calipso::fem
