#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "calipso_render/inpaint.hpp"
#include "fill/distances_to.hpp"
#include "place/crossing_planes.hpp"
#include "place/key_cover.hpp"
#include "place/place_relief.hpp"
#include "place/plane_edges.hpp"
#include "place/plane_reach.hpp"
#include "place/sure_surfaces.hpp"

namespace calipso::render {
namespace {

constexpr int kStride = 4;  // px between pixels that planes are sought among
// px: places where planes are begun, and the square they are begun from
constexpr int kSeedStep = 16, kSeedReach = 7;
constexpr int kMostPlanes = 10;
constexpr double kLeastPart = 0.01;  // of the picture, for a plane: walls, not the sides of things
constexpr double kSeedSpread = 0.005;  // likewise
// of the nearness: what is farther from the support planes is relief
constexpr float kOffSupport = 0.02f;
constexpr int kCurvedReach = 4;  // px of the square that tells the normal of what is not plane
constexpr float kSameSurface = 0.05f;  // of the nearness within it
// times that a pixel of a support plane is as near as the farthest beside it, from which on so
// little of the plane is left up to the horizon that what stands on it may hide it
constexpr float kAtHorizon = 1.05f;
constexpr int kOnSide = 13, kRisesSide = 3;  // px: squares of a support, of what rises, that tell

struct Pixel {
  int u, v;
  double nearness;
};

std::optional<Eigen::Vector3d> affineThrough(const std::vector<Pixel>& pixels) {
  if (pixels.size() < 3) return std::nullopt;
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  const double u0 = pixels.front().u, v0 = pixels.front().v;  // well conditioned about one of them
  for (const Pixel& p : pixels) {
    const Eigen::Vector3d x(p.u - u0, p.v - v0, 1.0);
    A += x * x.transpose(), b += p.nearness * x;
  }
  if (A.determinant() < 1e-6 * A.trace()) return std::nullopt;
  Eigen::Vector3d abc = A.ldlt().solve(b);
  abc[2] -= abc[0] * u0 + abc[1] * v0;
  return abc;
}

double errorAt(const Eigen::Vector3d& abc, const Pixel& p) {
  return std::abs(abc[0] * p.u + abc[1] * p.v + abc[2] - p.nearness) / p.nearness;
}

std::vector<Pixel> pixelsIn(const cv::Mat& nearness, const cv::Mat& wanted, const cv::Rect& rect,
                            int step) {
  std::vector<Pixel> pixels;
  const cv::Rect here = rect & cv::Rect({0, 0}, wanted.size());
  for (int v = here.y; v < here.br().y; v += step) {
    for (int u = here.x; u < here.br().x; u += step) {
      if (wanted.at<std::uint8_t>(v, u) != 0) pixels.push_back({u, v, nearness.at<float>(v, u)});
    }
  }
  return pixels;
}

// Planes through small squares that are plane.
std::vector<Eigen::Vector3d> seeds(const cv::Mat& nearness, const cv::Mat& wanted) {
  std::vector<Eigen::Vector3d> found;
  const int side = 2 * kSeedReach + 1;
  for (int v = kSeedReach; v < wanted.rows; v += kSeedStep) {
    for (int u = kSeedReach; u < wanted.cols; u += kSeedStep) {
      const std::vector<Pixel> pixels =
          pixelsIn(nearness, wanted, {u - kSeedReach, v - kSeedReach, side, side}, 2);
      if (10 * pixels.size() < 6 * static_cast<std::size_t>((side + 1) * (side + 1) / 4)) continue;
      const auto abc = affineThrough(pixels);
      if (!abc) continue;
      double squares = 0.0;
      for (const Pixel& p : pixels) squares += errorAt(*abc, p) * errorAt(*abc, p);
      if (squares < kSeedSpread * kSeedSpread * static_cast<double>(pixels.size()))
        found.push_back(*abc);
    }
  }
  return found;
}

std::vector<Pixel> onPlane(const Eigen::Vector3d& abc, const std::vector<Pixel>& pixels) {
  std::vector<Pixel> on;
  std::copy_if(pixels.begin(), pixels.end(), std::back_inserter(on),
               [&](const Pixel& p) { return errorAt(abc, p) < kOnPlane; });
  return on;
}

cv::Mat supportNearness(const SupportPlane& plane, const Camera& camera) {
  cv::Mat nearness = cv::Mat::zeros(camera.height, camera.width, CV_32F);
  const Eigen::Isometry3d from_world = camera.world_from_camera.inverse();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < nearness.rows; ++v) {
    for (int u = 0; u < nearness.cols; ++u) {
      const auto r = receiverAt({plane}, camera, static_cast<float>(u), static_cast<float>(v));
      if (r)
        nearness.at<float>(v, u) =
            static_cast<float>(1.0 / (from_world * r->position.cast<double>()).z());
    }
  }
  return nearness;
}

// @param offset added to the plane's nearness
cv::Mat nearnessOf(const PicturePlane& plane, double offset, const cv::Size& size) {
  cv::Mat nearness(size, CV_32F);
  for (int v = 0; v < nearness.rows; ++v) {
    for (int u = 0; u < nearness.cols; ++u)
      nearness.at<float>(v, u) = static_cast<float>(std::max(0.0, plane.nearnessAt(u, v) + offset));
  }
  return nearness;
}

// The normal of a surface that is not plane, from its pixels around.
// @param known CV_8UC1, != 0: the depth image says how near it is
std::optional<PicturePlane> curvedAt(const cv::Mat& nearness, const cv::Mat& known, int u, int v) {
  const float own = nearness.at<float>(v, u);
  const cv::Rect around(u - kCurvedReach, v - kCurvedReach, 2 * kCurvedReach + 1,
                        2 * kCurvedReach + 1);
  std::vector<Pixel> same;
  for (const Pixel& p : pixelsIn(nearness, known, around, 1)) {
    if (std::abs(p.nearness - own) < kSameSurface * own) same.push_back(p);
  }
  const auto abc = affineThrough(same);
  return abc ? std::optional<PicturePlane>({*abc}) : std::nullopt;
}

void setAt(int u, int v, double nearness, const Eigen::Vector3f& normal, const Camera& camera,
           PlaceSurfaces& surfaces) {
  const Eigen::Vector3f p =
      (camera.world_from_camera * Eigen::Vector3d(camera.ray(u, v) / nearness)).cast<float>();
  surfaces.position.at<cv::Vec3f>(v, u) = {p.x(), p.y(), p.z()};
  surfaces.normal.at<cv::Vec3f>(v, u) = {normal.x(), normal.y(), normal.z()};
}

// Of planes first ... last - 1 the one that misses what is seen least, by less than `most`; of those
// that are met within a pixel the nearest one to it.
int closest(const std::vector<PlaneExtent>& planes, int first, int last, float most, float seen,
            int u, int v) {
  int best = kNoPlane;
  std::pair least(most, 0.0f);
  for (int k = first; k < last; ++k) {
    const float off = std::abs(seen - planes[k].nearness.at<float>(v, u));
    const std::pair miss(planes[k].miss(seen, u, v), off);
    if (miss < least) least = miss, best = k;
  }
  return best;
}

// The plane that the depth image shows at a pixel, or kNoPlane: support planes above all, which
// others pass through, and which are met less exactly.
int planeSeen(const std::vector<PlaneExtent>& planes, int supports, float seen, int u, int v) {
  int best = closest(planes, 0, supports, kOnPlane, seen, u, v);
  if (best == kNoPlane)
    best = closest(planes, supports, static_cast<int>(planes.size()), kOnPlane, seen, u, v);
  return best != kNoPlane ? best : closest(planes, 0, supports, kOffSupport, seen, u, v);
}

// The plane seen if the object were not there: the nearest behind it, but for one that has ended at
// its edge with another. @param object nearness of the object, 0 unknown
int planeBehind(const std::vector<PlaneExtent>& planes, const Edges& edges, float object, int u,
                int v) {
  const float limit = object > 0.0f ? kBehind * object : 1e9f;
  const auto isThere = [&](int k) {
    const float near = planes[k].nearness.at<float>(v, u);
    return near > 0.0f && near < limit && planes[k].goes_on.at<std::uint8_t>(v, u) != 0;
  };
  const auto hasEnded = [&](int k) {
    for (int j = 0; j < static_cast<int>(planes.size()); ++j) {
      if (edges[k][j] == kStandsOut && isThere(j) &&
          planes[j].nearness.at<float>(v, u) < planes[k].nearness.at<float>(v, u))
        return true;
    }
    return false;
  };
  int best = kNoPlane;
  float nearest = 0.0f;
  for (int k = 0; k < static_cast<int>(planes.size()); ++k) {
    const float near = planes[k].nearness.at<float>(v, u);
    if (near > nearest && isThere(k) && !hasEnded(k)) nearest = near, best = k;
  }
  return best;
}

// Of a mask the pieces that are as large as planes.
cv::Mat largePieces(const cv::Mat& mask) {
  cv::Mat pieces, stats, centres, large = cv::Mat::zeros(mask.size(), CV_8U);
  cv::connectedComponentsWithStats(mask, pieces, stats, centres, 8, CV_32S);
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      const int piece = pieces.at<int>(v, u);
      if (piece > 0 && stats.at<int>(piece, cv::CC_STAT_AREA) >= kLeastPart * mask.total())
        large.at<std::uint8_t>(v, u) = 255;
    }
  }
  return large;
}

