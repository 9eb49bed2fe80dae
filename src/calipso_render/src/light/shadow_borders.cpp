#include "light/shadow_borders.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"
#include "draw/ray_scene.hpp"
#include "place/plane_view.hpp"

namespace calipso::render {
namespace {

constexpr int kMaskMargin = 5;      // px around the masks that are left out: mixed pixels
constexpr float kOffPlane = 0.05f;  // of the distance: something else than a plane is seen
constexpr float kSharp = 1e-3f;     // rad, of a sun whose shadows have plain outlines
constexpr float kOutline = 2.0f;    // px by which outlines are smoothed for their normals
constexpr int kStride = 4;          // px between places on a border
constexpr std::size_t kViews = 3, kPlaces = 100;  // at most; the latter of a view
constexpr int kAcross = 9, kAlong = 2;            // px around a place that are looked at
constexpr float kFurthest = 5.0f;                 // px between where a border is expected and seen
constexpr float kContrast = 0.03f;                // linear: the least that tells
constexpr float kDarker = 0.85f;  // of the light beside it, what a shadow leaves at most
constexpr float kMisfit = 0.1f;   // of the contrast, r.m.s.: more is no plain step
constexpr float kNarrowest = 0.4f, kWider = 1.5f;  // px, factor: widths of a step that are tried
constexpr int kWidths = 7;
constexpr std::size_t kFewest = 16;   // borders
constexpr float kLeastShift = 15.0f;  // px per rad: less tells nothing
constexpr float kKnown = 0.01f;       // rad, to which the sun is known before
constexpr float kError = 1.0f;        // px, of a border's place
constexpr int kReweightings = 10;
// Its softness: of the borders that move most with the sun this part tells it, by this quantile of
// them, as what lies beside a border makes it look softer, never sharper, ...
constexpr std::size_t kSoftPart = 3, kSoftQuantile = 4;
constexpr float kLeastLever = 60.0f;  // ... px per rad, if they move as much
// px^2: of a pixel's own width, and of places across a border told to a pixel
constexpr float kPixels = 2.0f / 12.0f;
constexpr float kSmallest = 0.002f, kLargest = 0.06f;  // rad: suns

// A step of brightness across a border.
struct Step {
  float at, width;  // px: from the place outwards; standard deviation
};

struct Border {
  float offset;           // px outwards, from where it is expected
  float width;            // px, standard deviation
  Eigen::Vector2f shift;  // px outwards, if the sun moves by 1 rad along either axis
};

// Mean brightness at every pixel across a border, and how much of it is expected to be shaded.
struct Profile {
  std::array<float, 2 * kAcross + 1> values;
  float expected;  // px: where its border is
};

// How much of a step's height is reached k / kParts px from it, by its width.
class Steps {
 public:
  static constexpr int kParts = 2;  // of a pixel: places of the step that are tried
  Steps() {
    for (int w = 0; w < kWidths; ++w) {
      const double width = kNarrowest * std::pow(kWider, w);
      for (int k = 0; k < kSize; ++k) {
        const double x = static_cast<double>(k - kSize / 2) / kParts;
        rise_[w][k] = static_cast<float>(0.5 * std::erfc(-x / (width * M_SQRT2)));
      }
    }
  }
  // From pixel -kAcross on, every kParts-th, of a step at `edge` / kParts.
  const float* rise(int width, int edge) const {
    return &rise_[width][kSize / 2 - kAcross * kParts - edge];
  }

