#include "line_bridge.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {
namespace {

constexpr int kHalf = 4;            // px on either side of a line that are drawn with it
constexpr float kShortest = 14.0f;  // px of a line that is seen
constexpr float kReach = 8.0f;      // px from where a line was lost to the hole
// px from the hole at which the line must have been seen: it does not run along the rim
constexpr float kClear = 4.0f;
constexpr int kFirst = 2, kLast = 14;  // px before the end over which its colours are averaged
constexpr int kCentrings = 3;
// of the contrast: what differs more from its surroundings is the line
constexpr float kLineItself = 0.3f;
constexpr float kSameLine = 0.995f;  // cosine between the two edges of a line
constexpr float kContrast = 12.0f;   // code values across a line, at least
constexpr int kBesideFirst = kHalf + 2,
              kBesideLast = kHalf + 8;  // px beside a line that are not its own
constexpr float kStandsOut = 3.0f;      // contrast of a line, in deviations of what is beside it
constexpr float kAloneContrast =
    30.0f;                            // code values across a line that ends at another; it is thin:
constexpr float kAsStrong = 0.5f;     // that has at least this part of its contrast
constexpr float kThin = 0.35f;        // both sides differ by no more than this part of the contrast
constexpr float kStray = 1.5f;        // px by which ends may miss each other,
constexpr float kTurn = 0.04f;        // and part of the way between them
constexpr float kAlike = 0.4f;        // difference of colours across, to their contrast
constexpr float kBesideAlike = 0.5f;  // the same of what is beside it
constexpr float kInHole = 0.7f;       // part of a connection that the hole hides
constexpr float kLongest = 40.0f;     // px of a line that are mirrored
constexpr float kNear = 4.0f;         // px on either side that its colours reach
constexpr float kCore = 1.5f;         // px on either side that are the line itself
// change of colours along a line, to their contrast, from which it is another
constexpr float kSame = 0.2f;
constexpr float kCrossFade = 4.0f;  // px on either side of the middle

using Profile = std::array<cv::Vec3f, 2 * kHalf + 1>;  // colours across a line

cv::Point2f leftOf(const cv::Point2f& d) { return {d.y, -d.x}; }
float rms(const cv::Vec3f& c) { return std::sqrt(c.dot(c) / 3.0f); }
float cross(const cv::Point2f& a, const cv::Point2f& b) { return a.x * b.y - a.y * b.x; }

// A line that is lost in the hole.
struct End {
  cv::Point2f at, into;  // into: unit direction towards the hole
  float length;          // px that are seen of it
  Profile profile;       // from left to right of `into`
  float contrast;
  std::array<cv::Vec3f, 2> beside;  // mean colours left and right of it
};

struct Bridge {
  const End *from, *to;  // to: nothing if it ends at another bridge
  float gap, cost;
};

class Bridger {
 public:
  Bridger(const cv::Mat& hole, const cv::Mat& source, cv::Mat& image)
      : hole_(hole), source_(source), image_(image) {
    cv::distanceTransform(hole == 0, away_, cv::DIST_L2, 3);
    result_.drawn = cv::Mat::zeros(hole.size(), CV_8U);
    result_.core = cv::Mat::zeros(hole.size(), CV_8U);
    result_.lines = cv::Mat::zeros(hole.size(), CV_8U);
    result_.origin = cv::Mat(hole.size(), CV_16SC2, cv::Scalar(-1, -1));
  }

  LineBridges run() {
    findEnds();
    std::vector<Bridge> bridges = connections();
    const std::size_t through = bridges.size();
    for (const End& end : ends_) {
      if (std::any_of(bridges.begin(), bridges.begin() + through,
                      [&](const Bridge& b) { return b.from == &end || b.to == &end; }))
        continue;
      if (const auto gap = wayTo(end, bridges, through))
        bridges.push_back({&end, nullptr, *gap, 0.0f});
    }
    // What is led to another line comes before it, which goes through its end; what is weaker comes
    // first.
    const auto strength = [](const Bridge& b) {
      return b.to == nullptr ? kAsStrong * b.from->contrast
                             : std::min(b.from->contrast, b.to->contrast);
    };
    std::stable_sort(bridges.begin(), bridges.end(),
                     [&](const Bridge& a, const Bridge& b) { return strength(a) < strength(b); });
    const cv::Mat known = image_.clone();
    for (const Bridge& b : bridges) {
      draw(b, known);
      markSeen(*b.from);
      if (b.to != nullptr) markSeen(*b.to);
    }
    return result_;
  }

