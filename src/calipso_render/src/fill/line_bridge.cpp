#include "fill/line_bridge.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "fill/line_band.hpp"
#include "fill/line_ends.hpp"
#include "fill/line_match.hpp"
#include "fill/line_to_border.hpp"
#include "fill/surface_border.hpp"

namespace calipso::render {
namespace {

// code values across a thin line that ends at another one
constexpr float kAloneContrast = 30.0f;
constexpr float kAsStrong = 0.5f;       // part of its contrast that the other one has at least
constexpr float kAlike = 0.4f;          // difference of colours across, to their contrast
constexpr float kHidden = 0.7f;         // part of a connection that is not seen
constexpr float kSeenPart = 0.1f;       // of it, that is seen of either line at least,
constexpr float kSeenAmid = 0.15f;      // and amid others, as blades of grass are
constexpr float kSeenOnOneSide = 0.3f;  // of the longer where its other side is texture
constexpr float kBesideLine = 3.0f;     // px by which its pieces may miss it
constexpr float kAmid = 25.0f;          // px around a line's end,
constexpr int kOthers = 3;              // and how many others end there
constexpr float kLongest = 40.0f;       // px of a line that are mirrored
constexpr float kCore = 1.5f;           // px on either side that are the line itself
constexpr float kAlone = 1.0f;          // the same of one that passes before different things
constexpr LineBand kOwn{kLineHalf, kLineHalf};  // of a line by itself
constexpr float kCrossFade = 4.0f;              // px on either side of the middle
constexpr float kMoved = 0.05f;                 // cost of a px beside it
constexpr int kBesideEnd = 3;  // px by which a border's end may have been found beside it

struct Bridge {
  const LineEnd *from, *to;  // to: nothing if it ends at another bridge
  float gap, cost;
  LineBand band;
  std::optional<SurfaceBorder> border = std::nullopt;  // if it is one

  bool isAlone() const { return band.left == kAlone; }
};

class Bridger {
 public:
  Bridger(const cv::Mat& hole, const cv::Mat& source, const cv::Mat& surface, cv::Mat& image)
      : hole_(hole), source_(source), surface_(surface), image_(image) {
    result_.drawn = cv::Mat::zeros(hole.size(), CV_8U);
    result_.core = cv::Mat::zeros(hole.size(), CV_8U);
    result_.before = cv::Mat::zeros(hole.size(), CV_8U);
    result_.lines = cv::Mat::zeros(hole.size(), CV_8U);
    result_.origin = cv::Mat(hole.size(), CV_16SC2, cv::Scalar(-1, -1));
  }

  LineBridges run(const std::vector<cv::Vec4f>& edges, const Lattice* lattice) {
    edges_ = edges;
    ends_ = findLineEnds(edges, hole_, source_, image_);
    const auto clear = std::stable_partition(ends_.begin(), ends_.end(),
                                             [](const LineEnd& end) { return end.isClear(); });
    std::vector<LineEnd> more;
    if (lattice == nullptr) more.assign(clear, ends_.end());
    ends_.erase(clear, ends_.end());
    if (lattice != nullptr) {
      ends_.erase(std::remove_if(
                      ends_.begin(), ends_.end(),
                      [&](const LineEnd& end) { return repeats(end, *lattice, source_, image_); }),
                  ends_.end());
    }
    const std::vector<LineEnd> joints = jointsOf(ends_, hole_, source_, image_);
    more.insert(more.end(), joints.begin(), joints.end());
    std::vector<Bridge> bridges = connections(more, &Bridger::connection);
    for (Bridge& b : bridges) {
      if (!b.isAlone()) b.band = bandAlong(*b.from, *b.to, source_, image_);
    }
    const std::size_t through = bridges.size();
    for (const LineEnd& end : ends_) {
      if (std::any_of(bridges.begin(), bridges.begin() + through, [&](const Bridge& b) {
            return b.from->line == end.line || b.to->line == end.line;
          }))
        continue;
      if (const auto gap = goesOn(end, bridges, through))
        bridges.push_back({&end, nullptr, *gap, 0.0f, kOwn});
    }
    sortByStrength(bridges);
    drawAll(bridges);
    return result_;
  }

  // @param surface as bridgeBorders()'s
  LineBridges runBorders(const std::vector<cv::Vec4f>& edges, cv::Mat& surface) {
    ends_ = findLineEnds(edges, hole_, source_, image_, true);
    beside_ = withBeside(ends_, kBesideEnd, hole_, source_, image_);
    std::vector<Bridge> borders = connections({}, &Bridger::border);
    sortByStrength(borders);
    drawAll(borders);
    for (const Bridge& b : borders) setSides(*b.border, *b.from, *b.to, hole_, surface);
    return result_;
  }

