#include "texture/pattern_motifs.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kLevels = 16;                      // of each channel
constexpr int kLike = 2;                         // levels that like colours are apart, at most
constexpr int kSquare = 12;                      // px
constexpr int kFewest = 14;                      // pixels by which a square shows a colour
constexpr float kRare = 0.25f, kAllOver = 0.5f;  // of the sample; of its squares
constexpr int kSpot = 5;                         // px that spots are wide, at most
constexpr double kPiece = 0.1;  // of what is known that a band leaves on either side
constexpr int kHardly = 2;  // times as many pixels of single things as of others have their colours
constexpr int kMixed = 3;   // px of a rim

int levelOf(float code) {
  return std::clamp(static_cast<int>(code) * kLevels / 256, 0, kLevels - 1);
}
std::size_t colourOf(const cv::Vec3f& code) {
  return (static_cast<std::size_t>(levelOf(code[0])) * kLevels + levelOf(code[1])) * kLevels +
         levelOf(code[2]);
}

// For every colour the pixels of a part of the picture that are like it.
std::vector<int> likeCounts(const cv::Mat& colour, const cv::Mat& known) {
  std::vector<int> counts(kLevels * kLevels * kLevels, 0), sums(counts.size());
  for (int v = 0; v < colour.rows; ++v) {
    for (int u = 0; u < colour.cols; ++u)
      counts[colourOf(colour.at<cv::Vec3f>(v, u))] += known.at<std::uint8_t>(v, u) != 0;
  }
  for (const int step : {1, kLevels, kLevels * kLevels}) {
    for (int i = 0; i < static_cast<int>(counts.size()); ++i) {
      const int level = i / step % kLevels;
      sums[i] = 0;
      for (int k = std::max(0, level - kLike); k <= std::min(kLevels - 1, level + kLike); ++k)
        sums[i] += counts[i + (k - level) * step];
    }
    counts.swap(sums);
  }
  return counts;
}

cv::Mat squareOf(int side) { return cv::Mat::ones(side, side, CV_8U); }

// Colours that are rare in a sample, and not all over it.
std::vector<bool> rareColours(const cv::Mat& colour, const cv::Mat& known) {
  const std::vector<int> all = likeCounts(colour, known);
  std::vector<int> showing(all.size(), 0);
  int squares = 0;
  for (int v = 0; v < colour.rows; v += kSquare) {
    for (int u = 0; u < colour.cols; u += kSquare) {
      const cv::Rect square =
          cv::Rect(u, v, kSquare, kSquare) & cv::Rect(cv::Point(), colour.size());
      if (cv::countNonZero(known(square)) < kSquare * kSquare / 2) continue;
      const std::vector<int> here = likeCounts(colour(square), known(square));
      for (std::size_t i = 0; i < here.size(); ++i) showing[i] += here[i] >= kFewest;
      ++squares;
    }
  }
  std::vector<bool> rare;
  for (std::size_t i = 0; i < all.size(); ++i)
    rare.push_back(all[i] < kRare * cv::countNonZero(known) && showing[i] < kAllOver * squares);
  return rare;
}

// Where a picture has one of some colours, in parts that are larger than spots. A number from 1 on
// for each of them; CV_32SC1.
cv::Mat largeParts(const std::vector<bool>& some, const cv::Mat& colour, const cv::Mat& known) {
  cv::Mat all = cv::Mat::zeros(colour.size(), CV_8U), inner, labels;
  for (int v = 0; v < colour.rows; ++v) {
    for (int u = 0; u < colour.cols; ++u) {
      if (known.at<std::uint8_t>(v, u) != 0 && some[colourOf(colour.at<cv::Vec3f>(v, u))])
        all.at<std::uint8_t>(v, u) = 255;
    }
  }
  cv::morphologyEx(all, all, cv::MORPH_CLOSE, squareOf(kMixed));
  cv::erode(all, inner, squareOf(kSpot), {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  std::vector<bool> large(cv::connectedComponents(all, labels), false);
  const auto forEach = [&](auto act) {
    for (int v = 0; v < all.rows; ++v) {
      for (int u = 0; u < all.cols; ++u) act(labels.at<int>(v, u), v, u);
    }
  };
  forEach([&](int part, int v, int u) {
    if (part > 0 && inner.at<std::uint8_t>(v, u) != 0) large[part] = true;
  });
  forEach([&](int& part, int, int) { part = large[part] ? part : 0; });
  return labels;
}

// Connected parts that are not small.
int piecesOf(const cv::Mat& known, double smallest) {
  cv::Mat labels, numbers, middles;
  const int count = cv::connectedComponentsWithStats(known, labels, numbers, middles);
  int pieces = 0;
  for (int k = 1; k < count; ++k) pieces += numbers.at<int>(k, cv::CC_STAT_AREA) > smallest;
  return pieces;
}

// The parts that do not part what is known in two.
cv::Mat singleThings(const cv::Mat& parts, const cv::Mat& known) {
  cv::Mat wide, things = cv::Mat::zeros(parts.size(), CV_8U);
  const double smallest = kPiece * cv::countNonZero(known);
  const int pieces = piecesOf(known, smallest);
  double last = 0.0;
  cv::minMaxLoc(parts, nullptr, &last);
  for (int k = 1; k <= static_cast<int>(last); ++k) {
    const cv::Mat part = parts == k;
    if (cv::countNonZero(part) == 0) continue;
    cv::dilate(part, wide, squareOf(kSpot));
    if (piecesOf(known & ~wide, smallest) <= pieces) things |= part;
  }
  return things;
}

}  // namespace

PatternMotifs::PatternMotifs(const cv::Mat& colour, const cv::Mat& known) {
  const cv::Mat things = singleThings(largeParts(rareColours(colour, known), colour, known), known);
  const std::vector<int> of_things = likeCounts(colour, things & known),
                         others = likeCounts(colour, known & ~things);
  for (std::size_t i = 0; i < others.size(); ++i)
    of_motif_.push_back(of_things[i] >= kFewest && of_things[i] > kHardly * others[i]);
}

cv::Mat PatternMotifs::in(const cv::Mat& colour, const cv::Mat& known) const {
  cv::Mat motifs;
  cv::dilate(largeParts(of_motif_, colour, known) > 0, motifs, squareOf(2 * kMixed + 1));
  return motifs;
}

}  // namespace calipso::render