 private:
  static constexpr int kSize = 2 * kParts * (kAcross + static_cast<int>(kFurthest)) + 1;
  float rise_[kWidths][kSize];
};

// The width between those that were tried, by a parabola through what they leave.
float widthBetween(const std::array<double, kWidths>& left, int best) {
  double by = 0.0;
  if (best > 0 && best + 1 < kWidths) {
    const double bend = left[best - 1] - 2.0 * left[best] + left[best + 1];
    by = bend > 0.0 ? 0.5 * (left[best - 1] - left[best + 1]) / bend : 0.0;
  }
  return kNarrowest * std::pow(kWider, static_cast<float>(best + by));
}

// The step up in a profile that explains it, as v = a + b s(x) + c x: besides shade itself the
// sky that objects hide makes it slope.
std::optional<Step> stepIn(const Profile& profile, const Steps& steps) {
  constexpr int kCount = 2 * kAcross + 1;
  double mean = 0.0, xx = 0.0, xv = 0.0, vv = 0.0;
  for (const float v : profile.values) mean += v / kCount;
  for (int i = 0; i < kCount; ++i) {
    const double x = i - kAcross, v = profile.values[i] - mean;
    xx += x * x, xv += x * v, vv += v * v;
  }
  std::array<double, kWidths> least;  // squares left by the best step of each width
  least.fill(vv);
  std::optional<float> at;
  int best = 0;
  constexpr int kEdges = static_cast<int>(kFurthest) * Steps::kParts;
  for (int w = 0; w < kWidths; ++w) {
    for (int edge = -kEdges; edge <= kEdges; ++edge) {
      const float* rise = steps.rise(w, edge);
      double s = 0.0, ss = 0.0, sx = 0.0, sv = 0.0;
      for (int i = 0; i < kCount; ++i) {
        const double r = rise[i * Steps::kParts];
        s += r, ss += r * r, sx += r * (i - kAcross), sv += r * (profile.values[i] - mean);
      }
      const double spread = ss - s * s / kCount - sx * sx / xx,
                   height = spread > 1e-6 ? (sv - sx * xv / xx) / spread : 0.0,
                   slope = (xv - height * sx) / xx,
                   here = static_cast<double>(edge) / Steps::kParts,
                   shaded = mean - height * s / kCount + slope * here,
                   left = vv - xv * xv / xx - height * height * spread;
      if (height < kContrast || shaded > kDarker * (shaded + height) || left >= least[w]) continue;
      least[w] = left;
      if (left > least[best]) continue;
      best = w;
      at = std::sqrt(std::max(0.0, left) / kCount) < kMisfit * height
               ? std::make_optional(static_cast<float>(here))
               : std::nullopt;
    }
  }
  return at ? std::make_optional(Step{*at, widthBetween(least, best)}) : std::nullopt;
}

// Those of one view.
class Borders {
 public:
  Borders(const View& view, const std::vector<SupportPlane>& planes, const cv::Mat& depth,
          const Eigen::Vector3f& sun)
      : view_(view), planes_(planes, view.camera), sun_(sun), scene_(occludersOf(view.actors)) {
    findShade(depth);
  }