// Where the picture shows nothing, as far as it has any depth: large areas in which nothing was
// measured, but for those in which a support plane would be seen (not just below its horizon).
cv::Mat showsNothing(const cv::Mat& depth, const cv::Mat& labels, int supports,
                     const std::vector<PlaneExtent>& planes) {
  cv::Mat unmeasured = (depth == 0.0f) & (labels == 0);
  for (int k = 0; k < supports; ++k)
    unmeasured &=
        (planes[k].nearness == 0.0f) | (planes[k].nearness > kAtHorizon * planes[k].farthest);
  return largePieces(unmeasured);
}

// CV_8SC1: the plane that every pixel shows, or kNoPlane.
cv::Mat planesSeen(const cv::Mat& scenery, int supports, const std::vector<PlaneExtent>& planes) {
  cv::Mat seen(scenery.size(), CV_8S, cv::Scalar(kNoPlane));
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < scenery.rows; ++v) {
    for (int u = 0; u < scenery.cols; ++u) {
      const float near = scenery.at<float>(v, u);
      if (near > 0.0f)
        seen.at<std::int8_t>(v, u) =
            static_cast<std::int8_t>(planeSeen(planes, supports, near, u, v));
    }
  }
  settleCrossings(scenery, supports, planes, kOffSupport, seen);
  return seen;
}

