#include "texture/texture_patches.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calipso_render/colour.hpp"
#include "calipso_render/inpaint.hpp"
#include "smooth_step.hpp"
#include "texture/mesh_topology.hpp"
#include "texture/pattern_motifs.hpp"
#include "texture/surface_chart.hpp"

namespace calipso::render {
namespace {

constexpr float kAcross = 200.0f;  // px of a chart's picture that the surface's extent has, at most
constexpr float kRadius = 70.0f;   // px, of a chart
// certainty, of the greatest there is, from which a texel is copied from and stays
constexpr float kKnown = 0.5f;
constexpr float kBlend = 0.2f;  // ... on either side of which both colours mix
constexpr int kMargin = 4;      // px around a chart
constexpr int kGap = 8;         // px between two charts in one picture: more than a patch
// px: standard deviation of the blur that takes a pattern away
constexpr double kPatternSize = 3.0;
// code values r.m.s. of what it takes: no more than a picture's noise
constexpr double kPlain = 6.0;
constexpr int kPatternSide = 25;  // px of the square in which that is looked at
constexpr double kAllOver = 0.8;  // of the best seen part on which there must be more
constexpr int kGoesOn = 13;       // px of the square within which a single motif goes on
constexpr int kMostCharts = 60;
constexpr int kFewest = 400;  // px of the best seen part that make a sample of the pattern

// A chart as a picture.
struct ChartPicture {
  std::vector<FlatTriangle> triangles;
  Eigen::Vector2f origin;  // px that the chart's origin comes to
  cv::Mat colour;          // CV_32FC3, code values
  cv::Mat laid, known;     // CV_8UC1
};

cv::Mat widened(const cv::Mat& part) {
  cv::Mat wide;
  cv::cvtColor(part, wide, cv::COLOR_GRAY2BGR);
  return wide;
}

class PatternFill {
 public:
  PatternFill(const Points& vertices, const Triangles& triangles, const Eigen::Vector3f& down,
              std::vector<float>& certain, SurfaceTexture& texture)
      : triangles_(triangles),
        down_(down),
        unfolder_(vertices, triangles),
        certain_(certain),
        texture_(texture),
        known_(texture) {
    pixel_ = std::max(texture.spacing(), boxOf(vertices).diagonal().norm() / kAcross);
    const float most = *std::max_element(certain.begin(), certain.end());
    for (std::size_t i = 0; i < certain.size(); ++i)
      known_.texels[i][3] = most > 0.0f ? certain[i] / most : 0.0f;
  }

  void run() {
    std::vector<bool> unknown = unknownTriangles();
    if (std::find(unknown.begin(), unknown.end(), true) == unknown.end()) return;
    const int best = farthest(unfolder_.distances(unknown), kRadius * pixel_);
    if (best < 0) return;
    sample_ = draw(unfolder_.around(best, down_, kRadius * pixel_));
    if (!hasPattern()) return;
    motifs_.emplace(sample_.colour, sample_.known);
    leaveOtherParts(best, unknown);
    for (int i = 0; i < kMostCharts; ++i) {
      const int seed = nextSeed(unknown);
      if (seed < 0) return;
      const ChartPicture chart = draw(unfolder_.around(seed, down_, kRadius * pixel_));
      unknown[seed] = false;
      for (const FlatTriangle& t : chart.triangles) unknown[t.triangle] = false;
      take(chart, filled(chart));
    }
  }

 private:
  std::vector<bool> unknownTriangles() const {
    std::vector<bool> unknown(triangles_.size(), false);
    for (int t = 0; t < known_.triangleCount(); ++t) {
      for (std::size_t i = known_.firstOf(t); i < known_.firstOf(t + 1); ++i)
        unknown[t] = unknown[t] || known_.texels[i][3] < kKnown;
    }
    return unknown;
  }

  // What does not hang together with the sample may be another thing: a balloon's ropes.
  void leaveOtherParts(int sample, std::vector<bool>& unknown) const {
    std::vector<bool> goal(unknown.size(), false);
    goal[sample] = true;
    const std::vector<float> distances = unfolder_.distances(goal);
    for (std::size_t t = 0; t < unknown.size(); ++t)
      unknown[t] = unknown[t] && std::isfinite(distances[t]);
  }

