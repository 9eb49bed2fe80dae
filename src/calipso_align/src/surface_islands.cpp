#include "calipso_align/surface_islands.hpp"

#include <algorithm>

#include "calipso_align/relief.hpp"
#include "calipso_scene/disjoint_sets.hpp"

namespace calipso::align {

cv::Mat surfaceIslands(const Relief& relief, float largest_jump) {
  const int rows = relief.state.rows, cols = relief.state.cols;
  const auto isSurface = [&](int x, int y) {
    return relief.state.at<uchar>(y, x) == Relief::kSurface;
  };
  DisjointSets sets(rows * cols);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < cols; ++x) {
      if (!isSurface(x, y)) continue;
      if (x + 1 < cols && isSurface(x + 1, y) && jump(relief, {x, y}, {1, 0}) <= largest_jump)
        sets.join(y * cols + x, y * cols + x + 1);
      if (y + 1 < rows && isSurface(x, y + 1) && jump(relief, {x, y}, {0, 1}) <= largest_jump)
        sets.join(y * cols + x, (y + 1) * cols + x);
    }
  std::vector<int> number(static_cast<size_t>(rows) * cols, 0);
  int count = 0;
  cv::Mat islands = cv::Mat::zeros(relief.state.size(), CV_32S);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < cols; ++x) {
      if (!isSurface(x, y)) continue;
      int& own = number[sets.find(y * cols + x)];
      if (own == 0) own = ++count;
      islands.at<int>(y, x) = own;
    }
  return islands;
}

cv::Mat seedsOfIslands(const cv::Mat& islands, const cv::Mat& seeds,
                       const std::vector<cv::Mat>& allowed) {
  constexpr int kSeveral = -1;
  double most = 0.0;
  cv::minMaxLoc(islands, nullptr, &most);
  std::vector<int> seed(static_cast<size_t>(most) + 1, 0);
  const auto each = [&](const auto& action) {
    for (int y = 0; y < islands.rows; ++y)
      for (int x = 0; x < islands.cols; ++x)
        if (islands.at<int>(y, x) != 0) action(cv::Point(x, y), seed[islands.at<int>(y, x)]);
  };
  each([&](const cv::Point& p, int& own) {
    const int mark = seeds.at<uchar>(p);
    if (mark != 0) own = own == 0 || own == mark ? mark : kSeveral;
  });
  each([&](const cv::Point& p, int& own) {
    if (own == 1 || (own > 1 && !allowed[own - 2].at<uchar>(p))) own = kSeveral;
  });
  cv::Mat result = cv::Mat::zeros(islands.size(), CV_8U);
  each([&](const cv::Point& p, int own) {
    result.at<uchar>(p) = static_cast<uchar>(std::max(0, own));
  });
  return result;
}

}  // namespace calipso::align
