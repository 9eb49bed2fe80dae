#include "place/hollow.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calipso_render/colour.hpp"
#include "calipso_render/inpaint.hpp"
#include "place/key_cover.hpp"

namespace calipso::render {
namespace {

constexpr int kFewest = 1000;       // px of a hollow that are seen
constexpr int kFewestHidden = 100;  // px that are hidden
constexpr int kRings = 60;          // from the axis to the rim
constexpr int kSectors = 36;        // around the axis,
constexpr int kSeenSectors = 18;    // ... and those that must be seen
constexpr int kRounds = 10;         // of the axis' robust fit
constexpr double kRound = 0.02;     // of its depth: mean error of heights around the axis
constexpr double kDeep = 0.15;      // of the rim's radius: its depth, at least
constexpr double kMostly = 0.995;   // part of what is inside that is taken to be no error
constexpr double kOff = 0.02;     // of the rim's radius: what is that far off its height is not it
constexpr double kTurned = 0.2;   // cosine between normal and way to the axis, on what is inside
constexpr int kBeside = 2;        // px to what tells a pixel's normal,
constexpr float kSmooth = 0.05f;  // ... unless it is that much nearer or farther
constexpr float kDark = 4e-3f;    // linear; added before the logarithm
// between pixels that tell how a ring differs from the next
constexpr std::size_t kFewestSteps = 12;
constexpr float kStep = 0.15f;  // rings by which two neighbours must differ to tell that
constexpr int kMixed = 2;       // px beside the hole, which shows what is before it

// A point of the scenery.
struct Point {
  double x, y, h;  // along the support, and over it
  double nx, ny;   // of its normal
};

class Hollow {
 public:
  // @param points of a connected piece of the scenery
  static std::optional<Hollow> find(std::vector<Point> points) {
    Hollow hollow;
    hollow.fitAxis(points);
    const auto isOutside = [&](const Point& p) {
      const double x = hollow.x_ - p.x, y = hollow.y_ - p.y, r = std::hypot(x, y);
      return p.nx * x + p.ny * y < kTurned * r * std::hypot(p.nx, p.ny);
    };
    points.erase(std::remove_if(points.begin(), points.end(), isOutside), points.end());
    if (points.size() < kFewest) return std::nullopt;
    hollow.refineAxis(points);
    std::array<bool, kSectors> seen{};
    std::vector<double> radii;
    for (const Point& p : points) {
      radii.push_back(hollow.radius(p.x, p.y));
      const double turn = std::atan2(p.y - hollow.y_, p.x - hollow.x_) / (2.0 * M_PI) + 0.5;
      seen[std::min(kSectors - 1, static_cast<int>(turn * kSectors))] = true;
    }
    if (std::count(seen.begin(), seen.end(), true) < kSeenSectors) return std::nullopt;
    const auto rim = radii.begin() + static_cast<std::ptrdiff_t>(kMostly * radii.size());
    std::nth_element(radii.begin(), rim, radii.end());
    hollow.rim_ = *rim;
    hollow.measure(points);
    const double deep = hollow.heights_.back() - hollow.heights_.front();
    if (deep < kDeep * hollow.rim_ || !hollow.rises() ||
        hollow.meanError(points, hollow.x_, hollow.y_) > kRound * deep)
      return std::nullopt;
    return hollow;
  }

  double radius(double x, double y) const { return std::hypot(x - x_, y - y_); }
  double rim() const { return rim_; }

  double height(double r) const {
    const double at = std::clamp(kRings * r / rim_ - 0.5, 0.0, kRings - 1.0);
    const int k = std::min(kRings - 2, static_cast<int>(at));
    return heights_[k] + (at - k) * (heights_[k + 1] - heights_[k]);
  }

 private:
  // Heights by rings. @param points of its inside
  void measure(const std::vector<Point>& points) {
    std::array<std::vector<double>, kRings> of;
    for (const Point& p : points) {
      const double r = radius(p.x, p.y);
      if (r < rim_) of[static_cast<int>(kRings * r / rim_)].push_back(p.h);
    }
    int last = -1;
    for (int k = 0; k < kRings; ++k) {
      if (of[k].empty()) continue;
      std::nth_element(of[k].begin(), of[k].begin() + of[k].size() / 2, of[k].end());
      heights_[k] = of[k][of[k].size() / 2];
      for (int j = last + 1; j < k; ++j)
        heights_[j] =
            last < 0 ? heights_[k]
                     : heights_[last] + (heights_[k] - heights_[last]) * (j - last) / (k - last);
      last = k;
    }
    for (int j = last + 1; j < kRings && last >= 0; ++j) heights_[j] = heights_[last];
  }

