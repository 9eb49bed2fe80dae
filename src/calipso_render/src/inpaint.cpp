#include "calipso_render/inpaint.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "patch_field.hpp"

namespace calipso::render {
namespace {

constexpr int kTextureSide = 9;        // px, window of the texture features
constexpr float kTextureWeight = 4.0f;

struct Level {
  cv::Mat image;         // CV_32FC(5) of Feature
  cv::Mat hole, banned;  // CV_8UC1
};

// Half the size; a pixel is hole (or banned) if any of its four was.
Level halved(const Level& fine) {
  Level half;
  const cv::Size size((fine.hole.cols + 1) / 2, (fine.hole.rows + 1) / 2);
  half.hole = cv::Mat::zeros(size, CV_8U);
  half.banned = cv::Mat::zeros(size, CV_8U);
  half.image = cv::Mat::zeros(size, CV_32FC(5));
  cv::Mat count = cv::Mat::zeros(size, CV_32F);
  for (int v = 0; v < fine.hole.rows; ++v) {
    for (int u = 0; u < fine.hole.cols; ++u) {
      half.hole.at<std::uint8_t>(v / 2, u / 2) |= fine.hole.at<std::uint8_t>(v, u);
      half.banned.at<std::uint8_t>(v / 2, u / 2) |= fine.banned.at<std::uint8_t>(v, u);
      half.image.at<Feature>(v / 2, u / 2) += fine.image.at<Feature>(v, u);
      count.at<float>(v / 2, u / 2) += 1.0f;
    }
  }
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) half.image.at<Feature>(v, u) /= count.at<float>(v, u);
  }
  return half;
}

std::vector<Level> pyramid(const Level& finest, const InpaintParams& params) {
  std::vector<Level> levels = {finest};
  while (true) {
    const Level& last = levels.back();
    cv::Mat depth;
    cv::distanceTransform(last.hole, depth, cv::DIST_L2, 3);
    double widest = 0.0;
    cv::minMaxLoc(depth, nullptr, &widest);
    const bool small = std::min(last.hole.cols, last.hole.rows) / 2 < params.coarsest_side;
    if (small || widest <= params.patch_radius) return levels;
    levels.push_back(halved(last));
  }
}

// Colours and texture alone, three channels each, as pushPull() takes them.
void split(const cv::Mat& features, cv::Mat& colour, cv::Mat& texture) {
  colour.create(features.size(), CV_32FC3);
  texture = cv::Mat::zeros(features.size(), CV_32FC3);
  const int channels[] = {0, 0, 1, 1, 2, 2, 3, 3, 4, 4};
  cv::Mat out[] = {colour, texture};
  cv::mixChannels(&features, 1, out, 2, channels, 5);
}

cv::Mat colourOf(const cv::Mat& features) {
  cv::Mat colour, texture;
  split(features, colour, texture);
  return colour;
}

cv::Mat merge(const cv::Mat& colour, const cv::Mat& texture) {
  cv::Mat features(colour.size(), CV_32FC(5));
  const cv::Mat in[] = {colour, texture};
  const int channels[] = {0, 0, 1, 1, 2, 2, 3, 3, 4, 4};
  cv::mixChannels(in, 2, &features, 1, channels, 5);
  return features;
}

cv::Mat smoothFill(const Level& level) {
  cv::Mat weight(level.hole.size(), CV_32F), colour, texture;
  weight.setTo(1.0f);
  weight.setTo(0.0f, level.hole | level.banned);
  split(level.image, colour, texture);
  const cv::Mat smooth = merge(pushPull(colour, weight), pushPull(texture, weight));
  cv::Mat filled = level.image.clone();
  smooth.copyTo(filled, level.hole);
  return filled;
}

