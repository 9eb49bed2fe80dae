#include "calipso_fem/world/soft_contacts.hpp"

#include <algorithm>

#include "soft_island.hpp"
#include "thread_team.hpp"

namespace calipso::fem {
namespace {

// A point that came from afar is near from now on.
Contact::Key atRest(Contact::Key key) {
  std::get<3>(key) &= 1;
  return key;
}

}  // namespace

void ContactReport::add(const ContactReport& other) {
  contacts += other.contacts;
  iterations += other.iterations;
  newton_iterations = std::max(newton_iterations, other.newton_iterations);
  renewals += other.renewals;
  deepest = std::max(deepest, other.deepest);
  converged = converged && other.converged;
}

SoftContacts::SoftContacts(const ContactParams& params) : params_(params) {}
SoftContacts::~SoftContacts() = default;

ContactReport SoftContacts::step(const std::vector<SoftEntry>& softs,
                                 const std::vector<Obstacle>& obstacles, RigidWorld& rigid,
                                 double h) {
  std::vector<Island> islands = islandsOf(softs, obstacles, rigid, h);
  eachOnAThread(static_cast<int>(islands.size()),
                [&](int k) { solveIsland(obstacles, rigid, h, islands[k]); });
  ContactReport report;
  bool accepted = true;
  for (const Island& island : islands) {
    accepted = accepted && island.accepted;
    report.add(island.report);
  }
  if (!accepted) return report;
  forgetForces();
  contacts_.clear();
  report.bodies.resize(softs.size());
  for (Island& island : islands) {
    remember(island.contacts, *island.motion);
    publish(island.contacts, *island.motion, island.softs, obstacles);
    const std::vector<StepReport> bodies = island.motion->finish(island.contacts);
    for (size_t k = 0; k < bodies.size(); ++k) report.bodies[island.members[k]] = bodies[k];
  }
  return report;
}

void SoftContacts::forgetForces() {
  for (auto it = memory_.begin(); it != memory_.end();) {
    it->second.force.setZero();
    const bool empty = !it->second.holds && it->second.offset >= 0.0;
    it = empty ? memory_.erase(it) : std::next(it);
  }
}

void SoftContacts::remember(const Contacts& contacts, const StepMotion& motion) {
  for (const auto& [key, c] : contacts) {
    if (c.soft_a < 0) continue;
    Memory& m = memory_[atRest(key)];
    if (m.force.squaredNorm() > c.force.squaredNorm()) continue;  // found twice: once is enough
    m.force = c.force;
    const double gap = motion.gap(c);
    if (m.holds && gap - m.offset > 0.2 * c.reach) {  // apart: what held it holds no more
      m.holds = false;
      m.held_normal = m.held_tangential = 0.0;
    }
    if (!m.holds) m.offset = std::min(0.0, std::max(m.offset, gap));
    if (m.force.isZero(0.0) && !m.holds && m.offset >= 0.0) memory_.erase(atRest(key));
  }
}

void SoftContacts::publish(const Contacts& contacts, const StepMotion& motion,
                           const std::vector<SoftEntry>& softs,
                           const std::vector<Obstacle>& obstacles) {
  for (const auto& [key, c] : contacts) {
    if (c.soft_a < 0 || c.force.isZero(0.0)) continue;
    ContactPoint p;
    p.a = softs[c.soft_a].name;
    p.b = obstacles[c.obstacle].name;
    p.position = c.place;
    p.normal = c.normal;
    p.force = c.force;
    p.depth = c.offset - motion.gap(c);
    contacts_.push_back(p);
  }
}

}  // namespace calipso::fem
