// Shadows that edited objects cast.

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ball_setting.hpp"
#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// Near the ball the shadow is darker than the sun's absence makes it: the ball hides sky, too.
TEST(Renderer, TheDarkOfAShadowIsToldFromTheHiddenSky) {
  const cv::Vec3f umbra(0.45f, 0.4f, 0.35f);
  const ObjectModel ball = ballAt({0.0, 0.1, kBallRadius});
  ClipFrame frame = frameWithBall(ball);
  const Surface surface = makeSurface(ball);
  const std::vector<Occluder> occluder = {{&surface.key_vertices, &surface.triangles}};
  const ShadowMap sun(occluder, sunlight().direction.cast<double>(), {512, 0.025, 16});
  const SkyMap sky(occluder, Eigen::Vector3d::UnitZ(), {256});
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = receiverAt(table(), frame.camera, u, v);
      if (frame.labels.at<std::uint8_t>(v, u) != 0 || !r) continue;
      const float part = sun.visibility(r->position, r->normal),
                  open = sky.visibility(r->position, r->normal);
      for (int c = 0; c < 3; ++c) {
        std::uint8_t& code = frame.bgr.at<cv::Vec3b>(v, u)[c];
        code = quantise(
            codeFromLinear(linearFromCode(code) * (umbra[c] * open + (1.0f - umbra[c]) * part)));
      }
    }
  }
  ClipSample clip;
  clip.add(frame);
  const Prepared prepared = prepare(clip, {ball}, params());
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(prepared.umbra.at<cv::Vec4b>(kHeight - 1, 0)[c], 255 * umbra[c], 13)
        << c;  // the table behind it is invented
}

TEST(Renderer, AMovedShadowTakesItsWholeEdgeAlong) {
  const Setting s(params());
  const FrameOutput out =
      Renderer(s.prepared, params()).composite(s.input(true, {0.25f, 0.0f, 0.0f}));
  const Actor original =
      makeActor(s.prepared->surfaces[0], s.prepared->surfaces[0].key_vertices, camera());
  const ShadowMap sun({{&original.vertices, &original.surface->triangles}},
                      s.prepared->light.light.direction.cast<double>(), {512, 0.025, 16});
  cv::Mat shaded = cv::Mat::zeros(kHeight, kWidth, CV_8U), edge;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto receiver = receiverAt(params().planes, camera(), u, v);
      if (receiver && sun.visibility(receiver->position, receiver->normal) < 0.5f)
        shaded.at<std::uint8_t>(v, u) = 255;
    }
  }
  ASSERT_GT(cv::countNonZero(shaded), 50);
  cv::dilate(shaded, edge, cv::Mat::ones(7, 7, CV_8U));  // three pixels beyond the predicted shadow
  cv::Mat kept = edge & (out.provenance == kOriginal);
  EXPECT_LT(cv::countNonZero(kept), cv::countNonZero(edge) / 50);
}

// Pixels of the table in the full shadow of the ball where it is now.
std::vector<cv::Point> inShadow(const Setting& s, const FrameInput& moved) {
  const Actor now = makeActor(s.prepared->surfaces[0], moved.objects[0].vertices, camera());
  const ShadowMap cast({{&now.vertices, &now.surface->triangles}},
                       s.prepared->light.light.direction.cast<double>(), {512, 0.025, 16});
  std::vector<cv::Point> pixels;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = receiverAt(params().planes, camera(), u, v);
      if (r && cast.visibility(r->position, r->normal) <= 0.1f) pixels.push_back({u, v});
    }
  }
  return pixels;
}

// One half of the shadow falls on what the sun's absence leaves more of.
TEST(Renderer, ShadowsAreAsDarkAsWhatTheyFallOn) {
  const Setting s(params());
  const FrameInput moved = s.input(true, {-0.3f, 0.0f, 0.0f});
  const auto draw = [&](const cv::Range& bright) {
    auto prepared = std::make_shared<Prepared>(*s.prepared);
    prepared->shadowless.release();
    prepared->umbra.setTo(cv::Scalar::all(60));
    prepared->umbra.colRange(bright).setTo(cv::Scalar::all(150));
    return Renderer(prepared, params()).composite(moved).bgr;
  };
  const cv::Mat light = draw({0, kWidth}), dark = draw({0, 0});
  std::vector<cv::Point> shaded;  // the ball hides others
  for (const cv::Point& p : inShadow(s, moved)) {
    if (dark.at<cv::Vec3b>(p)[1] + 20 < light.at<cv::Vec3b>(p)[1]) shaded.push_back(p);
  }
  ASSERT_GT(shaded.size(), 50u);
  const cv::Rect box = cv::boundingRect(shaded);
  const int middle = box.x + box.width / 2;
  const cv::Mat both = draw({0, middle});
  for (const cv::Point& p : shaded) {
    if (std::abs(p.x - middle) <= 3) continue;
    EXPECT_EQ(both.at<cv::Vec3b>(p), (p.x < middle ? light : dark).at<cv::Vec3b>(p)) << p;
  }
}

