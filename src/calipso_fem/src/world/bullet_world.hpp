#pragma once

#include <btBulletDynamicsCommon.h>

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

// Bullet's world with the three things the simulator needs beyond it. Private to the rigid world.
namespace calipso::fem {

inline btVector3 toBullet(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
inline Eigen::Vector3d fromBullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
btTransform toBullet(const Eigen::Isometry3d& pose);
Eigen::Isometry3d fromBullet(const btTransform& pose);

// NOTE: deviations from btDiscreteDynamicsWorld, each with its reason:
//  - overlap at the start is forgiven (alignment errors must not make objects jump);
//  - a bounce takes place in the sub-step in which the surfaces meet; Bullet starts to brake bodies
//    that are still apart, which costs most of the height of a bounce;
//  - of a pair's many contacts, those that others stand for are left out (manifold_reduction.hpp);
//  - free flight is exact: Bullet's x += h (v + h a) leads the parabola by h^2 a / 2.
class BulletWorld : public btDiscreteDynamicsWorld {
 public:
  using Pair = std::pair<int, int>;  // user indices, smaller first

  using btDiscreteDynamicsWorld::btDiscreteDynamicsWorld;

  // Contacts further apart than this are none: that of contacts that are left out is beyond. m
  static constexpr double kIgnoredBeyond = 1e6;

  static Pair pairOf(const btPersistentManifold& manifold);
  static bool isDynamic(const btCollisionObject* object);

  // Detects contacts, and forgives `id` the depth it has in others.
  void forgiveOverlapOf(int id);
  void forget(int id);
  void setPairSurface(const Pair& pair, std::optional<double> friction,
                      std::optional<double> restitution);
  double frictionOf(const btCollisionObject& a, const btCollisionObject& b) const;
  void substep(double h);

  // Pairs that push on each other since the last sub-step, and did not before.
  struct Touch {
    int a = 0, b = 0;  // user indices
    btVector3 position, normal;
    double approach_speed = 0.0;  // m/s
  };
  const std::vector<Touch>& newTouches() const { return new_touches_; }

 private:
  void solveConstraints(btContactSolverInfo& info) override;
  void adjust(btManifoldPoint& point, const btPersistentManifold& manifold, double h,
              double forgiven);
  std::vector<btManifoldPoint*> redundantContacts();
  void findTouches();

  std::map<Pair, double> forgiven_;  // m
  struct PairSurface {
    std::optional<double> friction, restitution;
  };
  std::map<Pair, PairSurface> pair_surface_;
  std::map<Pair, double> closing_;  // m/s, of the pairs near each other, before they are solved
  std::set<Pair> touching_;
  std::vector<Touch> new_touches_;
};

}  // namespace calipso::fem
