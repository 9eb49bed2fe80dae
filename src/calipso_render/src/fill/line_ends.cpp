#include "fill/line_ends.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <tuple>
#include <utility>

#include "calipso_render/inpaint.hpp"
#include "fill/around_hole.hpp"

namespace calipso::render {
namespace {

constexpr float kShortest = 14.0f;  // px of a line that is seen
// px of one that is the only one of its kind, its contrast at least, and px that it goes on unseen
constexpr float kLong = 40.0f, kLoneContrast = 30.0f, kGoesOn = 20.0f;
constexpr float kLost = 14.0f;      // px from where a line was lost to the hole, and at most,
constexpr float kFarthest = 24.0f;  // where what is near the hole does not tell its colours
constexpr float kStepBack = 4.0f;   // px
constexpr float kReach = 8.0f;      // px along a line by which both of its edges may end apart
// px from the hole at which the line must have been seen: it does not run along the rim
constexpr float kClear = 4.0f;
constexpr int kFirst = 2, kLast = 14;  // px before the end over which its colours are averaged
constexpr int kCentrings = 3;
constexpr int kLineWidth = 3;  // px on either side of an edge of a thin line that are its own
// of the contrast: what differs more from its surroundings is the line
constexpr float kLineItself = 0.3f;
constexpr float kSameLine = 0.995f;  // cosine between the two edges of a line
constexpr float kContrast = 12.0f;   // code values across a line, at least
constexpr int kBesideFirst = kLineHalf + 2,
              kBesideLast = kLineHalf + 8;  // px beside a line that are not its own
constexpr float kStandsOut = 3.0f;  // contrast of a line, in deviations of what is beside it
constexpr float kStray = 1.5f;      // px by which ends may miss each other,
// change of colours along a line, to their contrast, from which it is another
constexpr float kSame = 0.2f;
constexpr float kAgain = 0.25f;  // mean difference, to the contrast, of a line that is seen again
constexpr float kOnEdge = 0.3f;  // part of the contrast that is within a px of an edge
constexpr float kThin = 0.35f;   // both sides differ by no more than this part of the contrast

class LineEndFinder {
 public:
  LineEndFinder(const cv::Mat& hole, const cv::Mat& source, const cv::Mat& image, bool any = false)
      : hole_(hole), source_(source), image_(image), any_(any) {}

  std::vector<LineEnd> run(const std::vector<cv::Vec4f>& edges) {
    const cv::Rect near = windowAround(hole_, cvCeil(kClear), cvCeil(kClear));
    cv::Mat away(hole_.size(), CV_32F, cv::Scalar(kClear)), away_near = away(near);
    if (!near.empty()) cv::distanceTransform(hole_(near) == 0, away_near, cv::DIST_L2, 3);
    std::vector<std::optional<LineEnd>> found(2 * edges.size());  // of either end of every edge
#pragma omp parallel for schedule(dynamic, 8)
    for (std::size_t i = 0; i < found.size(); ++i) {
      const cv::Vec4f& s = edges[i / 2];
      const cv::Point2f first(s[0], s[1]), last(s[2], s[3]);
      found[i] = i % 2 == 0 ? endOf(first, last, away) : endOf(last, first, away);
    }
    for (const std::optional<LineEnd>& end : found) {
      if (end) ends_.push_back(*end);
    }
    dropDoubles();
    for (std::size_t i = 0; i < ends_.size(); ++i) ends_[i].line = static_cast<int>(i);
    return ends_;
  }

  // Mean contrast of a thin line that stands out on most of its way; 0 if it is none.
  float contrastOfThin(const cv::Point2f& from, const cv::Point2f& way) const {
    const float length = static_cast<float>(cv::norm(way));
    if (length < kShortest) return 0.0f;
    const cv::Point2f into = way / length;
    const int pieces = static_cast<int>(length) / kLast;
    int found = 0;
    float sum = 0.0f;
    for (int i = 1; i <= pieces; ++i) {
      LineEnd end{
          from + static_cast<float>(i * kLast) * into, into, 1.0f * kLast, {}, 0.0f, {}, false};
      if (isSet(source_, end.at) && measure(end) && standsOut(end) && end.isClear() && end.isThin())
        ++found, sum += end.contrast;
    }
    return 2 * found > pieces ? sum / static_cast<float>(found) : 0.0f;
  }