// @param seen planesSeen()
void findReaches(const cv::Mat& scenery, const cv::Mat& nothing, int supports, const cv::Mat& seen,
                 const std::vector<PicturePlane>& in_picture, const Edges& edges,
                 std::vector<PlaneExtent>& planes) {
  cv::Mat on_support = (seen > kNoPlane) & (seen < supports);
  for (int v = 0; v < scenery.rows && supports > 0; ++v) {
    for (int u = 0; u < scenery.cols; ++u) {
      const float near = scenery.at<float>(v, u);
      if (near > 0.0f && closest(planes, 0, supports, kOnPlane, near, u, v) != kNoPlane)
        on_support.at<std::uint8_t>(v, u) = 255;
    }
  }
  const cv::Mat none = cv::Mat::zeros(scenery.size(), CV_8U), on_others = seen >= supports;
  cv::Mat taken = on_support & ~on_others;
  for (int k = 0; k < static_cast<int>(planes.size()); ++k) {
    cv::Mat beyond = none.clone(), edge = none.clone();
    for (int j = 0; j < static_cast<int>(planes.size()); ++j) {
      if (edges[k][j] != kStandsOut) continue;
      beyond |= seen == j;
      if (j < k)
        edge |= (scenery == 0.0f) & planes[j].goes_on &
                alongEdge(in_picture[k], in_picture[j], scenery.size());
    }
    const cv::Mat& nearness = planes[k].nearness;
    planes[k].goes_on = goesOn(nearness, planes[k].farthest, scenery,
                               k < supports ? on_others : taken, beyond, edge, nothing);
    // What a larger plane explains is no sign of one that passes through it.
    if (k >= supports)
      taken |= (scenery > 0.0f) & (cv::abs(nearness - scenery) < kOnPlane * nearness);
  }
}

