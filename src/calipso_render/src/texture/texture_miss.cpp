#include "texture/texture_miss.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "noise_mask.hpp"
#include "smooth_step.hpp"

namespace calipso::render {
namespace {

constexpr float kCertain = 0.9f;      // trust, and clearness, of pixels that grain is measured at
constexpr std::size_t kFewest = 500;  // of them
constexpr int kAround = 5;            // px of the square in which the texture's own change counts
// of them, where it changes least: beside its marks a pose that is a little off makes a difference
constexpr double kPlainest = 0.05;
constexpr int kEvened = 11;  // px of the square whose mean tells a picture's shade
// parts by which such means differ that are put down to blur, and to shade alone
constexpr float kBlur = 0.05f, kShade = 0.2f;
constexpr float kLeast = 1e-4f;  // reflectance that is told from none

// The picture's reflectance as the texture has it. CV_32FC4, the picture's own beside the object.
cv::Mat drawnInto(const Reflectance& picture, const Actor& actor, const SurfaceTexture& texture) {
  cv::Mat drawn = picture.albedo.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < drawn.rows; ++v) {
    for (int u = 0; u < drawn.cols; ++u) {
      const int triangle = picture.triangle.at<int>(v, u);
      if (triangle < 0) continue;
      const Eigen::Vector3f weights =
          barycentric(actor.screen, triangle, static_cast<float>(u + picture.region.x),
                      static_cast<float>(v + picture.region.y));
      drawn.at<cv::Vec4f>(v, u) = texture.at(triangle, weights);
    }
  }
  return drawn;
}

// Weighted means of squares, times the mean of the weights.
cv::Mat meanAround(const cv::Mat& picture, const cv::Mat& weight) {
  cv::Mat weights, mean;
  cv::merge(std::vector<cv::Mat>(4, weight), weights);
  cv::blur(picture.mul(weights), mean, {kEvened, kEvened}, {-1, -1}, cv::BORDER_CONSTANT);
  return mean;
}

// Times by which a picture is brought to the texture's brightness, by their means around: 1 where
// blur explains the difference.
float gainTo(float now, float own) {
  own += kLeast, now += kLeast;
  const float part = smoothStep(kBlur, kShade, 1.0f - std::min(own, now) / std::max(own, now));
  return 1.0f + part * (now / own - 1.0f);
}

// @param drawn as of drawnInto(), of a picture whose own reflectance is `albedo`. CV_32FC4
cv::Mat gainsTo(const cv::Mat& drawn, const cv::Mat& albedo, const cv::Mat& trust) {
  const cv::Mat own = meanAround(albedo, trust), now = meanAround(drawn, trust);
  cv::Mat gain(drawn.size(), CV_32FC4, cv::Scalar::all(1));
  for (int v = 0; v < gain.rows; ++v) {
    for (int u = 0; u < gain.cols; ++u) {
      for (int c = 0; c < 3; ++c)
        gain.at<cv::Vec4f>(v, u)[c] =
            gainTo(now.at<cv::Vec4f>(v, u)[c], own.at<cv::Vec4f>(v, u)[c]);
    }
  }
  return gain;
}

void addMissed(const cv::Mat& missed, const cv::Mat& trust, cv::Mat& shown) {
  for (int v = 0; v < shown.rows; ++v) {
    for (int u = 0; u < shown.cols; ++u) {
      cv::Vec4f& colour = shown.at<cv::Vec4f>(v, u);
      for (int c = 0; c < 3; ++c)
        colour[c] =
            std::max(0.0f, colour[c] + trust.at<float>(v, u) * missed.at<cv::Vec4f>(v, u)[c]);
    }
  }
}

// What the picture has beyond a drawn reflectance, code values. CV_32FC3.
// @param certain out, CV_8UC1: where it can be told
cv::Mat missedCodes(const Reflectance& picture, const cv::Mat& drawn, cv::Mat& certain) {
  certain = (picture.trust >= kCertain) & (picture.clear >= kCertain);
  cv::Mat missed(drawn.size(), CV_32FC3, cv::Scalar());
  for (int v = 0; v < drawn.rows; ++v) {
    for (int u = 0; u < drawn.cols; ++u) {
      if (certain.at<std::uint8_t>(v, u) == 0) continue;
      const cv::Vec3f& code = picture.codes.at<cv::Vec3f>(v, u);
      const cv::Vec4f &own = picture.albedo.at<cv::Vec4f>(v, u), &now = drawn.at<cv::Vec4f>(v, u);
      for (int c = 0; c < 3; ++c) {
        const float ratio = now[c] / std::max(kLeast, own[c]);
        missed.at<cv::Vec3f>(v, u)[c] =
            code[c] - codeFromLinear(ratio * linearFromRealCode(code[c]));
      }
    }
  }
  return missed;
}

// What a picture has of the finest detail beyond a drawn reflectance, and how far that itself changes
// around, code values.
struct Detail {
  cv::Vec3f missed;
  float around;
};

std::vector<Detail> detailsOf(const Reflectance& picture, const cv::Mat& drawn) {
  cv::Mat certain, detail, change, channels[3];
  const cv::Mat missed = missedCodes(picture, drawn, certain);
  cv::filter2D(missed, detail, CV_32F, noiseMask());
  cv::morphologyEx(picture.codes - missed, change, cv::MORPH_GRADIENT,
                   cv::Mat::ones(kAround, kAround, CV_8U));
  cv::split(change, channels);
  change = cv::max(cv::max(channels[0], channels[1]), channels[2]);
  cv::erode(certain, certain, cv::Mat::ones(kAround, kAround, CV_8U));
  std::vector<Detail> details;
  for (int v = 0; v < detail.rows; ++v) {
    for (int u = 0; u < detail.cols; ++u) {
      if (certain.at<std::uint8_t>(v, u) != 0)
        details.push_back({detail.at<cv::Vec3f>(v, u), change.at<float>(v, u)});
    }
  }
  return details;
}

}  // namespace

