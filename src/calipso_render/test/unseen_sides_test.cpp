#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "calipso_render/appearance.hpp"
#include "calipso_render/colour.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kPlace(0.0, 0.1, 0.12);
constexpr float kGrey = 0.5f;

Light ambient() {
  Light light;
  light.ambient[0] = {0.8f, 0.8f, 0.8f};
  return light;
}

// A grey object before the same grey. @param times of what is seen of a point, beyond its light
template <typename Times>
View viewOf(const Surface& surface, Times times) {
  View view{cv::Mat(kHeight, kWidth, CV_32FC3, cv::Scalar::all(codeFromLinear(0.8f * kGrey))),
            cv::Mat::zeros(kHeight, kWidth, CV_8U),
            camera(),
            {makeActor(surface, surface.key_vertices, camera())}};
  forEachPixelOf(view.actors[0], [&](int u, int v, const SurfacePoint& p) {
    const cv::Vec3f shade = diffuseShading(ambient(), p.normal, 1.0f, p.seen, {});
    for (int c = 0; c < 3; ++c)
      view.picture.at<cv::Vec3f>(v, u)[c] = codeFromLinear(kGrey * shade[c] * times(p));
    view.labels.at<std::uint8_t>(v, u) = kBallLabel;
  });
  return view;
}

// Calls `act(place, texel)` for the texels of an object's triangles up to `triangles`.
template <typename Act>
void forEachTexel(const Surface& surface, const Appearance& a, int triangles, Act act) {
  for (int t = 0; t < triangles; ++t) {
    for (std::size_t i = a.texture.firstOf(t); i < a.texture.firstOf(t + 1); ++i) {
      const Eigen::Vector3f w = a.texture.weightsOf(t, i - a.texture.firstOf(t));
      const Eigen::Vector3i& c = surface.triangles[t];
      const Points& x = surface.key_vertices;
      act(Eigen::Vector3f(w[0] * x[c[0]] + w[1] * x[c[1]] + w[2] * x[c[2]]), a.texture.texels[i]);
    }
  }
}

// What is dark beside a part that touches it is not so on other sides, where nothing touches them.
TEST(Appearance, UnseenSidesDoNotTakeTheDarkOfContacts) {
  ObjectModel model = ballAt(kPlace);
  TriangleMesh &mesh = model.mesh, body = mesh;
  body.vertices.leftCols(2) *= 0.7;
  const int vertices = body.vertexCount(), triangles = body.triangleCount();
  mesh.vertices.resize(2 * vertices, 3), mesh.triangles.resize(2 * triangles, 3);
  const Eigen::RowVector3d knob(0.05, -0.06, 0.02);  // on the body's front
  mesh.vertices << body.vertices, (0.2 * ball().vertices).rowwise() + knob;
  mesh.triangles << body.triangles, body.triangles.array() + vertices;
  const Surface surface = makeSurface(model);
  const View view = viewOf(surface, [&](const SurfacePoint& p) {
    return p.triangle < triangles && p.seen.open < 0.88f ? 0.6f : 1.0f;
  });
  const Appearance a = makeAppearances({view}, {false}, ambient(), {Gloss()}).front();
  int dark = 0, texels = 0;
  forEachTexel(surface, a, triangles, [&](const Eigen::Vector3f& place, const cv::Vec4f& texel) {
    if (place.y() < kPlace.y() + 0.02) return;
    ++texels, dark += texel[1] < 0.85f * kGrey;
  });
  ASSERT_GT(texels, 1000);
  EXPECT_LT(dark, texels / 100);
}

// A box that turns: the key frame shows its side +x, a later one +y, none -y.
struct TurningBox {
  const Eigen::Vector3d half{0.05, 0.04, 0.06};  // m

  static Eigen::Isometry3d turned(double angle) {
    Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
    return turn.translate(kPlace).rotate(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
  }

  ObjectModel model() const {
    ObjectModel box = ballAt(kPlace);
    box.world_from_object = turned(-0.5 * M_PI);
    box.mesh.vertices.resize(8, 3), box.mesh.triangles.resize(12, 3);
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d side((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1,
                                 (i & 4) != 0 ? 1 : -1);
      box.mesh.vertices.row(i) = half.cwiseProduct(side).transpose();
    }
    box.mesh.triangles << 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0,
        2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6;
    return box;
  }

  // +y and -y are light above and dark below, all else is between. @param x of the object
  float albedoAt(const Eigen::Vector3f& x) const {
    if (std::abs(x.y()) < 0.98f * static_cast<float>(half.y())) return kGrey;
    return x.z() > 0.0f ? 0.7f : 0.2f;
  }

  View view(const Surface& surface, const Eigen::Isometry3d& turn) const {
    View view{cv::Mat::zeros(kHeight, kWidth, CV_32FC3),
              cv::Mat::zeros(kHeight, kWidth, CV_8U),
              camera(),
              {makeActor(surface, transformed(surface.object_vertices, turn), camera())}};
    forEachPixelOf(view.actors[0], [&](int u, int v, const SurfacePoint& p) {
      const cv::Vec3f shade = diffuseShading(ambient(), p.normal, 1.0f, p.seen, {});
      const float albedo = albedoAt((turn.inverse() * p.position.cast<double>()).cast<float>());
      for (int c = 0; c < 3; ++c)
        view.picture.at<cv::Vec3f>(v, u)[c] = codeFromLinear(albedo * shade[c]);
      view.labels.at<std::uint8_t>(v, u) = kBallLabel;
    });
    return view;
  }
};

TEST(Appearance, UnseenSidesLookAsLikeOnesThatLaterFramesShow) {
  const TurningBox box;
  const ObjectModel model = box.model();
  const Surface surface = makeSurface(model);
  const std::vector<View> views = {box.view(surface, model.world_from_object),
                                   box.view(surface, TurningBox::turned(M_PI))};
  const Appearance a = makeAppearances(views, {true}, ambient(), {Gloss()}).front();
  const Eigen::Isometry3f to_box = model.world_from_object.inverse().cast<float>();
  int texels = 0, right = 0;
  forEachTexel(surface, a, 12, [&](const Eigen::Vector3f& place, const cv::Vec4f& texel) {
    const Eigen::Vector3f x = to_box * place;
    if (x.y() > -0.039f || std::abs(x.x()) > 0.03f || std::abs(std::abs(x.z()) - 0.03f) > 0.015f)
      return;
    // What keeps the light from 0 takes 5 % off, evened out seams as much again.
    ++texels, right += std::abs(texel[1] - box.albedoAt(x)) < 0.1f;
  });
  ASSERT_GT(texels, 200);
  EXPECT_GT(right, 0.95 * texels);
}

}  // namespace
}  // namespace calipso::render
