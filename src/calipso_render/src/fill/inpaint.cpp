#include <algorithm>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "draw/side_by_side.hpp"
#include "fill/around_hole.hpp"
#include "fill/colour_trend.hpp"
#include "fill/hidden_plane.hpp"
#include "fill/hidden_sky.hpp"
#include "fill/inpaint_at_size.hpp"
#include "fill/lattice.hpp"
#include "fill/line_bridge.hpp"
#include "fill/line_ends.hpp"
#include "fill/patch_cost.hpp"
#include "fill/patch_fill.hpp"
#include "fill/pattern.hpp"
#include "fill/plane_pattern.hpp"
#include "fill/seam_blend.hpp"
#include "fill/seam_cut.hpp"
#include "fill/spline.hpp"

namespace calipso::render {
namespace {

constexpr int kLatticeMargin = 72;  // px around it in which a pattern is sought,
constexpr int kFarMargin = 216;     // ... that alone can tell a plane
constexpr float kRounded =
    1.5f;  // px by which copies are off a lattice whose shifts are no whole pixels
constexpr float kAwayOnPlane = 3.0f;  // InpaintParams::away_row there: its rows are no layers
constexpr float kAwayFromStripe = 300.0f, kAwayAlongStripe = 4.0f;  // ... where they are stripes
constexpr float kFarther = 2000.0f;  // InpaintParams::away_farther along a plane
// InpaintParams::off_colour where it does not repeat itself: two things lie in one plane, and what is
// livelier in it is a mark
constexpr float kOffColour = 1.0f;
constexpr float kPatchesLeft = 0.5f;  // of all, that must remain beside lines that are not copied
constexpr int kSkyLabel = 254;        // of the sky among surfaces
constexpr int kFewestOnPlane = 200;   // px of a plane's part of the hole, to be filled along it

InpaintParams within(const cv::Rect& window, const InpaintParams& params) {
  InpaintParams inner = params;
  const cv::Matx33d shift(1, 0, window.x, 0, 1, window.y, 0, 0, 1);
  for (cv::Matx33d& plane : inner.planes) plane = plane * shift;
  if (!params.nearness.empty()) inner.nearness = params.nearness(window).clone();
  if (!params.surface.empty()) inner.surface = params.surface(window).clone();
  if (!params.sky.empty()) inner.sky = params.sky(window).clone();
  if (!params.sure.empty()) inner.sure = params.sure(window).clone();
  return inner;
}

// Copies every pixel from its origin. @return CV_8UC1: 255 where it has one
cv::Mat copyFrom(const cv::Mat& origin, const cv::Mat& image, cv::Mat& filled) {
  cv::Mat copied = cv::Mat::zeros(origin.size(), CV_8U);
  for (int v = 0; v < origin.rows; ++v) {
    for (int u = 0; u < origin.cols; ++u) {
      const cv::Vec2s from = origin.at<cv::Vec2s>(v, u);
      if (from[0] < 0) continue;
      filled.at<cv::Vec3f>(v, u) = image.at<cv::Vec3f>(from[1], from[0]);
      copied.at<std::uint8_t>(v, u) = 255;
    }
  }
  return copied;
}

// CV_8UC1: 255 where a pixel has an origin.
cv::Mat copied(const cv::Mat& origin) {
  cv::Mat columns;
  cv::extractChannel(origin, columns, 0);
  return columns >= 0;
}

// What fills a hole and where it comes from.
struct Filling {
  cv::Mat image;   // CV_32FC3
  cv::Mat origin;  // CV_16SC2; (-1, -1) where nothing was copied
};

// The surfaces that are planes, the others unknown.
cv::Mat planesOf(const InpaintParams& params) {
  cv::Mat planes = params.surface.clone();
  if (!planes.empty()) planes.setTo(0, planes > static_cast<double>(params.planes.size()));
  return planes;
}

int patchesIn(const cv::Mat& source) {
  cv::Mat whole;
  cv::erode(source, whole, cv::Mat::ones(kPatchSide, kPatchSide, CV_8U));
  return cv::countNonZero(whole);
}

// If most of what may be copied remains.
void leaveOut(const cv::Mat& lines, cv::Mat& source) {
  cv::Mat without = source.clone();
  without.setTo(0, lines);
  if (patchesIn(without) > kPatchesLeft * patchesIn(source)) source = without;
}

// @param edges straightEdges() of the picture
// @param look is filled
// @param known CV_8UC1: what the filling has to go with; source, of it: what may be copied
Filling fill(const std::vector<cv::Vec4f>& edges, cv::Mat look, cv::Mat to_fill, cv::Mat source,
             cv::Mat known, const Pattern& pattern, InpaintParams params) {
  const cv::Mat whole_hole = to_fill.clone();
  const cv::Mat lone = !pattern.lattice ? loneLines(edges, source, look) : cv::Mat();
  const LineBridges bridges = bridgeLines(edges, to_fill, source, params.surface, look,
                                          pattern.lattice ? &*pattern.lattice : nullptr);
  const cv::Mat lines = look.clone(), guide = bridges.core & ~bridges.before;
  to_fill.setTo(0, guide);
  known |= guide;
  source.setTo(0, bridges.lines);
  if (!lone.empty()) leaveOut(lone, source);
  if (!params.sky.empty()) params.sky = hiddenSky(copiedSky(params.sky, bridges.origin));
  Filling f{look, patchOrigins(look, to_fill, source, pattern, params)};
  cutSeams(look, to_fill, source, known, params, f.origin);
  const cv::Mat without = to_fill & (copyFrom(f.origin, look, f.image) == 0);
  if (cv::countNonZero(without) > 0) smoothFill(look, to_fill, known).copyTo(f.image, without);
  if (cv::countNonZero(without) < cv::countNonZero(to_fill))
    blendSeams(to_fill, known, f.origin, planesOf(params), params.sky, f.image);
  bridges.origin.copyTo(f.origin, bridges.core);
  lines.copyTo(f.image, bridges.before);
  f.origin.setTo(cv::Scalar(-1, -1), whole_hole == 0);
  return f;
}

// A picture on its way to being filled.
struct Canvas {
  cv::Mat look, hole, source, known;
  cv::Mat origin;                               // CV_16SC2
  cv::Mat lift;                                 // InpaintResult::lift
  std::optional<std::vector<cv::Vec4f>> edges;  // straightEdges(), once sought