cv::Mat sharpen(const SeenObject& object, const SurfaceTexture& texture,
                std::vector<cv::Mat>& shown) {
  cv::Mat key;
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const Reflectance& picture = object.pictures[i];
    const cv::Mat drawn = drawnInto(picture, *object.actors[i], texture);
    cv::Mat trust = picture.trust.mul(picture.clear);
    trust.setTo(0.0f, picture.triangle < 0);
    const cv::Mat gain = gainsTo(drawn, picture.albedo, trust);
    cv::Mat level;  // not shown[i], whose values the picture may hold, too
    cv::multiply(shown[i], gain, level);
    if (i == 0) key = level.clone();
    addMissed(gain.mul(picture.albedo) - drawn, trust, level);
    shown[i] = level;
  }
  return key;
}

float grainOf(const SeenObject& object, const SurfaceTexture& texture) {
  std::vector<std::vector<Detail>> of_view(object.views.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t i = 0; i < object.views.size(); ++i) {
    const Reflectance& picture = object.pictures[i];
    of_view[i] = detailsOf(picture, drawnInto(picture, *object.actors[i], texture));
  }
  std::vector<Detail> details;
  for (const std::vector<Detail>& own : of_view)
    details.insert(details.end(), own.begin(), own.end());
  if (details.size() < kFewest) return 0.0f;
  const std::size_t plain =
      std::max(kFewest, static_cast<std::size_t>(kPlainest * static_cast<double>(details.size())));
  const auto last = details.begin() + static_cast<std::ptrdiff_t>(plain - 1);
  std::nth_element(details.begin(), last, details.end(),
                   [](const Detail& a, const Detail& b) { return a.around < b.around; });
  details.resize(plain);
  std::vector<float> sizes;
  for (const Detail& d : details) {
    for (int c = 0; c < 3; ++c) sizes.push_back(std::abs(d.missed[c]));
  }
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return kMedianToSigma / kNoiseMaskGain * *middle;
}

}  // namespace calipso::render
