#include "light/shadow_clue.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

constexpr float kShade = 0.6f, kCode = 150.0f;  // of the code values; of the table
const Eigen::Vector3f kSun = Eigen::Vector3f(0.5f, -0.4f, 0.77f).normalized();

// Two balls on a table, seen by `eye`: the first leaves its place, the second stays.
struct Setting {
  Surface goes = makeSurface(ballAt({-0.15, 0.1, kBallRadius}, "goes", 1)),
          stays = makeSurface(ballAt({0.15, 0.15, kBallRadius}, "stays", 2));
  Camera eye = camera();
  Background seen;
  cv::Mat depth;

  explicit Setting(const Camera& from = camera()) : eye(from) {
    seen.plate = tableUnder(camera(), RayScene({occluder(1)}));
    seen.count = cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(9));
    seen.spread = cv::Mat::zeros(kHeight, kWidth, CV_32F);
  }

  Occluder occluder(int i) const {
    const Surface& s = i == 0 ? goes : stays;
    return {&s.key_vertices, &s.triangles, s.winding};
  }

  // The table with the objects' shadows, and stripes that tell places apart.
  static cv::Mat tableUnder(const Camera& from, const RayScene& objects) {
    cv::Mat picture(kHeight, kWidth, CV_32FC3, cv::Scalar::all(kCode));
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const auto r = receiverAt(table(), from, u, v);
        if (!r) continue;
        cv::Vec3f& code = picture.at<cv::Vec3f>(v, u);
        code *= 1.0f + 0.2f * std::sin(60.0f * r->position.x());
        if (objects.blocked(r->position, r->normal, kSun)) code *= kShade;
      }
    }
    return picture;
  }

  // With the first ball 0.3 m farther left, or where it was.
  View view(bool gone) const {
    Points moved = goes.key_vertices;
    for (Eigen::Vector3f& p : moved) p.x() -= gone ? 0.3f : 0.0f;
    const Occluder at_its_place{&moved, &goes.triangles, goes.winding};
    View v{tableUnder(eye, RayScene({at_its_place, occluder(1)})),
           cv::Mat::zeros(kHeight, kWidth, CV_8U),
           eye,
           {makeActor(goes, moved, eye), makeActor(stays, stays.key_vertices, eye)}};
    for (int i = 0; i < 2; ++i) {
      for (const Eigen::Vector3f& p : v.actors[i].vertices) {
        const Eigen::Vector2d at = eye.projectWorld(p.cast<double>());
        const cv::Point pixel(cvRound(at.x()), cvRound(at.y()));
        if (cv::Rect(0, 0, kWidth, kHeight).contains(pixel))
          v.labels.at<std::uint8_t>(pixel) = static_cast<std::uint8_t>(i + 1);
      }
    }
    return v;
  }

  // @param leaves false: the first ball has not moved yet
  ShadowClue clue(bool leaves = true) const {
    return {{view(false), view(leaves)}, {true, false}, table(), {camera(), seen, depth}};
  }

  static std::vector<RayScene> casting(const std::vector<View>& views) {
    std::vector<RayScene> scenes;
    for (const View& v : views) {
      const Actor& a = v.actors[0];
      scenes.emplace_back(
          std::vector<Occluder>{{&a.vertices, &a.surface->triangles, a.surface->winding}});
    }
    return scenes;
  }
  double misfit(const Eigen::Vector3f& l, bool leaves = true) const {
    return clue(leaves).misfit(casting({view(false), view(leaves)}), l);
  }
};

void expectBestAtTheSun(const Setting& setting) {
  ASSERT_TRUE(setting.clue().plateKnown());
  const double at_sun = setting.misfit(kSun);
  EXPECT_LT(at_sun, -10.0);
  const Eigen::Vector3f s = kSun.unitOrthogonal(), t = kSun.cross(s);
  for (const Eigen::Vector3f& way : {s, Eigen::Vector3f(-s), t, Eigen::Vector3f(-t)})
    EXPECT_LT(at_sun, setting.misfit((kSun + 0.15f * way).normalized()));
}

// The shadow of what stays is in the plate, too.
TEST(ShadowClue, IsBestWhereTheSunIsBesideAShadowThatStays) { expectBestAtTheSun(Setting()); }

TEST(ShadowClue, KnowsThePlateFromAnotherCamera) {
  Camera aside = camera();
  aside.world_from_camera.translation().x() += 0.1;
  aside.world_from_camera.rotate(Eigen::AngleAxisd(-0.1, Eigen::Vector3d::UnitY()));
  expectBestAtTheSun(Setting(aside));
}

// Darker than the plate, but in all frames: that is no passing shadow.
TEST(ShadowClue, AShadowThatNoFrameLacksSaysNothing) {
  EXPECT_EQ(Setting().misfit(kSun, false), 0.0);
}

TEST(ShadowClue, AsksNothingThatStandsBeforeThePlane) {
  Setting setting;
  setting.depth = cv::Mat(kHeight, kWidth, CV_32F, cv::Scalar(0.2f));
  EXPECT_FALSE(setting.clue().plateKnown());
}

// Places of the shadow are told from the ball's middle: within the angle that the ball fills.
TEST(ShadowClue, CandidatesLieAroundTheSun) {
  float best = -1.0f;
  for (const Eigen::Vector3f& l : Setting().clue().candidates()) best = std::max(best, l.dot(kSun));
  EXPECT_GT(best, 0.9f);
}

TEST(Leavers, MoveAndAreSeenPast) {
  Setting setting;
  const View view = setting.view(false);
  EXPECT_EQ(leavers(view, {true, false}, setting.seen), (std::vector<bool>{true, false}));
  EXPECT_EQ(leavers(view, {true, true}, Background()), (std::vector<bool>{false, false}));
  setting.seen.count.setTo(0, view.labels == 1);
  EXPECT_EQ(leavers(view, {true, true}, setting.seen), (std::vector<bool>{false, true}));
}

}  // namespace
}  // namespace calipso::render