 private:
  // The weaker first: what is led to another line comes before that, which goes through its end.
  static void sortByStrength(std::vector<Bridge>& bridges) {
    const auto strength = [](const Bridge& b) {
      return b.to == nullptr ? kAsStrong * b.from->contrast
                             : std::min(b.from->contrast, b.to->contrast);
    };
    std::stable_sort(bridges.begin(), bridges.end(),
                     [&](const Bridge& a, const Bridge& b) { return strength(a) < strength(b); });
  }

  void drawAll(const std::vector<Bridge>& bridges) {
    const cv::Mat known = image_.clone();
    for (const Bridge& b : bridges) {
      draw(b, known);
      markSeen(*b.from);
      if (b.to != nullptr) markSeen(*b.to);
    }
  }

  // A thin one; an edge between two things may well have others like it.
  void markSeen(const LineEnd& end) {
    if (!end.isThin()) return;
    cv::line(result_.lines, end.at, end.at - end.length * end.into, cv::Scalar(255),
             2 * cvRound(kCore) + 1);
  }

  // @return nothing if b does not continue a
  std::optional<Bridge> connection(const LineEnd& a, const LineEnd& b, float gap) const {
    if (!areInLine(a, b, gap) || isByChance(a, b, gap)) return std::nullopt;
    if (!a.isClear() || !b.isClear()) return connectionOnOneSide(a, b, gap);
    if (!a.is_joint && !b.is_joint && besideAlike(a, b)) {
      if (const auto cost = misfit(a, b, gap, differenceAcross(a, b)))
        return Bridge{&a, &b, gap, *cost, kOwn};
    }
    if (!a.isLine() || !b.isLine()) return std::nullopt;
    const auto alone = misfit(a, b, gap, differenceAlone(a, b));
    return alone ? std::optional<Bridge>({&a, &b, gap, 1.0f + *alone, {kAlone, kAlone}})
                 : std::nullopt;
  }

  // Of a thing's edge before texture: the thing is alike.
  std::optional<Bridge> connectionOnOneSide(const LineEnd& a, const LineEnd& b, float gap) const {
    if (std::min(a.contrast, b.contrast) < kAloneContrast || a.from_afar || b.from_afar ||
        std::max(seenLength(a), seenLength(b)) < kSeenOnOneSide * gap)
      return std::nullopt;
    std::optional<Bridge> best;
    for (const int side : {0, 1}) {
      if (!standOut(a, b, side) || !besideAlike(a, b, side)) continue;
      const auto cost = misfit(a, b, gap, differenceOfSide(a, b, side));
      if (cost && (!best || 2.0f + *cost < best->cost))
        best = Bridge{&a, &b, gap, 2.0f + *cost, kOwn};
    }
    return best;
  }

  // Of two surfaces: one side of them is alike. Labels tell that they meet along here, a few pixels
  // off, colours where.
  std::optional<Bridge> border(const LineEnd& a, const LineEnd& b, float) const {
    std::optional<Bridge> best;
    std::optional<SurfaceBorder> surfaces;
    for (const LineEnd& from : beside_[a.line]) {
      for (const LineEnd& to : beside_[b.line]) {
        const float gap = static_cast<float>(cv::norm(to.at - from.at));
        if (!areInLine(from, to, gap)) continue;
        const float difference =
            std::min(differenceOfSide(from, to, 0), differenceOfSide(from, to, 1));
        auto cost = misfit(from, to, gap, difference);
        if (!cost) continue;
        *cost += kMoved * (from.aside + to.aside);
        if (!surfaces) surfaces = borderAlong(from, to, surface_);
        if (!best || *cost < best->cost) best = Bridge{&from, &to, gap, *cost, kOwn};
      }
    }
    if (best) best->border = surfaces;
    return surfaces ? best : std::nullopt;
  }

