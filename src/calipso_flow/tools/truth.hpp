#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

// What the evaluator alone may read of a scene folder: how its objects really moved.
namespace calipso::flow {

struct TrueCollision {
  double time;                                      // s
  Eigen::Vector3d velocity_before, velocity_after;  // m/s, of the centre of mass
};

struct TrueObject {
  std::string mesh_path;
  std::vector<Eigen::Isometry3d> world_from_object;  // one, or one per frame
  // m/s, of the centre of mass (of a deforming object: of its surface); empty where none is told.
  std::vector<Eigen::Vector3d> velocity;
  std::vector<Eigen::Vector3d> spin;  // rad/s
  std::vector<TrueCollision> collisions;
  bool collisions_known = false;  // that none is listed says something
  // A prescribed wave: dy = u^1.3 (lean + A sin(k.x - omega t + ...) + ...), object frame.
  struct Wave {
    double omega, lean;      // rad/s, m
    Eigen::Vector3d vector;  // k, rad/m
  };
  std::optional<Wave> wave;
  std::vector<Eigen::MatrixXd> vertices;  // of a deforming object: per frame #V x 3, object frame
  std::string mask_path;                  // of frame 0; empty when there is none

  bool still() const { return world_from_object.size() == 1 && vertices.empty(); }
  bool hasVelocity() const { return still() || !velocity.empty(); }
};

// The truth of the object called `name`; nothing when the scene folder holds no truth about it.
std::optional<TrueObject> readTruth(const std::string& directory, const std::string& name);

}  // namespace calipso::flow
