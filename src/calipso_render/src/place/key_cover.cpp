#include "place/key_cover.hpp"

#include <opencv2/imgproc.hpp>

#include "place/rim_remains.hpp"
#include "place/touching_pieces.hpp"

namespace calipso::render {
namespace {

// px; narrower gaps between mask and model are misfit, unless they reach
constexpr int kFrontOpening = 7;
constexpr int kNarrowFront = 3;     // ... so much of them
constexpr float kDeepFront = 6.0f;  // ... that far inside the model's outline: a peg on a towel
constexpr int kRim = 2;             // px beyond a model's outline in which its rim may be drawn
constexpr int kBroad = 7;           // px: what is narrower is a blade
constexpr float kInSun = 0.5f;      // part of it from which something is not shaded
// part by which what stands before a plane is nearer if it has another light: blades of grass have
// that of their ground
constexpr float kFarBefore = 0.25f;
constexpr int kAmong = 10;       // px around a place in which blades are counted
constexpr float kDense = 0.04f;  // part of these pixels from which it is among blades
// part by which scenery is nearer or farther than the plane behind or before it
constexpr float kOffPlane = 0.1f;
constexpr int kWaterline = 2;  // px by which masks end before it, and over which it mixes

// Where an object's surface should be seen at the key frame but no mask is, something stands before
// it. The rim is left out: there the fit is not exact.
cv::Mat frontOf(const cv::Mat& outline, const cv::Mat& labels) {
  const cv::Mat gaps = outline & (labels == 0);
  cv::Mat front, narrow, inside;
  cv::morphologyEx(gaps, front, cv::MORPH_OPEN, cv::Mat::ones(kFrontOpening, kFrontOpening, CV_8U));
  cv::morphologyEx(gaps, narrow, cv::MORPH_OPEN, cv::Mat::ones(kNarrowFront, kNarrowFront, CV_8U));
  cv::distanceTransform(outline, inside, cv::DIST_L2, cv::DIST_MASK_3);
  front |= touchingPieces(narrow, inside >= kDeepFront);
  return cv::countNonZero(front) > 0 ? front : cv::Mat();
}

cv::Mat nearnessOf(const cv::Mat& depth) {
  cv::Mat nearness = cv::Mat::zeros(depth.size(), CV_32F);
  cv::Mat(1.0 / depth).copyTo(nearness, depth > 0.0f);
  return nearness;
}

// Where the depth image shows the support planes. @param ground nearness of these
cv::Mat onGround(const cv::Mat& nearness, const cv::Mat& ground) {
  return (ground > 0.0f) & (cv::abs(nearness - ground) <= (kBehind - 1.0f) * nearness);
}

// Where it shows something well before the planes, in another light than theirs.
cv::Mat farBefore(const cv::Mat& nearness, const cv::Mat& ground) {
  return ground.empty() ? cv::Mat(nearness > 0.0f)
                        : cv::Mat(nearness > (1.0f + kFarBefore) * ground);
}

// What the depth image shows just beside an object, off the planes and nearer.
// @param ground nearness of the support planes
cv::Mat nearerBeside(const cv::Mat& mask, const cv::Mat& labels, const cv::Mat& nearness,
                     const cv::Mat& ground, const BackgroundParams& params) {
  cv::Mat own = cv::Mat::zeros(nearness.size(), CV_32F);
  nearness.copyTo(own, mask);
  own = grown(own, params.mask_margin_px + params.shadow_margin_px + 1);
  cv::Mat nearer = (labels == 0) & (own > 0.0f) & (nearness > kBehind * own);
  if (!ground.empty()) nearer &= ~onGround(nearness, ground);
  return nearer;
}

cv::Mat opened(const cv::Mat& mask, int width) {
  cv::Mat out;
  cv::morphologyEx(mask, out, cv::MORPH_OPEN, cv::Mat::ones(width, width, CV_8U));
  return out;
}

}  // namespace

cv::Mat outlineOf(const Actor& actor, const cv::Size& size) {
  cv::Mat outline = cv::Mat::zeros(size, CV_8U);
  const VisibilityBuffer buffer({0, 0, size.width, size.height}, {&actor.screen});
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      if (buffer.ids(v)[u] != VisibilityBuffer::kNothing) outline.at<std::uint8_t>(v, u) = 255;
    }
  }
  return outline;
}