TEST(Renderer, TakesNoSunWhereSceneryKeepsItOff) {
  const Setting s(params());
  const FrameInput moved = s.input(true, {-0.3f, 0.0f, 0.0f});
  auto shaded = std::make_shared<Prepared>(*s.prepared);
  shaded->sunless = cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(255));
  const FrameOutput in_sun = Renderer(s.prepared, params()).composite(moved),
                    in_shade = Renderer(shaded, params()).composite(moved);
  int darker = 0, all = 0;
  for (const cv::Point& p : inShadow(s, moved)) {
    const int sun = in_sun.bgr.at<cv::Vec3b>(p)[1], shade = in_shade.bgr.at<cv::Vec3b>(p)[1];
    ++all, darker += sun + 20 < shade;
  }
  ASSERT_GT(all, 50);
  EXPECT_GT(darker, all / 5);  // the ball hides others, and the sky
}

TEST(Renderer, ShadesNothingOfWhatHazeAdds) {
  const Setting s(params());
  auto clear = std::make_shared<Prepared>(*s.prepared);
  clear->shadowless.release();
  auto hazy = std::make_shared<Prepared>(*clear);
  hazy->veil = cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(128));
  const FrameInput moved = s.input(true, {-0.3f, 0.0f, 0.0f});
  const cv::Mat in_clear = Renderer(clear, params()).composite(moved).bgr,
                in_haze = Renderer(hazy, params()).composite(moved).bgr;
  double dark = 0.0, half_dark = 0.0;
  for (const cv::Point& p : inShadow(s, moved)) {
    if (in_clear.at<cv::Vec3b>(p) == in_haze.at<cv::Vec3b>(p)) continue;  // the ball itself
    const float lit = linearFromCode(s.key.bgr.at<cv::Vec3b>(p)[1]);
    dark += lit - linearFromCode(in_clear.at<cv::Vec3b>(p)[1]);
    half_dark += lit - linearFromCode(in_haze.at<cv::Vec3b>(p)[1]);
  }
  ASSERT_GT(dark, 5.0);
  EXPECT_NEAR(half_dark / dark, 0.5, 0.12);  // the table is told from the frame or from the plate
}

// A ball before a wall that turns away from the sun, nearly touching it; the picture has its dark
// there, and no shadow of the sun.
struct BeforeAWall {
  static constexpr double kAway = 0.18;  // m
  static constexpr int kCode = 150;      // of wall and floor
  const Eigen::Vector3d normal = Eigen::Vector3d(-1.0, -1.0, 0.0).normalized();
  const Eigen::Vector3d centre = (1.02 * kBallRadius - kAway) * normal + Eigen::Vector3d(0, 0, 0.1);
  ObjectModel ball = ballAt(centre);
  ClipFrame key{cv::Mat(kHeight, kWidth, CV_8UC3), cv::Mat::zeros(kHeight, kWidth, CV_8U),
                camera()};
  RenderParams render = params();

  BeforeAWall() {
    render.depth = cv::Mat(kHeight, kWidth, CV_32F);
    Light light = sunlight();
    light.direction = Eigen::Vector3f(0.4f, 0.3f, 0.87f).normalized();
    cv::RNG random(7);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        render.depth.at<float>(v, u) = static_cast<float>(std::min(toWall(u, v), toFloor(u, v)));
        const float open = 1.0f - 0.85f * hiddenAt(u, v, centre),
                    code = codeFromLinear(open * linearFromCode(kCode));
        key.bgr.at<cv::Vec3b>(v, u) =
            cv::Vec3b::all(quantise(code + static_cast<float>(random.uniform(-3, 4))));
      }
    }
    const Surface surface = makeSurface(ball);
    forEachPixelOf(makeActor(surface, surface.key_vertices, key.camera),
                   [&](int u, int v, const SurfacePoint& p) {
                     const cv::Vec3f shade = diffuseShading(light, p.normal, 1.0f);
                     for (int c = 0; c < 3; ++c)
                       key.bgr.at<cv::Vec3b>(v, u)[c] = quantise(codeFromLinear(0.5f * shade[c]));
                     key.labels.at<std::uint8_t>(v, u) = kBallLabel;
                     const Eigen::Vector3d at =
                         key.camera.world_from_camera.inverse() * p.position.cast<double>();
                     render.depth.at<float>(v, u) = static_cast<float>(at.z());
                   });
  }
  Eigen::Vector3d eye() const { return key.camera.world_from_camera.translation(); }
  Eigen::Vector3d ray(int u, int v) const {
    return key.camera.world_from_camera.linear() * key.camera.ray(u, v);
  }
  double toWall(int u, int v) const {
    const double t = (-kAway - normal.dot(eye())) / normal.dot(ray(u, v));
    return t > 0.0 ? t : 1e9;
  }
  double toFloor(int u, int v) const {
    return ray(u, v).z() < 0.0 ? -eye().z() / ray(u, v).z() : 1e9;
  }
  // Of the wall's sky, by a ball of which it sees all: its form factor.
  float hiddenAt(int u, int v, const Eigen::Vector3d& by) const {
    if (toWall(u, v) > toFloor(u, v)) return 0.0f;
    const Eigen::Vector3d way = by - eye() - toWall(u, v) * ray(u, v);
    return static_cast<float>(normal.dot(way) * kBallRadius * kBallRadius /
                              std::pow(way.norm(), 3));
  }
  bool isBeside(int u, int v, const Eigen::Vector3d& ball_at) const {
    const Eigen::Vector3d way = ball_at - eye(), along = ray(u, v).normalized();
    return (way - way.dot(along) * along).norm() > 1.3 * kBallRadius;
  }
  // Mean code of what is seen of the wall where a ball hides much of its sky.
  double darkAt(const cv::Mat& picture, const Eigen::Vector3d& by,
                const Eigen::Vector3d& other) const {
    double sum = 0.0;
    int count = 0;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        if (!(hiddenAt(u, v, by) > 0.3f) || !isBeside(u, v, by) || !isBeside(u, v, other)) continue;
        sum += picture.depth() == CV_8U ? picture.at<cv::Vec3b>(v, u)[1]
                                        : picture.at<cv::Vec3f>(v, u)[1];
        ++count;
      }
    }
    EXPECT_GT(count, 20);
    return sum / count;
  }
};