 private:
  bool inside(const cv::Point2f& p) const {
    return p.x >= 0.0f && p.y >= 0.0f && p.x <= hole_.cols - 1.0f && p.y <= hole_.rows - 1.0f;
  }
  bool is(const cv::Mat& mask, const cv::Point2f& p) const {
    return inside(p) && mask.at<std::uint8_t>(cvRound(p.y), cvRound(p.x)) != 0;
  }

  void findEnds() {
    cv::Mat weight(hole_.size(), CV_32F, cv::Scalar(0.0f)), grey;
    weight.setTo(1.0f, source_);
    cv::Mat smooth = image_.clone();
    pushPull(image_, weight).copyTo(smooth, source_ == 0);
    cv::cvtColor(smooth, grey, cv::COLOR_BGR2GRAY);
    grey.convertTo(grey, CV_8U);
    std::vector<cv::Vec4f> segments;
    cv::createLineSegmentDetector(cv::LSD_REFINE_STD)->detect(grey, segments);
    for (const cv::Vec4f& s : segments) {
      addEnd({s[0], s[1]}, {s[2], s[3]});
      addEnd({s[2], s[3]}, {s[0], s[1]});
    }
    dropDoubles();
  }

  // Both edges of a line were found and are now the same: the longer one stays.
  void dropDoubles() {
    const auto isSame = [](const End& a, const End& b) {
      const cv::Point2f apart = b.at - a.at;
      return a.into.dot(b.into) > kSameLine && std::abs(a.into.dot(apart)) < kReach &&
             std::abs(render::cross(a.into, apart)) < kStray;
    };
    std::stable_sort(ends_.begin(), ends_.end(),
                     [](const End& a, const End& b) { return a.length > b.length; });
    std::vector<End> kept;
    for (const End& end : ends_) {
      if (std::none_of(kept.begin(), kept.end(), [&](const End& k) { return isSame(k, end); }))
        kept.push_back(end);
    }
    ends_ = std::move(kept);
  }

  void addEnd(cv::Point2f from, cv::Point2f to) {
    const cv::Point2f way = to - from;
    float length = static_cast<float>(cv::norm(way));
    if (length < kShortest) return;
    const cv::Point2f into = way / length;
    // The last place that is known, and the hole soon after it.
    while (length >= kShortest && !is(source_, to)) to -= into, length -= 1.0f;
    if (length < kShortest || away_.at<float>(cv::Point(cvRound(to.x - kLast * into.x),
                                                        cvRound(to.y - kLast * into.y))) < kClear)
      return;
    float reach = 1.0f;
    while (reach <= kReach && !is(hole_, to + reach * into)) reach += 1.0f;
    if (reach > kReach) return;
    End end{to, into, length, {}, 0.0f, {}};
    if (measure(end) && standsOut(end) && centre(end)) ends_.push_back(end);
  }

  // An edge of a thin line goes to the line's middle, and along it: through its middles near the
  // end and far from it.
  bool centre(End& end) const {
    for (int i = 0; i < kCentrings && isThin(end); ++i) {
      const auto near = middleAt(end, kFirst, kLast),
                 far = middleAt(end, static_cast<int>(end.length) - kLast,
                                static_cast<int>(end.length) - kFirst);
      if (!near) return true;
      if (far && end.length > 2 * kLast) end.into = (*near - *far) / cv::norm(*near - *far);
      end.at = *near + 0.5f * (kFirst + kLast) * end.into;
      if (!measure(end) || !standsOut(end)) return false;
    }
    return true;
  }

