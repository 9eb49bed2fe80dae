#include "place_relief.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr int kStride = 4;             // px between pixels that planes are sought among
constexpr int kSeedStep = 16, kSeedReach = 7;  // px: places where planes are begun, and the square they are begun from
constexpr int kMostPlanes = 10;
constexpr double kLeastPart = 0.004;   // of the picture, for a plane
constexpr double kOnPlane = 0.01, kSeedSpread = 0.005;  // of the nearness
constexpr float kOffSupport = 0.02f;   // of the nearness: what is farther from the support planes is relief
constexpr double kBehind = 1.02;       // of an object's nearness: what it hides is no nearer
constexpr double kLeastPiece = 0.05;   // of a plane's pixels, for a connected piece to widen its hull
constexpr int kCurvedReach = 4;        // px of the square that tells the normal of what is not plane
constexpr float kSameSurface = 0.05f;  // of the nearness within it
constexpr float kLeastSlope = 0.05f;   // cosine between normal and sun of what is lit
constexpr float kFullShade = 0.15f;    // of the sun
constexpr std::size_t kFewest = 50;    // px
constexpr float kDark = 0.01f;         // linear
constexpr float kNoShade = 0.9f;       // hardly darker: the shade was not where it was predicted

constexpr int kSupport = -1, kNoPlane = -2;

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

double errorAt(const Eigen::Vector3d& abc, const Pixel& p) { return std::abs(abc[0] * p.u + abc[1] * p.v + abc[2] - p.nearness) / p.nearness; }

std::vector<Pixel> pixelsIn(const cv::Mat& nearness, const cv::Mat& wanted, const cv::Rect& rect, int step) {
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
      const std::vector<Pixel> pixels = pixelsIn(nearness, wanted, {u - kSeedReach, v - kSeedReach, side, side}, 2);
      if (10 * pixels.size() < 6 * static_cast<std::size_t>((side + 1) * (side + 1) / 4)) continue;
      const auto abc = affineThrough(pixels);
      if (!abc) continue;
      double squares = 0.0;
      for (const Pixel& p : pixels) squares += errorAt(*abc, p) * errorAt(*abc, p);
      if (squares < kSeedSpread * kSeedSpread * static_cast<double>(pixels.size())) found.push_back(*abc);
    }
  }
  return found;
}

std::vector<Pixel> onPlane(const Eigen::Vector3d& abc, const std::vector<Pixel>& pixels) {
  std::vector<Pixel> on;
  std::copy_if(pixels.begin(), pixels.end(), std::back_inserter(on), [&](const Pixel& p) { return errorAt(abc, p) < kOnPlane; });
  return on;
}

// Hull of the pixels on the plane that lie together.
cv::Mat hullOf(const Eigen::Vector3d& abc, const cv::Mat& nearness, const cv::Mat& known) {
  cv::Mat on = cv::Mat::zeros(known.size(), CV_8U), pieces, stats, centres;
  for (const Pixel& p : pixelsIn(nearness, known, {{0, 0}, known.size()}, 1)) {
    if (errorAt(abc, p) < kOnPlane) on.at<std::uint8_t>(p.v, p.u) = 255;
  }
  const int count = cv::connectedComponentsWithStats(on, pieces, stats, centres, 8, CV_32S), all = cv::countNonZero(on);
  std::vector<cv::Point> points, hull;
  for (int v = 0; v < on.rows; ++v) {
    for (int u = 0; u < on.cols; ++u) {
      const int piece = pieces.at<int>(v, u);
      if (piece > 0 && piece < count && stats.at<int>(piece, cv::CC_STAT_AREA) >= kLeastPiece * all) points.push_back({u, v});
    }
  }
  cv::Mat region = cv::Mat::zeros(known.size(), CV_8U);
  if (points.empty()) return region;
  cv::convexHull(points, hull);
  cv::fillConvexPoly(region, hull, 255);
  return region;
}

// How near the support planes are, and which of them is seen.
struct Supports {
  cv::Mat nearness, label;  // CV_32FC1, 0: none; CV_8UC1, from 1 on