  // An edge of a line between two things, in its middle; nothing if there is none.
  std::optional<LineEnd> joint(LineEnd end) const {
    end.is_joint = true;
    const bool found = partsThings(end) && centre(end) && partsThings(end);
    return found ? std::optional<LineEnd>(end) : std::nullopt;
  }

  std::optional<LineEnd> moved(LineEnd end, float aside) const {
    end.at += aside * leftOf(end.into), end.aside = std::abs(aside);
    const bool found = isSet(source_, end.at) && measure(end) && isOnEdge(end);
    return found ? std::optional<LineEnd>(end) : std::nullopt;
  }

 private:
  static bool isOnEdge(const LineEnd& end) {
    return rms(end.profile[kLineHalf + 1] - end.profile[kLineHalf - 1]) > kOnEdge * end.contrast;
  }

  // Either side differs from the mean of both by less than the line does.
  static bool partsThings(const LineEnd& end) {
    return !end.isThin() && 0.5f * rms(end.beside[0] - end.beside[1]) < kLineItself * end.contrast;
  }

  // Both edges of a line were found and are now the same: the longer one stays, seen near the hole
  // if one is.
  void dropDoubles() {
    const auto isSame = [](const LineEnd& a, const LineEnd& b) {
      const cv::Point2f apart = b.at - a.at;
      return a.into.dot(b.into) > kSameLine && std::abs(a.into.dot(apart)) < kReach &&
             std::abs(render::cross(a.into, apart)) < kStray;
    };
    std::stable_sort(ends_.begin(), ends_.end(), [](const LineEnd& a, const LineEnd& b) {
      return std::make_tuple(a.from_afar, !a.isClear(), -a.length) <
             std::make_tuple(b.from_afar, !b.isClear(), -b.length);
    });
    std::vector<LineEnd> kept;
    for (const LineEnd& end : ends_) {
      if (std::none_of(kept.begin(), kept.end(), [&](const LineEnd& k) { return isSame(k, end); }))
        kept.push_back(end);
    }
    ends_ = std::move(kept);
  }

  // Where an edge meets the hole; nothing if it does not, or does not stand out there.
  // @param away CV_32FC1: px from the hole
  std::optional<LineEnd> endOf(const cv::Point2f& from, cv::Point2f to, const cv::Mat& away) const {
    const cv::Point2f way = to - from;
    float length = static_cast<float>(cv::norm(way));
    if (length < kShortest) return std::nullopt;
    const cv::Point2f into = way / length;
    // The last place that is known, and the hole soon after it.
    while (length >= kShortest && !isSet(source_, to)) to -= into, length -= 1.0f;
    const cv::Point before(cvRound(to.x - kLast * into.x), cvRound(to.y - kLast * into.y));
    if (length < kShortest || !cv::Rect({0, 0}, hole_.size()).contains(before) ||
        away.at<float>(before) < kClear)
      return std::nullopt;
    float reach = toHole(to, into);
    std::optional<LineEnd> on_one_side;
    // Where the hole runs beside it the line is measured farther back.
    for (const float nearest = std::min(reach, kLost); reach <= kFarthest && length >= kShortest;
         reach += kStepBack, length -= kStepBack, to -= kStepBack * into) {
      LineEnd end{to, into, length, {}, 0.0f, {}, reach > nearest};
      if (!measure(end) || !standsOut(end) || !centre(end)) continue;
      if (end.isClear() || any_) return end;
      if (!on_one_side) on_one_side = end;
    }
    return on_one_side;
  }

