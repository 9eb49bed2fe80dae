#include "ros/segmentation_ros.hpp"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>

#include <chrono>
#include <stdexcept>

#include "calipso_align/overlay.hpp"
#include "calipso_ros/node_main.hpp"
#include "calipso_ros/topics.hpp"
#include "calipso_scene/same_camera.hpp"
#include "ros/segmentation_conversions.hpp"

namespace calipso::align {
namespace {

// Every clip frame counts, so the queues of bag mode have no limit; a live camera's frames may
// drop.
constexpr unsigned kUnlimited = 0, kLiveQueue = 2;
constexpr bool kLatched = true;

double millisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

}  // namespace

SegmentationNodeParams loadSegmentationParams(const ros::NodeHandle& pnh) {
  SegmentationNodeParams params;
  params.scene = pathParam(pnh, "scene");
  params.mode = modeParam(pnh);
  params.use_depth = optionalParam(pnh, "use_depth", params.use_depth);
  return params;
}

SegmentationRos::SegmentationRos(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : params_(loadSegmentationParams(pnh)),
      scene_(loadScene(params_.scene)),
      reporter_(nh, "segmentation"),
      strokes_(loadStrokes(scene_)) {
  const bool bag = params_.mode == Mode::kBag;
  segmentation_publisher_ = nh.advertise<calipso_msgs::Segmentation>(
      topics::kSegmentation, kUnlimited,
      [this](const ros::SingleSubscriberPublisher& subscriber) { onSubscriber(subscriber); });
  overlay_publisher_ = nh.advertise<sensor_msgs::Image>(topics::kOverlay, 1, kLatched);
  strokes_subscriber_ = nh.subscribe(topics::kStrokes, 1, &SegmentationRos::onStrokes, this);
  image_subscriber_ = nh.subscribe(bag ? topics::kClipImage : topics::kImage,
                                   bag ? kUnlimited : kLiveQueue, &SegmentationRos::onImage, this);
  reporter_.starting("waiting for the key frame");
}

// A subscriber that comes late gets the key frame first: latching alone would give it the last one.
void SegmentationRos::onSubscriber(const ros::SingleSubscriberPublisher& subscriber) {
  if (key_message_) subscriber.publish(*key_message_);
}

// A latched image can come twice to a subscriber that connects while it is published.
void SegmentationRos::onImage(const sensor_msgs::ImageConstPtr& msg) {
  if (msg->header.stamp == last_stamp_) {
    if (last_stamp_.isZero())
      reporter_.warn(last_stamp_, "an image's stamp is 0; the camera's driver must stamp them");
    return;
  }
  last_stamp_ = msg->header.stamp;
  if (params_.mode == Mode::kLive && clock_.startsOver(last_stamp_)) startOver();
  try {
    if (key_image_.empty())
      adoptKeyFrame(msg);
    else if (tracker_)
      trackFrame(msg);
  } catch (const std::exception& error) {
    reporter_.failed(error.what());
  }
  if (params_.mode == Mode::kBag) reporter_.clipFrameDone();
}

// The frame at hand is to become the key frame.
void SegmentationRos::startOver() {
  reporter_.remark(kStartsOver);
  key_image_.release();
  key_message_.reset();
  segmenter_.reset();
  tracker_.reset();
}

void SegmentationRos::onStrokes(const sensor_msgs::ImageConstPtr& msg) {
  try {
    const cv::Mat strokes = labelsFromMsg(*msg);
    const bool tracked = tracker_ && last_stamp_ != key_header_.stamp;
    if (tracked && params_.mode == Mode::kBag)
      throw std::runtime_error(
          "strokes come after frames have got their masks; save them as the scene's strokes.png "
          "and start again");
    if (!key_image_.empty()) segment(strokes);
    strokes_ = strokes;
    if (tracked)
      reporter_.remark(
          "with new strokes masks start over from the key frame: what has moved far since may be "
          "lost");
  } catch (const std::exception& error) {
    reporter_.warn(msg->header.stamp, error.what());
    if (key_message_)
      reporter_.ready("the segmentation before these strokes stands");
    else if (!key_image_.empty())
      reporter_.failed(error.what());
  }
}

// A picture of another size is not kept: one of the right size may follow.
void SegmentationRos::adoptKeyFrame(const sensor_msgs::ImageConstPtr& msg) {
  const cv::Mat image = colourImageFromMsg(msg);
  Camera camera = scene_.camera;
  camera.width = image.cols;
  camera.height = image.rows;
  checkSameCamera(scene_, camera);
  key_image_ = image.clone();
  key_header_ = msg->header;
  segment(strokes_);
}

// Where this throws nothing has changed, but that colours are learnt anew the next time: a segmenter
// that gives up is left half way.
void SegmentationRos::segment(const cv::Mat& strokes) {
  reporter_.preparing("segmenting the key frame");
  const auto start = std::chrono::steady_clock::now();
  std::unique_ptr<Segmenter> segmenter = std::move(segmenter_);
  if (!segmenter)
    // A live camera's first frame is not the picture that the scene's depth image was taken with.
    segmenter = std::make_unique<Segmenter>(
        makeSegmenter(key_image_, scene_, params_.use_depth && params_.mode == Mode::kBag));
  const KeyFrame key = segmentKeyFrame(key_image_, *segmenter, strokes);
  tracker_ = std::make_unique<MaskTracker>(key_image_, key.labels, key.models);
  segmenter_ = std::move(segmenter);
  labels_ = key.labels;
  key_message_ = boost::make_shared<calipso_msgs::Segmentation>(
      toMsg(key_header_, key.labels, key.contours, 1.0f));
  segmentation_publisher_.publish(key_message_);
  publishOverlay(key);
  for (const std::string& remark : key.remarks) reporter_.remark(remark);
  reporter_.timing(key_header_.stamp, millisecondsSince(start));
  reporter_.ready("key frame segmented");
}

// Who waits for the labels of a frame gets some, even if the frame cannot be read: those of the
// frame before.
void SegmentationRos::trackFrame(const sensor_msgs::ImageConstPtr& msg) {
  const auto start = std::chrono::steady_clock::now();
  TrackedMask tracked{labels_, 0.0f};
  try {
    tracked = tracker_->track(colourImageFromMsg(msg));
    labels_ = tracked.labels;
  } catch (const std::exception& error) {
    reporter_.warn(msg->header.stamp, error.what());
  }
  segmentation_publisher_.publish(toMsg(msg->header, tracked.labels, {}, tracked.confidence));
  reporter_.timing(msg->header.stamp, millisecondsSince(start));
}

void SegmentationRos::publishOverlay(const KeyFrame& key) {
  const cv::Mat picture = drawOverlay(key_image_, key.labels, key.contours);
  overlay_publisher_.publish(
      cv_bridge::CvImage(key_header_, sensor_msgs::image_encodings::BGR8, picture).toImageMsg());
}

}  // namespace calipso::align