cv::Mat grown(const cv::Mat& mask, int radius) {
  cv::Mat out;
  cv::dilate(mask, out,
             cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}));
  return out;
}

std::vector<cv::Mat> frontsOf(const Prepared& p, const RenderParams& params) {
  std::vector<cv::Mat> fronts;
  cv::Mat ground, nearness;
  if (!params.depth.empty()) {
    ground = groundNearness(params.planes, p.camera, cv::Mat());
    nearness = nearnessOf(params.depth);
  }
  for (std::size_t i = 0; i < p.surfaces.size(); ++i) {
    const cv::Mat mask = p.key_labels == p.surfaces[i].index;
    cv::Mat front = frontOf(p.outlines[i], p.key_labels);
    // A plane that hides its foot (water, grass): what mixes along there is the object's, too.
    if (!front.empty() && !ground.empty())
      front.setTo(0, grown(mask, kWaterline) & grown(onGround(nearness, ground), 1));
    if (!nearness.empty() && !p.moves[i]) {
      // Blades of grass are narrower: beside them pixels are mixed with the object, and go with it.
      const cv::Mat nearer = nearerBeside(mask, p.key_labels, nearness, ground, params.background),
                    things = nearer & farBefore(nearness, ground),
                    beside = opened(nearer, kNarrowFront) |
                             touchingPieces(things, opened(things, kBroad));  // a flower's stem
      if (cv::countNonZero(beside) > 0) front = front.empty() ? beside : cv::Mat(front | beside);
    }
    // The outline of what is hidden is hidden, too, with the pixels that it only touches.
    if (!front.empty())
      front |= grown(front, kRim) & ~grown(mask, kRim) & ~p.outlines[i] & (p.key_labels == 0);
    fronts.push_back(front);
  }
  return fronts;
}

cv::Mat offPlanes(const cv::Mat& scenery, const std::vector<SupportPlane>& planes,
                  const Camera& camera) {
  cv::Mat off = cv::Mat::zeros(camera.height, camera.width, CV_8U);
  const cv::Mat ground = scenery.empty() ? cv::Mat() : groundNearness(planes, camera, cv::Mat());
  if (ground.empty()) return off;
  cv::Mat farthest;  // of a pixel and those around: towards the horizon one row makes much
  cv::erode(ground, farthest, cv::Mat::ones(3, 3, CV_8U));
  return (scenery > 0.0f) &
         ((scenery > (1.0f + kOffPlane) * ground) | ((1.0f + kOffPlane) * scenery < farthest));
}

cv::Mat rimsOff(const cv::Mat& off_planes, const Prepared& p, const RenderParams& params) {
  cv::Mat nearness = nearnessOf(params.depth);
  nearness.setTo(0, p.key_labels != 0);
  cv::Mat around;
  cv::dilate(off_planes, around, cv::Mat::ones(3, 3, CV_8U));
  return offPlanes(nearness, params.planes, p.camera) & around & ~off_planes;
}

cv::Mat bladesBefore(const Prepared& p, const RenderParams& params) {
  const cv::Mat ground = groundNearness(params.planes, p.camera, cv::Mat());
  cv::Mat blades = cv::Mat::zeros(p.key_labels.size(), CV_8U), outlines = blades.clone(), part;
  if (ground.empty()) return blades;
  const cv::Mat nearness = nearnessOf(params.depth);
  for (std::size_t i = 0; i < p.surfaces.size(); ++i) {
    outlines |= p.outlines[i];
    if (p.moves[i]) continue;
    const cv::Mat nearer = nearerBeside(p.key_labels == p.surfaces[i].index, p.key_labels, nearness,
                                        ground, params.background);
    blades |= nearer & ~grown(opened(nearer, kBroad), 1);
  }
  cv::boxFilter(blades, part, CV_32F, {2 * kAmong + 1, 2 * kAmong + 1});
  return (part > 255.0f * kDense) & ~outlines;
}

