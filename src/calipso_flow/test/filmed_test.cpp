#include <gtest/gtest.h>

#include <cmath>

#include "../tools/film.hpp"
#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_flow/deformable_tracker.hpp"
#include "calipso_flow/live_dynamics.hpp"
#include "calipso_scene/median.hpp"

// Bodies whose motion is known because it was simulated, estimated from pictures of them.
namespace calipso::flow {
namespace {

int nearestVertex(const ObjectModel& model, const Eigen::Vector3d& point) {
  int nearest = 0;
  (model.mesh.vertices.rowwise() - point.transpose()).rowwise().squaredNorm().minCoeff(&nearest);
  return nearest;
}

TEST(Filmed, windAcrossASheetIsFound) {
  const Eigen::Vector3d wind(0.0, 4.0, 0.0);
  const FilmedSheet sheet = filmedSheet(wind, 24);
  const ObjectDynamics found =
      analyseFilm(sheet.model, sheet.camera, sheet.shapes, sheet.times, sheet.gravity);
  ASSERT_TRUE(found.deformation);
  ASSERT_TRUE(found.deformation->wind) << found.deformation->note;
  const WindEstimate& w = *found.deformation->wind;
  // What is asked for: 10 degrees, 15 %.
  EXPECT_GT(w.mean.normalized().dot(wind.normalized()), std::cos(10.0 * M_PI / 180.0));
  EXPECT_NEAR(w.mean.norm(), wind.norm(), 0.15 * wind.norm());
  EXPECT_GT(w.explained, 0.9);
  // Along the sheet nothing is seen: the deviation is that of what is known beforehand.
  EXPECT_GT(std::sqrt(w.mean_covariance(0, 0)), 2.0 * std::sqrt(w.mean_covariance(1, 1)));
}

// It hardly moves, and a stiff sheet in much wind looks nearly as a soft one in little: the search
// has to go along a narrow valley, and the interval to say what is not known.
TEST(Filmed, windOnASmallSheetIsFoundOrItsIntervalSaysSo) {
  SheetTruth small;
  small.width = 0.4, small.height = 0.45;
  const FilmedSheet sheet = filmedSheet({0.0, 3.0, 0.0}, 45, small);
  const ObjectDynamics found =
      analyseFilm(sheet.model, sheet.camera, sheet.shapes, sheet.times, sheet.gravity);
  ASSERT_TRUE(found.deformation && found.deformation->wind);
  const WindEstimate& w = *found.deformation->wind;
  EXPECT_GT(w.explained, 0.95);
  EXPECT_NEAR(w.mean.y(), 3.0, 0.15 * 3.0);
  const Eigen::Vector3d error = w.mean - sheet.wind;
  EXPECT_LT(error.dot(w.mean_covariance.ldlt().solve(error)), 7.815);  // 95 %, three unknowns
}

// Live, the sheet's modes, their velocities and the wind come from what has been seen so far.
TEST(Filmed, aSheetIsFollowedLive) {
  const FilmedSheet sheet = filmedSheet({0.0, 4.0, 0.0}, 24);
  const auto frame = [&](size_t k) {
    return makeFrame(sheet.times[k], film(sheet.model, sheet.shapes[k], sheet.camera, 2.0, k + 1),
                     sheet.camera);
  };
  LiveAnalyser live(frame(0), {sheet.model}, {cv::Mat()}, sheet.gravity);
  std::vector<NamedMotion> motions;
  double error = 0.0, motion = 0.0;
  for (size_t k = 1; k < sheet.times.size(); ++k) {
    motions = live.add(frame(k));
    if (k < 10 || k + 1 == sheet.times.size()) continue;
    const CoarseModes* modes = live.modesOf("sheet");
    ASSERT_NE(modes, nullptr);
    const Eigen::VectorXd velocities = modes->shapes * motions[0].mode_velocities;
    const Eigen::MatrixXd ahead = sheet.shapes[k + 1], behind = sheet.shapes[k - 1];
    for (int i = 0; i < sheet.model.mesh.vertexCount(); ++i) {
      const Eigen::RowVector3d v =
          (ahead.row(i) - behind.row(i)) / (sheet.times[k + 1] - sheet.times[k - 1]);
      error += (velocities.segment<3>(3 * i).transpose() - v).squaredNorm();
      motion += v.squaredNorm();
    }
  }
  EXPECT_TRUE(motions[0].motion.moving);
  EXPECT_LT(std::sqrt(error / motion), 0.3);
  const std::vector<ObjectDynamics> of_late = describe(live.windows(), sheet.gravity, true);
  ASSERT_EQ(of_late.size(), 1u);
  ASSERT_TRUE(of_late[0].deformation->wind) << of_late[0].deformation->note;
  EXPECT_NEAR(of_late[0].deformation->wind->mean.y(), 4.0, 0.6);
}

// It is followed in smaller frames; its tracks are told in those that were given.
TEST(Filmed, aSheetSeenTwiceAsLargeIsFollowedAsWell) {
  const FilmedSheet sheet = filmedSheet({0.0, 4.0, 0.0}, 8);
  Camera camera = sheet.camera;
  camera.width *= 2, camera.height *= 2, camera.fx *= 2.0, camera.fy *= 2.0;
  camera.cx = 2.0 * camera.cx + 0.5, camera.cy = 2.0 * camera.cy + 0.5;
  const auto frame = [&](size_t k) {
    return makeFrame(sheet.times[k], film(sheet.model, sheet.shapes[k], camera, 2.0, k + 1),
                     camera);
  };
  DeformableTracker tracker(sheet.model, frame(0), cv::Mat(), {});
  for (size_t k = 1; k < sheet.times.size(); ++k) {
    const DeformationObservation seen = tracker.track(frame(k), false);
    ASSERT_TRUE(seen.found);
    const Eigen::MatrixXd surface = tracker.surfaceAt(seen.controls).rowwise() +
                                    sheet.model.world_from_object.translation().transpose();
    const Eigen::MatrixXd motion = sheet.shapes[k] - sheet.shapes[0];
    // Two to four percent are left over a clip; here the first frames, in which it hardly moves.
    EXPECT_LT((surface - sheet.shapes[k]).norm(), 0.1 * motion.norm() + 0.01);
    std::vector<double> off;  // px
    for (const Track& track : seen.tracks) {
      const int v = nearestVertex(sheet.model, track.point);
      const Eigen::Vector3d there =
          sheet.model.world_from_object * track.point + motion.row(v).transpose();
      off.push_back((camera.projectWorld(there) - track.pixel).norm());
    }
    EXPECT_LT(median(off), 0.7);
  }
}

TEST(Filmed, beamVibratesAtItsFrequency) {
  const FilmedBeam beam = filmedBeam({}, 40);
  const ObjectDynamics found = analyseFilm(beam.model, beam.camera, beam.shapes, beam.times,
                                           Eigen::Vector3d(0.0, 0.0, -9.81));
  ASSERT_TRUE(found.deformation);
  ASSERT_FALSE(found.deformation->lines.empty());
  // 1 % over two seconds; here over 1.3.
  EXPECT_NEAR(found.deformation->lines.front().line.naturalFrequency(), beam.frequency,
              0.02 * beam.frequency);
}

}  // namespace
}  // namespace calipso::flow