  // The triangle with the greatest distance that is not above a limit; -1: all are 0 or above it.
  static int farthest(const std::vector<float>& distances, float limit) {
    int best = -1;
    for (std::size_t t = 0; t < distances.size(); ++t) {
      if (distances[t] > 0.0f && distances[t] <= limit &&
          (best < 0 || distances[t] > distances[best]))
        best = static_cast<int>(t);
    }
    return best;
  }

  // An unknown triangle whose chart reaches what is known, or else the nearest; none of a part of
  // which nothing is known: it may be another thing.
  int nextSeed(const std::vector<bool>& unknown) const {
    std::vector<bool> known = unknown;
    known.flip();
    const std::vector<float> distances = unfolder_.distances(known);
    const int seed = farthest(distances, 0.5f * kRadius * pixel_);
    if (seed >= 0) return seed;
    int nearest = -1;
    for (std::size_t t = 0; t < unknown.size(); ++t) {
      if (unknown[t] && std::isfinite(distances[t]) &&
          (nearest < 0 || distances[t] < distances[nearest]))
        nearest = static_cast<int>(t);
    }
    return nearest;
  }

  ChartPicture draw(std::vector<FlatTriangle> triangles) const {
    Eigen::AlignedBox2f box(Eigen::Vector2f(0, 0));
    for (const FlatTriangle& t : triangles) {
      for (const Eigen::Vector2f& c : t.corners) box.extend(c / pixel_);
    }
    const Eigen::Vector2f size = box.max() - box.min();
    const cv::Size pixels(static_cast<int>(std::ceil(size.x())) + 2 * kMargin + 1,
                          static_cast<int>(std::ceil(size.y())) + 2 * kMargin + 1);
    ChartPicture picture{std::move(triangles), Eigen::Vector2f::Constant(kMargin) - box.min(),
                         cv::Mat(pixels, CV_32FC3, cv::Scalar::all(0)),
                         cv::Mat::zeros(pixels, CV_8U), cv::Mat::zeros(pixels, CV_8U)};
    for (const FlatTriangle& t : picture.triangles) drawTriangle(t, picture);
    return picture;
  }

  void drawTriangle(const FlatTriangle& flat, ChartPicture& picture) const {
    std::array<Eigen::Vector2f, 3> c;
    Eigen::AlignedBox2f box;
    for (int k = 0; k < 3; ++k) box.extend(c[k] = flat.corners[k] / pixel_ + picture.origin);
    Eigen::Matrix2f edges;
    edges << c[0] - c[2], c[1] - c[2];
    const Eigen::Matrix2f weights_of = edges.inverse();
    for (int v = static_cast<int>(std::ceil(box.min().y())); v <= box.max().y(); ++v) {
      for (int u = static_cast<int>(std::ceil(box.min().x())); u <= box.max().x(); ++u) {
        const Eigen::Vector2f w = weights_of * (Eigen::Vector2f(u, v) - c[2]);
        const Eigen::Vector3f weights(w[0], w[1], 1.0f - w[0] - w[1]);
        if (!(weights.minCoeff() >= 0.0f)) continue;
        const cv::Vec4f texel = known_.at(flat.triangle, weights);
        for (int k = 0; k < 3; ++k)
          picture.colour.at<cv::Vec3f>(v, u)[k] = codeFromLinear(texel[k]);
        picture.laid.at<std::uint8_t>(v, u) = 255;
        picture.known.at<std::uint8_t>(v, u) = texel[3] >= kKnown ? 255 : 0;
      }
    }
  }

  // Whether the sample shows a pattern that is all over it: a single motif is not repeated on other
  // sides.
  bool hasPattern() const {
    if (cv::countNonZero(sample_.known) < kFewest) return false;
    cv::Mat part, smooth, share, detail;
    sample_.known.convertTo(part, CV_32F, 1.0 / 255.0);
    const cv::Mat parts = widened(part);
    cv::GaussianBlur(sample_.colour.mul(parts), smooth, {}, kPatternSize);
    cv::GaussianBlur(parts, share, {}, kPatternSize);
    detail = (sample_.colour - smooth / cv::max(share, 1e-3)).mul(parts);
    cv::Mat energy = detail.mul(detail), weight;
    cv::transform(energy, energy, cv::Matx13f(1.0f / 3.0f, 1.0f / 3.0f, 1.0f / 3.0f));
    cv::blur(energy, energy, {kPatternSide, kPatternSide}),
        cv::blur(part, weight, {kPatternSide, kPatternSide});
    const cv::Mat lively = (energy > kPlain * kPlain * weight) & sample_.known;
    return cv::countNonZero(lively) > kAllOver * cv::countNonZero(sample_.known);
  }

