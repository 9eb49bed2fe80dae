#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "calipso_fem/world/rigid_world.hpp"
#include "calipso_fem/world/soft_contacts.hpp"

// A few deformable bodies and what they meet, stepped without a World: for tests and the evaluator.
namespace calipso::fem::test {

TriangleMesh movedMesh(TriangleMesh mesh, const Eigen::Vector3d& by);

// x(t) of something that is moved; world_from_tree.
using PoseOverTime = std::function<Eigen::Isometry3d(double)>;

class SoftScene {
 public:
  explicit SoftScene(const ContactParams& params = {}) : contacts_(params) {}

  Eigen::Vector3d gravity = {0.0, 0.0, -9.81};
  SurfaceSettings surface;  // of whatever is added next

  SoftObject& addSoft(const TriangleMesh& surface_mesh, const Material& material, double cell_size,
                      const Eigen::Vector3d& velocity = Eigen::Vector3d::Zero(),
                      const Eigen::Vector3d& angular = Eigen::Vector3d::Zero());
  void addPlane(const Eigen::Vector3d& normal, double offset);
  void addMoving(const TriangleMesh& mesh, PoseOverTime pose);
  RigidWorld::Id addRigid(const TriangleMesh& mesh, double density, const Eigen::Isometry3d& pose,
                          const Eigen::Vector3d& velocity = Eigen::Vector3d::Zero());

  void step(double h);

  SoftObject& soft(int i) { return *softs_[i]; }
  RigidWorld& rigid() { return rigid_; }
  SoftContacts& contacts() { return contacts_; }
  double time() const { return time_; }
  double energy() const;                       // kinetic, elastic, in gravity; J
  double deepest() const { return deepest_; }  // over all steps, m
  double cpuMs() const { return cpu_ms_; }     // of all steps
  const ContactReport& report() const { return report_; }
  // Linear momentum, then angular momentum about the origin.
  Eigen::Matrix<double, 6, 1> momentum() const;

 private:
  std::vector<SoftEntry> entries() const;
  std::vector<Obstacle> obstacles(double h) const;  // of a step of h seconds from now on

  struct Rigid {
    RigidWorld::Id id;
    MassProperties mass;
    std::unique_ptr<SurfaceTree> tree;
    SurfaceSettings surface;
  };
  struct Moving {
    std::unique_ptr<SurfaceTree> tree;
    PoseOverTime pose;
    SurfaceSettings surface;
  };

  SoftContacts contacts_;
  RigidWorld rigid_;
  std::vector<std::unique_ptr<SoftObject>> softs_;
  std::vector<SurfaceSettings> soft_surfaces_;
  std::vector<Rigid> rigids_;
  std::vector<Moving> moving_;
  std::vector<std::pair<SupportPlane, SurfaceSettings>> planes_;
  double time_ = 0.0, deepest_ = 0.0, cpu_ms_ = 0.0;
  ContactReport report_;
};

}  // namespace calipso::fem::test
