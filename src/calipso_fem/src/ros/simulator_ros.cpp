#include "simulator_ros.hpp"

#include <calipso_msgs/Plan.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <boost/make_shared.hpp>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/same_message.hpp"
#include "calipso_ros/topics.hpp"
#include "world_conversions.hpp"
#include "world_markers.hpp"

namespace calipso::fem {
namespace {

constexpr unsigned kKeepAll = 0;     // in bag mode nothing may be lost
constexpr double kFarAhead = 600.0;  // s past live video, at which no edit is meant

}  // namespace

SimulatorRos::SimulatorRos(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : params_(loadSimulatorParams(pnh)),
      scene_(loadScene(params_.scene_directory)),
      reporter_(nh, "simulator") {
  if (scene_.fps > 0.0) params_.world.frame_period = 1.0 / scene_.fps;
  constexpr bool kLatched = true;
  state_ = nh.advertise<calipso_msgs::SimulationState>(topics::kState, 1000);
  plan_ = nh.advertise<calipso_msgs::Plan>(topics::kPlan, 1, kLatched);
  applied_ = nh.advertise<calipso_msgs::EditReport>(topics::kEditsApplied, 1000);
  markers_ = nh.advertise<visualization_msgs::MarkerArray>(topics::kMarkers, 2);
  const unsigned queue = params_.mode == Mode::kLive ? 2 : kKeepAll;
  subscribers_ = {
      nh.subscribe(topics::kModels, 1, &SimulatorRos::onModels, this),
      nh.subscribe(topics::kEdits, kKeepAll, &SimulatorRos::onEdit, this),
      nh.subscribe(topics::kCameraInfo, queue, &SimulatorRos::onFrame, this),
  };
  if (params_.mode == Mode::kLive) {
    subscribers_.push_back(nh.subscribe(topics::kDynamics, queue, &SimulatorRos::onDynamics, this));
    subscribers_.push_back(
        nh.subscribe(topics::kClipDynamics, 1, &SimulatorRos::onLiveModes, this));
  } else {
    subscribers_.push_back(nh.subscribe(topics::kClipInfo, 1, &SimulatorRos::onClipInfo, this));
    subscribers_.push_back(
        nh.subscribe(topics::kClipDynamics, 1, &SimulatorRos::onClipDynamics, this));
    subscribers_.push_back(nh.subscribe(topics::kStatus, 100, &SimulatorRos::onStatus, this));
  }
  reporter_.starting("waiting for models");
}

// Latched messages can come twice; the world must not start anew for that.
void SimulatorRos::onModels(const calipso_msgs::AlignedModelsConstPtr& models) {
  if (models_ && sameMessage(*models_, *models)) return;
  models_ = models;
  prepare();
}

void SimulatorRos::onClipInfo(const calipso_msgs::ClipInfoConstPtr& info) {
  if (first_stamp_) return;
  first_stamp_ = info->header.stamp;
  clip_ = info;
  if (info->fps > 0.0) params_.world.frame_period = 1.0 / info->fps;
  prepare();
}

void SimulatorRos::onClipDynamics(const calipso_msgs::ClipDynamicsConstPtr& clip) {
  if (clip_dynamics_ && sameMessage(*clip_dynamics_, *clip)) return;
  clip_dynamics_ = clip;
  prepare();
}

// Without the flow nothing is known to move, and every other edit still works.
void SimulatorRos::onStatus(const calipso_msgs::NodeStatusConstPtr& status) {
  if (status->node != "flow" || status->state != calipso_msgs::NodeStatus::FAILED || clip_dynamics_)
    return;
  reporter_.remark("how things move in the video is not known, flow failed: " + status->message);
  clip_dynamics_ = boost::make_shared<const calipso_msgs::ClipDynamics>();
  prepare();
}

void SimulatorRos::onDynamics(const calipso_msgs::DynamicsConstPtr& dynamics) {
  if (!(world_ && first_stamp_) || !clock_.covers(dynamics->header.stamp)) return;
  take(*dynamics);
  for (const auto& object : dynamics->objects) {
    for (const auto& wind : object.wind)
      world_->addObservedWind(object.object, fromMsg(wind, *first_stamp_));
  }
}

// Live, a deforming object's modes come with what the last seconds tell; they stay the same.
void SimulatorRos::onLiveModes(const calipso_msgs::ClipDynamicsConstPtr& dynamics) {
  if (!world_ || !clock_.covers(dynamics->header.stamp)) return;
  try {
    for (const auto& object : dynamics->objects) {
      if (!object.modes.empty()) world_->addObservedModes(object.object, shapesOf(object.modes));
    }
  } catch (const std::invalid_argument& error) {
    reporter_.warn(dynamics->header.stamp, error.what());
  }
}

void SimulatorRos::prepare() {
  if (!models_) return;
  if (params_.mode == Mode::kBag && !(first_stamp_ && clip_dynamics_)) {
    reporter_.preparing("models are there; waiting for the clip's dynamics");
    return;
  }
  try {
    world_ = std::make_unique<World>(toWorldScene(scene_, *models_), params_.world);
    said_before_ = said_;
  } catch (const std::exception& error) {
    reporter_.failed(error.what());
    return;
  }
  if (params_.mode == Mode::kLive) {
    world_->prepareForEdits();
  } else {
    for (const auto& frame : clip_dynamics_->frames) take(frame);
    for (const auto& object : clip_dynamics_->objects) take(object);
    world_->allCollisionsKnown();
  }
  if (first_stamp_) submitAll();
  publishPlan(models_->header.stamp);
  reporter_.ready(std::to_string(models_->models.size()) + " objects");
}

void SimulatorRos::take(const calipso_msgs::Dynamics& dynamics) {
  for (const auto& object : dynamics.objects) {
    if (object.tracks == 0) continue;  // no estimate
    try {
      world_->addObservedMotion(object.object,
                                fromMsg(object, (dynamics.header.stamp - *first_stamp_).toSec()));
    } catch (const std::invalid_argument& error) {
      reporter_.warn(dynamics.header.stamp, error.what());
    }
  }
}

void SimulatorRos::take(const calipso_msgs::ObjectClipDynamics& object) {
  try {
    if (!object.modes.empty()) world_->addObservedModes(object.object, shapesOf(object.modes));
  } catch (const std::invalid_argument& error) {
    reporter_.warn(clip_dynamics_->header.stamp, error.what());
  }
  if (object.falls)
    world_->addObservedGravity(calipso::fromMsg(object.gravity), object.gravity_deviation);
  for (const auto& wind : object.wind)
    world_->addObservedWind(object.object, fromMsg(wind, *first_stamp_));
  for (const auto& collision : object.collisions)
    world_->addCollision(object.object, (collision.stamp - *first_stamp_).toSec());
}

void SimulatorRos::onEdit(const calipso_msgs::EditConstPtr& edit) {
  const std::string wrong = whyImpossible(*edit);
  if (wrong.empty()) {
    edits_.push_back(*edit);
    if (world_ && first_stamp_) submit(*edit);
  } else {
    send(refusal(*edit, wrong));
  }
  reporter_.editReceived();
}

// What no world can know; empty: nothing is wrong.
std::string SimulatorRos::whyImpossible(const calipso_msgs::Edit& edit) const {
  const bool live = params_.mode == Mode::kLive;
  const bool laid_out = plays_ || (clip_ && clip_->played_frames == clip_->frames);
  if (edit.kind == calipso_msgs::Edit::TIME_SCALE && (live || laid_out))
    return "pictures are laid out in time before the video plays, and those of a camera come "
           "as they are; give time_scale in the file of edits";
  if (live && !edit.after.empty())
    return "collisions of live video are not known when they happen; give the edit a time";
  const ros::Time last = clip_ ? clip_->last_stamp : newest_ + ros::Duration(kFarAhead);
  const bool known = clip_ || !newest_.isZero();
  if (known && edit.after.empty() && edit.header.stamp > last)
    return "its stamp is " + std::to_string(edit.header.stamp.toSec()) + " s, the video " +
           (clip_ ? "ends at " : "is at ") +
           std::to_string((clip_ ? clip_->last_stamp : newest_).toSec()) +
           " s; give a stamp of the video, or 0 for the next frame";
  return "";
}

// A world knows nothing of what one before it was told.
void SimulatorRos::submitAll() {
  for (const auto& edit : edits_) submit(edit);
}

void SimulatorRos::submit(const calipso_msgs::Edit& edit) {
  try {
    world_->submit(calipso::fromMsg(edit, *first_stamp_));
  } catch (const std::invalid_argument& error) {
    report(refusal(edit, error.what()));
  }
}

calipso_msgs::EditReport SimulatorRos::refusal(const calipso_msgs::Edit& edit,
                                               const std::string& message) const {
  calipso_msgs::EditReport report;
  report.header.stamp = newest_.isZero() ? first_stamp_.value_or(edit.header.stamp) : newest_;
  report.header.frame_id = topics::kWorldFrame;
  report.edit = edit;
  report.accepted = false;
  report.message = message;
  return report;
}

// Models of a key frame that is not later stay: they are sent once only, perhaps before this.
void SimulatorRos::startOver(const ros::Time& stamp) {
  reporter_.remark(kStartsOver);
  world_.reset();
  first_stamp_.reset();
  newest_ = ros::Time();
  edits_.clear(), said_.clear(), said_before_.clear();
  if (models_ && models_->header.stamp > stamp) models_.reset();
  reporter_.starting("waiting for models");
  prepare();
}

void SimulatorRos::onFrame(const sensor_msgs::CameraInfoConstPtr& info) {
  const ros::Time stamp = info->header.stamp;
  plays_ = true;
  if (params_.mode == Mode::kLive && clock_.startsOver(stamp)) startOver(stamp);
  newest_ = stamp;
  if (!world_) {
    // A state without objects lets the frame pass unedited.
    if (reporter_.state() == calipso_msgs::NodeStatus::FAILED) {
      state_.publish(stateMsg(WorldState{}, stamp));
      reporter_.warn(stamp, "there is no simulation; the frame passes unedited");
    }
    return;
  }
  if (!first_stamp_) {
    first_stamp_ = stamp;
    submitAll();
  }
  try {
    publish(world_->advanceTo((stamp - *first_stamp_).toSec()), stamp);
  } catch (const std::exception& error) {
    state_.publish(stateMsg(WorldState{}, stamp));
    reporter_.warn(stamp, std::string(error.what()) + "; the frame passes unedited");
  }
}

void SimulatorRos::publish(const std::vector<EditOutcome>& outcomes, const ros::Time& stamp) {
  for (const EditOutcome& outcome : outcomes) report(toMsg(outcome, stamp, *first_stamp_));
  if (world_->planChanged()) publishPlan(stamp);
  const WorldState state = world_->state();
  state_.publish(stateMsg(state, stamp));
  reporter_.timing(stamp, state.step_ms);
  sendRigidTransforms(state, stamp);
  if (markers_.getNumSubscribers() > 0)
    markers_.publish(toMarkers(*world_, params_.colour_by, stamp));
}

// A world that is made anew says once more what the one before it has said.
void SimulatorRos::report(const calipso_msgs::EditReport& report) {
  const auto said = std::find_if(
      said_before_.begin(), said_before_.end(), [&](const calipso_msgs::EditReport& r) {
        return r.accepted == report.accepted && sameMessage(r.edit, report.edit);
      });
  if (said != said_before_.end()) {
    said_before_.erase(said);
    return;
  }
  said_.push_back(report);
  send(report);
}

void SimulatorRos::send(const calipso_msgs::EditReport& report) {
  applied_.publish(report);
  ++reports_;
  if (!report.accepted) reporter_.remark("edit refused: " + report.message);
}

void SimulatorRos::publishPlan(const ros::Time& stamp) {
  plan_.publish(toMsg(world_->plan(), stamp));
  plan_stamp_ = stamp;
}

calipso_msgs::SimulationState SimulatorRos::stateMsg(const WorldState& state,
                                                     const ros::Time& stamp) const {
  calipso_msgs::SimulationState message = toMsg(state, stamp);
  message.plan_stamp = plan_stamp_;
  message.reports = reports_;
  return message;
}

void SimulatorRos::sendRigidTransforms(const WorldState& state, const ros::Time& stamp) {
  std::vector<geometry_msgs::TransformStamped> transforms;
  for (const ObjectSnapshot& object : state.objects) {
    if (object.kind != ObjectKind::kRigid && object.kind != ObjectKind::kKinematic) continue;
    geometry_msgs::TransformStamped t;
    t.header.stamp = stamp;
    t.header.frame_id = topics::kWorldFrame;
    t.child_frame_id = "object/" + object.name;
    t.transform = toTransformMsg(object.world_from_object);
    transforms.push_back(t);
  }
  if (!transforms.empty()) tf_.sendTransform(transforms);
}

}  // namespace calipso::fem
