#include "calipso_render/appearance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "light/shaded_ground.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kPlace(0.0, 0.1, 0.12);
const cv::Vec3f kAlbedo(0.15f, 0.3f, 0.6f);  // of frameWithBall()
constexpr Gloss kTold{0.1f, 0.1f, 0.0f};
constexpr long kBallTriangles = 2 * 24 * 48;
constexpr float kTurn = 0.6f;  // rad about z: takes a place out of the highlight

float lobeAt(const Eigen::Vector3f& normal) {
  const Eigen::Vector3f eye = camera().world_from_camera.translation().cast<float>(),
                        place = kPlace.cast<float>() + static_cast<float>(kBallRadius) * normal;
  return torranceSparrow(normal, sunlight().direction, (eye - place).normalized(), kTold.roughness);
}

// The ball turned by `angle`, with a highlight twice as strong as told, and clipped.
View viewOf(const Surface& surface, float angle) {
  const ClipFrame frame = frameWithBall(ballAt(kPlace));
  View view{{}, frame.labels, frame.camera, {}};
  frame.bgr.convertTo(view.picture, CV_32F);
  forEachPixelOf(
      makeActor(surface, surface.key_vertices, frame.camera),
      [&](int u, int v, const SurfacePoint& p) {
        cv::Vec3f& code = view.picture.at<cv::Vec3f>(v, u);
        for (int c = 0; c < 3; ++c) {
          const float highlight = 2.0f * kTold.specular * sunlight().sun[c] * lobeAt(p.normal);
          code[c] = std::min(255.0f, codeFromLinear(linearFromRealCode(code[c]) + highlight));
        }
      });
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  turn.translate(kPlace).rotate(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
  view.actors.push_back(
      makeActor(surface, transformed(surface.object_vertices, turn), frame.camera));
  return view;
}

// A highlight that is told wrongly stays out of the texture where another view shows the place.
TEST(Appearance, TakesFromAnotherViewWhatAHighlightHides) {
  const Surface surface = makeSurface(ballAt(kPlace));
  const std::vector<View> views = {viewOf(surface, 0.0f), viewOf(surface, kTurn)};
  const Appearance a = makeAppearances(views, {true}, sunlight(), {kTold}).front();
  const auto normalOf = [&](int triangle, const Eigen::Vector3f& w) -> Eigen::Vector3f {
    const Eigen::Vector3i& t = surface.triangles[triangle];
    const Points& x = surface.key_vertices;
    return (w[0] * x[t[0]] + w[1] * x[t[1]] + w[2] * x[t[2]] - kPlace.cast<float>()).normalized();
  };
  const float strong = 0.5f / (kTold.roughness * kTold.roughness * 4.0f);
  const Eigen::AngleAxisf turn(kTurn, Eigen::Vector3f::UnitZ());
  int hidden = 0;
  for (int t = 0; t < a.texture.triangleCount(); ++t) {
    for (std::size_t i = a.texture.firstOf(t); i < a.texture.firstOf(t + 1); ++i) {
      const Eigen::Vector3f n = normalOf(t, a.texture.weightsOf(t, i - a.texture.firstOf(t)));
      if (lobeAt(n) < strong || lobeAt(turn * n) > 0.02f * strong) continue;
      ++hidden;
      // 0.06: what keeps the light from 0 takes 5 % off, the rest is for the codes and the other
      // view's own highlight. What a clipped highlight leaves is grey, 0.3 off.
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(a.texture.texels[i][c], kAlbedo[c], 0.06f);
    }
  }
  EXPECT_GT(hidden, 20);
}

// Dark letters on a white ball under a broad highlight, which outshines them but not the white.
TEST(Appearance, KeepsWhatIsDarkUnderABroadHighlight) {
  const Surface surface = makeSurface(ballAt(kPlace));
  constexpr Gloss kBroad{0.06f, 0.3f, 0.0f};
  constexpr float kWhite = 0.7f, kDark = 0.03f;
  View view{cv::Mat::zeros(kHeight, kWidth, CV_32FC3),
            cv::Mat::zeros(kHeight, kWidth, CV_8U),
            camera(),
            {makeActor(surface, surface.key_vertices, camera())}};
  const Eigen::Vector3f eye = camera().world_from_camera.translation().cast<float>();
  cv::Mat letters = cv::Mat::zeros(kHeight, kWidth, CV_8U);
  forEachPixelOf(view.actors.front(), [&](int u, int v, const SurfacePoint& p) {
    const bool dark = u / 6 % 2 == 0;
    const cv::Vec3f diffuse = diffuseShading(sunlight(), p.normal, 1.0f, p.seen, {}),
                    highlight = specularShading(sunlight(), kBroad, p.normal,
                                                (eye - p.position).normalized(), 1.0f, 1.0f);
    for (int c = 0; c < 3; ++c)
      view.picture.at<cv::Vec3f>(v, u)[c] =
          codeFromLinear((dark ? kDark : kWhite) * diffuse[c] + highlight[c]);
    view.labels.at<std::uint8_t>(v, u) = kBallLabel;
    if (dark && highlight[1] > 2.0f * kDark * diffuse[1]) letters.at<std::uint8_t>(v, u) = 255;
  });
  cv::Mat inside;
  cv::erode(view.labels, inside, cv::Mat::ones(9, 9, CV_8U));
  letters.setTo(0, inside == 0);
  ASSERT_GT(cv::countNonZero(letters), 40);
  const Appearance a = makeAppearances({view}, {false}, sunlight(), {kBroad}).front();
  const cv::Scalar found = cv::mean(a.albedo, letters(a.region));
  EXPECT_LT(found[1], 0.1);
}

// A model whose shadow on the ball the picture does not have, as of a part fitted beside its place,
// makes nothing of the ball brighter than it is.
TEST(Appearance, ShadeThatThePictureDoesNotHaveIsNotDividedBy) {
  const Surface surface = makeSurface(ballAt(kPlace));
  const ClipFrame frame = frameWithBall(ballAt(kPlace));
  View view{{}, frame.labels, frame.camera, {}};
  frame.bgr.convertTo(view.picture, CV_32F);
  view.actors.push_back(makeActor(surface, surface.key_vertices, frame.camera));
  ObjectModel pea =
      ballAt(kPlace + 1.5 * kBallRadius * sunlight().direction.cast<double>(), "pea", 2);
  pea.mesh.vertices *= 0.15;
  const Surface blocker = makeSurface(pea);
  view.actors.push_back(makeActor(blocker, blocker.key_vertices, view.camera));
  const ShadowMap sun({{&view.actors[1].vertices, &blocker.triangles, blocker.winding}},
                      sunlight().direction.cast<double>(), {});
  const Appearance a =
      makeAppearances({view}, {false, false}, sunlight(), {Gloss(), Gloss()}).front();
  int shaded = 0;
  forEachPixelOf(view.actors[0], [&](int u, int v, const SurfacePoint& p) {
    if (sun.visibility(p.position, p.normal) > 0.1f) return;
    ++shaded;
    // 0.06 as above; divided by the ambient light alone it would be more than twice as bright.
    const cv::Vec4f& c = a.albedo.at<cv::Vec4f>(v - a.region.y, u - a.region.x);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(c[i], kAlbedo[i], 0.06f);
  });
  EXPECT_GT(shaded, 10);
}

// A pea in the sun before the ball, moved to the left.
Surface peaBefore(double left) {
  ObjectModel pea = ballAt(kPlace + 1.5 * kBallRadius * sunlight().direction.cast<double>() -
                               left * Eigen::Vector3d::UnitX(),
                           "pea", 2);
  pea.mesh.vertices *= 0.3;
  return makeSurface(pea);
}

ShadowMap shadowOf(const Actor& actor) {
  return {{{&actor.vertices, &actor.surface->triangles, actor.surface->winding}},
          sunlight().direction.cast<double>(),
          {}};
}

// A model whose shadow falls a pixel beside the picture's: where the one is lit and the other is not
// the picture is not divided by a light that it does not have.
TEST(Appearance, AShadowThatIsOffByAPixelLeavesNoEdge) {
  const Surface surface = makeSurface(ballAt(kPlace));
  const ClipFrame frame = frameWithBall(ballAt(kPlace));
  View view{{}, frame.labels, frame.camera, {}};
  frame.bgr.convertTo(view.picture, CV_32F);
  view.actors.push_back(makeActor(surface, surface.key_vertices, frame.camera));
  const double pixel =
      (kPlace - frame.camera.world_from_camera.translation()).norm() / frame.camera.fx;
  const Surface told = peaBefore(0.0), true_one = peaBefore(1.3 * pixel);
  view.actors.push_back(makeActor(told, told.key_vertices, view.camera));
  const ShadowMap sun = shadowOf(view.actors[1]),
                  true_sun = shadowOf(makeActor(true_one, true_one.key_vertices, view.camera));
  const auto dark = [](const SurfacePoint& p, const ShadowMap& map) {
    return map.visibility(p.position, p.normal) < 0.5f;
  };
  forEachPixelOf(view.actors[0], [&](int u, int v, const SurfacePoint& p) {
    if (!dark(p, true_sun)) return;
    const cv::Vec3f shade = diffuseShading(sunlight(), p.normal, 0.0f),
                    open = diffuseShading(sunlight(), p.normal, 1.0f);
    cv::Vec3f& code = view.picture.at<cv::Vec3f>(v, u);
    for (int c = 0; c < 3; ++c)
      code[c] = codeFromLinear(linearFromRealCode(code[c]) * shade[c] / open[c]);
  });
  const Appearance a =
      makeAppearances({view}, {false, false}, sunlight(), {Gloss(), Gloss()}).front();
  int darker = 0;
  forEachPixelOf(view.actors[0], [&](int u, int v, const SurfacePoint& p) {
    if (!dark(p, true_sun) || dark(p, sun)) return;
    ++darker;
    // divided by the light in the open it would be less than half as bright
    const cv::Vec4f& c = a.albedo.at<cv::Vec4f>(v - a.region.y, u - a.region.x);
    for (int i = 0; i < 3; ++i) EXPECT_GT(c[i], 0.75f * kAlbedo[i]);
  });
  EXPECT_GT(darker, 10);
}

// The ball, and a plate fixed before its left half, as one object.
ObjectModel halfHidden() {
  ObjectModel model = ballAt(kPlace);
  TriangleMesh& mesh = model.mesh;
  const auto first = static_cast<int>(mesh.vertices.rows()), t = static_cast<int>(kBallTriangles);
  const Eigen::RowVector3d ahead = Eigen::RowVector3d(0.0, -0.8, 0.38).normalized(),
                           up(0.0, -ahead.z(), ahead.y()), left(-0.12, 0.0, 0.0);
  mesh.vertices.conservativeResize(first + 4, 3), mesh.triangles.conservativeResize(t + 2, 3);
  for (int k = 0; k < 4; ++k)
    mesh.vertices.row(first + k) =
        0.15 * ahead + (k < 2 ? -0.12 : 0.12) * up + (k % 3 == 0 ? 0.0 : 1.0) * left;
  mesh.triangles.row(t) = Eigen::RowVector3i(first, first + 1, first + 2);
  mesh.triangles.row(t + 1) = Eigen::RowVector3i(first, first + 2, first + 3);
  return model;
}

// What a lens makes of it: the plate's colour and the ball's mix where the one ends.
View blurredView(const Surface& surface, float angle, const Light& light) {
  View view{cv::Mat::zeros(kHeight, kWidth, CV_32FC3),
            cv::Mat::zeros(kHeight, kWidth, CV_8U),
            camera(),
            {}};
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  turn.translate(kPlace).rotate(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
  view.actors.push_back(
      makeActor(surface, transformed(surface.object_vertices, turn), view.camera));
  forEachPixelOf(view.actors.front(), [&](int u, int v, const SurfacePoint& p) {
    const cv::Vec3f shade = diffuseShading(light, p.normal, 1.0f, p.seen, {});
    for (int c = 0; c < 3; ++c)
      view.picture.at<cv::Vec3f>(v, u)[c] = codeFromLinear(
          kAlbedo[p.triangle < static_cast<int>(kBallTriangles) ? c : 2 - c] * shade[c]);
    view.labels.at<std::uint8_t>(v, u) = kBallLabel;
  });
  cv::blur(view.picture, view.picture, {3, 3});
  return view;
}

// Where one part of an object ends before another their colours mix, as at the mask's rim: of
// several views those count that show the place elsewhere.
TEST(Appearance, TakesFromAnotherViewWhatMixesWithAPartBefore) {
  const Surface surface = makeSurface(halfHidden());
  Light light;
  light.ambient[0] = {0.8f, 0.8f, 0.8f};
  std::vector<View> views;
  for (const float angle : {0.0f, -kTurn, -1.3f * kTurn})
    views.push_back(blurredView(surface, angle, light));
  const Appearance a = makeAppearances(views, {true}, light, {Gloss()}).front();
  std::vector<float> ratios;
  for (int t = 0; t < static_cast<int>(kBallTriangles); ++t) {
    for (std::size_t i = a.texture.firstOf(t); i < a.texture.firstOf(t + 1); ++i) {
      const Eigen::Vector3f w = a.texture.weightsOf(t, i - a.texture.firstOf(t));
      const Eigen::Vector3i& corners = surface.triangles[t];
      const Points& x = surface.key_vertices;
      const Eigen::Vector3f
          place = w[0] * x[corners[0]] + w[1] * x[corners[1]] + w[2] * x[corners[2]],
          to_eye = (camera().world_from_camera.translation().cast<float>() - place).normalized();
      if ((place - kPlace.cast<float>()).dot(to_eye) < 0.5f * kBallRadius) continue;
      const double right_of_edge =
          camera().projectWorld(place.cast<double>()).x() - camera().projectWorld(kPlace).x();
      if (right_of_edge < 0.3 || right_of_edge > 1.0) continue;
      ratios.push_back(a.texture.texels[i][0] / a.texture.texels[i][2]);
    }
  }
  ASSERT_GT(ratios.size(), 20u);
  std::nth_element(ratios.begin(), ratios.begin() + ratios.size() / 2, ratios.end());
  // The ball's own ratio is 0.25, the plate's 4, that of the mixed pixels 0.6.
  EXPECT_LT(ratios[ratios.size() / 2], 0.33f);
}

// A ball of two shells: the second half of its triangles is the first, shrunk to `scale`.
ObjectModel ballWithSmaller(double scale) {
  ObjectModel model = ballAt(kPlace);
  const TriangleMesh skin = model.mesh;
  const int vertices = skin.vertexCount(), triangles = skin.triangleCount();
  model.mesh.vertices.resize(2 * vertices, 3);
  model.mesh.triangles.resize(2 * triangles, 3);
  model.mesh.vertices << skin.vertices, scale * skin.vertices;
  model.mesh.triangles << skin.triangles, skin.triangles.array() + vertices;
  return model;
}

// A part of the mesh just under another one, as the root of a wing in the fuselage, does not take
// the other's look.
TEST(Appearance, APartUnderAnotherIsNotSeen) {
  const ObjectModel model = ballWithSmaller(0.985);
  const int triangles = model.mesh.triangleCount() / 2;
  const Surface surface = makeSurface(model);
  const ClipFrame frame = frameWithBall(ballAt(kPlace));
  View view{{}, frame.labels, frame.camera, {}};
  frame.bgr.convertTo(view.picture, CV_32F);
  view.actors.push_back(makeActor(surface, surface.key_vertices, frame.camera));
  const Appearance a = makeAppearances({view}, {false}, sunlight(), {Gloss()}).front();
  const auto fromPicture = [&](int first, int end) {
    return std::count_if(a.texture.texels.begin() + a.texture.firstOf(first),
                         a.texture.texels.begin() + a.texture.firstOf(end),
                         [](const cv::Vec4f& texel) { return texel[3] > 0.0f; });
  };
  EXPECT_GT(fromPicture(0, triangles), 100);
  EXPECT_EQ(fromPicture(triangles, 2 * triangles), 0);
}

// A part that winds otherwise than the others, as a mirrored wheel does, is seen as they are.
TEST(Appearance, APartThatIsInsideOutIsSeen) {
  ObjectModel model = ballWithSmaller(0.5);
  const int vertices = model.mesh.vertexCount() / 2, triangles = model.mesh.triangleCount() / 2;
  model.mesh.vertices.bottomRows(vertices).col(0).array() -= 0.18;
  auto smaller = model.mesh.triangles.bottomRows(triangles);
  smaller = smaller.rowwise().reverse().eval();
  const Surface surface = makeSurface(model);
  const Actor actor = makeActor(surface, surface.key_vertices, camera());
  View view{cv::Mat(kHeight, kWidth, CV_32FC3, cv::Scalar(90, 120, 150)),
            cv::Mat::zeros(kHeight, kWidth, CV_8U),
            camera(),
            {actor}};
  forEachPixelOf(actor, [&](int u, int v, const SurfacePoint&) {
    view.labels.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(model.index);
  });
  const Appearance a = makeAppearances({view}, {false}, sunlight(), {Gloss()}).front();
  const auto seen = std::count_if(a.texture.texels.begin() + a.texture.firstOf(triangles),
                                  a.texture.texels.begin() + a.texture.firstOf(2 * triangles),
                                  [](const cv::Vec4f& texel) { return texel[3] > 0.0f; });
  EXPECT_GT(seen, 100);
}

// What a glossy ball mirrors of its own shade on the table is dark: that is no highlight.
TEST(Appearance, TakesOffTheGroundAsShadedAsItIs) {
  const Surface surface = makeSurface(ballAt(kPlace));
  constexpr Gloss kMirroring{0.0f, 0.4f, 0.1f};
  View view{cv::Mat::zeros(kHeight, kWidth, CV_32FC3),
            cv::Mat::zeros(kHeight, kWidth, CV_8U),
            camera(),
            {makeActor(surface, surface.key_vertices, camera())}};
  const Actor& actor = view.actors.front();
  const std::vector<Occluder> occluders = {{&actor.vertices, &surface.triangles, surface.winding}};
  Light light = sunlight();  // from behind: the shadow lies before the ball
  light.direction = Eigen::Vector3f(0.1f, 0.7f, 0.7f).normalized();
  const ShadowMap sun(occluders, light.direction.cast<double>(), ShadowMap::Params());
  const SkyMap sky(occluders, Eigen::Vector3d::UnitZ(), SkyMap::Params());
  const ShadedGround ground(table(), light, {&sun}, sky);
  const Eigen::Vector3f eye = camera().world_from_camera.translation().cast<float>();
  cv::Mat lit = cv::Mat::ones(kHeight, kWidth, CV_32F);
  forEachPixelOf(actor, [&](int u, int v, const SurfacePoint& p) {
    const Eigen::Vector3f towards = (eye - p.position).normalized(),
                          mirrored = mirroredIn(p.normal, towards);
    const float visible = sun.visibility(p.position, p.normal);
    lit.at<float>(v, u) = ground.lit(p.position, mirrored);
    const cv::Vec3f diffuse = diffuseShading(light, p.normal, visible, p.seen, {}),
                    highlight = specularShading(light, kMirroring, p.normal, towards, visible,
                                                skyMirrored(p.seen, mirrored, lit.at<float>(v, u)));
    for (int c = 0; c < 3; ++c)
      view.picture.at<cv::Vec3f>(v, u)[c] = codeFromLinear(kAlbedo[c] * diffuse[c] + highlight[c]);
    view.labels.at<std::uint8_t>(v, u) = kBallLabel;
  });
  cv::Mat inside;
  cv::erode(view.labels, inside, cv::Mat::ones(7, 7, CV_8U));
  // Mean error where the table's shade is mirrored, as a part of the reflectance.
  const auto error = [&](const std::vector<SupportPlane>& planes) {
    const Appearance a = makeAppearances({view}, {false}, light, {kMirroring}, planes).front();
    double sum = 0.0;
    int count = 0;
    forEachPixelOf(actor, [&](int u, int v, const SurfacePoint& p) {
      if (inside.at<std::uint8_t>(v, u) == 0 || lit.at<float>(v, u) > 0.5f ||
          p.normal.dot(light.direction) > 0.0f)
        return;
      const cv::Vec3f diffuse = diffuseShading(light, p.normal, 1.0f, p.seen, {});
      const float floor = lightFloor(a.mean_light)[0];
      const cv::Vec4f& found = a.albedo.at<cv::Vec4f>(v - a.region.y, u - a.region.x);
      sum += std::abs(found[0] * (diffuse[0] + floor) / (kAlbedo[0] * diffuse[0]) - 1.0f), ++count;
    });
    EXPECT_GT(count, 30);
    return sum / count;
  };
  EXPECT_LT(error(table()), 0.08);  // weak light's reflectance is mixed with that around
  EXPECT_GT(error({}), 0.15);
}

}  // namespace
}  // namespace calipso::render
