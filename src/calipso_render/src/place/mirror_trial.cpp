#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "place/drawn_out.hpp"
#include "place/plane_mirror.hpp"

namespace calipso::render {
namespace {

constexpr int kTestedWidth = 192;  // px to which the picture is brought down for the test
constexpr double kAround = 10.0;   // px of those: deviation of the weights around a pixel
constexpr int kSquare = 8;         // px of the squares of which every other one is held out
constexpr int kFarthest = 64;      // px by which the image is displaced for comparison
// correlation with the image in place up to which a displaced one is another
constexpr double kAlike = 0.3;
constexpr int kFewestOthers = 12;    // such displaced images, at least
constexpr double kClear = 1.8;       // times what the best of them explains
constexpr double kExplained = 0.1;   // of the squares around the image, at least
// strengths, times what water and varnish mirror: dull ones, and polished steel
constexpr double kFaintest = 0.3, kBrightest = 10.0;
constexpr int kMisplaced = 2;  // px by which the image may be displaced against its place
constexpr float kSlopes[] = {0.0f, 0.01f, 0.02f, 0.04f, 0.08f, 0.16f};  // that are tried
constexpr double kUsual = 1e-3;  // weight of the usual strength, to that of what is seen
constexpr double kRidge = 1e-6;

// The test's pictures, brought down.
class Trial {
 public:
  Trial(const MirrorImage& image, const cv::Mat& picture, const cv::Mat& known,
        const cv::Mat& hidden)
      : scale_(std::max(1.0f, static_cast<float>(picture.cols) / kTestedWidth)) {
    const cv::Size size(cvRound(picture.cols / scale_), cvRound(picture.rows / scale_));
    const auto brought = [&](const cv::Mat& values) {
      cv::Mat out;
      cv::resize(values, out, size, 0, 0, cv::INTER_AREA);
      return out;
    };
    cv::Mat part;
    known.convertTo(part, CV_32F, 1.0 / 255.0);
    weight_ = cv::Mat::zeros(size, CV_32F);
    weight_.setTo(1.0f, brought(part) > 0.99f);
    cv::GaussianBlur(weight_, around_, {}, kAround);
    around_ = cv::max(around_, 1e-6);
    std::array<cv::Mat, 3> y;
    cv::split(brought(picture), y);
    if (!hidden.empty()) shade_ = lessAround(brought(hidden).mul(y[0] + y[1] + y[2]));
    for (int c = 0; c < 3; ++c) y_less_[c] = less(y[c]);
    image_ = brought(withCover(image, {{0, 0}, image.colour.size()}));
    spread_ = brought(image.spread) / scale_, across_ = image.across;
  }

  struct Fit {
    double explained = 0.0;     // squares of what is held out
    std::array<double, 4> x{};  // strength; strength times the surroundings
    cv::Mat cover;              // cover'

    // What the objects' mirror image takes away was mirrored there.
    bool plausible() const { return std::min({x[1], x[2], x[3]}) >= 0.0; }
    // Shade under objects, over a pattern that happens to go along with their colours.
    bool brighterThanAny() const { return x[0] >= kBrightest; }
    double alike(const Fit& other) const {
      return cover.dot(other.cover) /
             std::sqrt(std::max(1e-30, cover.dot(cover) * other.cover.dot(other.cover)));
    }
  };

  // Drawn out by the planes' slope.
  cv::Mat drawnOut(float slope) const { return DrawnOut(spread_, across_, slope)(image_); }

  // @param drawn what drawnOut() gave; by px by which it is displaced
  Fit fit(const cv::Mat& drawn, int by) const {
    cv::Mat columns[4];
    cv::split(displaced(drawn, by), columns);
    for (cv::Mat& c : columns) c = less(c);
    std::array<Eigen::Matrix4d, 2> G{Eigen::Matrix4d::Zero(), Eigen::Matrix4d::Zero()};
    std::array<Eigen::Vector4d, 2> b{Eigen::Vector4d::Zero(), Eigen::Vector4d::Zero()};
    for (int v = 0; v < weight_.rows; ++v) {
      for (int u = 0; u < weight_.cols; ++u) {
        if (weight_.at<float>(v, u) == 0.0f) continue;
        const int half = (u / kSquare + v / kSquare) % 2;
        const double s = columns[3].at<float>(v, u);
        for (int c = 0; c < 3; ++c) {
          const double l = columns[c].at<float>(v, u), y = y_less_[c].at<float>(v, u);
          G[half](0, 0) += l * l, G[half](0, c + 1) -= l * s, G[half](c + 1, 0) -= l * s,
              G[half](c + 1, c + 1) += s * s;
          b[half][0] += l * y, b[half][c + 1] -= s * y;
        }
      }
    }
    Fit fit;
    for (int half = 0; half < 2; ++half) {
      const Eigen::Vector4d x = solve(G[1 - half], b[1 - half]);
      fit.explained += 2.0 * x.dot(b[half]) - x.dot(G[half] * x);
    }
    const Eigen::Vector4d x = solve(G[0] + G[1], b[0] + b[1]);
    std::copy_n(x.data(), 4, fit.x.begin());
    fit.cover = columns[3];
    return fit;
  }

