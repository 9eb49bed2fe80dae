#include "label_store.hpp"

#include <iterator>
#include <opencv2/imgcodecs.hpp>

namespace calipso::render {

void LabelStore::put(const ros::Time& stamp, const cv::Mat& labels) {
  std::vector<std::uint8_t> packed;
  cv::imencode(".png", labels, packed, {cv::IMWRITE_PNG_COMPRESSION, 1});
  packed_[stamp] = std::move(packed);
  if (limit_ > 0 && packed_.size() > limit_) packed_.erase(packed_.begin());
}

cv::Mat LabelStore::at(const ros::Time& stamp) const {
  auto it = packed_.upper_bound(stamp);
  if (it == packed_.begin()) return {};
  return cv::imdecode((--it)->second, cv::IMREAD_GRAYSCALE);
}

ros::Time LabelStore::stampAt(const ros::Time& stamp) const {
  const auto it = packed_.upper_bound(stamp);
  return it == packed_.begin() ? stamp : std::prev(it)->first;
}

}  // namespace calipso::render
