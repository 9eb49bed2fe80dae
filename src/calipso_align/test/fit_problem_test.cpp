#include "calipso_align/fit_problem.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <random>

#include "calipso_align/rough_fit.hpp"
#include "calipso_align/trust.hpp"
#include "synthetic_shape.hpp"

namespace calipso::align {
namespace {

constexpr float kWallDepth = 6.0f;  // m, behind the pear at 3 m

struct Seen {
  Camera camera = test::frontCamera();
  TriangleMesh mesh = test::pear();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::vector<ContourLoop> contour = test::contourOf(mesh, pose, camera);
  AlignOptions options;

  // The pear in front of a wall.
  cv::Mat1f depth() const {
    const DepthRendering rendering =
        renderDepth(test::inCamera(camera, pose, mesh.vertices), mesh.triangles, camera);
    cv::Mat1f picture(camera.height, camera.width, kWallDepth);
    cv::Mat1f part = picture(rendering.roi);
    rendering.depth.copyTo(part, rendering.depth > 0.0f);
    return picture;
  }
  FitProblem problem() const { return makeFitProblem(mesh, camera, pose, contour, options); }
};

long knownPoints(const FitProblem& problem, bool right, double middle) {
  return std::count_if(
      problem.target.points.begin(), problem.target.points.end(),
      [&](const TargetPoint& p) { return p.known && (p.pixel.x() > middle) == right; });
}

// Points in between, each off by noise: what a hand drawn or scattered contour looks like.
std::vector<ContourLoop> denseAndNoisy(const std::vector<ContourLoop>& contour, double noise_px) {
  constexpr int kParts = 6;
  std::mt19937 generator(7);
  std::normal_distribution<double> normal(0.0, noise_px);
  std::vector<ContourLoop> loops;
  for (const ContourLoop& loop : contour) {
    ContourLoop dense;
    for (size_t i = 0; i < loop.points.size() * kParts; ++i) {
      const Eigen::Vector2d a = loop.points[i / kParts];
      const Eigen::Vector2d b = loop.points[(i / kParts + 1) % loop.points.size()];
      dense.points.push_back(a + (b - a) * (i % kParts) / kParts +
                             Eigen::Vector2d(normal(generator), normal(generator)));
    }
    dense.known.assign(dense.points.size(), true);
    dense.confidence.assign(dense.points.size(), 1.0f);
    loops.push_back(dense);
  }
  return loops;
}

TEST(FitProblem, NoiseDoesNotThinTheTarget) {
  Seen seen;
  const size_t clean = seen.problem().target.points.size();
  seen.contour = denseAndNoisy(seen.contour, 3.0);
  const ContourTarget target = seen.problem().target;
  EXPECT_NEAR(target.noise_px, 3.0, 0.5);
  EXPECT_NEAR(target.points.size(), clean, 0.15 * clean);  // the contour's corners are cut a little
}

TEST(FitProblem, ContourOfAnOccluderIsUnknown) {
  for (const float nearer : {1.5f, 2.8f}) {  // m; the second is a tenth of the pear before it
    Seen seen;
    cv::Mat1f depth = seen.depth();
    const double middle = seen.camera.cx;
    seen.options.depth = DepthObservation{depth};
    const long right = knownPoints(seen.problem(), true, middle);
    // Everything right of the middle that is not the pear comes nearer than it.
    for (float& d : cv::Mat1f(depth.colRange(static_cast<int>(middle) + 1, depth.cols))) {
      if (d == kWallDepth) d = nearer;
    }
    seen.options.depth = DepthObservation{depth};
    const FitProblem hidden = seen.problem();
    EXPECT_GT(right, 50);
    EXPECT_LT(knownPoints(hidden, true, middle), right / 10) << nearer;
    EXPECT_GT(knownPoints(hidden, false, middle), right / 2) << nearer;
    EXPECT_LT(hidden.target.known_length_px, 0.7 * hidden.target.length_px) << nearer;
  }
}

// The lower half stands behind a wall, and the model was placed a twentieth of the distance off.
TEST(RoughFit, GoesToWhatIsSeenOfAnObjectThatIsHalfHidden) {
  Seen seen;
  const Points truth = test::inCamera(seen.camera, seen.pose, seen.mesh.vertices);
  cv::Mat1f depth = seen.depth();
  cv::Mat1b mask = fillContour(seen.contour, depth.size());
  const int half = depth.rows / 2;
  depth.rowRange(half, depth.rows) = 2.0f;
  mask.rowRange(half, mask.rows) = 0;
  seen.contour = traceLoops(mask / 255, 1, {});
  seen.options.depth = DepthObservation{depth};
  seen.pose.translation() = Eigen::Vector3d(0.12, 0.0, -0.09);
  const FitProblem problem = seen.problem();
  LowOrderMap map(problem.X);
  placeRoughly(problem, map);
  const Points off = map.apply(problem.X) - truth;
  EXPECT_LT(off.colwise().mean().norm(), 0.02);  // m: three pixels
}

// A pole of 0.8 m whose end alone is seen, and a pear through a round window.
TEST(RoughFit, WhatShowsLittleOfItselfIsNotOfAnotherUnit) {
  Seen pole;
  pole.mesh = test::box({0.02, 0.4, 0.02});
  pole.contour = test::contourOf(pole.mesh, pole.pose, pole.camera);
  EXPECT_TRUE(checkPlacement(pole.problem()).usable);
  Seen pear;
  cv::Mat1b window = cv::Mat1b::zeros(pear.camera.height, pear.camera.width);
  cv::circle(window, {160, 120}, 12, 1, cv::FILLED);
  pear.contour = traceLoops(window, 1, {});
  EXPECT_FALSE(checkPlacement(pear.problem()).usable);
  pear.contour[0].known.assign(pear.contour[0].points.size(), false);
  EXPECT_TRUE(checkPlacement(pear.problem()).usable);
  pear.mesh.vertices *= 100.0;  // in centimetres
  EXPECT_FALSE(checkPlacement(pear.problem()).usable);
}

// A rail that was taken in: two pixels high, where the pear has nothing as thin.
TEST(FitProblem, ASpurNarrowerThanTheModelIsNotItsOwn) {
  const Seen seen;
  cv::Mat1b mask = fillContour(seen.contour, {seen.camera.width, seen.camera.height});
  const cv::Rect body = cv::boundingRect(mask);
  mask(cv::Rect(body.x + body.width / 2, body.y + body.height / 2, body.width, 2)).setTo(255);
  const FitProblem problem = makeFitProblem(seen.mesh, seen.camera, seen.pose,
                                            traceLoops(mask / 255, 1, {}), seen.options);
  for (const TargetPoint& p : problem.target.points) {
    if (p.pixel.x() > body.x + body.width + 3) {
      EXPECT_TRUE(p.foreign && !p.known);
    } else if (p.pixel.x() < body.x + body.width / 2) {
      EXPECT_FALSE(p.foreign);
    }
  }
  EXPECT_LT(assess(problem, problem.X).open, 0.005);  // nor does it count as left open
}

TEST(FitProblem, ContourOnASupportPlaneIsUnknown) {
  Seen seen;
  const double water = -0.2;  // m; the pear reaches down to -0.5
  cv::Mat1f depth = seen.depth();
  cv::Mat1b mask = fillContour(seen.contour, depth.size());
  int line = 0;  // the lowest row where the pear is seen
  for (int v = 0; v < depth.rows; ++v) {
    const double below = (v - seen.camera.cy) / seen.camera.fy;  // of a ray of depth 1
    const float surface = below > 0.0 ? static_cast<float>(-water / below) : kWallDepth;
    for (int u = 0; u < depth.cols; ++u) {
      if (surface < depth(v, u)) mask(v, u) = 0;
      if (mask(v, u)) line = v;
      depth(v, u) = std::min(depth(v, u), surface);
    }
  }
  seen.contour = traceLoops(mask / 255, 1, {});
  seen.options.depth = DepthObservation{depth};
  const auto known_at_line = [&](const FitProblem& problem) {
    return std::count_if(problem.target.points.begin(), problem.target.points.end(),
                         [&](const TargetPoint& p) { return p.known && p.pixel.y() > line - 1.0; });
  };
  EXPECT_GT(known_at_line(seen.problem()), 10);
  seen.options.planes.push_back({"water", Eigen::Vector3d::UnitZ(), water, std::nullopt});
  EXPECT_LT(known_at_line(seen.problem()), 3);
}

// Its top is seen at 8 degrees, which tells nothing, its front is less than a pixel high.
TEST(FitProblem, WhatTheDepthImageDoesNotShowStandsOnItsPlane) {
  Seen seen;
  seen.mesh = test::box({0.4, 0.4, 0.001});
  seen.pose.linear() = Eigen::AngleAxisd(0.14, Eigen::Vector3d::UnitX()).toRotationMatrix();
  seen.contour = test::contourOf(seen.mesh, seen.pose, seen.camera);
  seen.options.depth = DepthObservation{seen.depth()};
  const double lowest = transformed(seen.pose, seen.mesh.vertices).col(2).minCoeff();
  seen.options.planes.push_back({"table", Eigen::Vector3d::UnitZ(), lowest, std::nullopt});
  EXPECT_TRUE(seen.problem().depth.empty());
  EXPECT_TRUE(seen.problem().supports[0].stands);
  seen.mesh = test::box({0.2, 0.2, 0.2});
  seen.contour = test::contourOf(seen.mesh, seen.pose, seen.camera);
  seen.options.depth = DepthObservation{seen.depth()};
  EXPECT_FALSE(seen.problem().depth.empty());
}

TEST(ContourTerm, AnUnknownEdgeOnlyPullsOutwards) {
  Seen seen;
  for (ContourLoop& loop : seen.contour) loop.known.assign(loop.known.size(), false);
  const FitProblem problem = seen.problem();
  const auto pulls = [&](double scale) {
    const Eigen::RowVector3d c = problem.X.colwise().mean();
    const Points x = (scale * (problem.X.rowwise() - c)).rowwise() + c;
    const DepthRendering rendering = renderDepth(x, problem.topology.triangles(), problem.camera);
    ContourTermOptions options;
    options.tangential = 0.0;
    const Rows rows = contourRows(
        problem.target, occludingContour(x, problem.topology, rendering, problem.camera, 2.0),
        problem.camera, options);
    double sum = 0.0;
    for (const PointRow& row : rows) sum += row.weight * std::abs(row.r);
    return sum;
  };
  EXPECT_GT(pulls(0.8), 0.0);
  EXPECT_EQ(pulls(1.2), 0.0);
}

TEST(Trust, NoiseOpensNothing) {
  Seen seen;
  seen.contour = denseAndNoisy(seen.contour, 4.0);
  const FitProblem problem = seen.problem();
  const FitQuality quality = assess(problem, problem.X);
  // The true placement: what is open or sticks out is the noise that smoothing leaves, under a
  // pixel.
  EXPECT_LT(quality.open, 0.005);
  EXPECT_LT(quality.protruding, 0.005);
  EXPECT_TRUE(judge(problem, seen.contour, quality, 1.0, 0.0, {}).trusted);
}

TEST(Trust, AVaseSpinsAndAPearAndABoxDoNot) {
  constexpr int kSegments = 16;
  TriangleMesh vase = test::pear(18, kSegments);
  for (int i = 0; i < vase.vertexCount(); ++i) {
    const double turn = 2.0 * M_PI * (i - 2) / kSegments, z = vase.vertices(i, 2);
    const double radius =
        i < 2 ? 0.0 : (0.2 - 0.1 * z) * std::sqrt(std::max(0.0, 1.0 - 4.0 * z * z));
    vase.vertices.row(i) << radius * std::cos(turn), radius * std::sin(turn), z;
  }
  const std::optional<Eigen::Vector3d> axis = spinAxis(vase.vertices, vase.triangles);
  ASSERT_TRUE(axis.has_value());
  EXPECT_GT(std::abs(axis->z()), 0.99);
  for (const TriangleMesh& mesh :
       {test::pear(), test::box({0.25, 0.2, 0.3}), test::box({0.2, 0.2, 0.4})})
    EXPECT_FALSE(spinAxis(mesh.vertices, mesh.triangles).has_value());
}

TEST(Trust, AnUncertainDistanceIsRemarked) {
  const Seen seen;
  const FitProblem problem = seen.problem();
  const FitQuality fits = assess(problem, problem.X);
  EXPECT_EQ(judge(problem, seen.contour, fits, 1.0, 0.009, {}).reason.find("distance"),
            std::string::npos);
  const Verdict verdict = judge(problem, seen.contour, fits, 1.0, 0.025, {});
  EXPECT_TRUE(verdict.trusted);
  EXPECT_NE(verdict.reason.find("distance uncertain by 2.5 %"), std::string::npos)
      << verdict.reason;
}

TEST(Trust, AModelThatSticksOutOrFallsShortIsNotTrusted) {
  const Seen seen;
  const FitProblem problem = seen.problem();
  const FitQuality fits = assess(problem, problem.X);
  EXPECT_GT(fits.met, 0.99);
  EXPECT_EQ(fits.protruding, 0.0);
  EXPECT_TRUE(judge(problem, seen.contour, fits, 1.0, 0.0, {}).trusted);

  // One end drawn out: most of the contour is still met.
  Points x = problem.X;
  const double end = x.col(1).minCoeff();
  for (int i = 0; i < x.rows(); ++i) {
    if (x(i, 1) < 0.6 * end) x(i, 1) -= 0.8 * (0.6 * end - x(i, 1));
  }
  const FitQuality drawn = assess(problem, x);
  EXPECT_GT(drawn.protruding, 0.02);
  EXPECT_FALSE(judge(problem, seen.contour, drawn, 1.0, 0.0, {}).trusted);

  // One end pushed in.
  for (int i = 0; i < x.rows(); ++i) x(i, 1) = std::max(problem.X(i, 1), 0.7 * end);
  const FitQuality pushed = assess(problem, x);
  EXPECT_GT(pushed.open, 0.02);
  EXPECT_EQ(pushed.protruding, 0.0);
  EXPECT_FALSE(judge(problem, seen.contour, pushed, 1.0, 0.0, {}).trusted);
}

}  // namespace
}  // namespace calipso::align
