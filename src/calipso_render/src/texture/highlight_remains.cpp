#include "texture/highlight_remains.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {
namespace {

constexpr float kHidden = 0.5f;  // Reflectance::clear from which on a highlight hides nothing
// part of the light from which a lobe is a highlight; of its greatest that makes its middle
constexpr double kSeen = 0.1, kCore = 0.5;
constexpr double kCompact = 0.4;   // of the square of its length that a compact highlight covers
constexpr float kEnded = 0.03f;    // part of the light at which the lobe has ended
constexpr float kBrighter = 0.2f;  // part of what is around by which spots are brighter
constexpr float kGrey = 0.5f;      // least of the colours that are added, of the greatest
constexpr int kBeside = 12;  // px around within which a mark's colour is seen without a highlight
constexpr std::size_t kLookedAt = 300;  // pixels, for that
constexpr float kSure = 0.9f;  // trust of what is looked at: the surroundings are in none of it
constexpr float kLeastClear = 0.02f;
constexpr float kNone = 1e-3f;  // reflectance that is told from none

// Around each compact highlight, as far again as it reaches from its middle. Along an edge one is as
// long as that, whatever the surface is like.
cv::Mat around(const cv::Mat& hidden) {
  cv::Mat labels, numbers, middles, zone = cv::Mat::zeros(hidden.size(), CV_8U);
  const int count = cv::connectedComponentsWithStats(hidden, labels, numbers, middles);
  for (int k = 1; k < count; ++k) {
    const int area = numbers.at<int>(k, cv::CC_STAT_AREA);
    const int across =
        std::max(numbers.at<int>(k, cv::CC_STAT_WIDTH), numbers.at<int>(k, cv::CC_STAT_HEIGHT));
    if (area < kCompact * across * across) continue;
    const double radius = std::sqrt(area / M_PI);
    const int reach = 1 + static_cast<int>(std::lround(radius));
    cv::Mat grown;
    cv::dilate(labels == k, grown,
               cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * reach + 1, 2 * reach + 1}));
    zone |= grown;
  }
  return zone;
}

// The reflectances beside a zone, some of them.
std::vector<cv::Vec3f> coloursBeside(const cv::Mat& zone, const cv::Mat& albedo,
                                     const cv::Mat& certain) {
  cv::Mat beside;
  cv::dilate(zone, beside, cv::Mat::ones(2 * kBeside + 1, 2 * kBeside + 1, CV_8U));
  std::vector<cv::Point> places;
  cv::findNonZero(beside & ~zone & certain, places);
  std::vector<cv::Vec3f> colours;
  for (std::size_t i = 0; i < places.size(); i += 1 + places.size() / kLookedAt)
    colours.push_back(albedo.at<cv::Vec3f>(places[i]));
  return colours;
}

bool isAmong(const cv::Vec3f& colour, const std::vector<cv::Vec3f>& colours) {
  return std::any_of(colours.begin(), colours.end(), [&](const cv::Vec3f& other) {
    return cv::norm(colour - other, cv::NORM_INF) <
           kBrighter * std::max({other[0], other[1], other[2]});
  });
}

// Whether `here` is `there` with a greyish light added.
bool hasGreyAdded(const cv::Vec3f& here, const cv::Vec3f& there) {
  const cv::Vec3f more = here - there;
  const auto [least, most] = std::minmax({more[0], more[1], more[2]});
  return least > kGrey * most && most > kBrighter * std::max({there[0], there[1], there[2], kNone});
}

}  // namespace

void hideRemains(const cv::Mat& albedo, const cv::Mat& trust, const cv::Mat& lobe, cv::Mat& clear) {
  double peak = 0.0;
  cv::minMaxLoc(lobe, nullptr, &peak);
  const cv::Mat hidden = (clear < kHidden) | (lobe > std::max(kSeen, kCore * peak));
  if (cv::countNonZero(hidden) == 0) return;
  const cv::Mat zone = around(hidden) & (lobe > kEnded) & (trust > kSure);
  cv::Mat weight = trust.mul(clear);
  weight.setTo(0.0f, zone);
  const cv::Mat beside = pushPull(albedo, weight);
  const std::vector<cv::Vec3f> own = coloursBeside(zone, albedo, (trust > kSure) & ~hidden);
  cv::Mat remains = cv::Mat::zeros(clear.size(), CV_8U);
  for (int v = 0; v < clear.rows; ++v) {
    for (int u = 0; u < clear.cols; ++u) {
      const cv::Vec3f& here = albedo.at<cv::Vec3f>(v, u);
      if (zone.at<std::uint8_t>(v, u) != 0 && hasGreyAdded(here, beside.at<cv::Vec3f>(v, u)) &&
          !isAmong(here, own))
        remains.at<std::uint8_t>(v, u) = 255;
    }
  }
  cv::dilate(remains, remains, cv::Mat::ones(3, 3, CV_8U));
  clear.setTo(kLeastClear, remains & (clear > kLeastClear));
}

}  // namespace calipso::render
