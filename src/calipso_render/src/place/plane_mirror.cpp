#include "place/plane_mirror.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/colour.hpp"
#include "place/drawn_out.hpp"

namespace calipso::render {

namespace {

constexpr float kReach = 3.0f;  // standard deviations
constexpr float kEven = 0.03f;  // slope of planes in which outlines are seen
// of a place's brightness: where the mirror image adds or takes more, the plane is seen through it
constexpr double kMirrors = 0.1;
constexpr int kAround = 15;        // px of the squares in which gradients are averaged, and rows
constexpr int kFewestBeside = 40;  // pixels of a row beside the mirror image, for it to be compared
constexpr float kPlain = 0.4f;     // of the gradients beside it
constexpr float kOutline = 0.1f;   // of the brightness, from pixel to pixel: an outline is mirrored
constexpr int kBesideOutline = 2;  // px by which it may be off
constexpr float kRough = 1.8f;     // times the gradients beside the mirror image: it is

cv::Mat gradientOf(const cv::Mat& bgr) {
  cv::Mat grey, across, down;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  cv::Scharr(grey, across, CV_32F, 1, 0), cv::Scharr(grey, down, CV_32F, 0, 1);
  return cv::abs(across) + cv::abs(down);
}

// The mean of a gradient around every pixel, of what is set in `where`.
cv::Mat meanAround(const cv::Mat& gradient, const cv::Mat& where) {
  cv::Mat weight, weights, mean;
  cv::erode(where, weight, cv::Mat::ones(3, 3, CV_8U));
  weight.convertTo(weight, CV_32F, 1.0 / 255.0);
  cv::blur(gradient.mul(weight), mean, {kAround, kAround});
  cv::blur(weight, weights, {kAround, kAround});
  return mean / cv::max(weights, 1e-3);
}

// The mean of a picture over every row and those around, of what is set; 0 where too few are.
std::vector<float> meanOfRows(const cv::Mat& values, const cv::Mat& where) {
  cv::Mat sum(values.rows, 1, CV_32F), count(values.rows, 1, CV_32F);
  for (int v = 0; v < values.rows; ++v) {
    sum.at<float>(v) = static_cast<float>(cv::mean(values.row(v), where.row(v))[0]);
    count.at<float>(v) = static_cast<float>(cv::countNonZero(where.row(v)));
  }
  sum = sum.mul(count);
  cv::blur(sum, sum, {1, kAround}), cv::blur(count, count, {1, kAround});
  std::vector<float> means(values.rows, 0.0f);
  for (int v = 0; v < values.rows; ++v) {
    if (count.at<float>(v) >= kFewestBeside) means[v] = sum.at<float>(v) / count.at<float>(v);
  }
  return means;
}

}  // namespace

// To whole squares of DrawnOut::kCoarsest px.
cv::Rect reachedBy(const MirrorImage& image, float slope) {
  double spread = 0.0;
  cv::minMaxLoc(image.spread, nullptr, &spread);
  const int reach = static_cast<int>(kReach * slope * spread) + 1;
  constexpr int kSquare = DrawnOut::kCoarsest;
  const auto down = [](int x) { return std::max(0, x) / kSquare * kSquare; };
  const cv::Point low(down(image.box.x - reach), down(image.box.y - reach)),
      high(down(image.box.br().x + reach) + kSquare, down(image.box.br().y + reach) + kSquare);
  return cv::Rect(low, high) & cv::Rect({0, 0}, image.spread.size());
}

cv::Mat withCover(const MirrorImage& image, const cv::Rect& box) {
  cv::Mat out;
  cv::merge(std::vector<cv::Mat>{image.colour(box), image.cover(box)}, out);
  return out;
}

cv::Mat addedBy(const PlaneMirror& mirror, const MirrorImage& image) {
  cv::Mat added = cv::Mat::zeros(image.colour.size(), CV_32FC3);
  const cv::Rect box = reachedBy(image, mirror.slope);
  const cv::Mat drawn =
      DrawnOut(image.spread(box), image.across, mirror.slope)(withCover(image, box));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v) {
    const cv::Vec4f* c = drawn.ptr<cv::Vec4f>(v);
    cv::Vec3f* to = added.ptr<cv::Vec3f>(box.y + v) + box.x;
    for (int u = 0; u < box.width; ++u)
      to[u] =
          mirror.strength * (cv::Vec3f(c[u][0], c[u][1], c[u][2]) - c[u][3] * mirror.surroundings);
  }
  return added;
}