  // The chart's colours with its unknown parts filled.
  cv::Mat filled(const ChartPicture& chart) const {
    const cv::Size own = chart.colour.size(), other = sample_.colour.size();
    const cv::Rect left(cv::Point(), own), right(cv::Point(own.width + kGap, 0), other);
    const cv::Size both(right.br().x, std::max(own.height, other.height));
    cv::Mat image(both, CV_32FC3, cv::Scalar::all(0)), hole = cv::Mat::zeros(both, CV_8U),
                                                       banned(both, CV_8U, cv::Scalar(255));
    chart.colour.copyTo(image(left)), sample_.colour.copyTo(image(right));
    const cv::Mat unknown = chart.laid & (chart.known == 0);
    cv::Mat around;  // so that whole patches are there to compare
    cv::dilate(unknown, around, cv::Mat::ones(2 * kMargin + 1, 2 * kMargin + 1, CV_8U));
    cv::Mat(unknown | (around & (chart.laid == 0))).copyTo(hole(left));
    // A single motif goes on where it meets what is not known.
    cv::Mat beside;
    cv::dilate(unknown, beside, cv::Mat::ones(kGoesOn, kGoesOn, CV_8U));
    const cv::Mat near = chart.known & (beside | ~motifs_->in(chart.colour, chart.known)),
                  far = sample_.known & ~motifs_->in(sample_.colour, sample_.known);
    banned(left).setTo(0, near), banned(right).setTo(0, far);
    InpaintParams params;
    params.away_row = params.away_column = 0.0f;
    params.from_anywhere = true;  // the sample lies beside the chart
    return inpaint(image, hole, banned, params).image(left).clone();
  }

  // Puts a filled chart's colours on the surface.
  void take(const ChartPicture& chart, const cv::Mat& colours) {
    for (const FlatTriangle& flat : chart.triangles) {
      for (std::size_t i = texture_.firstOf(flat.triangle); i < texture_.firstOf(flat.triangle + 1);
           ++i) {
        cv::Vec4f& known = known_.texels[i];
        if (known[3] >= 1.0f) continue;
        const Eigen::Vector3f w =
            texture_.weightsOf(flat.triangle, i - texture_.firstOf(flat.triangle));
        const Eigen::Vector2f p =
            (w[0] * flat.corners[0] + w[1] * flat.corners[1] + w[2] * flat.corners[2]) / pixel_ +
            chart.origin;
        cv::Mat code;
        cv::getRectSubPix(colours, {1, 1}, {p.x(), p.y()}, code);
        const float stays = smoothStep(kKnown - kBlend, kKnown + kBlend, known[3]);
        for (int k = 0; k < 3; ++k)
          known[k] += (1.0f - stays) * (linearFromRealCode(code.at<cv::Vec3f>(0, 0)[k]) - known[k]);
        known[3] = certain_[i] = 1.0f;
        texture_.texels[i] = cv::Vec4f(known[0], known[1], known[2], stays * texture_.texels[i][3]);
      }
    }
  }

  const Triangles& triangles_;
  Eigen::Vector3f down_;
  SurfaceUnfolder unfolder_;
  std::vector<float>& certain_;
  SurfaceTexture& texture_;
  SurfaceTexture known_;                 // the same colours, and how far they are known
  float pixel_ = 0.0f;                   // m, of charts' pictures
  ChartPicture sample_;                  // of the best seen part
  std::optional<PatternMotifs> motifs_;  // of the sample
};

}  // namespace

void continuePattern(const Points& vertices, const Triangles& triangles,
                     const Eigen::Vector3f& down, std::vector<float>& certain,
                     SurfaceTexture& texture) {
  if (!certain.empty()) PatternFill(vertices, triangles, down, certain, texture).run();
}

}  // namespace calipso::render
