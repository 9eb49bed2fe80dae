#include "contact_operator.hpp"

#include <set>

#include "dense_kernels.hpp"
#include "soft_system.hpp"
#include "thread_team.hpp"

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
  if (contacts.size() != entries_.size()) parts_.clear();
  std::vector<int> renewed;
  for (size_t s = 0; s < softs.size(); ++s) {
    const auto part = parts_.find(static_cast<int>(s));
    const bool known =
        part != parts_.end() && part->second.version == softs[s].soft->system().version();
    if (motion.bodies()[s].touched && !known) renewed.push_back(static_cast<int>(s));
  }
  if (renewed.empty() && contacts.size() == entries_.size()) return;
  entries_.clear();
  for (const auto& [key, c] : contacts)
    entries_.push_back({{sideOf(c.soft_a, c.rigid_a, c.point, c.place, 1.0, softs),
                         sideOf(c.soft_b, c.rigid_b, c.other, c.place, -1.0, softs)},
                        contactFrame(c.normal),
                        c.motion});
  std::vector<Part> parts(renewed.size());
  eachOnAThread(static_cast<int>(renewed.size()), [&](int k) {
    parts[k] = partOf(renewed[k], softs[renewed[k]].soft->system(), motion.h());
  });
  for (size_t k = 0; k < renewed.size(); ++k) parts_[renewed[k]] = std::move(parts[k]);
  const auto n = static_cast<Eigen::Index>(entries_.size());
  W_.setZero(3 * n, 3 * n);
  for (const auto& [soft, part] : parts_) addPart(part);
  addRigid(rigid);
}

// In runs of contacts that follow each other in W, too.
void ContactOperator::addPart(const Part& part) {
  const auto n = static_cast<int>(part.contacts.size());
  for (int begin = 0, end = 0; begin < n; begin = end) {
    while (end < n && part.contacts[end] - part.contacts[begin] == end - begin) ++end;
    const int rows = 3 * (end - begin);
    for (int j = 0; j < n; ++j)
      W_.block(3 * part.contacts[begin], 3 * part.contacts[j], rows, 3) +=
          part.W.block(3 * begin, 3 * j, rows, 3);
  }
}

// F_i R J_i C J_j^T R^T F_j^T / h^2 for all contacts of a body.
ContactOperator::Part ContactOperator::partOf(int soft, SoftSystem& system, double h) const {
  const Eigen::MatrixXd& C = system.compliance();
  Part part;
  part.version = system.version();
  std::vector<int> start(1, 0), node;
  std::vector<double> weight;
  std::vector<Eigen::Matrix3d> frames;
  for (size_t i = 0; i < entries_.size(); ++i)
    for (const Side& side : entries_[i].sides) {
      if (side.soft != soft) continue;
      for (const auto& [k, w] : side.nodes) node.push_back(k), weight.push_back(w);
      start.push_back(static_cast<int>(node.size()));
      frames.push_back(side.sign / h * entries_[i].frame * system.turn());
      part.contacts.push_back(static_cast<int>(i));
    }
  const auto n = static_cast<int>(frames.size());
  const PlaceList places{start.data(), node.data(), weight.data(),
                         n > 0 ? frames.front().data() : nullptr};
  part.W.resize(3 * n, 3 * n);
  Eigen::Matrix<double, 3, Eigen::Dynamic> FJC(3, C.cols()), row(3, 3 * n);
  Eigen::Matrix<double, Eigen::Dynamic, 3> CJ(C.rows(), 3);
  for (int i = 0; i < n; ++i) {
    CJ.setZero();
    for (int k = start[i]; k < start[i + 1]; ++k) CJ += weight[k] * C.middleCols<3>(3 * node[k]);
    FJC.noalias() = frames[i] * CJ.transpose();  // C is symmetric
    projectOnto(places, i + 1, FJC.data(), row.data());
    part.W.block(3 * i, 0, 3, 3 * (i + 1)) = row.leftCols(3 * (i + 1));
    part.W.block(0, 3 * i, 3 * i, 3) = row.leftCols(3 * i).transpose();
  }
  return part;
}

void ContactOperator::addRigid(const RigidWorld& rigid) {
  for (size_t i = 0; i < entries_.size(); ++i)
    for (size_t j = 0; j <= i; ++j)
      for (const Side& at : entries_[i].sides)
        for (const Side& from : entries_[j].sides)
          if (at.rigid && at.rigid == from.rigid) {
            const Eigen::Matrix3d w = at.sign * from.sign * entries_[i].frame *
                                      rigid.compliance(*at.rigid, at.place, from.place) *
                                      entries_[j].frame.transpose();
            W_.block<3, 3>(3 * i, 3 * j) += w;
            if (i != j) W_.block<3, 3>(3 * j, 3 * i) += w.transpose();
          }
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
