#include "frame/soft_outlines.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>

#include "calipso_render/colour.hpp"
#include "draw/wide_loops.hpp"
#include "frame/marked.hpp"
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

using Three = cv::v_float32x4;  // and one that does not matter

// B, G and R of a row's pixels [first, last), blurred: down the columns, then along the row.
// @param columns room for `reach` more on either side
template <class At>
void blurRow(const cv::Mat& bgr, int v, int first, int last, const std::vector<float>& parts,
             const At& at, std::vector<cv::Vec4f>& columns, std::vector<cv::Vec4f>& blurred) {
  const int reach = static_cast<int>(parts.size()) - 1;
  columns.assign(last - first + 2 * reach, {});
  for (int dv = -reach; dv <= reach; ++dv) {
    const cv::Vec3b* row = bgr.ptr<cv::Vec3b>(std::clamp(v + dv, 0, bgr.rows - 1));
    const Three part = cv::v_setall_f32(parts[std::abs(dv)]);
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const int u = std::clamp(first - reach + static_cast<int>(i), 0, bgr.cols - 1);
      cv::v_store(columns[i].val, cv::v_load(columns[i].val) + part * at(row[u]));
    }
  }
  blurred.resize(last - first);
  for (std::size_t i = 0; i < blurred.size(); ++i) {
    Three sum = cv::v_setzero_f32();
    for (int k = 0; k <= 2 * reach; ++k)
      sum += cv::v_setall_f32(parts[std::abs(k - reach)]) * cv::v_load(columns[i + k].val);
    cv::v_store(blurred[i].val, sum);
  }
}

// Softness that lens and pixels make, in linear light.
struct Lens {
  static Three at(const cv::Vec3b& code) {
    const float* linear = decodeTable();
    return {linear[code[0]], linear[code[1]], linear[code[2]], 0.0f};
  }
  // @param part of it that `code` is to get @return code values
  static cv::Vec3f soften(const cv::Vec3b& code, const cv::Vec3f& blurred, float part) {
    const float* linear = decodeTable();
    cv::Vec3f soft;
    for (int c = 0; c < 3; ++c) {
      const float now = linear[code[c]];
      soft[c] = codeFromLinear(now + part * (blurred[c] - now));
    }
    return soft;
  }
};

// Softness that codecs make: luma stays, the colours beside it are those around, in code values.
struct Codec {
  static Three at(const cv::Vec3b& code) {
    return {static_cast<float>(code[0]), static_cast<float>(code[1]), static_cast<float>(code[2]),
            0.0f};
  }
  static cv::Vec3f soften(const cv::Vec3b& code, const cv::Vec3f& blurred, float part) {
    const cv::Vec3f now = code, change = blurred - now;
    return now + part * (change - cv::Vec3f::all(lumaOf(change)));
  }
};

// How much of its softness an outline lacks: none where the surface is where the video has it, as
// what drawing misses of the video is carried over there. Nothing is carried from where the video
// has another part of a surface that moves.
float lacksSoftness(const StagedFrame& frame, std::uint32_t id, int u, int v) {
  if (!frame.objectOf(id).isAtRestInVideo()) return 1.0f;
  const Eigen::Vector2f moved = frame.movement(id, static_cast<float>(u), static_cast<float>(v));
  const cv::Point from(cvRound(u - moved.x()), cvRound(v - moved.y()));
  if (frame.whole().contains(from) && frame.isElsewhere(from.x, from.y)) return 1.0f;
  return smoothStep(kStillPx, kNonePx, moved.norm());
}

// A pixel of an outline, and how much of its softness it lacks.
struct OutlinePixel {
  int column;
  std::uint8_t lacks;
};
using Outlines = std::vector<std::vector<OutlinePixel>>;  // by the region's rows

