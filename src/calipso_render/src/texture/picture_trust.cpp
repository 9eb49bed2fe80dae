#include "texture/picture_trust.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "model_details.hpp"
#include "smooth_step.hpp"

namespace calipso::render {
namespace {

constexpr float kDarkest = 1e-4f;  // linear brightness that is told from none
// part by which light falls within two pixels, at which it begins to be a step, and is one
constexpr float kStep = 0.2f, kWholeStep = 0.4f;
constexpr float kLeastAtStep = 0.1f;  // of the trust
constexpr float kDeep = 2.5f;         // px from the rim, from which a pixel has the object's colour
constexpr int kThin = 2;              // px around within which a thin part has its middle
// cosine of the angle by which a surface turns from pixel to pixel
constexpr float kCrease = 0.87f;

// By distance from the mask's rim (px): the first pixels mix with the background and with what
// compression spreads.
float rimTrust(float depth) {
  if (depth <= 1.0f) return 0.02f;
  return std::clamp((depth - 1.0f) / (kDeep - 1.0f), 0.05f, 1.0f);
}

// Distance of an object's pixels from its mask's rim, px.
cv::Mat depthIn(const cv::Mat& labels, int index, const cv::Rect& region) {
  cv::Mat padded, depth;
  cv::copyMakeBorder(labels(region) == index, padded, 1, 1, 1, 1, cv::BORDER_REPLICATE);
  cv::distanceTransform(padded, depth, cv::DIST_L2, 5);
  return depth({{1, 1}, region.size()});
}

// Whether the fronts at two neighbouring pixels belong to parts of which one hides the other: each
// is off the plane that touches the other.
// @param tolerance m of depth
bool jumps(const Reflectance& r, const Camera& camera, const cv::Point& a, const cv::Point& b,
           float tolerance) {
  const Eigen::Matrix3f axes = camera.world_from_camera.linear().cast<float>();
  const auto isOff = [&](const cv::Point& here, const cv::Point& there) {
    const cv::Vec3f& n = r.normal.at<cv::Vec3f>(here);
    const Eigen::Vector3f normal = axes.transpose() * Eigen::Vector3f(n[0], n[1], n[2]);
    const auto facing = [&](const cv::Point& q) {
      return normal.dot(camera.ray(q.x + r.region.x, q.y + r.region.y).cast<float>());
    };
    const float near = r.nearness.at<float>(here), plane = near * facing(there) / facing(here);
    return std::abs(r.nearness.at<float>(there) - plane) > tolerance * near * near;
  };
  return r.nearness.at<float>(a) > 0.0f && r.nearness.at<float>(b) > 0.0f && isOff(a, b) &&
         isOff(b, a);
}

// Part by which values fall within two pixels. @param values CV_32F; where CV_8U, != 0: has some
cv::Mat fallOf(const cv::Mat& values, const cv::Mat& where) {
  const cv::Mat around = cv::Mat::ones(3, 3, CV_8U);
  cv::Mat most, least = values.clone();
  least.setTo(std::numeric_limits<float>::max(), where == 0);
  cv::erode(least, least, around);
  cv::dilate(values, most, around);
  return 1.0f - least / cv::max(most, kDarkest);
}

}  // namespace

cv::Mat trustOf(const cv::Mat& labels, int index, const cv::Rect& region) {
  const cv::Mat depth = depthIn(labels, index, region);
  cv::Mat trust = cv::Mat::zeros(region.size(), CV_32F);
  for (int v = 0; v < region.height; ++v) {
    for (int u = 0; u < region.width; ++u) {
      const float d = depth.at<float>(v, u);
      if (d > 0.0f) trust.at<float>(v, u) = rimTrust(d);
    }
  }
  return trust;
}

bool showsMark(const cv::Mat& marks, const cv::Point& corner, const Camera& camera,
               const Place& place) {
  if (marks.empty()) return false;
  const Eigen::Vector3d to_eye =
      camera.world_from_camera.translation() - place.point.cast<double>();
  if (place.normal.cast<double>().dot(to_eye) < 0.0) return false;
  const Eigen::Vector2d pixel = camera.projectWorld(place.point.cast<double>());
  const cv::Point at = cv::Point(cvRound(pixel.x()), cvRound(pixel.y())) - corner;
  return cv::Rect({0, 0}, marks.size()).contains(at) && marks.at<std::uint8_t>(at) != 0;
}

void trustDetails(const cv::Mat& labels, const Surface& surface, Reflectance& r) {
  if (surface.detailVertices() == 0) return;
  const cv::Mat depth = depthIn(labels, surface.index, r.region);
  cv::Mat deepest;
  cv::dilate(depth, deepest, cv::Mat::ones(2 * kThin + 1, 2 * kThin + 1, CV_8U));
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const int triangle = r.triangle.at<int>(v, u);
      const float d = depth.at<float>(v, u);
      const float lacks = kDeep - deepest.at<float>(v, u);
      if (triangle < 0 || d <= 0.0f || lacks <= 0.0f || !isDetail(surface, triangle)) continue;
      r.trust.at<float>(v, u) = rimTrust(d + lacks);
    }
  }
}

