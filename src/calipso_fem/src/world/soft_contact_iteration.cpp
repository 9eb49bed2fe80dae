#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include "anderson.hpp"
#include "calipso_fem/world/soft_contacts.hpp"
#include "contact_operator.hpp"
#include "soft_island.hpp"

namespace calipso::fem {
namespace {

// A longer step that does not converge is given up: the report then has no bodies, nothing has
// changed, and the caller takes two of half the length.
constexpr double kShortestStep = 1.0 / 100.0;       // s, for forces that do not balance,
constexpr double kShortestHeldStep = 1.0 / 500.0;   // s, for surfaces that are not held apart,
constexpr double kShortestFastStep = 1.0 / 1000.0;  // s, for objects too fast for their size
// Iterations that a renewal of a tangent costs.
constexpr double kRenewal = 8.0;

// Renewals of a body's tangent in a step: few of large bodies, whose factors cost more against an
// iteration.
int mostRenewals(const SoftObject& soft) {
  return std::clamp(8000 / soft.body().nodeCount(), 1, 8);
}

// Iterations after which a step may end further off balance, so many times as far with each more,
// and up to so many times further off the contacts' laws: crushed cells take many to the last
// digits.
constexpr int kPatience = 2;
constexpr double kImpatience = 4.0;
constexpr double kLooser = 5.0;
constexpr double kLoosest = 300.0;  // of the wanted residual: what a step may be off at most
constexpr int kStraightenings = 3;  // of the gaps of a step
constexpr double kFar = 3.0;  // of the wanted residual: from here on the iteration is accelerated

// @param velocity  of the surfaces against each other: along the normal, and two ways across
ContactRow rowOf(const Contact& c, const Eigen::Matrix3d& frame, const Eigen::Vector3d& velocity,
                 double h) {
  ContactRow row;
  row.free_velocity = velocity;
  row.impulse = h * (frame * c.force);
  row.friction = c.friction;
  row.held_normal = h * c.held_normal;
  row.held_tangential = h * c.held_tangential;
  return row;
}

ContactRow rowOf(const Contact& c, const StepMotion& motion) {
  const double h = motion.h();
  const Eigen::Matrix3d frame = contactFrame(c.normal);
  Eigen::Vector3d velocity = frame * motion.slip(c) / h;
  velocity[0] = motion.clearance(c) / h;
  ContactRow row = rowOf(c, frame, velocity, h);
  row.start_impulse = row.impulse;  // the velocity has its effect
  return row;
}

// How far a contact is from its law, m.
double violation(const ContactRow& row, double h) {
  const double normal = row.impulse[0] > -row.held_normal ? std::abs(row.free_velocity[0])
                                                          : std::max(0.0, -row.free_velocity[0]);
  const double limit = row.friction * (row.impulse[0] + row.held_normal) + row.held_tangential;
  const bool sticks = row.impulse.tail<2>().norm() < (1.0 - 1e-6) * limit;
  return h * std::max(normal, sticks ? row.free_velocity.tail<2>().norm() : 0.0);
}

// Whether the iteration with the kept tangent will take longer than with a new one.
bool slow(const StepMotion::Body& b, double wanted) {
  if (!(b.residual_before > 0.0)) return false;
  const double ratio = b.residual / b.residual_before;
  return ratio >= 1.0 || std::log(wanted / b.residual) / std::log(ratio) > kRenewal;
}

Vec forcesOf(const std::map<Contact::Key, Contact>& contacts) {
  Vec forces(3 * contacts.size());
  Eigen::Index at = 0;
  for (const auto& [key, c] : contacts) forces.segment<3>(3 * at++) = c.force;
  return forces;
}

void setForces(std::map<Contact::Key, Contact>& contacts, const Vec& forces) {
  Eigen::Index at = 0;
  for (auto& [key, c] : contacts) c.force = forces.segment<3>(3 * at++);
}

// Moves the bodies to where the last directions together point, if that is better than where they
// are. Contacts obey their laws only nearly there, so that the last iterations of a step do
// without.
bool accelerate(Anderson& anderson, StepMotion& motion, std::map<Contact::Key, Contact>& contacts) {
  const Vec plain = forcesOf(contacts);
  const auto next = anderson.next(motion.positions(), motion.targets(), plain);
  if (!next) return false;
  setForces(contacts, next->second);
  if (motion.tryTargets(next->first, contacts)) return true;
  setForces(contacts, plain);
  motion.follow(contacts);
  return false;
}

}  // namespace

// Whether a step may be kept, be it not solved to the last digit.
bool SoftContacts::acceptable(const Contacts& contacts, const StepMotion& motion) const {
  constexpr double kOff = 0.04;  // minimal distances
  for (const StepMotion::Body& b : motion.bodies())
    if (motion.h() > kShortestStep && b.touched && !(b.residual <= kLoosest * params_.residual))
      return false;
  if (motion.h() <= kShortestHeldStep) return true;
  for (const auto& [key, c] : contacts)
    if (c.soft_a >= 0 && !(-motion.clearance(c) <= kOff * c.reach)) return false;
  return true;
}

bool SoftContacts::unbalanced(const StepMotion& motion, size_t soft, double wanted) const {
  const StepMotion::Body& b = motion.bodies()[soft];
  return !b.stuck && b.residual > (b.touched ? wanted : b.soft->body().options().newton_tolerance);
}

// Whether an object with something in its way would go further than its own size.
bool SoftContacts::tooFast(const std::vector<Candidate>& watched,
                           const std::vector<SoftEntry>& softs, double h) const {
  std::vector<bool> fast;
  for (const SoftEntry& entry : softs) {
    const auto& vertices = entry.soft->vertices();
    fast.push_back(h * entry.soft->fastest() >
                   (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).norm());
  }
  return std::any_of(watched.begin(), watched.end(),
                     [&](const Candidate& c) { return fast[c.contact.soft_a]; });
}

// What pushed in the last step pushes from the start, and is a contact as long as it is near; what
// is in the way of the present motion may become one.
SoftContacts::Contacts SoftContacts::startingContacts(const std::vector<Candidate>& watched,
                                                      const std::vector<Obstacle>& obstacles,
                                                      const std::vector<SoftEntry>& softs,
                                                      const RigidWorld& rigid,
                                                      const StepMotion& motion) const {
  Contacts contacts;
  for (const Candidate& c : watched) {
    const auto known = memory_.find(c.contact.key);
    if (c.near && known != memory_.end() && !known->second.force.isZero(0.0))
      contacts.emplace(c.contact.key, completed(c.contact));
  }
  addRigidTouches(watched, softs, rigid, motion.h(), contacts);
  grow(watched, obstacles, softs, motion, contacts);
  return contacts;
}

int SoftContacts::solve(const ContactOperator& problem, const StepMotion& motion,
                        Contacts& contacts) const {
  const double h = motion.h();
  std::vector<ContactRow> rows;
  for (const auto& [key, c] : contacts) {
    const Eigen::Matrix3d frame = contactFrame(c.normal);
    const Eigen::Vector3d slip = problem.freeSlip(static_cast<int>(rows.size()), motion);
    Eigen::Vector3d velocity = frame * slip / h;
    velocity[0] += (c.start_gap + c.slack - c.offset + allowance(c, h)) / h;
    rows.push_back(rowOf(c, frame, velocity, h));
  }
  const int sweeps = solveContacts(problem.W(), rows, params_.iterations, 0.0,
                                   params_.tolerance * params_.allowed_depth / h)
                         .iterations;
  size_t i = 0;
  for (auto& [key, c] : contacts)
    c.force = contactFrame(c.normal).transpose() * rows[i++].impulse / h;
  return sweeps;
}

// Contacts that will act again. A pair that does not touch must not change a bit of what is
// computed.
SoftContacts::Contacts SoftContacts::expectedContacts(const std::vector<Candidate>& watched,
                                                      const Contacts& contacts,
                                                      const StepMotion& motion) const {
  std::set<std::pair<int, int>> touching;
  for (const auto& [key, c] : contacts) touching.emplace(std::get<0>(key), std::get<1>(key));
  Contacts expected;
  for (const Candidate& c : watched)
    if (c.near && motion.clearance(c.contact) < c.contact.reach &&
        touching.count({std::get<0>(c.contact.key), std::get<1>(c.contact.key)}))
      expected.emplace(c.contact.key, c.contact);
  return expected;
}

double SoftContacts::residualWanted(int iteration) const {
  return params_.residual *
         std::min(kLoosest, std::pow(kImpatience, std::max(0, iteration - kPatience)));
}

// Whether a contact is off its law or a body out of balance.
bool SoftContacts::isOpen(const Contacts& contacts, const StepMotion& motion, double wanted) const {
  const double allowed = params_.allowed_depth * std::min(kLooser, wanted / params_.residual);
  for (const auto& [key, c] : contacts)
    if (violation(rowOf(c, motion), motion.h()) > allowed) return true;
  for (size_t i = 0; i < motion.bodies().size(); ++i)
    if (unbalanced(motion, i, wanted)) return true;
  return false;
}

// Bodies whose tangents are too old for them, and which are not much nearer to their balance than
// others, get new ones. @return whether there were any
bool SoftContacts::renewStale(const Contacts& contacts, double wanted, StepMotion& motion,
                              std::vector<int>& renewals) const {
  constexpr double kMuch = 0.1;
  double worst = 0.0;
  for (const StepMotion::Body& b : motion.bodies())
    if (b.touched) worst = std::max(worst, b.residual);
  std::vector<int> stale;
  for (size_t i = 0; i < renewals.size(); ++i) {
    const StepMotion::Body& b = motion.bodies()[i];
    const bool behind = b.touched && unbalanced(motion, i, wanted) && b.residual >= kMuch * worst;
    if (behind && renewals[i] < mostRenewals(*b.soft) && slow(b, wanted))
      stale.push_back(static_cast<int>(i));
  }
  motion.renew(stale, contacts);
  for (const int soft : stale) ++renewals[soft];
  return !stale.empty();
}

// The next direction of the bodies that something keeps from their balance, with the contacts'
// forces. @return sweeps
int SoftContacts::direct(const std::vector<SoftEntry>& softs, RigidWorld& rigid, bool first,
                         ContactOperator& problem, StepMotion& motion, Contacts& contacts) const {
  motion.touch(contacts);
  std::vector<int> moving;
  for (size_t i = 0; i < softs.size(); ++i) {
    if (first && !motion.bodies()[i].touched) softs[i].soft->body().predictTrial();
    if (motion.bodies()[i].touched || first || unbalanced(motion, i, params_.residual))
      moving.push_back(static_cast<int>(i));
  }
  motion.aim(moving);
  if (contacts.empty()) return 0;
  problem.update(contacts, motion, softs, rigid);
  const int sweeps = solve(problem, motion, contacts);
  motion.follow(contacts);
  return sweeps;
}

// What rigid bodies near a deformable one rest on, or come to rest on, holds against its push.
void SoftContacts::addRigidTouches(const std::vector<Candidate>& watched,
                                   const std::vector<SoftEntry>& softs, const RigidWorld& rigid,
                                   double h, Contacts& contacts) const {
  constexpr int kNoSoft = std::numeric_limits<int>::max();
  std::set<RigidWorld::Id> ids;
  double pushed = 0.0;  // how far a deformable one may push them, m
  for (const Candidate& c : watched) {
    if (!c.contact.rigid_b) continue;
    ids.insert(*c.contact.rigid_b);
    pushed = std::max(pushed, h * softs[c.contact.soft_a].soft->fastest());
  }
  if (ids.empty()) return;
  int index = 0;
  for (const RigidTouch& t : rigid.touchesAround(ids, pushed, h)) {
    Contact c;
    c.key = {kNoSoft, 0, index++, 0};
    c.rigid_a = t.a;
    c.rigid_b = t.b;
    c.place = t.place;
    c.normal = t.normal;
    c.start_gap = t.gap;
    c.friction = t.friction;
    contacts.emplace(c.key, c);
  }
}

// What the iterations of a step carry from one to the next.
struct SoftContacts::Progress {
  explicit Progress(size_t bodies) : renewals(bodies, 0) {}

