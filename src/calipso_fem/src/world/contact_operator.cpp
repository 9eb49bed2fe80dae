#include "contact_operator.hpp"

#include <set>

#include "soft_system.hpp"

namespace calipso::fem {

std::vector<int> ContactOperator::nodesOf(int soft, const std::map<Contact::Key, Contact>& contacts,
                                          const SoftObject& body) {
  std::set<int> nodes;
  const auto add = [&](const SurfacePoint& point) {
    for (int k = 0; k < 3; ++k) {
      if (point.weights[k] == 0.0) continue;
      for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(
               body.body().embedding().weights, point.vertices[k]);
           it; ++it)
        nodes.insert(static_cast<int>(it.col()));
    }
  };
  for (const auto& [key, c] : contacts) {
    if (c.soft_a == soft) add(c.point);
    if (c.soft_b == soft) add(c.other);
  }
  return {nodes.begin(), nodes.end()};
}

ContactOperator::Side ContactOperator::sideOf(int soft, const std::optional<RigidWorld::Id>& rigid,
                                              const SurfacePoint& point,
                                              const Eigen::Vector3d& place, double sign,
                                              const std::vector<SoftEntry>& softs) const {
  Side side;
  side.soft = soft;
  side.rigid = rigid;
  side.place = place;
  side.sign = sign;
  if (soft < 0) return side;
  const SoftObject& body = *softs[soft].soft;
  const auto weights = body.body().embedding().pointWeights(point);
  for (Eigen::SparseVector<double>::InnerIterator it(weights); it; ++it)
    if (it.value() != 0.0)
      side.nodes.emplace_back(softs[soft].soft->system().indexOf(static_cast<int>(it.index())),
                              it.value());
  return side;
}

void ContactOperator::update(const std::map<Contact::Key, Contact>& contacts,
                             const StepMotion& motion, const std::vector<SoftEntry>& softs,
                             const RigidWorld& rigid) {
  std::vector<int> versions;
  for (const SoftEntry& entry : softs) versions.push_back(entry.soft->system().version());
  if (contacts.size() == entries_.size() && versions == versions_) return;
  versions_ = versions;
  entries_.clear();
  for (const auto& [key, c] : contacts)
    entries_.push_back({{sideOf(c.soft_a, c.rigid_a, c.point, c.place, 1.0, softs),
                         sideOf(c.soft_b, c.rigid_b, c.other, c.place, -1.0, softs)},
                        contactFrame(c.normal),
                        c.motion});
  const auto n = static_cast<Eigen::Index>(entries_.size());
  W_.setZero(3 * n, 3 * n);
  for (size_t s = 0; s < softs.size(); ++s)
    if (motion.bodies()[s].touched)
      addSoft(static_cast<int>(s), softs[s].soft->system(), motion.h());
  addRigid(rigid);
  W_.triangularView<Eigen::StrictlyUpper>() = W_.transpose();
}

// Lower half of F_i R J_i C J_j^T R^T F_j^T / h^2 for all contacts of a body.
void ContactOperator::addSoft(int soft, SoftSystem& system, double h) {
  const Eigen::MatrixXd& C = system.compliance();
  struct Row {
    int contact;
    const Side* side;
    Eigen::Matrix3d frame;
  };
  std::vector<Row> rows;
  for (size_t i = 0; i < entries_.size(); ++i)
    for (const Side& side : entries_[i].sides)
      if (side.soft == soft)
        rows.push_back({static_cast<int>(i), &side, side.sign / h * entries_[i].frame * system.turn()});
  Eigen::Matrix<double, 3, Eigen::Dynamic> JC(3, C.cols());
  for (const Row& at : rows) {
    JC.setZero();
    for (const auto& [k, w] : at.side->nodes)
      JC += w * C.middleCols<3>(3 * k).transpose();  // C is symmetric
    JC = (at.frame * JC).eval();
    for (const Row& from : rows) {
      if (from.contact > at.contact) break;
      Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
      for (const auto& [k, w] : from.side->nodes) sum += w * JC.middleCols<3>(3 * k);
      W_.block<3, 3>(3 * at.contact, 3 * from.contact) += sum * from.frame.transpose();
    }
  }
}

void ContactOperator::addRigid(const RigidWorld& rigid) {
  for (size_t i = 0; i < entries_.size(); ++i)
    for (size_t j = 0; j <= i; ++j)
      for (const Side& at : entries_[i].sides)
        for (const Side& from : entries_[j].sides)
          if (at.rigid && at.rigid == from.rigid)
            W_.block<3, 3>(3 * i, 3 * j) += at.sign * from.sign * entries_[i].frame *
                                            rigid.compliance(*at.rigid, at.place, from.place) *
                                            entries_[j].frame.transpose();
}

Eigen::Vector3d ContactOperator::freeSlip(int contact, const StepMotion& motion) const {
  const Entry& e = entries_[contact];
  Eigen::Vector3d slip = -e.motion;
  for (const Side& side : e.sides) {
    if (side.rigid) slip += side.sign * motion.freeRigidWay(*side.rigid, side.place);
    if (side.soft < 0) continue;
    const Vec& way = motion.bodies()[side.soft].free_way;
    for (const auto& [k, w] : side.nodes) slip += side.sign * w * way.segment<3>(3 * k);
  }
  return slip;
}

}  // namespace calipso::fem
