#include "reappearance.hpp"

#include <opencv2/imgproc.hpp>
#include <vector>

#include "background_evidence.hpp"
#include "layer_appearance.hpp"

namespace calipso::align {
namespace {

constexpr double kStillNoise = 4.0;  // grey levels; not more differs where nothing moves
constexpr float kUnlikely = 14.0f;   // nats; colours that an object is hardly made of
constexpr double kOwnShare = 0.7;    // of a piece: what the object's colours explain

// Pixels that are not the background, nor another object, single ones left out.
cv::Mat strangeParts(const cv::Mat& image, const KnownBackground& background, const cv::Mat& taken,
                     double noise, const GaussianMixture& colours) {
  const cv::Mat accounts = accountsOf(image, background, noise, {&colours});
  cv::Mat strange = (accounts == kOther) & (taken == 0);
  cv::morphologyEx(strange, strange, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  return strange;
}

// Pixels of a mask that look like the object.
cv::Mat lookingLike(const cv::Mat& image, const cv::Mat& mask, const GaussianMixture& colours) {
  cv::Mat own = cv::Mat::zeros(mask.size(), CV_8U);
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x)
      if (mask.at<uchar>(y, x) && colours.cost(image.at<cv::Vec3b>(y, x)) < kUnlikely)
        own.at<uchar>(y, x) = 255;
  return own;
}

}  // namespace

Reappearance findAgain(const cv::Mat& image, const KnownBackground& background,
                       const cv::Mat& taken, const GaussianMixture& colours, int least_px) {
  const double noise = noiseOf(image, background.image, background.known & (taken == 0));
  if (noise > kStillNoise) return {};
  const cv::Mat strange = strangeParts(image, background, taken, noise, colours);
  const cv::Mat own = lookingLike(image, strange, colours);
  if (cv::countNonZero(own) < least_px) return {{}, own};
  cv::Mat joined, pieces;  // gaps are passed over where object and background look alike
  cv::morphologyEx(strange, joined, cv::MORPH_CLOSE,
                   cv::Mat::ones(kLookAlikeGap + 1, kLookAlikeGap + 1, CV_8U));
  const int count = cv::connectedComponents(joined & (taken == 0), pieces, 8);
  std::vector<int> strange_in(count, 0), own_in(count, 0);
  for (int y = 0; y < pieces.rows; ++y) {
    for (int x = 0; x < pieces.cols; ++x) {
      const int piece = pieces.at<int>(y, x);
      strange_in[piece] += strange.at<uchar>(y, x) != 0;
      own_in[piece] += own.at<uchar>(y, x) != 0;
    }
  }
  int found = 0, most = least_px - 1;
  for (int piece = 1; piece < count; ++piece) {
    if (own_in[piece] <= most || own_in[piece] < kOwnShare * strange_in[piece]) continue;
    most = own_in[piece], found = piece;
  }
  return {found > 0 ? cv::Mat(pieces == found) : cv::Mat(), own};
}

}  // namespace calipso::align