  // @param from what lies just beyond the picture's border stands for it
  void set(const cv::Point& p, const cv::Vec3f& colour, const cv::Point& from) {
    for (int c = 0; c < 3; ++c) look.at<cv::Vec3f>(p)[c] = std::clamp(colour[c], 0.0f, 255.0f);
    hole.at<std::uint8_t>(p) = 0, known.at<std::uint8_t>(p) = 255;
    origin.at<cv::Vec2s>(p) = {static_cast<short>(std::clamp(from.x, 0, look.cols - 1)),
                               static_cast<short>(std::clamp(from.y, 0, look.rows - 1))};
  }
};

// Every pixel of a plane's hole as the chart's nearest one was filled: a sample of the picture, as
// far off along the plane as that was copied from, and what was evened out there.
// @param wanted CV_8UC1, of the chart
void copyBack(const PlanePart& part, const Filling& filled, const cv::Mat& wanted,
              const cv::Mat& hole, Canvas& canvas) {
  const cv::Mat spline = splineOf(part.plain);
  const cv::Rect all({0, 0}, part.look.size());
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < hole.rows; ++v) {
    for (int u = 0; u < hole.cols; ++u) {
      if (hole.at<std::uint8_t>(v, u) == 0) continue;
      const cv::Point2d at = taken(part.chart.to_chart, u, v);
      const cv::Point nearest(cvRound(at.x), cvRound(at.y));
      if (!all.contains(nearest) || wanted.at<std::uint8_t>(nearest) == 0) continue;
      if (filled.origin.at<cv::Vec2s>(nearest)[0] < 0) continue;
      const cv::Vec2s& o = filled.origin.at<cv::Vec2s>(nearest);
      cv::Point2f shift(cv::Point(o[0], o[1]) - nearest);
      const auto whole = part.pattern.nearest(nearest.y, shift);
      if (whole && cv::norm(*whole - shift) < kRounded) shift = *whole;
      const cv::Point2d from = taken(part.chart.to_picture, at.x + shift.x, at.y + shift.y);
      const cv::Vec3f evened =
          filled.image.at<cv::Vec3f>(nearest) - part.look.at<cv::Vec3f>(o[1], o[0]);
      canvas.set({u, v}, sampleSpline(spline, from.x, from.y) + evened,
                 {cvRound(from.x), cvRound(from.y)});
    }
  }
}

// Fills a plane's part of the hole with copies shifted along the plane.
void fillPlane(const HiddenPlane& plane, const PlanePart& part, const InpaintParams& params,
               Canvas& canvas) {
  InpaintParams inner = params;
  inner.surface = inner.sky = cv::Mat();
  inner.from_few = false;  // what is hardly seen is filled with the rest
  inner.nearness = part.chart.carried(nearnessOf(plane.to_plane, plane.hole.size())),
  inner.away_farther = kFarther;
  const std::optional<Lattice>& lattice = part.pattern.lattice;
  inner.away_row = kAwayOnPlane;
  if (part.pattern.striped) inner.away_row = kAwayFromStripe, inner.away_column = kAwayAlongStripe;
  if (lattice) {
    // A pattern is alike all over; its light is that of the next places.
    inner.away_column = inner.away_row = params.away_row;
    // Where patches span more than two of its shifts it is grey.
    const int side = std::min(part.look.cols, part.look.rows);
    inner.coarsest_side =
        std::max(inner.coarsest_side, cvRound(kPatchSide * side / (2.0f * lattice->shortest())));
  }
  if (!lattice && !part.pattern.striped) inner.off_colour = kOffColour, inner.off_bland = 0.0f;
  const cv::Mat wanted =
      lattice ? goesOnByPattern(repeatsBy(*lattice, part.look, part.known, part.known), part.known,
                                part.hole)
              : part.hole;
  copyBack(part,
           fill(part.edges, part.look, part.hole.clone(), part.source.clone(), part.known.clone(),
                part.pattern, inner),
           wanted, plane.hole, canvas);
}

std::vector<HiddenPlane> hiddenPlanes(const InpaintParams& params, const Canvas& canvas) {
  const cv::Mat told = (params.surface > 0) & (params.surface <= params.supports) & params.sure;
  std::vector<HiddenPlane> planes;
  for (int k = 0; k < static_cast<int>(params.planes.size()); ++k) {
    const bool supports = k < params.supports;
    const cv::Mat here = params.surface == k + 1;
    cv::Mat hidden = canvas.hole & here & params.sure;
    const bool known = cv::countNonZero(hidden) >= kFewestOnPlane;
    if (!known && supports)
      hidden = canvas.hole & ~told & (nearnessOf(params.planes[k], hidden.size()) > 0.0f);
    // Where its pattern has to tell, the depth image may have taken parts of it for something else.
    const cv::Mat beside = known ? cv::Mat(canvas.source & ~here & (params.surface != 0))
                                 : cv::Mat(here.size(), CV_8U, cv::Scalar(0));
    if (known || (supports && cv::countNonZero(hidden) >= kFewestOnPlane))
      planes.push_back(
          {k + 1, params.planes[k], supports, known, hidden, canvas.source & here, beside, {}});
  }
  return planes;
}

// What is sought in the picture before any of it is filled, at the same time.
void lookAround(std::vector<HiddenPlane>& planes, Canvas& canvas) {
#pragma omp parallel for schedule(dynamic, 1) if (planes.size() > 1)
  for (std::size_t i = 0; i < planes.size(); ++i) planes[i].part = chartedPart(planes[i]);
  cv::Mat rest = canvas.hole.clone();
  std::vector<std::function<void()>> looks, lattices, later;
  for (HiddenPlane& plane : planes) {
    if (!plane.part) continue;
    const bool anyway = plane.supports && plane.part->chart.tilted;
    lattices.push_back(
        [&] { addLattice(canvas.look, plane.known ? kLatticeMargin : kFarMargin, *plane.part); });
    if (!plane.known) continue;
    if (anyway) looks.push_back([&] { addLook(canvas.look, plane.seen, *plane.part); });
    later.push_back([&, anyway] {
      const bool repeats = plane.part->pattern.lattice.has_value();
      if (!repeats && turnAlongStripes(canvas.look, plane)) return;
      if (!anyway && repeats) addLook(canvas.look, plane.seen, *plane.part);
      if (!anyway && !repeats) plane.part.reset();
    });
    if (anyway) rest.setTo(0, plane.hole);
  }
  if (cv::countNonZero(rest) > 0 && !canvas.edges)
    lattices.push_back([&] { canvas.edges = straightEdges(canvas.source, canvas.look); });
  looks.insert(looks.end(), lattices.begin(), lattices.end());
  doAll(true, looks);
  doAll(true, later);
}

// @return false: patterns tell nothing that was not known
bool followPatterns(const std::vector<HiddenPlane>& planes, const Canvas& canvas,
                    InpaintParams& params) {
  bool more = false;
  for (const HiddenPlane& plane : planes) {
    if (!plane.supports || !plane.part || !plane.part->pattern.lattice) continue;
    more |= followPattern(
        {plane.label, plane.to_plane, *plane.part->pattern.lattice, plane.hole, plane.seen},
        {canvas.look, canvas.hole, canvas.source}, kFewestOnPlane, params);
  }
  return more;
}

// Edges between two surfaces, or one and the sky, go on before these do.
void fillBorders(InpaintParams& params, Canvas& canvas) {
  double first, last;
  cv::minMaxLoc(params.surface, &first, &last, nullptr, nullptr, canvas.hole);
  if (first == last) return;
  const bool any_sky = !params.sky.empty();
  if (any_sky) params.surface.setTo(kSkyLabel, params.sky == InpaintParams::kSky);
  canvas.edges = straightEdges(canvas.source, canvas.look);
  const LineBridges borders =
      bridgeBorders(*canvas.edges, canvas.hole, canvas.source, params.surface, canvas.look);
  if (any_sky) {
    const cv::Mat sky = params.surface == kSkyLabel;
    params.sky.setTo(InpaintParams::kSky, sky), params.surface.setTo(0, sky);
  }
  canvas.hole.setTo(0, borders.core), canvas.known |= borders.core;
  borders.origin.copyTo(canvas.origin, borders.core);
}

void fillPlanes(InpaintParams& params, Canvas& canvas) {
  std::vector<HiddenPlane> planes = hiddenPlanes(params, canvas);
  lookAround(planes, canvas);
  if (followPatterns(planes, canvas, params)) {
    planes = hiddenPlanes(params, canvas);
    lookAround(planes, canvas);
  }
  for (const HiddenPlane& plane : planes) {
    if (plane.known && plane.part) fillPlane(plane, *plane.part, params, canvas);
  }
}

// How the colours of support planes change slowly over the picture; 0 elsewhere. Takes pixels along
// the borders of such planes from canvas.source: the labels are off by a pixel or two there, so that
// a copy would have a trend that is not its own.
cv::Mat supportsTrend(const InpaintParams& params, Canvas& canvas) {
  cv::Mat trend = cv::Mat::zeros(canvas.look.size(), CV_32FC3), inner, outer;
  const cv::Mat square = cv::Mat::ones(2 * kOutlineError + 1, 2 * kOutlineError + 1, CV_8U);
  for (int k = 0; k < params.supports && !params.surface.empty(); ++k) {
    const cv::Mat here = params.surface == static_cast<double>(k + 1);
    if (cv::countNonZero(here & canvas.hole) == 0) continue;
    const cv::Mat own = colourTrend(canvas.look, here & canvas.known);
    if (cv::norm(own, cv::NORM_INF) == 0.0) continue;
    own.copyTo(trend, here);
    cv::erode(here, inner, square), cv::dilate(here, outer, square);
    canvas.source.setTo(0, outer & ~inner);
  }
  return trend;
}

std::vector<cv::Vec4f> edgesIn(const cv::Rect& window, const Canvas& canvas) {
  std::vector<cv::Vec4f> edges =
      canvas.edges ? *canvas.edges : straightEdges(canvas.source, canvas.look);
  const cv::Vec4f corner(window.x, window.y, window.x, window.y);
  for (cv::Vec4f& edge : edges) edge -= corner;
  return edges;
}

void fillRest(const InpaintParams& params, Canvas& canvas) {
  const cv::Rect window =
      params.from_anywhere ? cv::Rect({0, 0}, canvas.hole.size()) : windowAround(canvas.hole);
  const cv::Mat hole = canvas.hole(window), trend = supportsTrend(params, canvas)(window);
  InpaintParams here = params;
  if (!params.sky.empty()) here.sky = copiedSky(params.sky, canvas.origin);
  Filling rest =
      fill(edgesIn(window, canvas), canvas.look(window) - trend, hole.clone(),
           canvas.source(window).clone(), canvas.known(window).clone(), {}, within(window, here));
  rest.image += trend;
  rest.image.copyTo(canvas.look(window), hole);
  cv::Mat lift = canvas.lift(window);
  for (int v = 0; v < lift.rows; ++v) {
    for (int u = 0; u < lift.cols; ++u) {
      const cv::Vec2s from = rest.origin.at<cv::Vec2s>(v, u);
      if (from[0] >= 0)
        lift.at<cv::Vec3f>(v, u) =
            trend.at<cv::Vec3f>(v, u) - trend.at<cv::Vec3f>(from[1], from[0]);
    }
  }
  cv::Mat(rest.origin + cv::Scalar(window.x, window.y))
      .copyTo(canvas.origin(window), copied(rest.origin));
}

}  // namespace