  Supports(const std::vector<SupportPlane>& planes, const Camera& camera)
      : nearness(cv::Mat::zeros(camera.height, camera.width, CV_32F)), label(cv::Mat::zeros(camera.height, camera.width, CV_8U)) {
    const Eigen::Isometry3d from_world = camera.world_from_camera.inverse();
    for (std::size_t k = 0; k < planes.size(); ++k) {
#pragma omp parallel for schedule(static)
      for (int v = 0; v < nearness.rows; ++v) {
        for (int u = 0; u < nearness.cols; ++u) {
          const auto r = receiverAt({planes[k]}, camera, static_cast<float>(u), static_cast<float>(v));
          const float near = r ? static_cast<float>(1.0 / (from_world * r->position.cast<double>()).z()) : 0.0f;
          if (near > nearness.at<float>(v, u)) nearness.at<float>(v, u) = near, label.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(k + 1);
        }
      }
    }
  }
};

// The normal of a surface that is not plane, from its pixels around.
std::optional<PicturePlane> curvedAt(const cv::Mat& nearness, int u, int v) {
  const float own = nearness.at<float>(v, u);
  const cv::Rect around(u - kCurvedReach, v - kCurvedReach, 2 * kCurvedReach + 1, 2 * kCurvedReach + 1);
  std::vector<Pixel> same;
  for (const Pixel& p : pixelsIn(nearness, nearness > 0.0f, around & cv::Rect({0, 0}, nearness.size()), 1)) {
    if (std::abs(p.nearness - own) < kSameSurface * own) same.push_back(p);
  }
  const auto abc = affineThrough(same);
  return abc ? std::optional<PicturePlane>({*abc, {}}) : std::nullopt;
}

void setAt(int u, int v, double nearness, const Eigen::Vector3f& normal, const Camera& camera, PlaceSurfaces& surfaces) {
  const Eigen::Vector3f p = (camera.world_from_camera * Eigen::Vector3d(camera.ray(u, v) / nearness)).cast<float>();
  surfaces.position.at<cv::Vec3f>(v, u) = {p.x(), p.y(), p.z()};
  surfaces.normal.at<cv::Vec3f>(v, u) = {normal.x(), normal.y(), normal.z()};
}

// The plane nearest to what the depth image shows at a pixel: or kSupport, kNoPlane.
int planeSeen(const std::vector<PicturePlane>& found, double seen, double support, int u, int v) {
  const double off_support = support > 0.0 ? std::abs(support - seen) / seen : 1e9;
  int best = kNoPlane;
  double least = std::min(off_support, kOnPlane);
  for (std::size_t k = 0; k < found.size(); ++k) {
    const double error = errorAt(found[k].abc, {u, v, seen});
    if (error < least && found[k].region.at<std::uint8_t>(v, u) != 0) least = error, best = static_cast<int>(k);
  }
  if (best == kNoPlane && off_support < kOffSupport) best = kSupport;
  return best;
}

// The plane seen if the object were not there: the nearest behind it.
int planeBehind(const std::vector<PicturePlane>& found, double object, double support, int u, int v) {
  const double limit = object > 0.0 ? kBehind * object : 1e9;
  int best = kSupport;
  double nearest = support > 0.0 && support < limit ? support : 0.0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    const double near = found[k].nearnessAt(u, v);
    if (near > nearest && near < limit && found[k].region.at<std::uint8_t>(v, u) != 0) nearest = near, best = static_cast<int>(k);
  }
  return best;
}

float brightness(const cv::Vec3f& code) { return luminance({linearFromRealCode(code[0]), linearFromRealCode(code[1]), linearFromRealCode(code[2])}); }

// Sun over ambient light that a surface facing so gets.
float sunShare(const Light& light, const Eigen::Vector3f& normal) {
  const float shaded = luminance(diffuseShading(light, normal, 0.0f)), lit = luminance(diffuseShading(light, normal, 1.0f));
  return (lit - shaded) / std::max(shaded, 1e-4f);
}

}  // namespace

Eigen::Vector3f PicturePlane::normal(const Camera& camera) const {
  const Eigen::Vector3d m(abc[0] * camera.fx, abc[1] * camera.fy, abc[2] + abc[0] * camera.cx + abc[1] * camera.cy);
  return (camera.world_from_camera.linear() * -m.normalized()).cast<float>();
}

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
    found.push_back({abc, hullOf(abc, nearness, nearness > 0.0f)});
    left.erase(std::remove_if(left.begin(), left.end(), [&](const Pixel& p) { return errorAt(abc, p) < kOnPlane; }), left.end());
  }
  return found;
}

