#include "frame/soft_outlines.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "frame/pixel.hpp"
#include "smooth_step.hpp"

namespace calipso::render {
namespace {

constexpr float kLeast = 0.15f;  // px: less is not seen
constexpr int kMostReach = 6;    // px

// Parts of a Gaussian that fall upon the pixels 0, 1, ... from its middle.
std::vector<float> partsOf(float deviation) {
  const int reach = std::clamp(static_cast<int>(std::ceil(2.5f * deviation)), 1, kMostReach);
  const auto below = [&](float x) {
    return 0.5f * std::erfc(-x / (deviation * static_cast<float>(M_SQRT2)));
  };
  std::vector<float> parts;
  float sum = 0.0f;
  for (int k = 0; k <= reach; ++k) {
    const auto x = static_cast<float>(k);
    parts.push_back(below(x + 0.5f) - below(x - 0.5f));
    sum += (k == 0 ? 1.0f : 2.0f) * parts.back();
  }
  for (float& part : parts) part /= sum;
  return parts;
}

// Sum of what `at` tells of the pixels around (u, v), by their parts.
template <class At>
cv::Vec3f blurred(const cv::Mat& bgr, int u, int v, const std::vector<float>& parts, const At& at) {
  const int reach = static_cast<int>(parts.size()) - 1;
  cv::Vec3f sum;
  for (int dv = -reach; dv <= reach; ++dv) {
    const cv::Vec3b* row = bgr.ptr<cv::Vec3b>(std::clamp(v + dv, 0, bgr.rows - 1));
    cv::Vec3f line;
    for (int du = -reach; du <= reach; ++du)
      line += parts[std::abs(du)] * at(row[std::clamp(u + du, 0, bgr.cols - 1)]);
    sum += parts[std::abs(dv)] * line;
  }
  return sum;
}

// A pixel as soft as lens and pixels make it, in linear light. @return code values
cv::Vec3f softened(const cv::Mat& bgr, int u, int v, float part, const std::vector<float>& parts) {
  const float* linear = decodeTable();
  const cv::Vec3f now = linearPixel(bgr, u, v),
                  soft = blurred(bgr, u, v, parts, [&](const cv::Vec3b& code) {
                    return cv::Vec3f(linear[code[0]], linear[code[1]], linear[code[2]]);
                  });
  const cv::Vec3f mixed = now + part * (soft - now);
  return {codeFromLinear(mixed[0]), codeFromLinear(mixed[1]), codeFromLinear(mixed[2])};
}

// A pixel of its own luma with the colours around it, as codecs keep them. @return code values
cv::Vec3f recoloured(const cv::Mat& bgr, int u, int v, float part,
                     const std::vector<float>& parts) {
  const cv::Vec3f now = bgr.at<cv::Vec3b>(v, u),
                  soft = blurred(bgr, u, v, parts,
                                 [](const cv::Vec3b& code) { return cv::Vec3f(code); });
  return now + part * ((soft - cv::Vec3f::all(lumaOf(soft))) - (now - cv::Vec3f::all(lumaOf(now))));
}

// How much of its softness an outline lacks: none where the surface is where the video has it, as
// what drawing misses of the video is carried over there.
float lacksSoftness(const StagedFrame& frame, std::uint32_t id, int u, int v) {
  if (!frame.objectOf(id).isAtRestInVideo()) return 1.0f;
  const float moved = frame.movement(id, static_cast<float>(u), static_cast<float>(v)).norm();
  return smoothStep(kStillPx, kNonePx, moved);
}

// @return CV_8UC1 over the region: how much of the softness lacks within `reach` px of an outline
cv::Mat findOutlines(const StagedFrame& frame, const DrawnSurfaces& surfaces, int reach) {
  const cv::Rect region = surfaces.centre().region();
  const cv::Mat& drawn = surfaces.mask();
  cv::Mat lacking = cv::Mat::zeros(region.size(), CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = 1; v < region.height - 1; ++v) {
    const std::uint8_t *above = drawn.ptr(v - 1), *here = drawn.ptr(v), *below = drawn.ptr(v + 1);
    for (int u = 1; u < region.width - 1; ++u) {
      const bool inner = (here[u - 1] & here[u + 1] & above[u] & below[u]) != 0;
      if (here[u] == 0 || inner) continue;
      const float part =
          lacksSoftness(frame, surfaces.centre().ids(v)[u], u + region.x, v + region.y);
      lacking.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(255.0f * part + 0.5f);
    }
  }
  cv::dilate(lacking, lacking, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
  return lacking;
}

using Softening = cv::Vec3f (*)(const cv::Mat& bgr, int u, int v, float part,
                                const std::vector<float>& parts);

// Softens what is near the outlines.
// @param blur px, standard deviation
void soften(const StagedFrame& frame, const DrawnSurfaces& surfaces, float blur,
            Softening softening, FrameOutput& out) {
  if (blur < kLeast) return;
  const cv::Rect region = surfaces.centre().region();
  const std::vector<float> parts = partsOf(blur);
  const cv::Mat lacking = findOutlines(frame, surfaces, static_cast<int>(parts.size()) - 1);
  std::vector<std::vector<std::pair<int, cv::Vec3b>>> changed(region.height);
#pragma omp parallel for schedule(dynamic, 8)
  for (int j = 0; j < region.height; ++j) {
    const std::uint8_t* lacks = lacking.ptr(j);
    for (int i = 0; i < region.width; ++i) {
      if (lacks[i] == 0) continue;
      const int u = i + region.x, v = j + region.y;
      const cv::Vec3f soft = softening(out.bgr, u, v, lacks[i] / 255.0f, parts);
      const cv::Vec3b code(quantise(soft[0]), quantise(soft[1]), quantise(soft[2]));
      if (code != out.bgr.at<cv::Vec3b>(v, u)) changed[j].push_back({u, code});
    }
  }
  for (int j = 0; j < region.height; ++j) {
    for (const auto& [u, code] : changed[j]) {
      out.bgr.at<cv::Vec3b>(j + region.y, u) = code;
      std::uint8_t& source = out.provenance.at<std::uint8_t>(j + region.y, u);
      if (source == kOriginal) source = kRendered;
    }
  }
}

}  // namespace

void softenOutlines(const StagedFrame& frame, const DrawnSurfaces& surfaces, FrameOutput& out) {
  const float blur = frame.prepared.outline_blur, colour = frame.prepared.colour_blur;
  soften(frame, surfaces, blur, softened, out);
  soften(frame, surfaces, std::sqrt(std::max(0.0f, colour * colour - blur * blur)), recoloured,
         out);
}

}  // namespace calipso::render
