#include "place/umbra.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "place/plane_view.hpp"

namespace calipso::render {
namespace {

constexpr int kStride = 2;           // px between the places that are looked at
constexpr int kBeside = 5;           // px beside an object's mask that may show it
constexpr float kFullShade = 0.05f;  // of the sun
constexpr float kFullSun = 0.9f;     // but for the objects
constexpr float kOpenSky = 0.4f;     // less of it is seen along contacts, where the dark is another
constexpr float kDark = 0.01f;       // linear; what is darker says nothing of its shadow
constexpr std::size_t kFewest = 100;
constexpr float kNoShadow = 0.85f;  // hardly darker: the shadow was not where it was predicted

// Picture over plate in the full shade of one view.
void collect(const View& view, const std::vector<SupportPlane>& planes, const EmptyPlace& place,
             const Light& light, const Visibility& unseen, std::vector<float> (&ratios)[3]) {
  const std::vector<Occluder> occluders = occludersOf(view.actors);
  const ShadowMap sun(occluders, light.direction.cast<double>(), {512, light.angular_radius, 16});
  const SkyMap sky(occluders, planes.front().normal, {});
  const PlaneView seen(planes, view.camera);
  const Eigen::Isometry3d camera_from_world = place.camera.world_from_camera.inverse();
  cv::Mat covered;
  cv::dilate(view.labels != 0, covered, cv::Mat::ones(2 * kBeside + 1, 2 * kBeside + 1, CV_8U));
  Receiver r;
  for (int v = 0; v < covered.rows; v += kStride) {
    for (int u = 0; u < covered.cols; u += kStride) {
      if (covered.at<std::uint8_t>(v, u) != 0 || !seen.at(u, v, r) ||
          sun.visibility(r.position, r.normal) > kFullShade ||
          unseen.visibility(r.position, r.normal) < kFullSun)
        continue;
      const auto lit_code = unshaded(place, camera_from_world, r.position);
      const float open = sky.visibility(r.position, r.normal);
      const cv::Vec3f code = view.codeAt(v, u);
      for (int c = 0; c < 3 && lit_code && open >= kOpenSky; ++c) {
        const float lit = linearFromRealCode((*lit_code)[c]) * skyLight(open);
        if (lit > kDark) ratios[c].push_back(linearFromRealCode(code[c]) / lit);
      }
    }
  }
}

}  // namespace

SeenUmbra umbraInViews(const std::vector<View>& views, const std::vector<SupportPlane>& planes,
                       const EmptyPlace& place, const Light& light, const Visibility& unseen) {
  if (planes.empty()) return {};
  std::vector<float> ratios[3];
  for (const View& view : views) collect(view, planes, place, light, unseen, ratios);
  cv::Vec3f umbra;
  int undarkened = 0;
  for (int c = 0; c < 3; ++c) {
    if (ratios[c].size() < kFewest) return {};
    std::nth_element(ratios[c].begin(), ratios[c].begin() + ratios[c].size() / 2, ratios[c].end());
    umbra[c] = std::max(ratios[c][ratios[c].size() / 2], 0.1f);
    undarkened += umbra[c] > kNoShadow;
  }
  if (undarkened > 0) return {std::nullopt, undarkened == 3};
  return {umbra, false};
}

cv::Vec3f umbraInPicture(const cv::Mat& picture, const cv::Mat& plate, const cv::Mat& sun,
                         const cv::Mat& sky, const cv::Mat& labels, const cv::Vec3f& predicted) {
  cv::Vec3f umbra;
  for (int c = 0; c < 3; ++c) {
    std::vector<float> ratios;
    for (int v = 0; v < picture.rows; ++v) {
      for (int u = 0; u < picture.cols; ++u) {
        if (sun.at<float>(v, u) > 0.15f || sky.at<float>(v, u) < kOpenSky ||
            labels.at<std::uint8_t>(v, u) != 0)
          continue;
        const float lit =
            linearFromRealCode(plate.at<cv::Vec3f>(v, u)[c]) * skyLight(sky.at<float>(v, u));
        if (lit > 0.01f) ratios.push_back(linearFromRealCode(picture.at<cv::Vec3f>(v, u)[c]) / lit);
      }
    }
    if (ratios.size() < 50) return predicted;
    std::nth_element(ratios.begin(), ratios.begin() + ratios.size() / 2, ratios.end());
    // A shadow that is hardly darker in any colour was not seen where it was predicted.
    const float measured = ratios[ratios.size() / 2];
    if (measured > kNoShadow) return predicted;
    umbra[c] = std::max(measured, 0.1f);
  }
  return umbra;
}

cv::Vec3f umbraOfPassing(const std::vector<ClipFrame>& frames,
                         const std::vector<SupportPlane>& planes, const Background& background,
                         const cv::Vec3f& predicted) {
  std::vector<float> ratios[3];
  for (const ClipFrame& f : frames) {
    cv::Mat covered;
    cv::dilate(f.labels != 0, covered, cv::Mat::ones(11, 11, CV_8U));
    for (int v = 0; v < f.bgr.rows; v += 2) {
      for (int u = 0; u < f.bgr.cols; u += 2) {
        const bool quiet =
            background.count.at<std::uint8_t>(v, u) > 2 && background.spread.at<float>(v, u) < 5.0f;
        if (!quiet || covered.at<std::uint8_t>(v, u) != 0) continue;
        float ratio[3];
        for (int c = 0; c < 3; ++c) {
          const float lit = linearFromRealCode(background.plate.at<cv::Vec3f>(v, u)[c]);
          ratio[c] = linearFromCode(f.bgr.at<cv::Vec3b>(v, u)[c]) / std::max(lit, 0.004f);
        }
        if (std::max({ratio[0], ratio[1], ratio[2]}) > 0.8f || !receiverAt(planes, f.camera, u, v))
          continue;
        for (int c = 0; c < 3; ++c) ratios[c].push_back(ratio[c]);
      }
    }
  }
  if (ratios[0].size() < 100) return predicted;
  cv::Vec3f umbra;
  for (int c = 0; c < 3; ++c) {
    std::nth_element(ratios[c].begin(), ratios[c].begin() + ratios[c].size() / 3, ratios[c].end());
    umbra[c] = std::clamp(ratios[c][ratios[c].size() / 3], 0.1f, 0.95f);
  }
  return umbra;
}

cv::Vec3f predictedUmbra(const Light& light, const std::vector<SupportPlane>& planes) {
  const Eigen::Vector3f n = planes.empty() ? Eigen::Vector3f(Eigen::Vector3f::UnitZ())
                                           : planes.front().normal.cast<float>();
  const cv::Vec3f shaded = diffuseShading(light, n, 0.0f), lit = diffuseShading(light, n, 1.0f);
  cv::Vec3f umbra;
  for (int c = 0; c < 3; ++c)
    umbra[c] = std::clamp(shaded[c] / std::max(lit[c], 1e-4f), 0.1f, 0.95f);
  return umbra;
}

}  // namespace calipso::render
