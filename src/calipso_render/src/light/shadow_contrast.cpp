#include "light/shadow_contrast.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr double kReachAround = 0.1;  // of the picture's width: up to there others are around
constexpr double kScale = 0.3125;     // of that, deviation of their weights
constexpr int kMaskMargin = 5;        // px around the masks that are left out: mixed pixels
constexpr float kReach = 6.0f;        // radii of the objects in which their shadow is looked for
constexpr int kFlatReach = 4;   // px on either side of a pixel between which its surface is flat,
constexpr float kFlat = 0.02f;  // but for this part of its distance
constexpr int kGroups = 4;
constexpr double kFewest = 0.78;                          // of the reach's square receive shadows
constexpr float kDarkest = 0.02f;                         // linear; added before the logarithm
constexpr double kLeastDeviation = 0.015, kCapped = 3.0;  // of y', and of those the most that count
constexpr double kAlike = 0.1;                            // of the reach's square err alike
constexpr float kLift = 0.004f;                           // radii by which rays start off a surface
constexpr int kDirections = 800;
constexpr std::size_t kCandidates = 6;

std::optional<Eigen::Vector3f> flatPlace(const cv::Mat& depth, const Camera& camera, int u, int v) {
  const int r = kFlatReach;
  if (u < r || v < r || u + r >= depth.cols || v + r >= depth.rows) return std::nullopt;
  const auto nearness = [&](int x, int y) { return 1.0f / depth.at<float>(y, x); };
  const float near = nearness(u, v);
  for (const cv::Point& d : {cv::Point(r, 0), {0, r}, {r, r}, {r, -r}}) {
    const float sum = nearness(u + d.x, v + d.y) + nearness(u - d.x, v - d.y);
    if (!(std::abs(sum - 2.0f * near) < kFlat * near)) return std::nullopt;
  }
  return (camera.world_from_camera * (camera.ray(u, v) / near)).cast<float>();
}

float darknessOf(const cv::Vec3f& code) {
  const cv::Vec3f linear(linearFromRealCode(code[0]), linearFromRealCode(code[1]),
                         linearFromRealCode(code[2]));
  return -std::log(luminance(linear) + kDarkest);
}

// Variance of what is normally distributed but for few.
double robustVariance(const cv::Mat& values, const cv::Mat& where) {
  std::vector<float> sizes;
  for (int i = 0; i < values.rows; ++i) {
    for (int j = 0; j < values.cols; ++j) {
      if (where.at<std::uint8_t>(i, j) != 0) sizes.push_back(std::abs(values.at<float>(i, j)));
    }
  }
  std::nth_element(sizes.begin(), sizes.begin() + sizes.size() / 2, sizes.end());
  const double deviation = std::max(kLeastDeviation, sizes[sizes.size() / 2] / 0.6745);
  return deviation * deviation;
}

}  // namespace

ShadowContrast::ShadowContrast(const View& view, const std::vector<SupportPlane>& planes,
                               const cv::Mat& depth, int cells_across)
    : step_(std::max(1, view.picture.cols / cells_across)),
      reach_(std::max(1, cvRound(kReachAround * view.picture.cols / step_))) {
  Eigen::AlignedBox3f box;
  for (const Actor& a : view.actors) {
    for (const Eigen::Vector3f& p : a.vertices) box.extend(p);
  }
  if (box.isEmpty()) return;
  centre_ = box.center(), radius_ = 0.5f * box.diagonal().norm();
  findReceivers(view, planes, depth);
  if (cv::countNonZero(receives_) < kFewest * reach_ * reach_) {
    receives_.setTo(0);
    return;
  }
  cv::Mat smooth, darkness = cv::Mat::zeros(receives_.size(), CV_32F);
  cv::blur(view.picture, smooth, {step_, step_});
  for (int i = 0; i < receives_.rows; ++i) {
    for (int j = 0; j < receives_.cols; ++j) {
      if (receives_.at<std::uint8_t>(i, j) != 0)
        darkness.at<float>(i, j) =
            darknessOf(smooth.at<cv::Vec3f>(i * step_ + step_ / 2, j * step_ + step_ / 2));
    }
  }
  groupByColour(smooth);
  darkness_ = lessGroupMeans(darkness);
  variance_ = robustVariance(darkness_, receives_);
  const double most = kCapped * std::sqrt(variance_);
  darkness_ = cv::min(cv::max(darkness_, -most), most);
}

void ShadowContrast::findReceivers(const View& view, const std::vector<SupportPlane>& planes,
                                   const cv::Mat& depth) {
  cv::Mat covered;
  cv::dilate(view.labels != 0, covered,
             cv::Mat::ones(2 * kMaskMargin + 1, 2 * kMaskMargin + 1, CV_8U));
  receives_ = cv::Mat::zeros(view.picture.rows / step_, view.picture.cols / step_, CV_8U);
  position_.resize(receives_.total());
  for (int i = 0; i < receives_.rows; ++i) {
    for (int j = 0; j < receives_.cols; ++j) {
      const int u = j * step_ + step_ / 2, v = i * step_ + step_ / 2;
      if (covered.at<std::uint8_t>(v, u) != 0) continue;
      std::optional<Eigen::Vector3f> place;
      if (!depth.empty() && depth.at<float>(v, u) > 0.0f)
        place = flatPlace(depth, view.camera, u, v);
      else if (const auto receiver = receiverAt(planes, view.camera, u, v))
        place = receiver->position;
      if (!place || (*place - centre_).norm() > kReach * radius_) continue;
      receives_.at<std::uint8_t>(i, j) = 255;
      position_[i * receives_.cols + j] = *place;
    }
  }
}