cv::Mat besideDetails(const Reflectance& picture, const Surface& surface) {
  if (surface.detailVertices() == 0) return {};
  cv::Mat details = cv::Mat::zeros(picture.triangle.size(), CV_8U);
  for (int v = 0; v < details.rows; ++v) {
    for (int u = 0; u < details.cols; ++u) {
      const int triangle = picture.triangle.at<int>(v, u);
      if (triangle >= 0 && isDetail(surface, triangle)) details.at<std::uint8_t>(v, u) = 255;
    }
  }
  cv::dilate(details, details, cv::Mat::ones(2 * kThin + 1, 2 * kThin + 1, CV_8U));
  return details;
}

void lowerBesideJumps(const Camera& camera, float tolerance, Reflectance& r) {
  cv::Mat smooth(r.region.size(), CV_8U, cv::Scalar(255)), distance;
  for (int v = 0; v + 1 < smooth.rows; ++v) {
    for (int u = 0; u + 1 < smooth.cols; ++u) {
      for (const cv::Point q : {cv::Point(u + 1, v), cv::Point(u, v + 1)}) {
        if (jumps(r, camera, {u, v}, q, tolerance))
          smooth.at<std::uint8_t>(v, u) = smooth.at<std::uint8_t>(q) = 0;
      }
    }
  }
  if (cv::countNonZero(smooth == 0) == 0) return;
  cv::distanceTransform(smooth, distance, cv::DIST_L2, 5);
  for (int v = 0; v < smooth.rows; ++v) {
    for (int u = 0; u < smooth.cols; ++u) {
      float& trust = r.trust.at<float>(v, u);
      trust = std::min(trust, rimTrust(distance.at<float>(v, u) + 1.0f));
    }
  }
}

void lowerAtSteps(const cv::Mat& light_there, const cv::Mat& open, Reflectance& r) {
  const cv::Mat seen = r.triangle >= 0;
  cv::Mat light = cv::Mat::zeros(seen.size(), CV_32F), openness = light.clone(),
          albedo = light.clone(), creased = cv::Mat::zeros(seen.size(), CV_8U);
  for (int v = 0; v < light.rows; ++v) {
    for (int u = 0; u < light.cols; ++u) {
      if (seen.at<std::uint8_t>(v, u) == 0) continue;
      light.at<float>(v, u) = luminance(light_there.at<cv::Vec3f>(v, u));
      albedo.at<float>(v, u) = luminance(r.albedo.at<cv::Vec3f>(v, u));
      openness.at<float>(v, u) =
          light.at<float>(v, u) / std::max(kDarkest, luminance(open.at<cv::Vec3f>(v, u)));
      for (const cv::Point q : {cv::Point(u + 1, v), cv::Point(u, v + 1)}) {
        if (q.x < light.cols && q.y < light.rows && seen.at<std::uint8_t>(q) != 0 &&
            r.normal.at<cv::Vec3f>(v, u).dot(r.normal.at<cv::Vec3f>(q)) < kCrease)
          creased.at<std::uint8_t>(v, u) = creased.at<std::uint8_t>(q) = 255;
      }
    }
  }
  const cv::Mat shade = fallOf(openness, seen), turn = fallOf(light, seen),
                change = fallOf(albedo, seen);
  cv::Mat steady(seen.size(), CV_32F);
  for (int v = 0; v < steady.rows; ++v) {
    for (int u = 0; u < steady.cols; ++u) {
      const float fall = std::max(
          shade.at<float>(v, u), creased.at<std::uint8_t>(v, u) != 0 ? turn.at<float>(v, u) : 0.0f);
      steady.at<float>(v, u) =
          1.0f - (1.0f - kLeastAtStep) *
                     smoothStep(kStep, kWholeStep, std::min(fall, change.at<float>(v, u)));
    }
  }
  r.trust = r.trust.mul(steady);
}

}  // namespace calipso::render
