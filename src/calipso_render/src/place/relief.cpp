#include "calipso_render/relief.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

Eigen::Vector3f vectorAt(const cv::Mat& picture, int u, int v) {
  const cv::Vec3f& x = picture.at<cv::Vec3f>(v, u);
  return {x[0], x[1], x[2]};
}

}  // namespace

Receiver Relief::receiver(int u, int v) const {
  return {vectorAt(position, u, v), vectorAt(normal, u, v)};
}

bool Relief::touches(int u, int v, int size) const {
  if (empty()) return false;
  const cv::Rect here =
      cv::Rect(u / kTile, v / kTile, size / kTile, size / kTile) & cv::Rect({0, 0}, tiles.size());
  return !here.empty() && cv::countNonZero(tiles(here)) > 0;
}

bool Relief::isOneWall(const cv::Rect& part) const {
  if (empty() || (part & cv::Rect({0, 0}, seen.size())) != part) return false;
  const std::uint8_t number = wall.at<std::uint8_t>(part.tl());
  const auto all = [&part](const cv::Mat& picture, std::uint8_t value) {
    for (int v = part.y; v < part.br().y; ++v) {
      const std::uint8_t* row = picture.ptr<std::uint8_t>(v) + part.x;
      if (std::any_of(row, row + part.width, [value](std::uint8_t x) { return x != value; }))
        return false;
    }
    return true;
  };
  return number != 0 && all(wall, number) && all(seen, 255);
}

void Relief::index() {
  tiles = cv::Mat::zeros((seen.rows + kTile - 1) / kTile, (seen.cols + kTile - 1) / kTile, CV_8U);
  box.setEmpty(), walls.clear();
  for (int v = 0; v < seen.rows; ++v) {
    for (int u = 0; u < seen.cols; ++u) {
      if (seen.at<std::uint8_t>(v, u) == 0) continue;
      tiles.at<std::uint8_t>(v / kTile, u / kTile) = 255;
      box.extend(vectorAt(position, u, v));
      const int number = wall.at<std::uint8_t>(v, u);
      if (number > static_cast<int>(walls.size())) walls.resize(number);
      if (number == 0) continue;
      walls[number - 1].normal = vectorAt(normal, u, v);
      walls[number - 1].box.extend(vectorAt(position, u, v));
    }
  }
}

Relief warped(const Relief& relief, const cv::Mat& map) {
  Relief out;
  if (relief.empty()) return out;
  const auto carry = [&](const cv::Mat& from, cv::Mat& to) {
    cv::remap(from, to, map, cv::noArray(), cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  };
  carry(relief.seen, out.seen), carry(relief.position, out.position),
      carry(relief.normal, out.normal), carry(relief.wall, out.wall);
  out.index();
  return out;
}

}  // namespace calipso::render