// Marks what is drawn beside what is not.
CALIPSO_WIDE_LOOPS void markRims(const std::uint8_t* above, const std::uint8_t* here,
                                 const std::uint8_t* below, int count, std::uint8_t* rims) {
  for (int u = 1; u + 1 < count; ++u)
    rims[u] = here[u] & ~(here[u - 1] & here[u + 1] & above[u] & below[u]);
}

Outlines findOutlines(const StagedFrame& frame, const DrawnSurfaces& surfaces) {
  const cv::Rect region = surfaces.centre().region();
  const cv::Mat& drawn = surfaces.mask();
  Outlines outlines(region.height);
#pragma omp parallel
  {
    std::vector<std::uint8_t> rims(region.width, 0);
#pragma omp for schedule(static)
    for (int v = 1; v < region.height - 1; ++v) {
      markRims(drawn.ptr(v - 1), drawn.ptr(v), drawn.ptr(v + 1), region.width, rims.data());
      for (int u = nextMarked(rims.data(), 0, region.width); u < region.width;
           u = nextMarked(rims.data(), u + 1, region.width)) {
        const float part =
            lacksSoftness(frame, surfaces.centre().ids(v)[u], u + region.x, v + region.y);
        const auto lacks = static_cast<std::uint8_t>(255.0f * part + 0.5f);
        if (lacks > 0) outlines[v].push_back({u, lacks});
      }
    }
  }
  return outlines;
}

// Most that outlines within `reach` px of the pixels of a row lack.
void markAround(const Outlines& outlines, int row, int reach, std::vector<std::uint8_t>& lacking) {
  std::fill(lacking.begin(), lacking.end(), 0);
  const int width = static_cast<int>(lacking.size()), rows = static_cast<int>(outlines.size());
  for (int v = std::max(0, row - reach); v <= std::min(row + reach, rows - 1); ++v) {
    for (const OutlinePixel& o : outlines[v]) {
      for (int u = std::max(0, o.column - reach); u <= std::min(o.column + reach, width - 1); ++u)
        lacking[u] = std::max(lacking[u], o.lacks);
    }
  }
}

// Softens what is near the outlines.
// @param blur px, standard deviation
template <class Softness>
void soften(const Outlines& outlines, const cv::Rect& region, float blur, FrameOutput& out) {
  if (blur < kLeast) return;
  const std::vector<float> parts = partsOf(blur);
  std::vector<std::vector<std::pair<int, cv::Vec3b>>> changed(region.height);
#pragma omp parallel
  {
    std::vector<cv::Vec4f> columns, blurred;
    std::vector<std::uint8_t> lacking(region.width);
#pragma omp for schedule(dynamic, 8)
    for (int j = 0; j < region.height; ++j) {
      markAround(outlines, j, static_cast<int>(parts.size()) - 1, lacking);
      const std::uint8_t* lacks = lacking.data();
      const int v = j + region.y;
      for (int i = nextMarked(lacks, 0, region.width); i < region.width;
           i = nextMarked(lacks, i, region.width)) {
        const int first = i;
        while (i < region.width && lacks[i] != 0) ++i;
        blurRow(out.bgr, v, first + region.x, i + region.x, parts, Softness::at, columns, blurred);
        for (int k = first; k < i; ++k) {
          const cv::Vec3b& now = out.bgr.at<cv::Vec3b>(v, k + region.x);
          const cv::Vec4f& b = blurred[k - first];
          const cv::Vec3f soft = Softness::soften(now, {b[0], b[1], b[2]}, lacks[k] / 255.0f);
          const cv::Vec3b code(quantise(soft[0]), quantise(soft[1]), quantise(soft[2]));
          if (code != now) changed[j].push_back({k + region.x, code});
        }
      }
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
  if (std::max(blur, colour) < kLeast) return;
  const Outlines outlines = findOutlines(frame, surfaces);
  const cv::Rect region = surfaces.centre().region();
  soften<Lens>(outlines, region, blur, out);
  soften<Codec>(outlines, region, std::sqrt(std::max(0.0f, colour * colour - blur * blur)), out);
}

}  // namespace calipso::render
