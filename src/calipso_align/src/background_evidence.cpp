#include "background_evidence.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "layer_appearance.hpp"

namespace calipso::align {
namespace {

// Whether a shadow that lay on the background has gone, which explains its colour better than that
// the object has come.
bool isLitAgain(const cv::Vec3f& behind, const cv::Vec3f& seen, double noise,
                const std::vector<const GaussianMixture*>& object) {
  if (!isShadowed(seen, behind, noise)) return false;
  constexpr float kDoubt = 2.0f;  // nats that speak for the object before it is believed
  const float cost = shadowCost(seen, behind, noise);
  return std::all_of(object.begin(), object.end(), [&](const GaussianMixture* colours) {
    return colours->cost(seen) > cost - kDoubt;
  });
}

// The pieces of `pixels` that touch `mask`, gaps passed over where the two look alike.
cv::Mat connectedTo(const cv::Mat& mask, const cv::Mat& pixels) {
  cv::Mat wide, pieces, reached = cv::Mat::zeros(mask.size(), CV_8U);
  cv::dilate(pixels | mask, wide, cv::Mat::ones(kLookAlikeGap + 1, kLookAlikeGap + 1, CV_8U));
  const int count = cv::connectedComponents(wide, pieces, 8);
  std::vector<uchar> touches(count, 0);
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x)
      if (mask.at<uchar>(y, x)) touches[pieces.at<int>(y, x)] = 255;
  touches[0] = 0;
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x)
      if (pixels.at<uchar>(y, x)) reached.at<uchar>(y, x) = touches[pieces.at<int>(y, x)];
  return reached;
}

}  // namespace

cv::Mat accountsOf(const cv::Mat& view, const KnownBackground& background, double noise,
                   const std::vector<const GaussianMixture*>& object) {
  constexpr double kSame = 2.5, kDifferent = 6.0;  // deviations of a pixel's colour
  const float same = static_cast<float>(3.0 * kSame * kSame * noise * noise);
  const float different = static_cast<float>(3.0 * kDifferent * kDifferent * noise * noise);
  cv::Mat accounts = cv::Mat::zeros(view.size(), CV_8U);
#pragma omp parallel for schedule(dynamic, 16)
  for (int y = 0; y < view.rows; ++y)
    for (int x = 0; x < view.cols; ++x) {
      if (!background.known.at<uchar>(y, x)) continue;
      const cv::Vec3f behind(background.image.at<cv::Vec3b>(y, x)), seen(view.at<cv::Vec3b>(y, x));
      const cv::Vec3f d = seen - behind;
      // A shadow may have come, or gone that was there when the background was seen.
      const auto isShaded = [&] {
        return isShadowed(behind, seen, noise) || isLitAgain(behind, seen, noise, object);
      };
      if (d.dot(d) < same || isShaded())
        accounts.at<uchar>(y, x) = kBackground;
      else if (d.dot(d) > different)
        accounts.at<uchar>(y, x) = kOther;
    }
  return accounts;
}

cv::Mat contradicted(const cv::Mat& view, const cv::Mat& mask, const KnownBackground& background,
                     const cv::Mat& apart, double noise,
                     const std::vector<const GaussianMixture*>& colours) {
  // of what is known beside the object: so much may differ by chance
  constexpr double kStray = 0.02;
  const cv::Mat accounts = accountsOf(view, background, noise, colours);
  const cv::Mat object = mask > 0, elsewhere = apart > 0;
  // Single pixels that differ are noise, or the rim's mixtures.
  cv::Mat other = (accounts == kOther) & ~object & ~elsewhere, opened;
  cv::morphologyEx(other, opened, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  const cv::Mat gained = connectedTo(object, opened);
  const cv::Mat beside = background.known & ~object & ~elsewhere & ~gained;
  if (cv::countNonZero(opened & ~gained) > kStray * cv::countNonZero(beside))
    return cv::Mat::zeros(view.size(), CV_8U);
  cv::Mat lost;
  cv::morphologyEx((accounts == kBackground) & object, lost, cv::MORPH_OPEN,
                   cv::Mat::ones(3, 3, CV_8U));
  return gained | lost;
}

cv::Mat unseenParts(const cv::Mat& view, const cv::Mat& mask, const cv::Mat& known,
                    const cv::Mat& apart, const std::vector<const GaussianMixture*>& object,
                    const GaussianMixture& background) {
  constexpr float kSure = 5.0f;  // nats
  const cv::Mat unknown = (known == 0) & (mask == 0) & (apart == 0);
  cv::Mat parts = cv::Mat::zeros(view.size(), CV_8U);
#pragma omp parallel for schedule(dynamic, 16)
  for (int y = 0; y < view.rows; ++y)
    for (int x = 0; x < view.cols; ++x) {
      if (!unknown.at<uchar>(y, x)) continue;
      const cv::Vec3f seen(view.at<cv::Vec3b>(y, x));
      const float otherwise = background.cost(seen) - kSure;
      if (std::any_of(object.begin(), object.end(),
                      [&](const GaussianMixture* own) { return own->cost(seen) < otherwise; }))
        parts.at<uchar>(y, x) = 255;
    }
  cv::morphologyEx(parts, parts, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  return connectedTo(mask > 0, parts);
}

}  // namespace calipso::align