  // From the axis to the rim, but for errors.
  bool rises() const {
    const double error = kOff * rim_;
    for (int k = 0; k + 1 < kRings; ++k) {
      if (heights_[k + 1] < *std::max_element(heights_.begin(), heights_.begin() + k + 1) - error)
        return false;
    }
    return true;
  }

  // Normals of what turns about an axis meet it: (p - a) x n = 0, along the support.
  void fitAxis(const std::vector<Point>& points) {
    double scale = 1e9;
    for (int round = 0; round < kRounds; ++round) {
      Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
      Eigen::Vector2d b = Eigen::Vector2d::Zero();
      std::vector<double> errors;
      for (const Point& p : points) {
        const double error = (p.x - x_) * p.ny - (p.y - y_) * p.nx;
        const double weight = 1.0 / (1.0 + error * error / (scale * scale));
        const Eigen::Vector2d row(p.ny, -p.nx);
        A += weight * row * row.transpose(), b += weight * (p.x * p.ny - p.y * p.nx) * row;
        errors.push_back(std::abs(error));
      }
      const Eigen::Vector2d axis = A.ldlt().solve(b);
      std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
      if (round > 0) scale = std::max(1e-9, 2.0 * errors[errors.size() / 2]);
      x_ = axis[0], y_ = axis[1];
    }
  }

  // Mean error of heights against straight lines through rings about an axis.
  double meanError(const std::vector<Point>& points, double x, double y) const {
    struct Ring {
      double n = 0, r = 0, h = 0, rr = 0, rh = 0;
    };
    double most = 0.0;
    for (const Point& p : points) most = std::max(most, std::hypot(p.x - x, p.y - y));
    std::array<Ring, kRings> rings{};
    const auto ringOf = [&](double r) {
      return std::min(kRings - 1, static_cast<int>(kRings * r / most));
    };
    for (const Point& p : points) {
      const double r = std::hypot(p.x - x, p.y - y);
      Ring& ring = rings[ringOf(r)];
      ring.n += 1.0, ring.r += r, ring.h += p.h, ring.rr += r * r, ring.rh += r * p.h;
    }
    double sum = 0.0;
    for (const Point& p : points) {
      const double r = std::hypot(p.x - x, p.y - y);
      const Ring& ring = rings[ringOf(r)];
      const double mean = ring.r / ring.n, spread = ring.rr / ring.n - mean * mean,
                   slope =
                       spread > 1e-12 ? (ring.rh / ring.n - mean * ring.h / ring.n) / spread : 0;
      sum += std::abs(p.h - ring.h / ring.n - slope * (r - mean));
    }
    return sum / static_cast<double>(points.size());
  }

  // Compass search.
  void refineAxis(const std::vector<Point>& points) {
    double extent = 0.0;
    for (const Point& p : points) extent = std::max(extent, radius(p.x, p.y));
    double least = meanError(points, x_, y_);
    for (double step = 0.04 * extent; step > 2e-4 * extent;) {
      bool better = false;
      for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        const double error = meanError(points, x_ + step * dx, y_ + step * dy);
        if (error >= least) continue;
        least = error, x_ += step * dx, y_ += step * dy, better = true;
        break;
      }
      if (!better) step *= 0.5;
    }
  }

  double x_ = 0.0, y_ = 0.0, rim_ = 0.0;
  std::array<double, kRings> heights_{};
};

// The support plane's coordinates.
class Frame {
 public:
  Frame(const SupportPlane& support, const Camera& camera)
      : camera_(camera), up_(support.normal), offset_(support.offset) {
    across_ = up_.unitOrthogonal(), along_ = up_.cross(across_);
  }
  Eigen::Vector3d at(const Eigen::Vector3d& p) const {
    return {p.dot(across_), p.dot(along_), p.dot(up_) - offset_};
  }
  Eigen::Vector3d seen(int u, int v, float nearness) const {
    return at(camera_.world_from_camera * Eigen::Vector3d(camera_.ray(u, v) / nearness));
  }
  Eigen::Vector3d eye() const { return at(camera_.world_from_camera.translation()); }