InpaintResult inpaintAtSize(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                            const InpaintParams& params) {
  CV_Assert(params.nearness.empty() ||
            (params.nearness.type() == CV_32FC1 && params.nearness.size() == hole.size()));
  InpaintResult result{image.clone(), cv::Mat(image.size(), CV_16SC2, cv::Scalar(-1, -1)),
                       cv::Mat::zeros(image.size(), CV_32FC3), true};
  if (cv::countNonZero(hole) == 0) return result;
  const cv::Rect window = params.from_anywhere ? cv::Rect({0, 0}, hole.size()) : windowAround(hole);
  Canvas canvas{image(window).clone(),
                hole(window) != 0,
                hole(window) == 0,
                {},
                result.origin(window).clone(),
                result.lift(window),
                {}};
  if (!banned.empty()) canvas.source.setTo(0, banned(window));
  canvas.known = canvas.source.clone();
  InpaintParams inner = within(window, params);
  if (inner.surface.empty()) {
    InpaintParams supposed = supposedSupports(inner, window.size());
    fillPlanes(supposed, canvas);
  } else if (!inner.sure.empty()) {
    fillBorders(inner, canvas);
    fillPlanes(inner, canvas);
  }
  if (cv::countNonZero(canvas.hole) > 0) fillRest(inner, canvas);
  const cv::Mat has_origin = copied(canvas.origin);
  result.patches_found = cv::countNonZero(has_origin) > 0;
  cv::Mat(canvas.origin + cv::Scalar(window.x, window.y)).copyTo(result.origin(window), has_origin);
  canvas.look.copyTo(result.image(window), hole(window));
  return result;
}

}  // namespace calipso::render