  // What there is to explain around the image.
  double squares() const {
    cv::Mat cover, near;
    cv::extractChannel(image_, cover, 3);
    cv::dilate(cover > 0.0f, near, cv::Mat::ones(2 * kSquare + 1, 2 * kSquare + 1, CV_8U));
    double sum = 0.0;
    for (const cv::Mat& y : y_less_) {
      cv::Mat part = cv::Mat::zeros(y.size(), CV_32F);
      y.copyTo(part, near);
      sum += part.dot(part);
    }
    return sum;
  }

 private:
  // Of objects of one colour strength and surroundings are known together only: then the strength
  // is that of water and varnish, 1.
  static Eigen::Vector4d solve(const Eigen::Matrix4d& G, const Eigen::Vector4d& b) {
    const double weight = kUsual * G(0, 0);
    Eigen::Matrix4d A = G + 1e-12 * Eigen::Matrix4d::Identity();
    A(0, 0) += weight;
    for (int c = 1; c < 4; ++c) A(c, c) *= 1.0 + kRidge;
    Eigen::Vector4d x = A.ldlt().solve(b + weight * Eigen::Vector4d::UnitX());
    x[0] = std::clamp(x[0], kFaintest, kBrightest);
    for (int c = 1; c < 4; ++c) x[c] = (b[c] - A(c, 0) * x[0]) / A(c, c);
    return x;
  }

  static cv::Mat displaced(const cv::Mat& values, int by) {
    cv::Mat out = cv::Mat::zeros(values.size(), values.type());
    const int width = values.cols - std::abs(by);
    values(cv::Rect(std::max(0, -by), 0, width, values.rows))
        .copyTo(out(cv::Rect(std::max(0, by), 0, width, values.rows)));
    return out;
  }

  cv::Mat lessAround(const cv::Mat& values) const {
    cv::Mat sum;
    cv::GaussianBlur(values.mul(weight_), sum, {}, kAround);
    return (values - sum / around_).mul(weight_);
  }

  // Less what shade explains of it, too.
  cv::Mat less(const cv::Mat& values) const {
    cv::Mat out = lessAround(values);
    if (!shade_.empty()) out -= shade_ * (out.dot(shade_) / std::max(1e-12, shade_.dot(shade_)));
    return out;
  }

  float scale_;
  float across_ = 1.0f;
  cv::Mat weight_, around_, image_, spread_;  // image_ CV_32FC4: colour and cover
  cv::Mat shade_;                             // as dark as the hidden sky makes it; may be empty
  std::array<cv::Mat, 3> y_less_;
};

}  // namespace

PlaneMirror establishMirror(const MirrorImage& image, const cv::Mat& picture, const cv::Mat& known,
                            const cv::Mat& hidden) {
  const Trial trial(image, picture, known, hidden);
  Trial::Fit best;
  cv::Mat best_drawn;
  PlaneMirror mirror;
  for (const float slope : kSlopes) {
    const cv::Mat drawn = trial.drawnOut(slope);
    const Trial::Fit fit = trial.fit(drawn, 0);
    if (best.cover.empty() || fit.explained > best.explained)
      best = fit, best_drawn = drawn, mirror.slope = slope;
  }
  if (best.explained < kExplained * trial.squares() || !best.plausible() || best.brighterThanAny())
    return mirror;
  double others = 0.0, elsewhere = 0.0;
  int count = 0;
  for (int by = -kFarthest; by <= kFarthest; ++by) {
    if (by == 0) continue;
    const Trial::Fit fit = trial.fit(best_drawn, by);
    if (std::abs(by) > kMisplaced) elsewhere = std::max(elsewhere, fit.explained);
    if (fit.alike(best) > kAlike) continue;
    if (fit.plausible()) others = std::max(others, fit.explained);
    ++count;
  }
  if (count < kFewestOthers || best.explained < kClear * others || best.explained < elsewhere)
    return mirror;
  mirror.strength = static_cast<float>(best.x[0]);
  for (int c = 0; c < 3; ++c)
    mirror.surroundings[c] = static_cast<float>(best.x[c + 1] / best.x[0]);
  return mirror;
}

}  // namespace calipso::render
