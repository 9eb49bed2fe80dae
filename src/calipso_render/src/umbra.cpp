#include "umbra.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"
#include "plane_view.hpp"
#include "view_warp.hpp"

namespace calipso::render {
namespace {

constexpr int kStride = 2;           // px between the places that are looked at
constexpr int kBeside = 5;           // px beside an object's mask that may show it
constexpr float kFullShade = 0.05f;  // of the sun
constexpr float kOpenSky = 0.4f;     // less of it is seen along contacts, where the dark is another
constexpr float kQuiet = 5.0f;       // code values of spread over time: the place rests
constexpr float kDark = 0.01f;       // linear; what is darker says nothing of its shadow
constexpr std::size_t kFewest = 100;
constexpr float kNoShadow = 0.85f;  // hardly darker: the shadow was not where it was predicted

// Picture over plate in the full shade of one view.
void collect(const View& view, const std::vector<SupportPlane>& planes, const Background& plate,
             const Light& light, std::vector<float> (&ratios)[3]) {
  std::vector<Occluder> occluders;
  for (const Actor& a : view.actors)
    occluders.push_back({&a.vertices, &a.surface->triangles, a.surface->winding});
  const ShadowMap sun(occluders, light.direction.cast<double>(), {512, light.angular_radius, 16}),
      sky(occluders, planes.front().normal, {128, kSkyRadius, 24});
  const PlaneView seen(planes, view.camera);
  cv::Mat covered;
  cv::dilate(view.labels != 0, covered, cv::Mat::ones(2 * kBeside + 1, 2 * kBeside + 1, CV_8U));
  Receiver r;
  for (int v = 0; v < covered.rows; v += kStride) {
    for (int u = 0; u < covered.cols; u += kStride) {
      const bool quiet =
          plate.count.at<std::uint8_t>(v, u) > 2 && plate.spread.at<float>(v, u) < kQuiet;
      if (!quiet || covered.at<std::uint8_t>(v, u) != 0 || !seen.at(u, v, r) ||
          sun.visibility(r.position, r.normal) > kFullShade)
        continue;
      const float open = sky.visibility(r.position, r.normal);
      const cv::Vec3f &code = view.picture.at<cv::Vec3f>(v, u),
                      &lit_code = plate.plate.at<cv::Vec3f>(v, u);
      for (int c = 0; c < 3 && open >= kOpenSky; ++c) {
        const float lit = linearFromRealCode(lit_code[c]) * open;
        if (lit > kDark) ratios[c].push_back(linearFromRealCode(code[c]) / lit);
      }
    }
  }
}

}  // namespace

std::optional<cv::Vec3f> umbraInViews(const std::vector<View>& views,
                                      const std::vector<SupportPlane>& planes,
                                      const Background& plate, const Light& light) {
  if (planes.empty()) return std::nullopt;
  std::vector<float> ratios[3];
  for (const View& view : views) {
    if (sameView(view.camera, views.front().camera)) collect(view, planes, plate, light, ratios);
  }
  cv::Vec3f umbra;
  for (int c = 0; c < 3; ++c) {
    if (ratios[c].size() < kFewest) return std::nullopt;
    std::nth_element(ratios[c].begin(), ratios[c].begin() + ratios[c].size() / 2, ratios[c].end());
    umbra[c] = std::max(ratios[c][ratios[c].size() / 2], 0.1f);
    if (umbra[c] > kNoShadow) return std::nullopt;
  }
  return umbra;
}

}  // namespace calipso::render