// A support plane is not seen behind an object where things that rise above it (a bank, a rock, a
// bowl) are seen nearer by than it is: they hide it, or may, unless they would be beneath it if they
// went on there as near as around, or stand before the object.
// @param before beforeObjects() @param seen planesSeen()
void leaveToWhatRises(const cv::Mat& scenery, const cv::Mat& before,
                      const std::vector<PlaneExtent>& planes, const cv::Mat& seen,
                      PlaceSurfaces& surfaces) {
  const auto pieces = [](const cv::Mat& mask, int side) {
    cv::Mat opened;
    cv::morphologyEx(mask, opened, cv::MORPH_OPEN, cv::Mat::ones(side, side, CV_8U), {-1, -1}, 1,
                     cv::BORDER_REPLICATE);
    return opened;
  };
  const cv::Mat hidden = scenery == 0.0f;
  for (int k = 0; k < surfaces.supports; ++k) {
    const cv::Mat& plane = planes[k].nearness;
    const cv::Mat on = pieces(seen == k, kOnSide),
                  rises = pieces((surfaces.label == PlaceSurfaces::kCurved) & ~before &
                                     (scenery > (1.0f + kOffSupport) * plane),
                                 kRisesSide);
    if (cv::countNonZero(on) == 0 || cv::countNonZero(rises) == 0) continue;
    const auto [to_on, to_rises] = distancesTo(on, rises);
    cv::Mat weight;
    rises.convertTo(weight, CV_32F, 1.0 / 255.0);
    surfaces.label.setTo(PlaceSurfaces::kUnknown, hidden & (surfaces.label == k + 1) &
                                                      (to_rises < to_on) &
                                                      (pushPull(scenery, weight) > plane));
  }
}

// PlaceSurfaces::alike. @param near CV_8UC1, != 0: is known to be seen at some distance
cv::Mat alikeOf(const cv::Mat& scenery, const cv::Mat& near, const std::vector<PlaneExtent>& planes,
                const PlaceSurfaces& surfaces) {
  const cv::Mat hidden = scenery == 0.0f, &label = surfaces.label;
  cv::Mat alike = label.clone();
  alike.setTo(PlaceSurfaces::kCurved, hidden & near & (label == PlaceSurfaces::kUnknown));
  for (int k = 0; k < surfaces.supports; ++k)
    alike.setTo(PlaceSurfaces::kUnknown,
                hidden & (label == k + 1) & (planes[k].nearness > kAtHorizon * planes[k].farthest));
  return alike;
}

}  // namespace

std::vector<PicturePlane> picturePlanes(const cv::Mat& nearness, const cv::Mat& wanted) {
  const cv::Rect whole({0, 0}, wanted.size());
  const std::vector<Eigen::Vector3d> starts = seeds(nearness, wanted);
  std::vector<Pixel> left = pixelsIn(nearness, wanted, whole, kStride);
  const double fewest = kLeastPart * wanted.total() / (kStride * kStride);
  std::vector<PicturePlane> found;
  while (found.size() < kMostPlanes) {
    std::vector<Pixel> most;
    for (const Eigen::Vector3d& abc : starts) {
      std::vector<Pixel> on = onPlane(abc, left);
      if (on.size() > most.size()) most = std::move(on);
    }
    if (most.size() < fewest) break;
    const Eigen::Vector3d first = *affineThrough(most), abc = *affineThrough(onPlane(first, left));
    found.push_back({abc});
    left.erase(std::remove_if(left.begin(), left.end(),
                              [&](const Pixel& p) { return errorAt(abc, p) < kOnPlane; }),
               left.end());
  }
  return found;
}

