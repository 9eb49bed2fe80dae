#include "calipso_flow/vibration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

namespace calipso::flow {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;

Eigen::VectorXd evenTimes(int count, double fps) {
  return Eigen::VectorXd::LinSpaced(count, 0.0, (count - 1) / fps);
}

// Two series with a strong and a weak line, as a travelling wave gives them.
Eigen::MatrixXd twoLines(const Eigen::VectorXd& t, double f, double g) {
  Eigen::MatrixXd y(t.size(), 2);
  for (int k = 0; k < t.size(); ++k) {
    y(k, 0) = 0.3 + std::cos(kTwoPi * f * t[k] + 0.4) + 0.25 * std::cos(kTwoPi * g * t[k]);
    y(k, 1) = -0.1 + std::sin(kTwoPi * f * t[k] + 0.4) + 0.25 * std::sin(kTwoPi * g * t[k]);
  }
  return y;
}

TEST(Vibration, separatesTwoLinesInLittleMoreThanAPeriod) {
  const Eigen::VectorXd t = evenTimes(45, 30.0);
  const Spectrum spectrum = findLines(t, twoLines(t, 1.05, 1.995));
  ASSERT_GE(spectrum.lines.size(), 2u);
  // Without noise the lines are found to the refinement's tolerance.
  EXPECT_NEAR(spectrum.lines[0].frequency, 1.05, 1e-4);
  EXPECT_NEAR(spectrum.lines[1].frequency, 1.995, 1e-3);
  EXPECT_NEAR(spectrum.mean[0], 0.3, 1e-4);
  EXPECT_NEAR(spectrum.mean[1], -0.1, 1e-4);
  EXPECT_NEAR(std::abs(spectrum.lines[0].amplitude[0]), 1.0, 1e-3);
}

TEST(Vibration, findsADampedLineAtUnevenTimes) {
  Eigen::VectorXd t(60);
  for (int k = 0; k < t.size(); ++k) t[k] = (k + 0.3 * std::sin(1.7 * k)) / 30.0;
  Eigen::MatrixXd y(t.size(), 1);
  for (int k = 0; k < t.size(); ++k) {
    y(k, 0) = 0.02 * std::exp(-0.8 * t[k]) * std::sin(kTwoPi * 4.3 * t[k]);
  }
  const Spectrum spectrum = findLines(t, y);
  ASSERT_FALSE(spectrum.lines.empty());
  EXPECT_NEAR(spectrum.lines[0].frequency, 4.3, 1e-3);
  EXPECT_NEAR(spectrum.lines[0].decay, 0.8, 1e-2);
}

TEST(Vibration, statesItsUncertainty) {
  // 300 noisy repeats: the 95 % interval holds the truth in 90 to 99 %.
  const Eigen::VectorXd t = evenTimes(45, 30.0);
  const Eigen::MatrixXd clean = twoLines(t, 1.3, 3.1);
  std::mt19937 generator(5);
  std::normal_distribution<double> noise(0.0, 0.05);
  int covered = 0, found = 0;
  for (int repeat = 0; repeat < 300; ++repeat) {
    Eigen::MatrixXd y = clean;
    for (int i = 0; i < y.size(); ++i) y.data()[i] += noise(generator);
    const Spectrum spectrum = findLines(t, y);
    ASSERT_FALSE(spectrum.lines.empty());
    ++found;
    const SpectralLine& line = spectrum.lines[0];
    covered += std::abs(line.frequency - 1.3) < 1.96 * line.deviation;
  }
  EXPECT_GE(covered, 0.90 * found);
  EXPECT_LE(covered, 0.99 * found);
}

TEST(Vibration, findsNothingInNoise) {
  const Eigen::VectorXd t = evenTimes(60, 30.0);
  std::mt19937 generator(3);
  std::normal_distribution<double> noise(0.0, 0.01);
  Eigen::MatrixXd y(t.size(), 3);
  for (int i = 0; i < y.size(); ++i) y.data()[i] = noise(generator);
  EXPECT_TRUE(findLines(t, y).lines.empty());
}

// In a second nothing tells 1.2 Hz and 1.8 Hz apart, nor what takes longer than a second.
TEST(Vibration, tellsNothingApartThatTheClipDoesNot) {
  const Eigen::VectorXd t = evenTimes(31, 30.0);
  const Spectrum spectrum = findLines(t, twoLines(t, 1.2, 1.8));
  for (size_t a = 0; a < spectrum.lines.size(); ++a) {
    EXPECT_GT(spectrum.lines[a].frequency, 0.89);
    for (size_t b = 0; b < a; ++b) {
      EXPECT_GT(std::abs(spectrum.lines[a].frequency - spectrum.lines[b].frequency), 0.89);
    }
  }
}

TEST(Vibration, refusesTimesThatDoNotIncrease) {
  Eigen::VectorXd t = evenTimes(10, 30.0);
  t[5] = t[4];
  EXPECT_THROW(findLines(t, Eigen::MatrixXd::Zero(10, 1)), std::invalid_argument);
  EXPECT_THROW(findLines(evenTimes(9, 30.0), Eigen::MatrixXd::Zero(10, 1)), std::invalid_argument);
}

// A sheet in the plane y = 0 on which a wave exp(-i k.x) travels.
TEST(Vibration, tellsWhereCrestsGo) {
  constexpr int kCells = 12;
  TriangleMesh mesh;
  mesh.vertices.resize((kCells + 1) * (kCells + 1), 3);
  for (int j = 0; j <= kCells; ++j) {
    for (int i = 0; i <= kCells; ++i) {
      mesh.vertices.row(j * (kCells + 1) + i) << 0.05 * i, 0.0, 0.05 * j;
    }
  }
  mesh.triangles.resize(2 * kCells * kCells, 3);
  for (int j = 0, t = 0; j < kCells; ++j) {
    for (int i = 0; i < kCells; ++i) {
      const int a = j * (kCells + 1) + i, b = a + 1, c = a + kCells + 1, d = c + 1;
      mesh.triangles.row(t++) << a, b, d;
      mesh.triangles.row(t++) << a, d, c;
    }
  }
  const Eigen::Vector3d k(5.0, 0.0, -3.0);
  Eigen::VectorXcd travelling = Eigen::VectorXcd::Zero(3 * mesh.vertexCount()),
                   standing = travelling;
  for (int i = 0; i < mesh.vertexCount(); ++i) {
    const double phase = k.dot(mesh.vertex(i));
    travelling[3 * i + 1] = std::polar(0.1, -phase);
    standing[3 * i + 1] = std::polar(0.1 * std::cos(phase), 0.7);
  }
  const CrestTravel travel = crestTravel(mesh, travelling);
  // Linear elements of a seventh of a radian: their gradients are short by a per cent or two.
  EXPECT_LT((travel.wave_vector - k).norm(), 0.03 * k.norm());
  EXPECT_GT(travel.travelling, 0.95);
  EXPECT_LT(crestTravel(mesh, standing).travelling, 1e-6);
}

}  // namespace
}  // namespace calipso::flow