cv::Mat frontsInSun(const Visibility& sun, const RenderParams& params, const Prepared& p) {
  cv::Mat lit = cv::Mat::zeros(p.key_labels.size(), CV_8U);
  if (params.depth.empty()) return lit;
  const cv::Mat before =
      farBefore(nearnessOf(params.depth), groundNearness(params.planes, p.camera, cv::Mat()));
  const Eigen::Isometry3f camera = p.camera.world_from_camera.cast<float>();
  for (const cv::Mat& front : p.fronts) {
    if (front.empty()) continue;
    const cv::Mat unknown = front & before & (p.scenery == 0.0f);
    for (int v = 0; v < front.rows; ++v) {
      for (int u = 0; u < front.cols; ++u) {
        if (unknown.at<std::uint8_t>(v, u) == 0) continue;
        const Eigen::Vector3f at =
            camera * (params.depth.at<float>(v, u) * p.camera.ray(u, v).cast<float>());
        if (sun.visibility(at, p.light.light.direction) > kInSun) lit.at<std::uint8_t>(v, u) = 255;
      }
    }
  }
  return lit;
}

std::vector<cv::Mat> footprintsOf(const Prepared& p, const cv::Mat& picture, int margin) {
  std::vector<cv::Mat> footprints(p.surfaces.size());
  for (std::size_t i = 0; i < p.surfaces.size(); ++i) {
    if (p.moves[i]) continue;
    const cv::Mat own = p.key_labels == p.surfaces[i].index;
    const cv::Mat before = p.fronts[i].empty() ? cv::Mat::zeros(own.size(), CV_8U) : p.fronts[i],
                  footprint = (own | p.outlines[i]) & ~before, others = (p.key_labels != 0) & ~own;
    footprints[i] = footprint | (rimRemains(picture, footprint, others, margin) & ~before);
  }
  return footprints;
}

cv::Mat sceneryOf(const cv::Mat& depth, const Prepared& p, int margin) {
  if (depth.empty()) return {};
  cv::Mat objects = p.key_labels != 0;
  for (const cv::Mat& f : p.footprints) {
    if (!f.empty()) objects |= f;
  }
  cv::dilate(objects, objects,
             cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * margin + 1, 2 * margin + 1}));
  cv::Mat nearness = nearnessOf(depth);
  nearness.setTo(0, objects);
  cv::erode(nearness, nearness, cv::Mat::ones(3, 3, CV_8U));
  return nearness;
}

cv::Mat beforeObjects(const cv::Mat& scenery, const cv::Mat& depth, const cv::Mat& labels) {
  const cv::Mat object = (labels != 0) & (depth > 0.0f);
  cv::Mat before = cv::Mat::zeros(scenery.size(), CV_8U);
  if (cv::countNonZero(object) == 0) return before;
  cv::Mat away, nearest;
  cv::distanceTransform(object == 0, away, nearest, cv::DIST_L2, cv::DIST_MASK_5,
                        cv::DIST_LABEL_PIXEL);
  std::vector<float> nearness(cv::countNonZero(object) + 1, 0.0f);  // of every object's pixel
  for (int v = 0; v < object.rows; ++v) {
    for (int u = 0; u < object.cols; ++u) {
      if (object.at<std::uint8_t>(v, u) != 0)
        nearness[nearest.at<int>(v, u)] = 1.0f / depth.at<float>(v, u);
    }
  }
  for (int v = 0; v < object.rows; ++v) {
    for (int u = 0; u < object.cols; ++u) {
      if (scenery.at<float>(v, u) > kBehind * nearness[nearest.at<int>(v, u)])
        before.at<std::uint8_t>(v, u) = 255;
    }
  }
  return before;
}

}  // namespace calipso::render