  // Ends that continue each other, the best first, each once, none across another.
  // @param more of them; what is returned points into it
  // @param connect connection() or border()
  std::vector<Bridge> connections(const std::vector<LineEnd>& more,
                                  std::optional<Bridge> (Bridger::*connect)(const LineEnd&,
                                                                            const LineEnd&, float)
                                      const) const {
    std::vector<const LineEnd*> ends;
    for (const LineEnd& end : ends_) ends.push_back(&end);
    for (const LineEnd& end : more) ends.push_back(&end);
    std::vector<std::vector<Bridge>> from(ends.size());
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t i = 0; i < ends.size(); ++i) {
      for (std::size_t j = i + 1; j < ends.size(); ++j) {
        const float gap = static_cast<float>(cv::norm(ends[j]->at - ends[i]->at));
        if (const auto bridge = (this->*connect)(*ends[i], *ends[j], gap))
          from[i].push_back(*bridge);
      }
    }
    std::vector<Bridge> all, chosen;
    for (const std::vector<Bridge>& f : from) all.insert(all.end(), f.begin(), f.end());
    // What was measured near the hole comes first.
    const auto from_afar = [](const Bridge& b) { return b.from->from_afar || b.to->from_afar; };
    std::stable_sort(all.begin(), all.end(), [&](const Bridge& a, const Bridge& b) {
      return std::make_pair(from_afar(a), a.cost) < std::make_pair(from_afar(b), b.cost);
    });
    for (const Bridge& b : all) {
      const auto uses = [](const Bridge& c, const LineEnd* end) {
        return c.from->line == end->line || c.to->line == end->line;
      };
      const bool taken = std::any_of(chosen.begin(), chosen.end(), [&](const Bridge& c) {
        return uses(c, b.from) || uses(c, b.to) || cross(c, b);
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

  // Among many short lines some are in line with others far away.
  bool isByChance(const LineEnd& a, const LineEnd& b, float gap) const {
    const auto amid = [&](const LineEnd& end) {
      return std::count_if(ends_.begin(), ends_.end(), [&](const LineEnd& other) {
               return other.line != end.line && cv::norm(other.at - end.at) < kAmid;
             }) >= kOthers;
    };
    const auto is_short = [&](const LineEnd& end) {
      const float seen = seenLength(end);
      return seen < kSeenPart * gap || (seen < kSeenAmid * gap && amid(end));
    };
    return is_short(a) || is_short(b);
  }

  // px of the end's line, which may be seen in pieces, as a rope is.
  float seenLength(const LineEnd& end) const {
    float sum = 0.0f;
    for (const cv::Vec4f& s : edges_) {
      const cv::Point2f a(s[0], s[1]), b(s[2], s[3]);
      const auto aside = [&](const cv::Point2f& p) {
        return std::abs(render::cross(end.into, p - end.at));
      };
      const auto behind = [&](const cv::Point2f& p) {
        return end.into.dot(p - end.at) < kLineStray;
      };
      if (aside(a) <= kBesideLine && aside(b) <= kBesideLine && behind(a) && behind(b))
        sum += std::abs(end.into.dot(b - a));
    }
    return std::max(end.length, end.isThin() ? 0.5f * sum : sum);  // a line has two edges
  }

  // How badly b, in line with a, continues it; nothing if it does not.
  // @param difference of their colours, to their contrast
  std::optional<float> misfit(const LineEnd& a, const LineEnd& b, float gap,
                              float difference) const {
    if (difference > kAlike || hiddenPart(a.at, b.at) < kHidden) return std::nullopt;
    return strayOf(a, b) / allowedStray(gap) + difference / kAlike +
           gap / std::max(hole_.cols, hole_.rows);
  }

  float hiddenPart(const cv::Point2f& a, const cv::Point2f& b) const {
    const int steps = std::max(2, cvRound(cv::norm(b - a)));
    int hidden = 0;
    for (int i = 0; i <= steps; ++i)
      hidden += !isSet(source_, a + (static_cast<float>(i) / steps) * (b - a));
    return static_cast<float>(hidden) / (steps + 1);
  }

  // The way from a lone end to what it ends at: another line, or the end of the only surface.
  std::optional<float> goesOn(const LineEnd& end, const std::vector<Bridge>& bridges,
                              std::size_t count) const {
    if (end.contrast < kAloneContrast) return std::nullopt;
    const auto to_line = end.isThin() && !end.from_afar ? wayTo(end, bridges, count) : std::nullopt;
    if (to_line || !surface_.empty()) return to_line;
    return wayToBorder(end, hole_, source_, seenLength(end));
  }

  // To the nearest connection that it meets, all of it in the hole.
  std::optional<float> wayTo(const LineEnd& end, const std::vector<Bridge>& bridges,
                             std::size_t count) const {
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
    if (nearest && (hiddenPart(end.at, end.at + *nearest * end.into) < kHidden ||
                    !staysOnSurface(end, *nearest)))
      return std::nullopt;
    return nearest;
  }

  // Is the surface beside the way that beside what is seen of the line? Else another comes between.
  bool staysOnSurface(const LineEnd& end, float way) const {
    if (surface_.empty()) return true;
    for (const float s : {-1.0f * kLineHalf, 1.0f * kLineHalf}) {
      const int own = surfaceAt(surface_, end.at - kLineHalf * end.into + s * leftOf(end.into));
      for (float t = 0.0f; own != 0 && t < way - kLineHalf; t += 1.0f) {
        const int other = surfaceAt(surface_, end.at + t * end.into + s * leftOf(end.into));
        if (other != 0 && other != own) return false;
      }
    }
    return true;
  }

  // What is seen `t` px before an end, there and back, `s` px beside it.
  static cv::Point2f mirrored(const LineEnd& end, float t, float s) {
    const float length = std::clamp(end.length - kLineHalf, 1.0f * kLineHalf, kLongest),
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
    const int wide = cvCeil(std::max({b.band.left, b.band.right, 1.0f * kLineHalf}));
    const cv::Rect box = cv::Rect(cv::Point(cvFloor(std::min(start.x, stop.x)) - wide,
                                            cvFloor(std::min(start.y, stop.y)) - wide),
                                  cv::Point(cvCeil(std::max(start.x, stop.x)) + wide + 1,
                                            cvCeil(std::max(start.y, stop.y)) + wide + 1)) &
                         all;
    for (int v = box.y; v < box.br().y; ++v) {
      for (int u = box.x; u < box.br().x; ++u) {
        if (hole_.at<std::uint8_t>(v, u) == 0) continue;
        const cv::Point2f d = cv::Point2f(static_cast<float>(u), static_cast<float>(v)) - start;
        const float t = d.dot(along), s = d.dot(leftOf(along));
        if (result_.drawn.at<std::uint8_t>(v, u) != 0 && std::abs(s) > kCore) continue;
        const float beyond = b.to != nullptr ? kLineHalf : 0.0f;
        if (s <= b.band.left && s >= -b.band.right && t >= -kLineHalf && t <= b.gap + beyond)
          drawPixel(b, known, {u, v}, std::clamp(t, 0.0f, b.gap), s);
      }
    }
  }

  // Either half is mirrored from its own end; the colours across the line go over from one end's to
  // the other's.
  void drawPixel(const Bridge& b, const cv::Mat& known, const cv::Point& at, float t, float s) {
    const cv::Point2f from = mirrored(*b.from, t, s);
    if (!isSet(source_, from)) return;
    cv::Vec3f colour = sampleSeen(known, source_, from);
    cv::Point2f origin = from;
    if (b.to != nullptr) {
      const cv::Point2f other = mirrored(*b.to, b.gap - t, -s);
      if (!isSet(source_, other)) return;
      const int row = std::clamp(cvRound(s) + kLineHalf, 0, 2 * kLineHalf);
      const cv::Vec3f difference = b.to->profile[2 * kLineHalf - row] - b.from->profile[row];
      const float part = t / b.gap,
                  share = std::clamp(0.5f + (t - 0.5f * b.gap) / (2.0f * kCrossFade), 0.0f, 1.0f);
      colour = (1.0f - share) * (colour + part * difference) +
               share * (sampleSeen(known, source_, other) - (1.0f - part) * difference);
      if (share > 0.5f) origin = other;
    }
    image_.at<cv::Vec3f>(at) = colour;
    result_.drawn.at<std::uint8_t>(at) = 255;
    result_.core.at<std::uint8_t>(at) = 255;
    result_.before.at<std::uint8_t>(at) = b.isAlone() ? 255 : 0;
    result_.origin.at<cv::Vec2s>(at) =
        cv::Vec2s(cv::saturate_cast<short>(origin.x), cv::saturate_cast<short>(origin.y));
  }

  const cv::Mat &hole_, &source_, &surface_;
  cv::Mat& image_;
  std::vector<cv::Vec4f> edges_;
  std::vector<LineEnd> ends_;
  std::vector<std::vector<LineEnd>> beside_;  // of each end, where a border may have it
  LineBridges result_;
};

}  // namespace

LineBridges bridgeLines(const std::vector<cv::Vec4f>& edges, const cv::Mat& hole,
                        const cv::Mat& source, const cv::Mat& surface, cv::Mat& image,
                        const Lattice* lattice) {
  return Bridger(hole, source, surface, image).run(edges, lattice);
}

LineBridges bridgeBorders(const std::vector<cv::Vec4f>& edges, const cv::Mat& hole,
                          const cv::Mat& source, cv::Mat& surface, cv::Mat& image) {
  const cv::Mat before = surface.clone();
  return Bridger(hole, source, before, image).runBorders(edges, surface);
}

}  // namespace calipso::render