  // px to the hole; if it is too far, those that are seen on a way most of which is not; else more
  // than kFarthest.
  float toHole(const cv::Point2f& from, const cv::Point2f& into) const {
    const cv::Rect all({0, 0}, hole_.size());
    float seen = 1.0f;
    for (float t = 1.0f; t <= kFarthest || 2.0f * seen < std::min(t, kFarthest); t += 1.0f) {
      const cv::Point2f p = from + t * into;
      if (!all.contains(cv::Point(cvRound(p.x), cvRound(p.y)))) break;
      if (isSet(hole_, p)) return t <= kFarthest ? t : seen;
      if (isSet(source_, p)) seen += 1.0f;
    }
    return kFarthest + 1.0f;
  }

  // An edge of a thin line goes to the line's middle, and along it: through its middles near the
  // end and far from it.
  bool centre(LineEnd& end) const {
    for (int i = 0; i < kCentrings && end.isLine(); ++i) {
      const auto near = middleAt(end, kFirst, kLast),
                 far = middleAt(end, static_cast<int>(end.length) - kLast,
                                static_cast<int>(end.length) - kFirst);
      if (!near) return true;
      if (far && end.length > 2 * kLast) end.into = (*near - *far) / cv::norm(*near - *far);
      end.at = *near + 0.5f * (kFirst + kLast) * end.into;
      const bool was_clear = end.isClear() && !any_;
      if (!measure(end) || !standsOut(end) || (was_clear && !end.isClear())) return false;
    }
    return true;
  }

  // Middle of a line `first` to `last` px before its end.
  std::optional<cv::Point2f> middleAt(const LineEnd& end, int first, int last) const {
    const cv::Vec3f around = 0.5f * (end.beside[0] + end.beside[1]);
    float sum = 0.0f, weights = 0.0f;
    for (int t = first; t <= last; ++t) {
      for (int s = -kLineHalf; s <= kLineHalf; ++s) {
        const cv::Point2f p =
            end.at - static_cast<float>(t) * end.into + static_cast<float>(s) * leftOf(end.into);
        if (!isSet(source_, p)) continue;
        const cv::Vec3f c = sampleSeen(image_, source_, p);
        const float weight = std::max(0.0f, rms(c - around) - kLineItself * end.contrast);
        sum += static_cast<float>(s) * weight, weights += weight;
      }
    }
    if (weights == 0.0f) return std::nullopt;
    return end.at - 0.5f * static_cast<float>(first + last) * end.into +
           (sum / weights) * leftOf(end.into);
  }

  bool measure(LineEnd& end) const {
    float least = 255.0f, most = 0.0f;
    for (int s = -kLineHalf; s <= kLineHalf; ++s) {
      cv::Vec3f sum;
      int count = 0;
      for (int t = kFirst; t <= kLast; ++t) {
        const cv::Point2f p =
            end.at - static_cast<float>(t) * end.into + static_cast<float>(s) * leftOf(end.into);
        if (isSet(source_, p)) sum += sampleSeen(image_, source_, p), ++count;
      }
      if (2 * count < kLast - kFirst) return false;
      const cv::Vec3f mean = sum / count;
      end.profile[s + kLineHalf] = mean;
      const float grey = (mean[0] + 2.0f * mean[1] + mean[2]) / 4.0f;
      least = std::min(least, grey), most = std::max(most, grey);
    }
    end.contrast = most - least;
    end.length = std::min(end.length, sameLength(end));
    return end.contrast > kContrast;
  }

  // How far back the line looks as it does at its end.
  float sameLength(const LineEnd& end) const {
    for (int t = kLast; t < end.length; ++t) {
      float sums[2] = {0.0f, 0.0f};  // left and right
      for (int s = -kLineHalf; s <= kLineHalf; ++s) {
        const cv::Point2f p =
            end.at - static_cast<float>(t) * end.into + static_cast<float>(s) * leftOf(end.into);
        if (!isSet(source_, p)) return static_cast<float>(t);
        sums[s < 0 ? 0 : 1] +=
            rms(sampleSeen(image_, source_, p) - end.profile[s + kLineHalf]) / kLineHalf;
      }
      if (std::max(sums[0], sums[1]) > kSame * end.contrast) return static_cast<float>(t);
    }
    return end.length;
  }