// Mean absolute change along u and v, where both pixels are known.
cv::Mat withTexture(const cv::Mat& image, const cv::Mat& unknown) {
  cv::Mat change(image.size(), CV_32FC3, cv::Scalar::all(0)), known(image.size(), CV_32F, cv::Scalar(0));
  for (int v = 1; v < image.rows; ++v) {
    for (int u = 1; u < image.cols; ++u) {
      const bool usable = (unknown.at<std::uint8_t>(v, u) | unknown.at<std::uint8_t>(v, u - 1) | unknown.at<std::uint8_t>(v - 1, u)) == 0;
      if (!usable) continue;
      const cv::Vec3f here = image.at<cv::Vec3f>(v, u);
      const float along_u = static_cast<float>(cv::norm(here - image.at<cv::Vec3f>(v, u - 1)));
      const float along_v = static_cast<float>(cv::norm(here - image.at<cv::Vec3f>(v - 1, u)));
      change.at<cv::Vec3f>(v, u) = {kTextureWeight * along_u, kTextureWeight * along_v, 0.0f};
      known.at<float>(v, u) = 1.0f;
    }
  }
  cv::boxFilter(change, change, -1, {kTextureSide, kTextureSide});
  cv::boxFilter(known, known, -1, {kTextureSide, kTextureSide});
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) change.at<cv::Vec3f>(v, u) /= std::max(known.at<float>(v, u), 0.01f);
  }
  return merge(image, change);
}

cv::Mat sourceMask(const Level& level, int radius) {
  cv::Mat unusable, grown;
  cv::bitwise_or(level.hole, level.banned, unusable);
  cv::dilate(unusable, grown, cv::Mat::ones(2 * radius + 1, 2 * radius + 1, CV_8U));
  return grown == 0;
}

// Search and vote until the fill has settled.
void refine(PatchField& field, bool finest, const InpaintParams& params) {
  const int iterations = finest ? params.fine_iterations : params.coarse_iterations;
  const int reach = finest ? 8 : std::max(field.image().cols, field.image().rows) / 2;
  for (int i = 0; i < iterations; ++i) {
    field.search(false, reach);
    field.search(true, reach);
    field.vote(finest || i + 1 == iterations);
  }
}

// Part of the picture that the fill can depend on.
Level cropped(const Level& whole, const cv::Rect& window) {
  return {whole.image(window).clone(), whole.hole(window).clone(), whole.banned(window).clone()};
}

cv::Rect windowAround(const cv::Mat& hole) {
  const cv::Rect box = cv::boundingRect(hole);
  const int margin = std::max({48, box.width / 2, box.height / 2});
  const cv::Rect grown(box.x - margin, box.y - margin, box.width + 2 * margin, box.height + 2 * margin);
  return grown & cv::Rect(0, 0, hole.cols, hole.rows);
}

}  // namespace

InpaintResult inpaint(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                      const InpaintParams& params) {
  CV_Assert(image.type() == CV_32FC3 && hole.type() == CV_8UC1 && image.size() == hole.size());
  InpaintResult result{image.clone(), cv::Mat(image.size(), CV_16SC2, cv::Scalar(-1, -1)), true};
  if (cv::countNonZero(hole) == 0) return result;
  const cv::Rect window = windowAround(hole);
  const cv::Mat forbidden = banned.empty() ? cv::Mat(cv::Mat::zeros(hole.size(), CV_8U)) : cv::Mat(banned != 0);
  Level finest = cropped({image, hole != 0, forbidden}, window);
  finest.image = withTexture(finest.image, finest.hole | finest.banned);
  finest.banned.setTo(0, finest.hole);
  const std::vector<Level> levels = pyramid(finest, params);
  std::optional<PatchField> field;
  for (int i = static_cast<int>(levels.size()) - 1; i >= 0; --i) {
    PatchField next(smoothFill(levels[i]), levels[i].hole, sourceMask(levels[i], params.patch_radius),
                    params.patch_radius, static_cast<float>(1 << i), params.seed + i);
    if (!next.hasSources()) continue;
    if (field) {
      next.initialiseFrom(*field);
      next.vote(true);
    } else {
      next.initialiseRandomly();
    }
    refine(next, i == 0, params);
    field = next;
  }
  if (!field || field->image().size() != window.size()) {
    colourOf(smoothFill(finest)).copyTo(result.image(window), finest.hole);
    result.patches_found = false;
    return result;
  }
  colourOf(field->image()).copyTo(result.image(window), finest.hole);
  cv::Mat origin = field->origin() + cv::Scalar(window.x, window.y);
  origin.copyTo(result.origin(window), finest.hole);
  return result;
}

}  // namespace calipso::render