PlaceSurfaces findSurfaces(const cv::Mat& scenery, const cv::Mat& depth, const cv::Mat& labels, const std::vector<SupportPlane>& planes, const Camera& camera) {
  if (scenery.empty()) return {};
  const Supports support(planes, camera);
  const cv::Mat off = (scenery > 0.0f) & (cv::abs(scenery - support.nearness) > kOffSupport * scenery);
  const std::vector<PicturePlane> found = picturePlanes(scenery, off);
  std::vector<Eigen::Vector3f> normals;
  for (const PicturePlane& p : found) normals.push_back(p.normal(camera));
  const int supports = static_cast<int>(planes.size());
  PlaceSurfaces surfaces{cv::Mat::zeros(scenery.size(), CV_8U), cv::Mat(scenery.size(), CV_32FC3), cv::Mat(scenery.size(), CV_32FC3), supports};
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < scenery.rows; ++v) {
    for (int u = 0; u < scenery.cols; ++u) {
      const float seen = scenery.at<float>(v, u), near = support.nearness.at<float>(v, u), d = depth.at<float>(v, u);
      if (seen == 0.0f && d == 0.0f && labels.at<std::uint8_t>(v, u) == 0) continue;  // nothing is known
      const int plane = seen > 0.0f ? planeSeen(found, seen, near, u, v) : planeBehind(found, d > 0.0f ? 1.0 / d : 0.0, near, u, v);
      std::uint8_t& label = surfaces.label.at<std::uint8_t>(v, u);
      if (plane == kSupport) label = support.label.at<std::uint8_t>(v, u);
      if (plane >= 0) label = static_cast<std::uint8_t>(supports + 1 + plane), setAt(u, v, found[plane].nearnessAt(u, v), normals[plane], camera, surfaces);
      if (plane != kNoPlane) continue;
      if (const auto curved = curvedAt(scenery, u, v)) label = PlaceSurfaces::kCurved, setAt(u, v, seen, curved->normal(camera), camera, surfaces);
    }
  }
  return surfaces;
}

Relief findRelief(const PlaceSurfaces& surfaces, const Eigen::Vector3f& sun) {
  if (surfaces.empty()) return {};
  Relief relief{surfaces.label > surfaces.supports, surfaces.position, surfaces.normal, {}, {}, {}};
  for (int v = 0; v < relief.seen.rows; ++v) {
    for (int u = 0; u < relief.seen.cols; ++u) {
      if (relief.at(u, v) && relief.receiver(u, v).normal.dot(sun) < kLeastSlope) relief.seen.at<std::uint8_t>(v, u) = 0;
    }
  }
  relief.index();
  return relief.box.isEmpty() ? Relief() : relief;
}

void findUmbra(const Light& light, const cv::Mat& picture, const cv::Mat& plate, const cv::Mat& sun, const cv::Mat& labels,
                 const std::vector<SupportPlane>& planes, const cv::Vec3f& umbra, Relief& relief) {
  if (relief.empty()) return;
  relief.umbra = cv::Mat(relief.seen.size(), CV_32F, cv::Scalar(1.0f));
  const float own = luminance(umbra), of_planes = sunShare(light, planes.empty() ? Eigen::Vector3f::UnitZ() : Eigen::Vector3f(planes.front().normal.cast<float>()));
  std::vector<float> scales;  // of the sun's share, seen over predicted
  for (int v = 0; v < relief.seen.rows; ++v) {
    for (int u = 0; u < relief.seen.cols; ++u) {
      if (!relief.at(u, v)) continue;
      const Eigen::Vector3f normal = relief.receiver(u, v).normal;
      const float share = sunShare(light, normal), lit = brightness(plate.at<cv::Vec3f>(v, u));
      relief.umbra.at<float>(v, u) = share;
      if (sun.at<float>(v, u) > kFullShade || labels.at<std::uint8_t>(v, u) != 0 || lit < kDark) continue;
      const float ratio = brightness(picture.at<cv::Vec3f>(v, u)) / lit;
      scales.push_back((1.0f / std::clamp(ratio, 0.05f, 1.0f) - 1.0f) / share);
    }
  }
  float scale = of_planes > 0.0f ? (1.0f / own - 1.0f) / of_planes : 1.0f;
  if (scales.size() >= kFewest) {
    std::nth_element(scales.begin(), scales.begin() + scales.size() / 2, scales.end());
    const float seen = scales[scales.size() / 2];
    if (seen > 1.0f / kNoShade - 1.0f) scale = seen;
  }
  for (int v = 0; v < relief.seen.rows; ++v) {
    float* row = relief.umbra.ptr<float>(v);
    for (int u = 0; u < relief.seen.cols; ++u) row[u] = 1.0f / (1.0f + scale * row[u]);
  }
}

}  // namespace calipso::render
