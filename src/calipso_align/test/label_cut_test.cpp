#include "calipso_align/label_cut.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace calipso::align {
namespace {

// The energy of label_cut.hpp, written out for an image of one colour (all weights w_pq equal
// gamma, or gamma / sqrt 2 on diagonals).
double energy(const cv::Mat& labels, const std::vector<cv::Mat>& costs, double gamma) {
  double sum = 0.0;
  for (int y = 0; y < labels.rows; ++y)
    for (int x = 0; x < labels.cols; ++x) {
      sum += costs[labels.at<uchar>(y, x)].at<float>(y, x);
      const int steps[4][2] = {{1, 0}, {0, 1}, {1, 1}, {-1, 1}};
      for (const auto& [dx, dy] : steps) {
        if (x + dx < 0 || x + dx >= labels.cols || y + dy >= labels.rows) continue;
        if (labels.at<uchar>(y, x) != labels.at<uchar>(y + dy, x + dx))
          sum += gamma / std::hypot(dx, dy);
      }
    }
  return sum;
}

std::vector<cv::Mat> randomCosts(const cv::Size& size, int labels, int seed) {
  cv::RNG rng(seed);
  std::vector<cv::Mat> costs;
  for (int k = 0; k < labels; ++k) {
    cv::Mat cost(size, CV_32F);
    rng.fill(cost, cv::RNG::UNIFORM, 0.0, 3.0);
    costs.push_back(cost);
  }
  return costs;
}

TEST(LabelCut, TwoLabelsReachTheGlobalOptimum) {
  const cv::Size size(4, 3);
  const cv::Mat image(size, CV_8UC3, cv::Scalar(90, 90, 90)), free(size, CV_8U, cv::Scalar(1));
  for (int seed = 1; seed <= 5; ++seed) {
    const auto costs = randomCosts(size, 2, seed);
    cv::Mat labels = cv::Mat::zeros(size, CV_8U);
    cutLabels(image, free, costs, {0.8f, 0.0f}, labels);
    double best = std::numeric_limits<double>::max();
    for (int code = 0; code < 1 << size.area(); ++code) {
      cv::Mat candidate(size, CV_8U);
      for (int i = 0; i < size.area(); ++i)
        candidate.at<uchar>(i / size.width, i % size.width) = (code >> i) & 1;
      best = std::min(best, energy(candidate, costs, 0.8));
    }
    EXPECT_NEAR(energy(labels, costs, 0.8), best, 1e-4) << "seed " << seed;  // float sums
  }
}

TEST(LabelCut, NoSingleExpansionImprovesThreeLabels) {
  const cv::Size size(3, 3);
  const cv::Mat image(size, CV_8UC3, cv::Scalar(90, 90, 90)), free(size, CV_8U, cv::Scalar(1));
  const auto costs = randomCosts(size, 3, 11);
  cv::Mat labels = cv::Mat::zeros(size, CV_8U);
  cutLabels(image, free, costs, {0.5f, 0.0f}, labels);
  const double reached = energy(labels, costs, 0.5);
  for (int alpha = 0; alpha < 3; ++alpha)
    for (int code = 0; code < 1 << size.area(); ++code) {
      cv::Mat candidate = labels.clone();
      for (int i = 0; i < size.area(); ++i)
        if ((code >> i) & 1) candidate.at<uchar>(i / 3, i % 3) = static_cast<uchar>(alpha);
      EXPECT_GE(energy(candidate, costs, 0.5), reached - 1e-4);
    }
}

TEST(LabelCut, FixedPixelsAndForbiddenLabelsStay) {
  const cv::Size size(5, 5);
  const cv::Mat image(size, CV_8UC3, cv::Scalar(90, 90, 90));
  cv::Mat free(size, CV_8U, cv::Scalar(1)), labels = cv::Mat::zeros(size, CV_8U);
  free.at<uchar>(2, 2) = 0;
  labels.at<uchar>(2, 2) = 1;
  std::vector<cv::Mat> costs = {cv::Mat(size, CV_32F, cv::Scalar(5)),
                                cv::Mat(size, CV_32F, cv::Scalar(0))};
  costs[1].row(0).setTo(kForbidden);
  cutLabels(image, free, costs, {0.1f, 0.0f}, labels);
  EXPECT_EQ(labels.at<uchar>(2, 2), 1);
  EXPECT_EQ(cv::countNonZero(labels.row(0)), 0);
  EXPECT_EQ(cv::countNonZero(labels), 20);
}

}  // namespace
}  // namespace calipso::align