 private:
  const Camera& camera_;
  Eigen::Vector3d up_, across_, along_;
  double offset_;
};

// Where a ray meets its inside, as a distance from its axis; none if it does not enter by the rim.
std::optional<double> radiusMet(const Hollow& hollow, const Eigen::Vector3d& eye,
                                const Eigen::Vector3d& there) {
  constexpr int kSteps = 200;
  const Eigen::Vector3d way = there - eye;
  const double top = hollow.height(hollow.rim());
  if (!(way.z() < 0.0) || eye.z() < top) return std::nullopt;
  for (int k = 0; k <= kSteps; ++k) {
    const double h = top * (1.0 - static_cast<double>(k) / kSteps);
    const Eigen::Vector3d p = eye + way * ((h - eye.z()) / way.z());
    const double r = hollow.radius(p.x(), p.y());
    if (k == 0 && r > hollow.rim()) return std::nullopt;
    if (h <= hollow.height(r)) return std::min(r, hollow.rim());
  }
  return std::nullopt;
}

float medianOf(std::vector<std::pair<float, float>>& slopes) {  // with weights
  std::sort(slopes.begin(), slopes.end());
  float total = 0.0f, below = 0.0f;
  for (const auto& [slope, weight] : slopes) total += weight;
  for (const auto& [slope, weight] : slopes) {
    below += weight;
    if (2.0f * below >= total) return slope;
  }
  return 0.0f;
}

// p at the borders of rings. @param radius CV_32FC1, in rings; 0 elsewhere
std::array<float, kRings + 1> patternOf(const cv::Mat& log, const cv::Mat& radius,
                                        const cv::Mat& known) {
  std::array<std::vector<std::pair<float, float>>, kRings> slopes;
  const auto look = [&](const cv::Point& p, const cv::Point& q) {
    if (known.at<std::uint8_t>(p) == 0 || known.at<std::uint8_t>(q) == 0) return;
    const float a = radius.at<float>(p), b = radius.at<float>(q);
    if (std::abs(a - b) < kStep) return;
    slopes[std::min(kRings - 1, static_cast<int>(0.5f * (a + b)))].push_back(
        {(log.at<float>(q) - log.at<float>(p)) / (b - a), std::abs(b - a)});
  };
  for (int v = 0; v + 1 < log.rows; ++v) {
    for (int u = 0; u + 1 < log.cols; ++u) look({u, v}, {u + 1, v}), look({u, v}, {u, v + 1});
  }
  std::array<float, kRings + 1> pattern{};
  for (int k = 0; k < kRings; ++k)
    pattern[k + 1] = pattern[k] + (slopes[k].size() < kFewestSteps ? 0.0f : medianOf(slopes[k]));
  return pattern;
}

float valueAt(const std::array<float, kRings + 1>& pattern, float radius) {
  const int k = std::clamp(static_cast<int>(radius), 0, kRings - 1);
  return pattern[k] + (radius - static_cast<float>(k)) * (pattern[k + 1] - pattern[k]);
}

// @param radius CV_32FC1, in rings, where it is known or hidden
void fillAround(const cv::Mat& radius, const cv::Mat& known, const cv::Mat& hidden,
                cv::Mat& plate) {
  cv::Mat weight, colours[3], filled[3];
  known.convertTo(weight, CV_32F, 1.0 / 255.0);
  cv::split(linearFromRealCodes(plate), colours);
  for (int c = 0; c < 3; ++c) {
    cv::Mat log, shade = cv::Mat::zeros(plate.size(), CV_32F);
    cv::log(colours[c] + kDark, log);
    const std::array<float, kRings + 1> pattern = patternOf(log, radius, known);
    for (int v = 0; v < plate.rows; ++v) {
      for (int u = 0; u < plate.cols; ++u) {
        if (known.at<std::uint8_t>(v, u) != 0)
          shade.at<float>(v, u) = log.at<float>(v, u) - valueAt(pattern, radius.at<float>(v, u));
      }
    }
    shade = pushPull(shade, weight);
    for (int v = 0; v < plate.rows; ++v) {
      for (int u = 0; u < plate.cols; ++u) {
        if (hidden.at<std::uint8_t>(v, u) == 0) continue;
        const float sum = shade.at<float>(v, u) + valueAt(pattern, radius.at<float>(v, u));
        plate.at<cv::Vec3f>(v, u)[c] = codeFromLinear(std::exp(sum) - kDark);
      }
    }
  }
}

// The points of a connected piece, with the normals that their neighbours tell.
std::vector<Point> pointsOf(const cv::Mat& piece, const cv::Mat& scenery, const Frame& frame) {
  std::vector<Point> points;
  for (int v = kBeside; v + kBeside < piece.rows; ++v) {
    for (int u = kBeside; u + kBeside < piece.cols; ++u) {
      if (piece.at<std::uint8_t>(v, u) == 0) continue;
      const float own = scenery.at<float>(v, u);
      const auto beside = [&](int du, int dv) {
        return frame.seen(u + du, v + dv, scenery.at<float>(v + dv, u + du));
      };
      bool smooth = true;
      for (const auto& [du, dv] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}})
        smooth = smooth && std::abs(scenery.at<float>(v + kBeside * dv, u + kBeside * du) - own) <
                               kSmooth * own;
      if (!smooth) continue;
      const Eigen::Vector3d p = frame.seen(u, v, own),
                            n = (beside(0, kBeside) - beside(0, -kBeside))
                                    .cross(beside(kBeside, 0) - beside(-kBeside, 0))
                                    .normalized();
      points.push_back({p.x(), p.y(), p.z(), n.x(), n.y()});
    }
  }
  return points;
}