  // A line among many like it is texture; a thing's edge may have texture on its other side.
  bool standsOut(LineEnd& end) const {
    for (const int side : {0, 1}) {
      cv::Vec3f sum;
      float squares = 0.0f;
      int count = 0;
      for (int s = kBesideFirst; s <= kBesideLast; ++s) {
        for (int t = kFirst; t <= kLast; ++t) {
          const cv::Point2f p = end.at - static_cast<float>(t) * end.into +
                                static_cast<float>(side == 0 ? -s : s) * leftOf(end.into);
          if (!isSet(source_, p)) continue;
          const cv::Vec3f c = sampleSeen(image_, source_, p);
          sum += c, squares += c.dot(c), ++count;
        }
      }
      end.stands_out[side] = false;
      if (4 * count < (kBesideLast - kBesideFirst) * (kLast - kFirst)) {
        end.beside[side] = end.profile[side == 0 ? 0 : 2 * kLineHalf];
        continue;
      }
      end.beside[side] = sum / count;
      const float deviation = std::sqrt(
          std::max(0.0f, squares / count - end.beside[side].dot(end.beside[side])) / 3.0f);
      end.stands_out[side] = end.contrast >= kStandsOut * deviation;
    }
    return any_ || end.stands_out[0] || end.stands_out[1];
  }

  const cv::Mat &hole_, &source_, &image_;
  bool any_;
  std::vector<LineEnd> ends_;
};

}  // namespace

bool LineEnd::isThin() const { return rms(beside[0] - beside[1]) < kThin * contrast; }

std::vector<cv::Vec4f> straightEdges(const cv::Mat& source, const cv::Mat& image) {
  cv::Mat weight(image.size(), CV_32F, cv::Scalar(0.0f)), grey;
  weight.setTo(1.0f, source);
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  pushPull(grey, weight).convertTo(grey, CV_8U);
  std::vector<cv::Vec4f> edges;
  cv::createLineSegmentDetector(cv::LSD_REFINE_STD)->detect(grey, edges);
  return edges;
}

std::vector<LineEnd> findLineEnds(const std::vector<cv::Vec4f>& edges, const cv::Mat& hole,
                                  const cv::Mat& source, const cv::Mat& image, bool any) {
  return LineEndFinder(hole, source, image, any).run(edges);
}

std::vector<LineEnd> jointsOf(const std::vector<LineEnd>& ends, const cv::Mat& hole,
                              const cv::Mat& source, const cv::Mat& image) {
  const LineEndFinder finder(hole, source, image);
  std::vector<LineEnd> joints;
  for (const LineEnd& end : ends) {
    if (const auto joint = finder.joint(end)) joints.push_back(*joint);
  }
  return joints;
}

std::vector<std::vector<LineEnd>> withBeside(const std::vector<LineEnd>& ends, int reach,
                                             const cv::Mat& hole, const cv::Mat& source,
                                             const cv::Mat& image) {
  const LineEndFinder finder(hole, source, image);
  std::vector<std::vector<LineEnd>> all(ends.size());
#pragma omp parallel for schedule(dynamic, 8)
  for (std::size_t i = 0; i < ends.size(); ++i) {
    all[i].push_back(ends[i]);
    for (int aside = -reach; aside <= reach; ++aside) {
      const auto beside =
          aside != 0 ? finder.moved(ends[i], static_cast<float>(aside)) : std::nullopt;
      if (beside) all[i].push_back(*beside);
    }
  }
  return all;
}

cv::Mat loneLines(const std::vector<cv::Vec4f>& edges, const cv::Mat& source,
                  const cv::Mat& image) {
  cv::Mat lines = cv::Mat::zeros(source.size(), CV_8U);
  const LineEndFinder finder(lines, source, image);
  const auto along = [](const cv::Vec4f& s) { return cv::Point2f(s[2] - s[0], s[3] - s[1]); };
  std::vector<float> contrast(edges.size());
#pragma omp parallel for schedule(dynamic, 8)
  for (std::size_t i = 0; i < edges.size(); ++i)
    contrast[i] = finder.contrastOfThin({edges[i][0], edges[i][1]}, along(edges[i]));
  std::vector<cv::Vec4f> found, faint;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (contrast[i] == 0.0f) continue;
    const bool lone = contrast[i] > kLoneContrast && cv::norm(along(edges[i])) > kLong;
    (lone ? found : faint).push_back(edges[i]);
  }
  const auto continues = [&](const cv::Vec4f& s, const cv::Vec4f& of) {
    const cv::Point2f way = along(of) / cv::norm(along(of)), start(of[0], of[1]);
    return std::abs(render::cross(way, cv::Point2f(s[0], s[1]) - start)) < kReach &&
           std::abs(render::cross(way, cv::Point2f(s[2], s[3]) - start)) < kReach;
  };
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto rest = std::stable_partition(
        faint.begin(), faint.end(), [&](const cv::Vec4f& s) { return !continues(s, found[i]); });
    found.insert(found.end(), rest, faint.end());
    faint.erase(rest, faint.end());
  }
  for (const cv::Vec4f& s : found) {
    const cv::Point2f from(s[0], s[1]), way = along(s),
                                        more = kGoesOn / static_cast<float>(cv::norm(way)) * way;
    cv::line(lines, from - more, from + way + more, cv::Scalar(255), 2 * kLineWidth + 1);
  }
  return lines;
}