TEST(Renderer, TheDarkOfAContactOnAWallGoesAlong) {
  const BeforeAWall s;
  ClipSample clip;
  clip.add(s.key);
  const auto prepared = std::make_shared<const Prepared>(prepare(clip, {s.ball}, s.render));
  const Eigen::Vector3d move = 0.25 * Eigen::Vector3d(-1.0, 1.0, 0.0).normalized(),
                        there = s.centre + move;
  ASSERT_LT(s.darkAt(s.key.bgr, s.centre, there), s.kCode - 20);
  EXPECT_NEAR(s.darkAt(prepared->background.plate, s.centre, there), s.kCode, 5);
  Renderer renderer(prepared, s.render);
  FrameInput in = ballMovedLeft(s.key, *prepared);
  in.objects[0].vertices = prepared->surfaces[0].key_vertices;
  for (Eigen::Vector3f& x : in.objects[0].vertices) x += move.cast<float>();
  const cv::Mat moved = renderer.composite(in).bgr;
  EXPECT_NEAR(s.darkAt(moved, s.centre, there), s.kCode, 5);
  EXPECT_LT(s.darkAt(moved, there, s.centre), s.kCode - 15);
  in.objects[0].removed = true;
  EXPECT_NEAR(s.darkAt(renderer.composite(in).bgr, s.centre, there), s.kCode, 5);
}

// Water, or a light that was told wrongly: where the ball casts none in the video, it casts none
// when it is moved.
TEST(Renderer, CastsShadowsOnlyWhereTheVideoShowsThem) {
  const ObjectModel ball = ballAt(kCentre);
  const Surface surface = makeSurface(ball);
  const ShadowMap sun({{&surface.key_vertices, &surface.triangles}},
                      sunlight().direction.cast<double>(), {512, 0.025, 16});
  for (const bool shadow : {true, false}) {
    ClipFrame key = frameWithBall(ball);
    cv::RNG random(5);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        if (key.labels.at<std::uint8_t>(v, u) != 0) continue;
        const auto r = receiverAt(table(), key.camera, u, v);
        const float light =
            shadow && r ? 0.4f + 0.6f * sun.visibility(r->position, r->normal) : 1.0f;
        key.bgr.at<cv::Vec3b>(v, u) = cv::Vec3b::all(
            quantise(codeFromLinear(0.4f * light) + static_cast<float>(random.uniform(-3, 4))));
      }
    }
    ClipSample clip;
    clip.add(key);
    const auto prepared = std::make_shared<const Prepared>(prepare(clip, {ball}, params()));
    const bool remarked =
        std::any_of(prepared->remarks.begin(), prepared->remarks.end(), [](const std::string& r) {
          return r.find("not seen in the picture") != std::string::npos;
        });
    EXPECT_EQ(remarked, !shadow);
    const FrameInput in = ballMovedLeft(key, *prepared);
    const FrameOutput out = Renderer(prepared, params()).composite(in);
    const Actor now = makeActor(prepared->surfaces[0], in.objects[0].vertices, key.camera);
    const ShadowMap cast({{&now.vertices, &now.surface->triangles}},
                         prepared->light.light.direction.cast<double>(), {512, 0.025, 16});
    int dark = 0, all = 0;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const auto r = receiverAt(table(), key.camera, u, v);
        if (!r || cast.visibility(r->position, r->normal) > 0.1f ||
            out.provenance.at<std::uint8_t>(v, u) == kInvented)
          continue;
        const cv::Vec3b c = out.bgr.at<cv::Vec3b>(v, u);
        if (std::abs(c[0] - c[2]) > 12) continue;  // the ball itself
        ++all, dark += c[1] < 140;                 // the table has 168
      }
    }
    ASSERT_GT(all, 50);
    if (shadow)
      EXPECT_GT(dark, all / 2);
    else
      EXPECT_LT(dark, all / 20);
  }
}

}  // namespace
}  // namespace calipso::render
