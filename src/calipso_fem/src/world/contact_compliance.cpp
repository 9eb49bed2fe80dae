#include "contact_compliance.hpp"

namespace calipso::fem {
namespace {

constexpr double kSameDirection = 0.99;  // cosine below which a normal has turned

// One of the bodies a contact acts on: sign +1 for a, -1 for b.
struct Side {
  int soft = -1;
  std::optional<RigidWorld::Id> rigid;
  const SurfacePoint* point = nullptr;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  double sign = 1.0;
};

struct Entry {
  Side sides[2];
  Eigen::Matrix3d frame;
  int old = -1;  // row in the matrix of before
};

Eigen::Matrix3d coupling(const Side& at, const Side& from, const std::vector<SoftEntry>& softs,
                         const RigidWorld& rigid, double h) {
  if (at.soft >= 0 && at.soft == from.soft)
    return at.sign * from.sign * softs[at.soft].soft->compliance(*at.point, *from.point, h);
  if (at.rigid && at.rigid == from.rigid)
    return at.sign * from.sign * rigid.compliance(*at.rigid, at.place, from.place);
  return Eigen::Matrix3d::Zero();
}

bool samePoint(const SurfacePoint& a, const SurfacePoint& b) {
  return a.vertices == b.vertices && (a.weights - b.weights).cwiseAbs().maxCoeff() < 0.1;
}

}  // namespace

bool ContactCompliance::same(const Known& known, const Contact& c) const {
  return known.normal.dot(c.normal) > kSameDirection && samePoint(known.point, c.point) &&
         (c.soft_b < 0 || samePoint(known.other, c.other)) && !c.rigid_a && !c.rigid_b;
}

const Eigen::MatrixXd& ContactCompliance::of(const std::map<Contact::Key, Contact>& contacts,
                                             const std::vector<SoftEntry>& softs,
                                             const RigidWorld& rigid, double h) {
  if (h != h_) known_.clear();
  h_ = h;
  std::vector<Entry> entries;
  std::map<Contact::Key, Known> known;
  bool unchanged = contacts.size() == known_.size();
  for (const auto& [key, c] : contacts) {
    Entry e{{Side{c.soft_a, c.rigid_a, &c.point, c.place, 1.0},
             Side{c.soft_b, c.rigid_b, &c.other, c.place, -1.0}},
            contactFrame(c.normal),
            -1};
    Known now{static_cast<int>(entries.size()), c.normal, c.point, c.other, c.place};
    const auto before = known_.find(key);
    if (before != known_.end() && same(before->second, c)) {
      e.old = before->second.index;
      now = before->second;  // what the blocks were made for
      now.index = static_cast<int>(entries.size());
    }
    unchanged = unchanged && e.old == now.index;
    entries.push_back(e);
    known.emplace(key, now);
  }
  if (unchanged) return W_;
  const int n = static_cast<int>(entries.size());
  Eigen::MatrixXd W = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) {
      Eigen::Matrix3d block;
      if (entries[i].old >= 0 && entries[j].old >= 0) {
        block = W_.block<3, 3>(3 * entries[i].old, 3 * entries[j].old);
      } else {
        Eigen::Matrix3d C = Eigen::Matrix3d::Zero();
        for (const Side& at : entries[i].sides)
          for (const Side& from : entries[j].sides) C += coupling(at, from, softs, rigid, h);
        block = entries[i].frame * C * entries[j].frame.transpose();
      }
      W.block<3, 3>(3 * i, 3 * j) = block;
      W.block<3, 3>(3 * j, 3 * i) = block.transpose();
    }
  W_ = std::move(W);
  known_ = std::move(known);
  return W_;
}

}  // namespace calipso::fem