cv::Mat unmirrored(const PlaneMirror& mirror, const cv::Mat& picture) {
  cv::Mat out = picture.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      const cv::Vec3f& added = mirror.at_key.at<cv::Vec3f>(v, u);
      if (added == cv::Vec3f()) continue;
      cv::Vec3f& c = out.at<cv::Vec3f>(v, u);
      for (int k = 0; k < 3; ++k)
        c[k] = codeFromLinear(std::max(0.0f, linearFromRealCode(c[k]) - added[k]));
    }
  }
  return out;
}

cv::Mat unmirroredCodes(const PlaneMirror& mirror, const cv::Mat& bgr) {
  cv::Mat out = bgr.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      const cv::Vec3f& added = mirror.at_key.at<cv::Vec3f>(v, u);
      if (added == cv::Vec3f()) continue;
      cv::Vec3b& c = out.at<cv::Vec3b>(v, u);
      for (int k = 0; k < 3; ++k) c[k] = quantise(codeFromLinear(linearFromCode(c[k]) - added[k]));
    }
  }
  return out;
}

namespace {

// Where a mirrored outline lies beside its place, so that taken off it leaves two steps.
// @param strength gradientOf(bgr); usual its mean beside the mirror image, per row
cv::Mat roughOutlines(const PlaneMirror& mirror, const cv::Mat& bgr, const cv::Mat& strength,
                      const std::vector<float>& usual, const cv::Mat& plane) {
  cv::Mat outline = cv::Mat::zeros(bgr.size(), CV_8U);
  for (int v = 0; v + 1 < bgr.rows; ++v) {
    for (int u = 0; u + 1 < bgr.cols; ++u) {
      const cv::Vec3f& here = mirror.at_key.at<cv::Vec3f>(v, u);
      const float step =
          std::max(std::abs(luminance(mirror.at_key.at<cv::Vec3f>(v, u + 1) - here)),
                   std::abs(luminance(mirror.at_key.at<cv::Vec3f>(v + 1, u) - here)));
      const cv::Vec3b& code = bgr.at<cv::Vec3b>(v, u);
      const float own =
          luminance({linearFromCode(code[0]), linearFromCode(code[1]), linearFromCode(code[2])});
      if (step > kOutline * own) outline.at<std::uint8_t>(v, u) = 255;
    }
  }
  constexpr int kSide = 2 * kBesideOutline + 1;
  cv::dilate(outline, outline, cv::Mat::ones(kSide, kSide, CV_8U));
  outline &= plane;
  const cv::Mat gradient = meanAround(strength, outline);
  for (int v = 0; v < bgr.rows; ++v) {
    if (usual[v] > 0.0f)
      outline.row(v) &= gradient.row(v) > kRough * usual[v];
    else
      outline.row(v).setTo(0);
  }
  return outline;
}

}  // namespace

cv::Mat lostInMirror(const PlaneMirror& mirror, const cv::Mat& bgr, const cv::Mat& plane) {
  cv::Mat changed(bgr.size(), CV_8U, cv::Scalar(0));
  for (int v = 0; v < bgr.rows; ++v) {
    for (int u = 0; u < bgr.cols; ++u) {
      const cv::Vec3b& code = bgr.at<cv::Vec3b>(v, u);
      double own = 0.0;
      for (int c = 0; c < 3; ++c) own += linearFromCode(code[c]);
      if (cv::norm(mirror.at_key.at<cv::Vec3f>(v, u), cv::NORM_L1) > kMirrors * own)
        changed.at<std::uint8_t>(v, u) = 255;
    }
  }
  const cv::Mat within = plane & changed, beside = plane & ~changed, strength = gradientOf(bgr),
                gradient = meanAround(strength, within);
  const std::vector<float> usual = meanOfRows(meanAround(strength, beside), beside);
  cv::Mat lost = cv::Mat::zeros(bgr.size(), CV_8U);
  for (int v = 0; v < bgr.rows; ++v) lost.row(v) = gradient.row(v) < kPlain * usual[v];
  lost &= within;
  cv::morphologyEx(lost, lost, cv::MORPH_OPEN, cv::Mat::ones(5, 5, CV_8U));
  cv::dilate(lost, lost, cv::Mat::ones(kAround, kAround, CV_8U));
  return (lost & within) | roughOutlines(mirror, bgr, strength, usual, plane);
}

bool mirrorsSharply(const PlaneMirror& mirror) {
  return mirror.established() && mirror.slope < kEven;
}

bool isWater(const PlaneMirror& mirror) { return mirror.established() && !mirrorsSharply(mirror); }

}  // namespace calipso::render
