#include "texture/hidden_front.hpp"

#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/inpaint.hpp"
#include "fill/around_hole.hpp"
#include "model_details.hpp"

namespace calipso::render {
namespace {

constexpr int kFewestHidden = 40;  // px
constexpr int kThin = 7;           // px: what is thinner hides hardly more than its own rim
constexpr float kClear = 0.5f;     // Reflectance::clear of what is copied from
constexpr int kOutline = 3;  // px of the square in which the outline mixes with what is beyond
constexpr int kRim = 9;      // px of the square in which what hides it mixes with it

cv::Mat square(int side) { return cv::Mat::ones(side, side, CV_8U); }

// Code values of the object in even light, and back.
cv::Mat evenlyLit(const cv::Mat& albedo, const cv::Vec3f& light) {
  cv::Mat linear;
  cv::cvtColor(albedo, linear, cv::COLOR_BGRA2BGR);
  cv::multiply(linear, cv::Scalar(light), linear);
  linear.forEach<cv::Vec3f>([](cv::Vec3f& c, const int*) {
    for (int k = 0; k < 3; ++k) c[k] = codeFromLinear(c[k]);
  });
  return linear;
}
cv::Mat albedoOf(const cv::Mat& codes, const cv::Vec3f& light) {
  cv::Mat albedo = linearFromRealCodes(cv::min(cv::max(codes, 0.0), 255.0));
  cv::divide(albedo, cv::Scalar(light), albedo);
  cv::cvtColor(albedo, albedo, cv::COLOR_BGR2BGRA);
  return albedo;
}

// InpaintParams::surface: copies come from the same side of a box, be there rails before it or not.
cv::Mat piecesIn(const cv::Mat& triangle, const Surface& surface, const std::vector<int>& pieces) {
  cv::Mat label = cv::Mat::zeros(triangle.size(), CV_8U);
  for (int v = 0; v < label.rows; ++v) {
    for (int u = 0; u < label.cols; ++u) {
      const int t = triangle.at<int>(v, u);
      if (t >= 0 && !isDetail(surface, t))
        label.at<std::uint8_t>(v, u) = 1 + pieces[t] % (InpaintParams::kNoPlane - 1);
    }
  }
  return label;
}

}  // namespace

std::optional<Reflectance> hiddenFront(const cv::Mat& labels, const Surface& surface,
                                       const std::vector<int>& pieces, const Reflectance& seen) {
  const cv::Mat own = labels(seen.region), front = seen.nearness > 0.0f,
                others = (own != 0) & (own != surface.index);
  cv::Mat hidden;
  cv::morphologyEx(front & others, hidden, cv::MORPH_OPEN, square(kThin));
  if (cv::countNonZero(hidden) < kFewestHidden) return std::nullopt;
  cv::Mat around;
  cv::dilate(hidden, around, square(kRim));
  cv::Mat inner;
  cv::erode(own == surface.index, inner, square(kOutline));
  const cv::Mat hole = around & front, known = front & inner & (seen.clear > kClear) & ~hole;
  const cv::Rect window = windowAround(hole);
  if (cv::countNonZero(known(window)) < cv::countNonZero(hole)) return std::nullopt;
  const cv::Mat banned = ~known(window) & ~hole(window);
  InpaintParams params;
  params.surface = piecesIn(seen.triangle(window), surface, pieces);
  const InpaintResult filled =
      inpaint(evenlyLit(seen.albedo(window), seen.mean_light), hole(window), banned, params);
  if (!filled.patches_found) return std::nullopt;
  Reflectance picture = seen;
  picture.albedo = seen.albedo.clone();
  albedoOf(filled.image, seen.mean_light).copyTo(picture.albedo(window), hole(window));
  picture.trust = cv::Mat::zeros(seen.trust.size(), CV_32F);
  picture.trust.setTo(1.0f, hole);
  return picture;
}

}  // namespace calipso::render
