#include "light/shadow_contrast.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

constexpr int kCoarse = ShadowContrast::kCoarse;
constexpr float kShade = 0.6f;  // of the code values
constexpr double kCalm = 0.3;   // part of the table's pattern, which alone is as dark as a shadow
const Eigen::Vector3f kSun = Eigen::Vector3f(0.5f, -0.4f, 0.77f).normalized();

// A ball above the table, seen with the shadow that a sun in direction `l` casts; l.z() <= 0: none.
struct Setting {
  Surface surface = makeSurface(ballAt({0.0, 0.0, kBallRadius}));
  std::vector<Actor> actors{makeActor(surface, surface.key_vertices, camera())};
  RayScene objects{{{&actors[0].vertices, &surface.triangles, surface.winding}}};

  View seenUnder(const Eigen::Vector3f& l) const {
    const ClipFrame frame = frameWithBall(ballAt({0.0, 0.0, kBallRadius}));
    View view{{}, frame.labels, camera(), actors};
    frame.bgr.convertTo(view.picture, CV_32F, kCalm, (1.0 - kCalm) * 120.0);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const auto receiver = receiverAt(table(), camera(), u, v);
        if (l.z() > 0.0f && frame.labels.at<std::uint8_t>(v, u) == 0 && receiver &&
            objects.blocked(receiver->position, receiver->normal, l))
          view.picture.at<cv::Vec3f>(v, u) *= kShade;
      }
    }
    return view;
  }
};

double degreesBetween(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return std::acos(std::min(1.0f, a.dot(b))) * 180.0 / M_PI;
}

TEST(ShadowContrast, IsBestWhereTheSunIs) {
  const Setting setting;
  for (const int cells : {kCoarse, ShadowContrast::kFine}) {
    const ShadowContrast contrast(setting.seenUnder(kSun), table(), cv::Mat(), cells);
    const double at_sun = contrast.misfit(setting.objects, kSun);
    EXPECT_LT(at_sun, -20.0) << cells;
    const Eigen::Vector3f s = kSun.unitOrthogonal(), t = kSun.cross(s);
    for (const Eigen::Vector3f& way : {s, Eigen::Vector3f(-s), t, Eigen::Vector3f(-t)}) {
      EXPECT_LT(at_sun, contrast.misfit(setting.objects, (kSun + 0.15f * way).normalized()))
          << cells;
    }
  }
}

// A twentieth of a radian (3 degrees) is more than the fine cells' size here.
TEST(ShadowContrast, TellsNearDirectionsApart) {
  const Setting setting;
  const ShadowContrast contrast(setting.seenUnder(kSun), table(), cv::Mat(), ShadowContrast::kFine);
  const Eigen::Vector3f s = kSun.unitOrthogonal(), t = kSun.cross(s);
  for (const Eigen::Vector3f& way : {s, Eigen::Vector3f(-s), t, Eigen::Vector3f(-t)}) {
    EXPECT_LT(contrast.misfit(setting.objects, kSun),
              contrast.misfit(setting.objects, (kSun + 0.05f * way).normalized()));
  }
}

TEST(ShadowContrast, CandidatesLieAroundTheSun) {
  const Setting setting;
  const ShadowContrast contrast(setting.seenUnder(kSun), table(), cv::Mat(), kCoarse);
  const std::vector<Eigen::Vector3f> found = contrast.candidates(setting.objects);
  ASSERT_FALSE(found.empty());
  EXPECT_LT(degreesBetween(found.front(), kSun), 8.0);  // directions tried are 8 degrees apart
}

TEST(ShadowContrast, WithoutAShadowNoDirectionStandsOut) {
  const Setting setting;
  const ShadowContrast contrast(setting.seenUnder({0.0f, 0.0f, -1.0f}), table(), cv::Mat(),
                                kCoarse);
  const auto candidates = contrast.candidates(setting.objects);
  EXPECT_FALSE(candidates.empty());
  for (const Eigen::Vector3f& l : candidates)
    EXPECT_GT(contrast.misfit(setting.objects, l), -12.0);  // from which on light_fit believes it
}

TEST(ShadowContrast, FallsOnWhatTheDepthImageShowsToBeFlat) {
  const Setting setting;
  cv::Mat depth(kHeight, kWidth, CV_32F, cv::Scalar(0.0f)), rough;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if (const auto receiver = receiverAt(table(), camera(), u, v))
        depth.at<float>(v, u) = static_cast<float>(
            (camera().world_from_camera.inverse() * receiver->position.cast<double>()).z());
    }
  }
  const View view = setting.seenUnder(kSun);
  const double on_plane = ShadowContrast(view, table(), {}, kCoarse).misfit(setting.objects, kSun);
  EXPECT_NEAR(ShadowContrast(view, {}, depth, kCoarse).misfit(setting.objects, kSun), on_plane,
              0.2 * std::abs(on_plane));  // the picture's rim lacks what tells it to be flat
  cv::RNG random(3);
  rough = depth.clone();
  for (float& d : cv::Mat_<float>(rough)) d *= static_cast<float>(1.0 + random.gaussian(0.1));
  EXPECT_EQ(ShadowContrast(view, {}, rough, kCoarse).misfit(setting.objects, kSun), 0.0);
}

TEST(ShadowContrast, SaysNothingWithoutReceivers) {
  const Setting setting;
  const ShadowContrast contrast(setting.seenUnder(kSun), {}, cv::Mat(), kCoarse);
  EXPECT_EQ(contrast.misfit(setting.objects, kSun), 0.0);
  EXPECT_TRUE(contrast.candidates(setting.objects).empty());
}

}  // namespace
}  // namespace calipso::render