// By colour without brightness, which a shadow changes little.
void ShadowContrast::groupByColour(const cv::Mat& smooth) {
  std::vector<cv::Point> cells;
  cv::findNonZero(receives_, cells);
  cv::Mat colours(static_cast<int>(cells.size()), 2, CV_32F), labels;
  for (int i = 0; i < colours.rows; ++i) {
    const cv::Vec3f& c = smooth.at<cv::Vec3f>(cells[i] * step_ + cv::Point(step_, step_) / 2);
    const float sum = c[0] + c[1] + c[2] + 1.0f;
    colours.at<float>(i, 0) = c[0] / sum, colours.at<float>(i, 1) = c[2] / sum;
  }
  cv::theRNG().state = 1;  // k-means draws its starts from the shared generator
  cv::kmeans(colours, kGroups, labels,
             {cv::TermCriteria::MAX_ITER | cv::TermCriteria::EPS, 20, 1e-4}, 2,
             cv::KMEANS_PP_CENTERS);
  for (int g = 0; g < kGroups; ++g) {
    cv::Mat member = cv::Mat::zeros(receives_.size(), CV_32F);
    for (int i = 0; i < colours.rows; ++i) {
      if (labels.at<int>(i) == g) member.at<float>(cells[i]) = 1.0f;
    }
    groups_.push_back({member, 1.0 / cv::max(meansAround(member), 1e-6)});
  }
}

cv::Mat ShadowContrast::meansAround(const cv::Mat& values) const {
  cv::Mat out;
  const int side = 2 * reach_ + 1;
  const double deviation = kScale * reach_;
  cv::GaussianBlur(values, out, {side, side}, deviation, deviation, cv::BORDER_CONSTANT);
  return out;
}

cv::Mat ShadowContrast::lessGroupMeans(const cv::Mat& values) const {
  cv::Mat out = cv::Mat::zeros(values.size(), CV_32F);
  for (const Group& g : groups_) {
    const cv::Mat mean = meansAround(values.mul(g.member)).mul(g.per_weight);
    out += (values - mean).mul(g.member);
  }
  return out;
}

bool ShadowContrast::mayBeHidden(const Eigen::Vector3f& position, const Eigen::Vector3f& l) const {
  const Eigen::Vector3f way = centre_ - position;
  const float along = way.dot(l);
  return along > -radius_ && way.squaredNorm() - along * along < radius_ * radius_;
}

cv::Rect ShadowContrast::cast(const RayScene& objects, const Eigen::Vector3f& l,
                              cv::Mat& hidden) const {
  cv::Rect box;
  const Eigen::Vector3f off = kLift * radius_ * l;
  for (int i = 0; i < receives_.rows; ++i) {
    for (int j = 0; j < receives_.cols; ++j) {
      const Eigen::Vector3f& p = position_[i * receives_.cols + j];
      if (receives_.at<std::uint8_t>(i, j) == 0 || !mayBeHidden(p, l) ||
          !objects.blocked(p + off, l))
        continue;
      hidden.at<float>(i, j) = 1.0f;
      box |= cv::Rect(j, i, 1, 1);
    }
  }
  if (box.empty()) return box;
  box = cv::Rect(box.x - reach_, box.y - reach_, box.width + 2 * reach_, box.height + 2 * reach_);
  return box & cv::Rect({0, 0}, hidden.size());
}

double ShadowContrast::misfit(const RayScene& objects, const Eigen::Vector3f& l) const {
  if (darkness_.empty()) return 0.0;
  cv::Mat hidden = cv::Mat::zeros(receives_.size(), CV_32F);
  const cv::Rect box = cast(objects, l, hidden);
  if (box.empty()) return 0.0;
  double xx = 0.0, xy = 0.0;
  for (const Group& g : groups_) {
    const cv::Mat member = g.member(box), own = hidden(box).mul(member);
    const cv::Mat x = (own - meansAround(own).mul(g.per_weight(box))).mul(member);
    xx += x.dot(x), xy += x.dot(darkness_(box));
  }
  return xx > 1e-6 && xy > 0.0 ? -0.5 * xy * xy / (xx * variance_ * kAlike * reach_ * reach_) : 0.0;
}

std::vector<Eigen::Vector3f> ShadowContrast::candidates(const RayScene& objects) const {
  std::vector<std::pair<double, int>> found(kDirections);
  const auto direction = [](int i) {  // Fibonacci's spiral over the sphere
    const float z = 1.0f - (2 * i + 1.0f) / kDirections, r = std::sqrt(1.0f - z * z),
                a = i * 2.39996323f;
    return Eigen::Vector3f(r * std::cos(a), r * std::sin(a), z);
  };
#pragma omp parallel for schedule(dynamic, 8)
  for (int i = 0; i < kDirections; ++i) found[i] = {misfit(objects, direction(i)), i};
  std::sort(found.begin(), found.end());
  std::vector<Eigen::Vector3f> best;
  for (std::size_t i = 0; i < kCandidates && found[i].first < 0.0; ++i)
    best.push_back(direction(found[i].second));
  return best;
}

}  // namespace calipso::render
