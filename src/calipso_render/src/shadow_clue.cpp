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
constexpr double kOutlier = 0.2,
                 kOutlierByColour = 0.8;   // error of a sample beyond which it does not count more
constexpr double kDeepest = 1.5;           // b at most
constexpr double kLeastDeviation = 0.015;  // of log-brightness
constexpr double kCorrelated = 20.0;       // so many neighbouring samples err alike
constexpr int kStep = 2;                   // px
constexpr int kGroups = 6;
constexpr float kShadow = 0.15f;  // darkness that may be a shadow
constexpr std::size_t kCandidates = 24;

float logBrightness(const cv::Vec3f& code) {
  const cv::Vec3f linear(linearFromRealCode(code[0]), linearFromRealCode(code[1]),
                         linearFromRealCode(code[2]));
  return std::log(luminance(linear) + kDarkest);
}

// Groups pixels by colour alone, which a shadow changes little.
int groupByColour(const std::vector<cv::Vec2f>& colours, std::vector<ShadowClue::Sample>& samples) {
  const int count = static_cast<int>(samples.size());
  if (count < 20 * kGroups) return 1;
  cv::Mat points(count, 1, CV_32FC2), labels;
  for (int i = 0; i < count; ++i) points.at<cv::Vec2f>(i) = colours[i];
  cv::theRNG().state = 1;  // k-means draws its starts from the shared generator
  cv::kmeans(points, kGroups, labels,
             {cv::TermCriteria::MAX_ITER | cv::TermCriteria::EPS, 20, 1e-4}, 2,
             cv::KMEANS_PP_CENTERS);
  for (int i = 0; i < count; ++i) samples[i].group = labels.at<int>(i);
  return kGroups;
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
  if (plate_known_)
    pixels.erase(std::remove_if(pixels.begin(), pixels.end(), unknown), pixels.end());
  const std::size_t step = std::max<std::size_t>(1, pixels.size() / kSamples);
  std::vector<cv::Vec2f> colours;
  for (std::size_t i = 0; i < pixels.size(); i += step) {
    const cv::Vec3f& code = view.picture.at<cv::Vec3f>(pixels[i].at);
    Sample s{pixels[i].receiver.position, pixels[i].receiver.normal, -logBrightness(code), 0};
    if (plate_known_)
      s.darkness = std::clamp(s.darkness + logBrightness(plate.plate.at<cv::Vec3f>(pixels[i].at)),
                              kBrighter, kDarker);
    samples_.push_back(s);
    const float sum = code[0] + code[1] + code[2] + 1.0f;
    colours.push_back({code[0] / sum, code[2] / sum});
  }
  if (!plate_known_) groups_ = groupByColour(colours, samples_);
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
  std::vector<double> n(groups_, 0.0), mean_x(groups_, 0.0), mean_y(groups_, 0.0);
  if (!plate_known_) {
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const int g = samples_[i].group;
      n[g] += 1.0, mean_x[g] += hidden[i], mean_y[g] += samples_[i].darkness;
    }
    for (int g = 0; g < groups_; ++g) {
      if (n[g] > 0.0) mean_x[g] /= n[g], mean_y[g] /= n[g];
    }
  }
  double xx = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const double x = hidden[i] - mean_x[samples_[i].group],
                 y = samples_[i].darkness - mean_y[samples_[i].group];
    xx += x * x, xy += x * y;
  }
  const double b = xx > 1e-9 ? std::clamp(xy / xx, 0.0, kDeepest) : 0.0,
               bound = plate_known_ ? kOutlier : kOutlierByColour;
  std::vector<double> squares(samples_.size());
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const double x = hidden[i] - mean_x[samples_[i].group],
                 y = samples_[i].darkness - mean_y[samples_[i].group];
    squares[i] = std::min((y - b * x) * (y - b * x), bound * bound);
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
  if (!plate_known_) return directions;
  for (const Sample& s : samples_) {
    if (s.darkness > kShadow) directions.push_back((centre_ - s.position).normalized());
  }
  const std::size_t step = std::max<std::size_t>(1, directions.size() / kCandidates);
  std::vector<Eigen::Vector3f> thinned;
  for (std::size_t i = 0; i < directions.size(); i += step) thinned.push_back(directions[i]);
  return thinned;
}

}  // namespace calipso::render