PlaceSurfaces findSurfaces(const cv::Mat& scenery, const cv::Mat& depth, const cv::Mat& labels,
                           const std::vector<SupportPlane>& planes, const Camera& camera) {
  if (scenery.empty()) return {};
  const int supports = static_cast<int>(planes.size());
  std::vector<PlaneExtent> extents;
  std::vector<PicturePlane> all;
  cv::Mat off = scenery > 0.0f;
  for (const SupportPlane& plane : planes) {
    all.push_back(inPicture(plane, camera));
    const double per_pixel = std::abs(all.back().abc[0]) + std::abs(all.back().abc[1]);
    extents.push_back(
        {supportNearness(plane, camera), nearnessOf(all.back(), -per_pixel, scenery.size()), {}});
    off &= (scenery - extents.back().nearness > kOffSupport * scenery) |
           (extents.back().farthest - scenery > kOffSupport * scenery);
  }
  std::vector<Eigen::Vector3f> normals(planes.size());
  for (const PicturePlane& plane : picturePlanes(scenery, off)) {
    const cv::Mat nearness = nearnessOf(plane, 0.0, scenery.size());
    all.push_back(plane), extents.push_back({nearness, nearness, {}}),
        normals.push_back(plane.normal(camera));
  }
  const cv::Mat seen_planes = planesSeen(scenery, supports, extents);
  const Edges edges = findEdges(all, seen_planes);
  const cv::Mat nothing = showsNothing(depth, labels, supports, extents);
  findReaches(scenery, nothing, supports, seen_planes, all, edges, extents);
  const cv::Mat known = scenery > 0.0f;
  PlaceSurfaces surfaces{
      cv::Mat::zeros(scenery.size(), CV_8U), {},       {}, {}, cv::Mat(scenery.size(), CV_32FC3),
      cv::Mat(scenery.size(), CV_32FC3),     supports, all};
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < scenery.rows; ++v) {
    for (int u = 0; u < scenery.cols; ++u) {
      const float seen = scenery.at<float>(v, u), d = depth.at<float>(v, u);
      if (seen == 0.0f && d == 0.0f && labels.at<std::uint8_t>(v, u) == 0)
        continue;  // nothing is known
      const int plane = seen > 0.0f ? seen_planes.at<std::int8_t>(v, u)
                                    : planeBehind(extents, edges, d > 0.0f ? 1.0f / d : 0.0f, u, v);
      std::uint8_t& label = surfaces.label.at<std::uint8_t>(v, u);
      if (plane != kNoPlane) label = static_cast<std::uint8_t>(plane + 1);
      if (plane >= supports)
        setAt(u, v, extents[plane].nearness.at<float>(v, u), normals[plane], camera, surfaces);
      if (plane != kNoPlane || seen == 0.0f) continue;
      if (const auto curved = curvedAt(scenery, known, u, v))
        label = PlaceSurfaces::kCurved, setAt(u, v, seen, curved->normal(camera), camera, surfaces);
    }
  }
  leaveToWhatRises(scenery, beforeObjects(scenery, depth, labels), extents, seen_planes, surfaces);
  surfaces.alike = alikeOf(scenery, (labels != 0) | (depth > 0.0f), extents, surfaces);
  surfaces.sky = cv::Mat::zeros(scenery.size(), CV_8U);
  surfaces.sky.setTo(InpaintParams::kSky, nothing);
  surfaces.sky.setTo(InpaintParams::kNoSky, known);
  surfaces.sure =
      sureOf(surfaces.label, (scenery == 0.0f) & (nothing == 0), seen_planes, nothing, edges);
  return surfaces;
}

void followPlanes(const PlaceSurfaces& surfaces, const cv::Mat& invented, cv::Mat& nearness) {
  for (int v = 0; v < surfaces.label.rows; ++v) {
    for (int u = 0; u < surfaces.label.cols; ++u) {
      const std::size_t label = surfaces.label.at<std::uint8_t>(v, u);
      if (invented.at<std::uint8_t>(v, u) == 0 || label == 0 || label > surfaces.planes.size())
        continue;
      const double near = surfaces.planes[label - 1].nearnessAt(u, v);
      nearness.at<float>(v, u) = static_cast<float>(std::max(0.0, near));
    }
  }
}

}  // namespace calipso::render