  std::vector<Border> find() const {
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(shade_ == kShaded, outlines, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
    std::vector<cv::Point> places;
    for (const auto& outline : outlines)
      for (std::size_t i = 0; i < outline.size(); i += kStride) places.push_back(outline[i]);
    const std::size_t step = 1 + places.size() / kPlaces;
    const Steps steps;
    std::vector<Border> found;
    for (std::size_t i = 0; i < places.size(); i += step)
      if (const auto border = borderAt(places[i], steps)) found.push_back(*border);
    return found;
  }

 private:
  enum : std::uint8_t { kNone, kOpen, kShaded };  // no plane is seen; one in the sun; one in shade

  void findShade(const cv::Mat& depth) {
    const ShadowMap shadow(occludersOf(view_.actors), sun_.cast<double>(), {1024, kSharp, 16});
    const Eigen::Isometry3f camera_from_world =
        view_.camera.world_from_camera.inverse().cast<float>();
    cv::Mat covered;
    cv::dilate(view_.labels != 0, covered,
               cv::Mat::ones(2 * kMaskMargin + 1, 2 * kMaskMargin + 1, CV_8U));
    shade_ = cv::Mat(view_.labels.size(), CV_8U, cv::Scalar(kNone));
    Receiver r;
    for (int v = 0; v < shade_.rows; ++v) {
      for (int u = 0; u < shade_.cols; ++u) {
        if (covered.at<std::uint8_t>(v, u) != 0 || !planes_.at(u, v, r)) continue;
        const float z = (camera_from_world * r.position).z(),
                    seen = depth.empty() ? 0.0f : depth.at<float>(v, u);
        if (seen > 0.0f && std::abs(seen - z) > kOffPlane * z) continue;
        shade_.at<std::uint8_t>(v, u) =
            shadow.visibility(r.position, r.normal) < 0.5f ? kShaded : kOpen;
      }
    }
    cv::Mat smooth = shade_ == kShaded;
    smooth.convertTo(smooth, CV_32F, 1.0 / 255.0);
    cv::GaussianBlur(smooth, smooth, {0, 0}, kOutline);
    cv::Sobel(smooth, along_u_, CV_32F, 1, 0), cv::Sobel(smooth, along_v_, CV_32F, 0, 1);
  }

  std::optional<Border> borderAt(const cv::Point& place, const Steps& steps) const {
    const Eigen::Vector2f outwards(-along_u_.at<float>(place), -along_v_.at<float>(place));
    if (outwards.norm() < 1e-3f) return std::nullopt;
    const Eigen::Vector2f n = outwards.normalized(), shift = shiftOf(place, n);
    if (shift.norm() < kLeastShift) return std::nullopt;
    const auto profile = profileAt(place, n);
    const auto step = profile ? stepIn(*profile, steps) : std::nullopt;
    if (!step) return std::nullopt;
    return Border{step->at - profile->expected, step->width, shift};
  }

  // nullopt where something else than the planes is near.
  std::optional<Profile> profileAt(const cv::Point& place, const Eigen::Vector2f& n) const {
    constexpr int kReach = kAcross + kAlong;
    const cv::Rect around(place.x - kReach, place.y - kReach, 2 * kReach + 1, 2 * kReach + 1);
    if ((around & cv::Rect({0, 0}, shade_.size())) != around) return std::nullopt;
    Profile profile{};
    std::array<float, 2 * kAcross + 1> counts{};
    float shaded = 0.0f;
    for (int v = around.y; v < around.br().y; ++v) {
      for (int u = around.x; u < around.br().x; ++u) {
        const Eigen::Vector2f off(static_cast<float>(u - place.x), static_cast<float>(v - place.y));
        const int across = static_cast<int>(std::lround(n.dot(off)));
        if (std::abs(across) > kAcross || std::abs(n.x() * off.y() - n.y() * off.x()) > kAlong)
          continue;
        if (shade_.at<std::uint8_t>(v, u) == kNone) return std::nullopt;
        const cv::Vec3f code = view_.codeAt(v, u);
        profile.values[across + kAcross] +=
            luminance({linearFromRealCode(code[0]), linearFromRealCode(code[1]),
                       linearFromRealCode(code[2])});
        counts[across + kAcross] += 1.0f;
        shaded += shade_.at<std::uint8_t>(v, u) == kShaded ? 1.0f : 0.0f;
      }
    }
    float all = 0.0f;
    for (std::size_t i = 0; i < counts.size(); ++i)
      profile.values[i] /= std::max(1.0f, counts[i]), all += counts[i];
    profile.expected = (shaded / all - 0.5f) * static_cast<float>(counts.size());
    return profile;
  }

  // 0 where nothing is met on the way to the sun.
  Eigen::Vector2f shiftOf(const cv::Point& place, const Eigen::Vector2f& n) const {
    constexpr float kSmall = 1e-3f, kSteep = 0.02f;
    Receiver r;
    if (!planes_.at(place.x, place.y, r)) return Eigen::Vector2f::Zero();
    const auto hit = scene_.hit(r.position, r.normal, sun_);
    const float n_l = r.normal.dot(sun_);
    if (!hit || n_l < kSteep) return Eigen::Vector2f::Zero();
    const Actor& a = view_.actors[hit->mesh];
    const Eigen::Vector3i& t = a.surface->triangles[hit->triangle];
    const Eigen::Vector3f caster = (1.0f - hit->v - hit->w) * a.vertices[t[0]] +
                                   hit->v * a.vertices[t[1]] + hit->w * a.vertices[t[2]];
    const float way = (caster - r.position).norm();
    const auto moved = [&](const Eigen::Vector3f& axis) {
      const Eigen::Vector3f p =
          r.position - kSmall * way * (axis - sun_ * (r.normal.dot(axis) / n_l));
      const Eigen::Vector2f uv = view_.camera.projectWorld(p.cast<double>()).cast<float>();
      return n.dot(uv - Eigen::Vector2f(place.x, place.y)) / kSmall;
    };
    const Eigen::Vector3f e = sun_.unitOrthogonal();
    return {moved(e), moved(sun_.cross(e))};
  }

  const View& view_;
  PlaneView planes_;
  Eigen::Vector3f sun_;
  RayScene scene_;
  cv::Mat shade_, along_u_, along_v_;  // CV_8UC1; CV_32FC1: gradient of the smoothed shade
};

// Robust least squares (Cauchy).
Eigen::Vector2f turnBy(const std::vector<Border>& borders) {
  Eigen::Vector2f turn = Eigen::Vector2f::Zero();
  for (int round = 0; round < kReweightings; ++round) {
    Eigen::Matrix2f left = Eigen::Matrix2f::Identity() * (kError * kError / (kKnown * kKnown));
    Eigen::Vector2f right = Eigen::Vector2f::Zero();
    for (const Border& b : borders) {
      const float error = (b.offset - b.shift.dot(turn)) / kError,
                  weight = 1.0f / (1.0f + error * error);
      left += weight * b.shift * b.shift.transpose(), right += weight * b.shift * b.offset;
    }
    turn = left.ldlt().solve(right);
  }
  return turn;
}

// Radius of the sun's disc by the softness of the borders: a disc's edge of so many pixels' radius
// deviates by half of them. @param blur px, of a sharp edge in the picture
std::optional<float> radiusBy(std::vector<Border> borders, float blur) {
  std::sort(borders.begin(), borders.end(), [](const Border& a, const Border& b) {
    return a.shift.squaredNorm() > b.shift.squaredNorm();
  });
  borders.resize(borders.size() / kSoftPart);
  if (borders.back().shift.norm() < kLeastLever) return std::nullopt;
  std::vector<float> radii;
  for (const Border& b : borders)
    radii.push_back(2.0f * std::sqrt(std::max(0.0f, b.width * b.width - blur * blur - kPixels)) /
                    b.shift.norm());
  const auto quantile = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / kSoftQuantile);
  std::nth_element(radii.begin(), quantile, radii.end());
  return std::clamp(*quantile, kSmallest, kLargest);
}

}  // namespace

std::optional<SunByBorders> sunByBorders(const std::vector<View>& views,
                                         const std::vector<SupportPlane>& planes,
                                         const cv::Mat& depth, const Eigen::Vector3f& sun,
                                         float blur) {
  if (planes.empty()) return std::nullopt;
  const std::size_t count = std::min(views.size(), kViews);
  std::vector<std::vector<Border>> seen(count);
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = k * (views.size() - 1) / std::max<std::size_t>(1, count - 1);
    seen[k] = Borders(views[i], planes, i == 0 ? depth : cv::Mat(), sun).find();
  }
  std::vector<Border> borders;
  for (const auto& some : seen) borders.insert(borders.end(), some.begin(), some.end());
  if (borders.size() < kFewest) return std::nullopt;
  const Eigen::Vector2f turn = turnBy(borders);
  const Eigen::Vector3f e = sun.unitOrthogonal();
  return SunByBorders{(sun + turn.x() * e + turn.y() * sun.cross(e)).normalized(),
                      radiusBy(std::move(borders), blur)};
}

}  // namespace calipso::render