bool repeats(const LineEnd& end, const Lattice& lattice, const cv::Mat& source,
             const cv::Mat& image) {
  int seen = 0, alike = 0;
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      const cv::Vec2f n = lattice.basis * cv::Vec2f(i, j);
      const cv::Point2f shift(n[0], n[1]);
      if (std::abs(render::cross(end.into, shift)) < kLineHalf) continue;
      float sum = 0.0f;
      int count = 0;
      for (int t = kFirst; t <= kLast; ++t) {
        for (int s = -kLineHalf; s <= kLineHalf; ++s) {
          const cv::Point2f p = end.at + shift - static_cast<float>(t) * end.into +
                                static_cast<float>(s) * leftOf(end.into);
          if (isSet(source, p))
            sum += rms(sampleSeen(image, source, p) - end.profile[s + kLineHalf]), ++count;
        }
      }
      if (2 * count < (kLast - kFirst) * (2 * kLineHalf + 1)) continue;
      ++seen, alike += sum < kAgain * end.contrast * static_cast<float>(count);
    }
  }
  return 2 * alike > seen;
}

float rms(const cv::Vec3f& c) { return std::sqrt(c.dot(c) / 3.0f); }

bool isSet(const cv::Mat& mask, const cv::Point2f& p) {
  return p.x >= 0.0f && p.y >= 0.0f && p.x <= mask.cols - 1.0f && p.y <= mask.rows - 1.0f &&
         mask.at<std::uint8_t>(cvRound(p.y), cvRound(p.x)) != 0;
}

cv::Vec3f sampleSeen(const cv::Mat& image, const cv::Mat& seen, const cv::Point2f& p) {
  const int x = std::clamp(static_cast<int>(std::floor(p.x)), 0, image.cols - 2),
            y = std::clamp(static_cast<int>(std::floor(p.y)), 0, image.rows - 2);
  const float a = std::clamp(p.x - x, 0.0f, 1.0f), b = std::clamp(p.y - y, 0.0f, 1.0f);
  cv::Vec3f sum;
  float total = 0.0f;
  for (const int i : {0, 1}) {
    for (const int j : {0, 1}) {
      if (seen.at<std::uint8_t>(y + i, x + j) == 0) continue;
      const float weight = (i == 0 ? 1.0f - b : b) * (j == 0 ? 1.0f - a : a);
      sum += weight * image.at<cv::Vec3f>(y + i, x + j), total += weight;
    }
  }
  return sum / total;
}

}  // namespace calipso::render