  // Middle of a line `first` to `last` px before its end.
  std::optional<cv::Point2f> middleAt(const End& end, int first, int last) const {
    const cv::Vec3f around = 0.5f * (end.beside[0] + end.beside[1]);
    float sum = 0.0f, weights = 0.0f;
    for (int t = first; t <= last; ++t) {
      for (int s = -kHalf; s <= kHalf; ++s) {
        const cv::Point2f p =
            end.at - static_cast<float>(t) * end.into + static_cast<float>(s) * leftOf(end.into);
        if (!is(source_, p)) continue;
        const float weight =
            std::max(0.0f, rms(sample(image_, p) - around) - kLineItself * end.contrast);
        sum += static_cast<float>(s) * weight, weights += weight;
      }
    }
    if (weights == 0.0f) return std::nullopt;
    return end.at - 0.5f * static_cast<float>(first + last) * end.into +
           (sum / weights) * leftOf(end.into);
  }

  static bool isThin(const End& end) {
    return rms(end.beside[0] - end.beside[1]) < kThin * end.contrast;
  }

  bool measure(End& end) const {
    float least = 255.0f, most = 0.0f;
    for (int s = -kHalf; s <= kHalf; ++s) {
      cv::Vec3f sum;
      int count = 0;
      for (int t = kFirst; t <= kLast; ++t) {
        const cv::Point2f p =
            end.at - static_cast<float>(t) * end.into + static_cast<float>(s) * leftOf(end.into);
        if (is(source_, p)) sum += sample(image_, p), ++count;
      }
      if (2 * count < kLast - kFirst) return false;
      const cv::Vec3f mean = sum / count;
      end.profile[s + kHalf] = mean;
      const float grey = (mean[0] + 2.0f * mean[1] + mean[2]) / 4.0f;
      least = std::min(least, grey), most = std::max(most, grey);
    }
    end.contrast = most - least;
    end.length = std::min(end.length, sameLength(end));
    return end.contrast > kContrast;
  }

  // How far back the line looks as it does at its end.
  float sameLength(const End& end) const {
    for (int t = kLast; t < end.length; ++t) {
      float sums[2] = {0.0f, 0.0f};  // left and right
      for (int s = -kHalf; s <= kHalf; ++s) {
        const cv::Point2f p =
            end.at - static_cast<float>(t) * end.into + static_cast<float>(s) * leftOf(end.into);
        if (!is(source_, p)) return static_cast<float>(t);
        sums[s < 0 ? 0 : 1] += rms(sample(image_, p) - end.profile[s + kHalf]) / kHalf;
      }
      if (std::max(sums[0], sums[1]) > kSame * end.contrast) return static_cast<float>(t);
    }
    return end.length;
  }

  // A thin one; an edge between two things may well have others like it.
  void markSeen(const End& end) {
    if (!isThin(end)) return;
    cv::line(result_.lines, end.at, end.at - end.length * end.into, cv::Scalar(255),
             2 * cvRound(kCore) + 1);
  }

  // A line among many like it is texture.
  bool standsOut(End& end) const {
    for (const int side : {0, 1}) {
      cv::Vec3f sum;
      float squares = 0.0f;
      int count = 0;
      for (int s = kBesideFirst; s <= kBesideLast; ++s) {
        for (int t = kFirst; t <= kLast; ++t) {
          const cv::Point2f p = end.at - static_cast<float>(t) * end.into +
                                static_cast<float>(side == 0 ? -s : s) * leftOf(end.into);
          if (!is(source_, p)) continue;
          const cv::Vec3f c = sample(image_, p);
          sum += c, squares += c.dot(c), ++count;
        }
      }
      if (4 * count < (kBesideLast - kBesideFirst) * (kLast - kFirst)) return false;
      end.beside[side] = sum / count;
      const float deviation = std::sqrt(
          std::max(0.0f, squares / count - end.beside[side].dot(end.beside[side])) / 3.0f);
      if (end.contrast < kStandsOut * deviation) return false;
    }
    return true;
  }

  static cv::Vec3f sample(const cv::Mat& image, const cv::Point2f& p) {
    const int x = std::clamp(static_cast<int>(std::floor(p.x)), 0, image.cols - 2),
              y = std::clamp(static_cast<int>(std::floor(p.y)), 0, image.rows - 2);
    const float a = std::clamp(p.x - x, 0.0f, 1.0f), b = std::clamp(p.y - y, 0.0f, 1.0f);
    const cv::Vec3f *upper = image.ptr<cv::Vec3f>(y) + x, *lower = image.ptr<cv::Vec3f>(y + 1) + x;
    return (1.0f - b) * ((1.0f - a) * upper[0] + a * upper[1]) +
           b * ((1.0f - a) * lower[0] + a * lower[1]);
  }

