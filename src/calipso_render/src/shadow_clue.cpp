#include "shadow_clue.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr std::size_t kSamples = 2500;
constexpr float kReach = 6.0f;     // radii of an object around it in which its shadow is looked for
constexpr int kMaskMargin = 5;     // px around the masks that are left out: mixed pixels
constexpr float kQuiet = 5.0f;     // code values of spread over time: the background rests
constexpr int kFewestFrames = 3;   // in which the plate must have been seen
constexpr float kDarkest = 0.02f;  // linear; added before the logarithm
constexpr float kBrighter = -0.2f, kDarker = 1.5f;  // range of darkness: more is something else
constexpr double kOutlier = 0.2;           // error of a sample beyond which it does not count more
constexpr double kDeepest = 1.5;           // b at most
constexpr double kLeastDeviation = 0.015;  // of log-brightness
constexpr double kCorrelated = 20.0;       // so many neighbouring samples err alike
constexpr int kStep = 2;                   // px
constexpr float kShadow = 0.15f;           // darkness that may be a shadow
constexpr std::size_t kCandidates = 24;

float logBrightness(const cv::Vec3f& code) {
  const cv::Vec3f linear(linearFromRealCode(code[0]), linearFromRealCode(code[1]),
                         linearFromRealCode(code[2]));
  return std::log(luminance(linear) + kDarkest);
}

struct PlanePixel {
  Receiver receiver;
  cv::Point at;
  bool known;  // the plate shows it without shadows
};

Eigen::AlignedBox3f boxOf(const Actor& actor) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : actor.vertices) box.extend(p);
  return box;
}

// Pixels of the support planes around the objects.
std::vector<PlanePixel> planePixels(const View& view, const std::vector<SupportPlane>& planes,
                                    const Background& plate) {
  std::vector<Eigen::AlignedBox3f> boxes;
  for (const Actor& a : view.actors) boxes.push_back(boxOf(a));
  cv::Mat covered;
  cv::dilate(view.labels != 0, covered,
             cv::Mat::ones(2 * kMaskMargin + 1, 2 * kMaskMargin + 1, CV_8U));
  std::vector<PlanePixel> pixels;
  for (int v = 0; v < view.picture.rows; v += kStep) {
    for (int u = 0; u < view.picture.cols; u += kStep) {
      if (covered.at<std::uint8_t>(v, u) != 0) continue;
      const auto receiver = receiverAt(planes, view.camera, u, v);
      if (!receiver) continue;
      const bool near = std::any_of(boxes.begin(), boxes.end(), [&](const Eigen::AlignedBox3f& b) {
        return (receiver->position - b.center()).norm() < 0.5f * kReach * b.diagonal().norm();
      });
      if (!near) continue;
      const bool known = !plate.count.empty() &&
                         plate.count.at<std::uint8_t>(v, u) >= kFewestFrames &&
                         plate.spread.at<float>(v, u) < kQuiet;
      pixels.push_back({*receiver, {u, v}, known});
    }
  }
  return pixels;
}

}  // namespace

ShadowClue::ShadowClue(const View& view, const std::vector<SupportPlane>& planes,
                       const Background& plate) {
  std::vector<PlanePixel> pixels = planePixels(view, planes, plate);
  const auto unknown = [](const PlanePixel& p) { return !p.known; };
  plate_known_ =
      2 * std::count_if(pixels.begin(), pixels.end(), unknown) < static_cast<long>(pixels.size());
  if (!plate_known_) return;
  pixels.erase(std::remove_if(pixels.begin(), pixels.end(), unknown), pixels.end());
  const std::size_t step = std::max<std::size_t>(1, pixels.size() / kSamples);
  for (std::size_t i = 0; i < pixels.size(); i += step) {
    const cv::Point& at = pixels[i].at;
    const float darkness = logBrightness(plate.plate.at<cv::Vec3f>(at)) -
                           logBrightness(view.picture.at<cv::Vec3f>(at));
    samples_.push_back({pixels[i].receiver.position, pixels[i].receiver.normal,
                        std::clamp(darkness, kBrighter, kDarker)});
  }
  for (const Actor& a : view.actors)
    centre_ += boxOf(a).center() / static_cast<float>(view.actors.size());
  // Most pixels lie in no shadow: the errors' median without one is what noise and texture do.
  std::vector<double> squares = squaredErrors(std::vector<float>(samples_.size(), 0.0f));
  if (squares.empty()) return;
  unshaded_ = std::accumulate(squares.begin(), squares.end(), 0.0);
  std::nth_element(squares.begin(), squares.begin() + squares.size() / 2, squares.end());
  variance_ = std::max(kLeastDeviation * kLeastDeviation,
                       squares[squares.size() / 2] / 0.455);  // median of chi^2, one degree
}

// Squared error of every sample at the best b; an outlier counts up to a bound.
std::vector<double> ShadowClue::squaredErrors(const std::vector<float>& hidden) const {
  double xx = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < samples_.size(); ++i)
    xx += hidden[i] * hidden[i], xy += hidden[i] * samples_[i].darkness;
  const double b = xx > 1e-9 ? std::clamp(xy / xx, 0.0, kDeepest) : 0.0;
  std::vector<double> squares(samples_.size());
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const double error = samples_[i].darkness - b * hidden[i];
    squares[i] = std::min(error * error, kOutlier * kOutlier);
  }
  return squares;
}

double ShadowClue::misfit(const RayScene& objects, const Eigen::Vector3f& l) const {
  if (samples_.empty()) return 0.0;
  std::vector<float> hidden(samples_.size());
  for (std::size_t i = 0; i < samples_.size(); ++i)
    hidden[i] = objects.blocked(samples_[i].position, samples_[i].normal, l) ? 1.0f : 0.0f;
  const std::vector<double> squares = squaredErrors(hidden);
  return 0.5 * (std::accumulate(squares.begin(), squares.end(), 0.0) - unshaded_) /
         (variance_ * kCorrelated);
}

std::vector<Eigen::Vector3f> ShadowClue::candidates() const {
  std::vector<Eigen::Vector3f> directions;
  for (const Sample& s : samples_) {
    if (s.darkness > kShadow) directions.push_back((centre_ - s.position).normalized());
  }
  const std::size_t step = std::max<std::size_t>(1, directions.size() / kCandidates);
  std::vector<Eigen::Vector3f> thinned;
  for (std::size_t i = 0; i < directions.size(); i += step) thinned.push_back(directions[i]);
  return thinned;
}

}  // namespace calipso::render