// What is seen by its rim.
// @param clear CV_8UC1: where scenery is known for certain
std::vector<std::pair<cv::Point, Point>> insideOf(const Hollow& hollow, const cv::Mat& scenery,
                                                  const cv::Mat& clear, const Frame& frame) {
  std::vector<std::pair<cv::Point, Point>> inside;
  for (int v = 0; v < clear.rows; ++v) {
    for (int u = 0; u < clear.cols; ++u) {
      if (clear.at<std::uint8_t>(v, u) == 0) continue;
      const Eigen::Vector3d p = frame.seen(u, v, scenery.at<float>(v, u));
      if (hollow.radius(p.x(), p.y()) <= hollow.rim() &&
          radiusMet(hollow, frame.eye(), frame.seen(u, v, 1.0f)))
        inside.push_back({{u, v}, {p.x(), p.y(), p.z(), 0.0, 0.0}});
    }
  }
  return inside;
}

cv::Mat fillHollow(const Hollow& hollow, const cv::Mat& scenery, const Frame& frame,
                   const cv::Mat& hole, cv::Mat& plate) {
  cv::Mat known = cv::Mat::zeros(hole.size(), CV_8U), hidden = known.clone(),
          radius = cv::Mat::zeros(hole.size(), CV_32F);
  const auto inRings = [&](double r) { return static_cast<float>(kRings * r / hollow.rim()); };
  const auto inside =
      insideOf(hollow, scenery, (scenery > 0.0f) & (grown(hole, kMixed) == 0), frame);
  for (const auto& [pixel, p] : inside) {
    const double r = hollow.radius(p.x, p.y);
    if (std::abs(p.h - hollow.height(r)) > kOff * hollow.rim()) continue;
    radius.at<float>(pixel) = inRings(r), known.at<std::uint8_t>(pixel) = 255;
  }
  for (int v = 0; v < hole.rows; ++v) {
    for (int u = 0; u < hole.cols; ++u) {
      if (hole.at<std::uint8_t>(v, u) == 0) continue;
      const auto r = radiusMet(hollow, frame.eye(), frame.seen(u, v, 1.0f));
      if (r) radius.at<float>(v, u) = inRings(*r), hidden.at<std::uint8_t>(v, u) = 255;
    }
  }
  if (cv::countNonZero(hidden) < kFewestHidden) return cv::Mat::zeros(hole.size(), CV_8U);
  fillAround(radius, known, hidden, plate);
  return hidden;
}

}  // namespace

cv::Mat fillHollows(const cv::Mat& scenery, const PlaceSurfaces& surfaces,
                    const SupportPlane& support, const Camera& camera, const cv::Mat& hole,
                    cv::Mat& plate) {
  cv::Mat filled = cv::Mat::zeros(hole.size(), CV_8U), pieces, stats, centres;
  if (surfaces.empty()) return filled;
  const Frame frame(support, camera);
  const cv::Mat off = (surfaces.label > surfaces.supports) & (scenery > 0.0f) & (hole == 0);
  const int count = cv::connectedComponentsWithStats(off, pieces, stats, centres, 8, CV_32S);
  for (int k = 1; k < count; ++k) {
    const int* of = stats.ptr<int>(k);
    const cv::Rect box(of[cv::CC_STAT_LEFT], of[cv::CC_STAT_TOP], of[cv::CC_STAT_WIDTH],
                       of[cv::CC_STAT_HEIGHT]);
    if (of[cv::CC_STAT_AREA] < kFewest || cv::countNonZero(hole(box)) < kFewestHidden) continue;
    const auto hollow = Hollow::find(pointsOf(pieces == k, scenery, frame));
    if (hollow) filled |= fillHollow(*hollow, scenery, frame, hole & ~filled, plate);
  }
  return filled;
}

}  // namespace calipso::render