  // Ends that continue each other, the best first, each once, none across another.
  std::vector<Bridge> connections() const {
    std::vector<Bridge> all, chosen;
    for (std::size_t i = 0; i < ends_.size(); ++i) {
      for (std::size_t j = i + 1; j < ends_.size(); ++j) {
        if (const auto cost = misfit(ends_[i], ends_[j]))
          all.push_back({&ends_[i], &ends_[j],
                         static_cast<float>(cv::norm(ends_[j].at - ends_[i].at)), *cost});
      }
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const Bridge& a, const Bridge& b) { return a.cost < b.cost; });
    for (const Bridge& b : all) {
      const bool taken = std::any_of(chosen.begin(), chosen.end(), [&](const Bridge& c) {
        return c.from == b.from || c.to == b.from || c.from == b.to || c.to == b.to || cross(c, b);
      });
      if (!taken) chosen.push_back(b);
    }
    return chosen;
  }

  static bool cross(const Bridge& a, const Bridge& b) {
    const auto side = [](const cv::Point2f& p, const cv::Point2f& q, const cv::Point2f& x) {
      return render::cross(q - p, x - p) > 0.0f;
    };
    const cv::Point2f &p = a.from->at, &q = a.to->at, &r = b.from->at, &s = b.to->at;
    return side(p, q, r) != side(p, q, s) && side(r, s, p) != side(r, s, q);
  }

  // How badly b continues a; nothing if it does not.
  std::optional<float> misfit(const End& a, const End& b) const {
    const cv::Point2f way = b.at - a.at;
    const float gap = static_cast<float>(cv::norm(way)), allowed = kStray + kTurn * gap;
    if (gap < 2.0f || a.into.dot(way) < 0.9f * gap || b.into.dot(way) > -0.9f * gap)
      return std::nullopt;
    const float stray =
        std::max(std::abs(render::cross(a.into, way)), std::abs(render::cross(b.into, way)));
    if (stray > allowed || hiddenPart(a.at, b.at) < kInHole) return std::nullopt;
    float sum = 0.0f;
    for (int s = 0; s <= 2 * kHalf; ++s)
      sum += static_cast<float>(cv::norm(a.profile[s] - b.profile[2 * kHalf - s], cv::NORM_L2SQR)) /
             3.0f;
    const float difference = std::sqrt(sum / (2 * kHalf + 1)) / std::min(a.contrast, b.contrast);
    if (difference > kAlike) return std::nullopt;
    for (const int side : {0, 1}) {
      if (rms(a.beside[side] - b.beside[1 - side]) >
          kBesideAlike * std::min(a.contrast, b.contrast))
        return std::nullopt;
    }
    return stray / allowed + difference / kAlike + gap / std::max(hole_.cols, hole_.rows);
  }

  float hiddenPart(const cv::Point2f& a, const cv::Point2f& b) const {
    const int steps = std::max(2, cvRound(cv::norm(b - a)));
    int hidden = 0;
    for (int i = 0; i <= steps; ++i)
      hidden += is(hole_, a + (static_cast<float>(i) / steps) * (b - a));
    return static_cast<float>(hidden) / (steps + 1);
  }

  // The way from a lone end to the nearest connection that it meets, all of it in the hole.
  std::optional<float> wayTo(const End& end, const std::vector<Bridge>& bridges,
                             std::size_t count) const {
    if (end.contrast < kAloneContrast || !isThin(end)) return std::nullopt;
    std::optional<float> nearest;
    for (std::size_t i = 0; i < count; ++i) {
      if (std::min(bridges[i].from->contrast, bridges[i].to->contrast) < kAsStrong * end.contrast)
        continue;
      const cv::Point2f start = bridges[i].from->at, along = bridges[i].to->at - start;
      const float sine = render::cross(end.into, along);
      if (std::abs(sine) < 0.2f * cv::norm(along)) continue;
      const float t = render::cross(start - end.at, along) / sine,
                  where = render::cross(start - end.at, end.into) / sine;
      if (t > 2.0f && where >= 0.0f && where <= 1.0f && (!nearest || t < *nearest)) nearest = t;
    }
    if (nearest && hiddenPart(end.at, end.at + *nearest * end.into) < kInHole) return std::nullopt;
    return nearest;
  }

