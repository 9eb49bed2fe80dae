#include "trace.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "calipso_flow/rotation.hpp"
#include "motion_errors.hpp"

namespace calipso::flow {
namespace {

void writeRow(std::ofstream& file, const std::vector<Eigen::Vector3d>& vectors) {
  for (const Eigen::Vector3d& v : vectors) file << "," << v.x() << "," << v.y() << "," << v.z();
}

// Measured pose, its error and the deviations that it states: centroid, m, and rotation, rad.
void writeMeasured(std::ofstream& file, const Observation& observation,
                   const Eigen::Isometry3d& truth, const Eigen::Vector3d& centroid) {
  const Eigen::Isometry3d& pose = observation.world_from_object;
  const Vector6d sigma = observation.covariance.diagonal().cwiseSqrt();
  writeRow(file, {pose * centroid - truth * centroid, sigma.head<3>(),
                  vectorFromRotation(pose.linear() * truth.linear().transpose()), sigma.tail<3>()});
  file << "," << observation.inliers() << "," << observation.deviation;
}

}  // namespace

void writeTrace(const std::string& folder, const Scene& scene, const ObjectModel& model,
                const TrueObject& truth, const ObjectDynamics& dynamics, int recording) {
  const std::string name = std::filesystem::path(scene.directory).filename().string();
  const std::string further = recording > 0 ? "_" + std::to_string(recording) : "";
  std::ofstream file(folder + "/" + name + "_" + dynamics.name + further + ".csv");
  file << "t,tracks,moving,x,y,z,vx,vy,vz,wx,wy,wz,ax,ay,az,sx,sy,sz,tvx,tvy,tvz,twx,twy,twz,"
          "mex,mey,mez,msx,msy,msz,rex,rey,rez,rsx,rsy,rsz,inliers,deviation\n";
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero(), middle = centroid(model.mesh);
  for (size_t k = 0; k < dynamics.motions.size(); ++k) {
    const ObjectMotion& m = dynamics.motions[k];
    file << m.state.time << "," << m.tracks << "," << m.moving;
    writeRow(file, {m.state.position, m.state.velocity, m.state.spin, m.state.acceleration,
                    m.state.twistCovariance().diagonal().head<3>().cwiseSqrt(),
                    truth.velocity.empty() ? zero : valueAt(truth.velocity, k),
                    truth.spin.empty() ? zero : valueAt(truth.spin, k)});
    const size_t last = truth.world_from_object.size() - 1;
    writeMeasured(file, dynamics.observations[k], truth.world_from_object[std::min(k, last)],
                  middle);
    file << "\n";
  }
  for (const Collision& c : dynamics.trajectory.collisions) {
    file << "# collision at " << c.time << " s +- " << c.time_deviation << ", speed "
         << c.before.velocity.transpose() << " -> " << c.after.velocity.transpose() << "\n";
  }
  for (const MotionPiece& piece : dynamics.trajectory.pieces) {
    file << "# piece from " << piece.start << " s, travel " << static_cast<int>(piece.travel)
         << ", turning " << static_cast<int>(piece.turning) << "\n";
  }
}

}  // namespace calipso::flow
