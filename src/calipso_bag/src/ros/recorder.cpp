#include "recorder.hpp"

#include <ros/callback_queue.h>

#include <algorithm>
#include <cstdio>
#include <stdexcept>

#include "calipso_msgs/ClipDynamics.h"
#include "calipso_msgs/Dynamics.h"
#include "calipso_ros/topics.hpp"
#include "run_log.hpp"
#include "wait.hpp"

namespace calipso::bag {
namespace {

// Nothing may be lost before it is written; in a clip the player sends no more than is taken in.
constexpr unsigned kQueue = 10000;
// messages of a frame may come this much later than its image
constexpr std::size_t kLagFrames = 8;
const ros::Duration kLatest(10.0);  // by which a message of live video may come late

std::string seconds(const ros::Time& stamp) { return std::to_string(stamp.toSec()) + " s"; }

}  // namespace

Recorder::Recorder(ros::NodeHandle& nh, const Params& params)
    : params_(params),
      nh_(nh),
      output_(params.output, params.inputs),
      writer_(output_),
      reporter_(nh, "recorder") {
  summary_.output = params.output;
  subscribeFrames();
  subscribeExplanations();
  reporter_.starting("waiting for the graph");
}

void Recorder::subscribeFrames() {
  const boost::function<void(const calipso_msgs::ClipInfoConstPtr&)> on_clip =
      [this](const calipso_msgs::ClipInfoConstPtr& clip) { clip_ = *clip; };
  subscribers_.push_back(nh_.subscribe<calipso_msgs::ClipInfo>(topics::kClipInfo, 1, on_clip));
  subscribers_.push_back(nh_.subscribe(topics::kCameraInfo, kQueue, &Recorder::onInput, this));
  subscribers_.push_back(nh_.subscribe(topics::kImageEdited, kQueue, &Recorder::onEdited, this));
  record<sensor_msgs::CameraInfo>(topics::kImageEditedCameraInfo);
  record<sensor_msgs::Image>(topics::kProvenance);
  subscribers_.push_back(nh_.subscribe(topics::kState, kQueue, &Recorder::onState, this));
  subscribers_.push_back(nh_.subscribe("/tf", kQueue, &Recorder::onTf, this));
  subscribers_.push_back(nh_.subscribe("/tf_static", kQueue, &Recorder::onTf, this));
}

void Recorder::subscribeExplanations() {
  record<calipso_msgs::Dynamics>(topics::kDynamics);
  record<calipso_msgs::ClipDynamics>(topics::kClipDynamics);
  if (params_.flow) record<sensor_msgs::Image>(topics::kFlow);
  recordAndNote<calipso_msgs::AlignedModels>(topics::kModels);
  recordAndNote<calipso_msgs::Plan>(topics::kPlan);
  recordAndNote<calipso_msgs::EditReport>(topics::kEditsApplied);
  recordAndNote<calipso_msgs::Timing>(topics::kTiming);
  subscribers_.push_back(
      nh_.subscribe(topics::kSegmentation, kQueue, &Recorder::onSegmentation, this));
  subscribers_.push_back(nh_.subscribe(topics::kMarkers, kQueue, &Recorder::onMarkers, this));
  const boost::function<void(const calipso_msgs::NodeStatusConstPtr&)> on_status =
      [this](const calipso_msgs::NodeStatusConstPtr& status) { note(*status, summary_); };
  subscribers_.push_back(nh_.subscribe<calipso_msgs::NodeStatus>(topics::kStatus, 1000, on_status));
}

template <typename M>
void Recorder::write(const std::string& topic, const ros::MessageEvent<M const>& event,
                     const std::string& rank) {
  const ros::Time stamp = event.getMessage()->header.stamp;
  writer_.add(nh_.resolveName(topic), std::max(stamp, ros::TIME_MIN), rank, event.getConstMessage(),
              event.getConnectionHeaderPtr());
  ++count_[topic];
  newest_[topic] = std::max(newest_[topic], stamp);
  // Live video may have no edited frames for long; nothing comes so much later.
  if (params_.mode == Mode::kLive && stamp > ros::TIME_MIN + kLatest)
    writer_.flush(stamp - kLatest);
}

template <typename M>
void Recorder::record(const std::string& topic, Rank<M> rank) {
  const boost::function<void(const ros::MessageEvent<M const>&)> on_message =
      [this, topic, rank](const ros::MessageEvent<M const>& event) {
        write(topic, event, rank ? rank(*event.getMessage()) : std::string());
      };
  subscribers_.push_back(nh_.subscribe<M>(topic, kQueue, on_message));
}

template <typename M>
void Recorder::recordAndNote(const std::string& topic) {
  record<M>(topic, [this](const M& message) {
    note(message, summary_);
    return nextRank();
  });
}

void Recorder::onInput(const sensor_msgs::CameraInfoConstPtr& info) {
  input_.push_back(info->header.stamp);
}

void Recorder::onEdited(const ros::MessageEvent<sensor_msgs::Image const>& event) {
  const ros::Time stamp = event.getMessage()->header.stamp;
  started_over_ = started_over_ || (params_.mode == Mode::kLive && clock_.startsOver(stamp));
  if (started_over_) return;
  const bool repeated = !edited_.empty() && stamp <= edited_.back();
  if (repeated && params_.mode == Mode::kLive) {
    ROS_WARN_STREAM_THROTTLE(10.0, "not recorded: the camera's stamp " << seconds(stamp)
                                                                       << " does not come after "
                                                                       << seconds(edited_.back()));
    return;
  }
  if (repeated) {
    throw std::runtime_error("edited frame " + seconds(stamp) + " came after " +
                             seconds(edited_.back()) + "; is a second renderer running?");
  }
  if (edited_.empty()) first_edited_ = ros::WallTime::now();
  edited_.push_back(stamp);
  write(topics::kImageEdited, event, "");
  reporter_.clipFrameDone();
  summary_.edit_seconds = (ros::WallTime::now() - first_edited_).toSec();
  if (edited_.size() > kLagFrames) writer_.flush(edited_[edited_.size() - 1 - kLagFrames]);
}

// The key frame's only: later masks are tracked ones, and large.
void Recorder::onSegmentation(const ros::MessageEvent<calipso_msgs::Segmentation const>& event) {
  if (count_[topics::kSegmentation] == 0) write(topics::kSegmentation, event, "");
}

void Recorder::onState(const ros::MessageEvent<calipso_msgs::SimulationState const>& event) {
  write(topics::kState, event, "");
  state_ = event.getConstMessage();
  simulator_ = event.getPublisherName();
}

void Recorder::onMarkers(const ros::MessageEvent<visualization_msgs::MarkerArray const>& event) {
  const auto& markers = event.getMessage()->markers;
  if (markers.empty()) return;
  const ros::Time stamp = std::max(markers.front().header.stamp, ros::TIME_MIN);
  writer_.add(nh_.resolveName(topics::kMarkers), stamp, event.getPublisherName() + nextRank(),
              event.getConstMessage(), event.getConnectionHeaderPtr());
  newest_[event.getPublisherName()] = stamp;
}

// One message for each transform, so that each is found at its own stamp. Of a clip the graph's own
// alone: what runs beside it has other times.
void Recorder::onTf(const ros::MessageEvent<tf2_msgs::TFMessage const>& event) {
  const std::string own = nh_.getNamespace() + "/";
  if (params_.mode == Mode::kBag && event.getPublisherName().compare(0, own.size(), own) != 0)
    return;
  const std::string topic = event.getConnectionHeader().at("topic");
  for (const geometry_msgs::TransformStamped& transform : event.getMessage()->transforms) {
    const auto single = boost::make_shared<tf2_msgs::TFMessage>();
    single->transforms.push_back(transform);
    writer_.add<tf2_msgs::TFMessage>(topic, std::max(transform.header.stamp, ros::TIME_MIN),
                                     transform.child_frame_id, single);
    newest_[transform.child_frame_id] = transform.header.stamp;
  }
}

std::string Recorder::nextRank() {
  char rank[24];
  std::snprintf(rank, sizeof rank, "%012d", rank_++);
  return rank;
}

bool Recorder::connected() const {
  return std::all_of(subscribers_.begin(), subscribers_.end(), [this](const ros::Subscriber& s) {
    const bool needed = s.getTopic() == nh_.resolveName(topics::kImageEdited) ||
                        s.getTopic() == nh_.resolveName(topics::kImageEditedCameraInfo) ||
                        s.getTopic() == nh_.resolveName(topics::kCameraInfo);
    return !needed || s.getNumPublishers() > 0;
  });
}

bool Recorder::allEdited() const {
  return clip_.played_frames > 0 && edited_.size() >= clip_.played_frames;
}

// What a failed node would have said is not waited for.
bool Recorder::allExplained() const {
  const auto complete = [this](const std::string& topic) {
    const auto found = count_.find(topic);
    return found != count_.end() && found->second >= static_cast<int>(clip_.played_frames);
  };
  // Without the flow there is still a simulation.
  const auto& failed = summary_.failed;
  const bool simulated = failed.empty() || (failed.size() == 1 && failed.count("flow") > 0);
  return input_.size() >= clip_.played_frames && complete(topics::kImageEditedCameraInfo) &&
         complete(topics::kProvenance) && (!failed.empty() || complete(topics::kDynamics)) &&
         (!simulated || (complete(topics::kState) && lastStateExplained()));
}

// What the simulator sends with a state travels on connections of its own, and may come later.
bool Recorder::lastStateExplained() const {
  const auto reached = [this](const std::string& name, const ros::Time& stamp) {
    const auto found = newest_.find(name);
    return found != newest_.end() && found->second >= stamp;
  };
  const auto reports = count_.find(topics::kEditsApplied);
  const std::uint32_t reported = reports == count_.end() ? 0 : reports->second;
  const bool planned = state_->plan_stamp.isZero() || reached(topics::kPlan, state_->plan_stamp);
  if (!planned || reported < state_->reports) return false;
  if (state_->objects.empty()) return true;  // there is no simulation
  const ros::Time stamp = state_->header.stamp;
  return reached(simulator_, stamp) &&
         std::all_of(state_->objects.begin(), state_->objects.end(), [&](const auto& object) {
           const bool placed = object.kind == "rigid" || object.kind == "kinematic";
           return !placed || reached("object/" + object.object, stamp);
         });
}

void Recorder::run() {
  try {
    if (params_.mode == Mode::kLive)
      recordLive();
    else
      recordClip();
  } catch (const std::exception& error) {
    throw std::runtime_error(error.what() + keepIncomplete());
  }
  summary_.frames_in = static_cast<int>(input_.size());
  summary_.frames_out = static_cast<int>(edited_.size());
  writer_.flushAll();
  output_.finish();
}

// What to do with the beginning of a run. Without any frame of it nothing stays.
std::string Recorder::keepIncomplete() {
  if (edited_.empty()) return "";
  std::string lacks;
  try {
    writer_.flushAll();
  } catch (const std::exception& error) {  // as on a full disk; what is written stays
    lacks = std::string(" without the last of them (") + error.what() + ")";
  }
  return "; the bag stays incomplete, with " + std::to_string(edited_.size()) + " edited frames" +
         lacks + ", as " + output_.path() + ".active";
}

void Recorder::recordClip() {
  constexpr double kOneHourSec = 3600.0;
  while (!waitFor([this] { return connected(); }, kOneHourSec)) {
  }
  reporter_.ready("recording to " + output_.path());
  waitForEdited();
  if (!waitFor([this] { return allExplained(); }, params_.late_timeout_sec)) {
    ROS_WARN_STREAM("what explains the last frames has not all come within "
                    << params_.late_timeout_sec
                    << " s (camera_info, provenance, state, dynamics, plan, edit reports, /tf or "
                       "markers): the bag lacks it; set late_timeout_sec higher");
  }
  checkFrames();
}

// Each image has a camera_info, which comes on a connection of its own: once all of these are there
// and no image has come for long, none will.
void Recorder::waitForEdited() {
  std::size_t had = 0;
  while (!waitFor([this] { return allEdited(); }, params_.late_timeout_sec)) {
    const bool all_sent = clip_.played_frames > 0 && count_[topics::kImageEditedCameraInfo] >=
                                                         static_cast<int>(clip_.played_frames);
    if (all_sent && edited_.size() == had) {
      throw std::runtime_error(std::to_string(clip_.played_frames - had) + " of " +
                               std::to_string(clip_.played_frames) +
                               " edited images were sent and got lost; give the recorder more of "
                               "the machine, or set in_flight to 1");
    }
    had = edited_.size();
  }
}

void Recorder::recordLive() {
  reporter_.ready("recording to " + output_.path() + " until stopped");
  while (ros::ok() && !started_over_)
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
  if (started_over_)
    ROS_WARN_STREAM("the stamps went back after " << seconds(edited_.back())
                                                  << ": the recording ends there");
  if (edited_.empty())
    throw std::runtime_error("no edited frame came: nothing is recorded; does the camera publish?");
}

void Recorder::checkFrames() const {
  if (edited_ == input_) return;
  throw std::runtime_error(std::to_string(input_.size()) + " frames went in, " +
                           std::to_string(edited_.size()) + " came out, or their stamps differ");
}

}  // namespace calipso::bag