  // What is seen `t` px before an end, there and back, `s` px beside it.
  static cv::Point2f mirrored(const End& end, float t, float s) {
    const float length = std::clamp(end.length - kHalf, 1.0f * kHalf, kLongest),
                turns = std::fmod(t, 2.0f * length);
    return end.at - (turns < length ? turns : 2.0f * length - turns) * end.into +
           s * leftOf(end.into);
  }

  void draw(const Bridge& b, const cv::Mat& known) {
    const cv::Point2f start = b.from->at,
                      along =
                          b.to != nullptr ? cv::Point2f((b.to->at - start) / b.gap) : b.from->into,
                      stop = start + b.gap * along;
    const cv::Rect all(0, 0, hole_.cols, hole_.rows);
    const cv::Rect box = cv::Rect(cv::Point(cvFloor(std::min(start.x, stop.x)) - kHalf,
                                            cvFloor(std::min(start.y, stop.y)) - kHalf),
                                  cv::Point(cvCeil(std::max(start.x, stop.x)) + kHalf + 1,
                                            cvCeil(std::max(start.y, stop.y)) + kHalf + 1)) &
                         all;
    for (int v = box.y; v < box.br().y; ++v) {
      for (int u = box.x; u < box.br().x; ++u) {
        if (hole_.at<std::uint8_t>(v, u) == 0) continue;
        const cv::Point2f d = cv::Point2f(static_cast<float>(u), static_cast<float>(v)) - start;
        const float t = d.dot(along), s = d.dot(leftOf(along));
        if (result_.drawn.at<std::uint8_t>(v, u) != 0 && std::abs(s) > kCore) continue;
        const float beyond = b.to != nullptr ? kHalf : 0.0f;
        if (std::abs(s) <= kHalf && t >= -kHalf && t <= b.gap + beyond)
          drawPixel(b, known, {u, v}, std::clamp(t, 0.0f, b.gap), s);
      }
    }
  }

  // Either half is mirrored from its own end; the colours across the line go over from one end's to
  // the other's.
  void drawPixel(const Bridge& b, const cv::Mat& known, const cv::Point& at, float t, float s) {
    const cv::Point2f from = mirrored(*b.from, t, s);
    if (!is(source_, from)) return;
    cv::Vec3f colour = sample(known, from);
    cv::Point2f origin = from;
    if (b.to != nullptr) {
      const cv::Point2f other = mirrored(*b.to, b.gap - t, -s);
      if (!is(source_, other)) return;
      const int row = std::clamp(cvRound(s) + kHalf, 0, 2 * kHalf);
      const cv::Vec3f difference = b.to->profile[2 * kHalf - row] - b.from->profile[row];
      const float part = t / b.gap,
                  share = std::clamp(0.5f + (t - 0.5f * b.gap) / (2.0f * kCrossFade), 0.0f, 1.0f);
      colour = (1.0f - share) * (colour + part * difference) +
               share * (sample(known, other) - (1.0f - part) * difference);
      if (share > 0.5f) origin = other;
    }
    image_.at<cv::Vec3f>(at) = colour;
    result_.drawn.at<std::uint8_t>(at) = 255;
    if (std::abs(s) <= kNear) result_.core.at<std::uint8_t>(at) = 255;
    result_.origin.at<cv::Vec2s>(at) =
        cv::Vec2s(cv::saturate_cast<short>(origin.x), cv::saturate_cast<short>(origin.y));
  }

  const cv::Mat &hole_, &source_;
  cv::Mat& image_;
  cv::Mat away_;  // CV_32FC1, px from the hole
  std::vector<End> ends_;
  LineBridges result_;
};

}  // namespace

LineBridges bridgeLines(const cv::Mat& hole, const cv::Mat& source, cv::Mat& image) {
  return Bridger(hole, source, image).run();
}

}  // namespace calipso::render