  void disturb() {
    undisturbed = 0;
    anderson.reset();
  }

  ContactOperator problem;
  Anderson anderson;
  std::vector<int> renewals;  // per body
  int undisturbed = 0;        // iterations with the same contacts and systems
  int straightened = 0;
  bool open = true;  // something is off its law
};

// One direction of all bodies, and the way along it.
void SoftContacts::iterate(const Surroundings& around, Island& island, Progress& p) const {
  StepMotion& motion = *island.motion;
  Contacts& contacts = island.contacts;
  const int iteration = ++island.report.newton_iterations;
  const double wanted = residualWanted(iteration);
  island.report.iterations +=
      direct(island.softs, around.rigid, iteration == 1, p.problem, motion, contacts);
  const int added = grow(around.watched, around.obstacles, island.softs, motion, contacts);
  motion.advanceFree();
  ++p.undisturbed;
  if (added > 0) p.disturb();
  const bool far = std::any_of(motion.bodies().begin(), motion.bodies().end(), [&](const auto& b) {
    return b.touched && b.residual > kFar * wanted;
  });
  if (p.undisturbed == 0 || !far || !accelerate(p.anderson, motion, contacts))
    motion.advanceTouched();
  p.open = added > 0 || isOpen(contacts, motion, wanted);
  if (p.open && added == 0 && renewStale(contacts, wanted, motion, p.renewals)) p.disturb();
}

// Where the iteration has ended, or half of it is gone, gaps are measured anew.
void SoftContacts::straightenWhereDue(const Surroundings& around, Island& island,
                                      Progress& p) const {
  const bool late = 2 * island.report.newton_iterations == params_.newton_iterations;
  if ((p.open && !late) || p.straightened == kStraightenings) return;
  ++p.straightened;
  if (straighten(around.watched, around.obstacles, island.softs, *island.motion, island.contacts) ==
      0)
    return;
  p.open = true;
  p.problem.forget();
  p.disturb();
}

void SoftContacts::solveIsland(const std::vector<Obstacle>& obstacles, RigidWorld& rigid, double h,
                               Island& island) const {
  const std::vector<Candidate> watched = candidates(island.softs, obstacles, rigid, h);
  if (h > kShortestFastStep && tooFast(watched, island.softs, h)) return;
  island.motion = std::make_unique<StepMotion>(island.softs, obstacles, rigid, h);
  const StepMotion& motion = *island.motion;
  island.contacts = startingContacts(watched, obstacles, island.softs, rigid, motion);
  island.motion->expect(expectedContacts(watched, island.contacts, motion));

  const Surroundings around{watched, obstacles, rigid};
  Progress progress(island.softs.size());
  while (progress.open && island.report.newton_iterations < params_.newton_iterations) {
    iterate(around, island, progress);
    straightenWhereDue(around, island, progress);
  }
  ContactReport& report = island.report;
  report.renewals = std::accumulate(progress.renewals.begin(), progress.renewals.end(), 0);
  for (const auto& [key, c] : island.contacts) {
    report.deepest = std::max(report.deepest, c.offset - motion.gap(c));
    report.contacts += c.soft_a >= 0 && !c.force.isZero(0.0);
  }
  report.converged = !progress.open;
  island.accepted = acceptable(island.contacts, motion);
}

}  // namespace calipso::fem
