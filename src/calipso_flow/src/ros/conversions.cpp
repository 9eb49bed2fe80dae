#include "conversions.hpp"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>

#include <stdexcept>

#include "calipso_ros/conversions.hpp"
#include "calipso_scene/attachment.hpp"

namespace calipso::flow {
namespace {

void checkSize(const sensor_msgs::Image& image) {
  const size_t needed = static_cast<size_t>(image.step) * image.height;
  if (image.width > 0 && image.height > 0 && image.data.size() >= needed) return;
  throw std::invalid_argument("image of " + std::to_string(image.width) + "x" +
                              std::to_string(image.height) + " with " +
                              std::to_string(image.data.size()) + " bytes of " +
                              std::to_string(needed) + "; publish whole images");
}

// An unmeasured quantity's variance: large, but finite, so that a filter can take it in.
constexpr double kUnknownVariance = 1e6;

geometry_msgs::Twist twistOf(const MotionState& state) {
  geometry_msgs::Twist twist;
  twist.linear = toVectorMsg(state.velocity);
  twist.angular = toVectorMsg(state.spin);
  return twist;
}

calipso_msgs::Collision toMsg(const Collision& collision) {
  calipso_msgs::Collision msg;
  msg.stamp = ros::Time(collision.time);
  msg.deviation = collision.time_deviation;
  msg.before = twistOf(collision.before);
  msg.after = twistOf(collision.after);
  msg.restitution = collision.restitution();
  msg.restitution_deviation = collision.restitutionDeviation();
  return msg;
}

calipso_msgs::Wind windMsg(double time, const Eigen::Vector3d& velocity,
                           const Eigen::Matrix3d& covariance) {
  calipso_msgs::Wind msg;
  msg.stamp = ros::Time(time);
  msg.velocity = toVectorMsg(velocity);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) msg.covariance[3 * r + c] = covariance(r, c);
  }
  return msg;
}

calipso_msgs::Vibration toMsg(const SurfaceLine& line) {
  calipso_msgs::Vibration msg;
  msg.frequency = line.line.frequency;
  msg.deviation = line.line.deviation;
  msg.decay = line.line.decay;
  msg.quality = line.line.quality;
  msg.amplitude = line.amplitude;
  const double waves = line.wave_vector.norm();  // rad/m
  if (waves > 0.0) {
    msg.travel = toVectorMsg(line.wave_vector / waves);
    msg.travel_speed = 2.0 * M_PI * line.line.frequency / waves;
  }
  return msg;
}

void addDeformation(const DeformationMotion& deformation, calipso_msgs::ObjectClipDynamics& msg) {
  const Eigen::MatrixXf shapes = deformation.modes.shapes.cast<float>();
  for (int m = 0; m < shapes.cols(); ++m) {
    msg.modes.emplace_back();
    msg.modes.back().displacements.assign(shapes.col(m).data(),
                                          shapes.col(m).data() + shapes.rows());
  }
  for (const SurfaceLine& line : deformation.lines) msg.vibrations.push_back(toMsg(line));
  msg.lean = toVectorMsg(deformation.lean);
  if (deformation.stiffness) {
    msg.stiffness_over_density = deformation.stiffness->value;
    msg.stiffness_over_density_deviation = deformation.stiffness->deviation;
  }
  if (deformation.wind) {
    const WindEstimate& wind = *deformation.wind;
    for (size_t i = 0; i < wind.knots.size(); ++i) {
      msg.wind.push_back(windMsg(wind.knots[i], wind.wind[i], wind.covariance[i]));
    }
    if (!deformation.stiffness) {
      msg.stiffness_over_density = wind.stiffness_over_density;
      msg.stiffness_over_density_deviation = wind.stiffness_over_density_deviation;
    }
    const double middle = 0.5 * (wind.knots.front() + wind.knots.back());
    msg.mean_wind.push_back(windMsg(middle, wind.mean, wind.mean_covariance));
  }
  msg.note = deformation.note;
}

}  // namespace

cv::Mat pictureFromMsg(const sensor_msgs::ImageConstPtr& image) {
  checkSize(*image);
  try {
    return cv_bridge::toCvShare(image, sensor_msgs::image_encodings::BGR8)->image;
  } catch (const cv_bridge::Exception& error) {
    throw std::invalid_argument("image encoding '" + image->encoding +
                                "' is no colour or grey picture; publish bgr8 or rgb8 (" +
                                error.what() + ")");
  }
}

Frame frameFromMsg(const calipso::Frame& frame) {
  return makeFrame(frame.stamp().toSec(), pictureFromMsg(frame.image), frame.camera);
}

ObjectModel modelFromMsg(const calipso_msgs::AlignedModel& model, const Scene& scene) {
  ObjectModel result{model.object,
                     model.index,
                     fromMsg(model.mesh),
                     fromMsg(model.world_from_object.pose),
                     Eigen::Matrix3d::Zero(),
                     {}};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      result.position_covariance(r, c) = model.world_from_object.covariance[6 * r + c];
    }
  }
  for (const SceneObject& object : scene.objects) {
    if (object.name == model.object)
      result.attached = attachedVertices(result.mesh, result.world_from_object, object.attachments);
  }
  return result;
}

cv::Mat maskFromMsg(const sensor_msgs::Image& labels, int index) {
  checkSize(labels);
  if (labels.encoding != sensor_msgs::image_encodings::MONO8) {
    throw std::invalid_argument("label image has encoding '" + labels.encoding +
                                "'; publish mono8 (0 none, else the object's index)");
  }
  return cv_bridge::toCvCopy(labels)->image == index;
}

calipso_msgs::ObjectDynamics toMsg(const std::string& object, const ObjectMotion& motion) {
  calipso_msgs::ObjectDynamics msg;
  msg.object = object;
  msg.moving = motion.moving;
  msg.world_from_object = calipso::toMsg(motion.world_from_object);
  msg.centroid = toPointMsg(motion.state.position);
  msg.twist.twist.linear = toVectorMsg(motion.state.velocity);
  msg.twist.twist.angular = toVectorMsg(motion.state.spin);
  const Matrix6d covariance = motion.state.twistCovariance();
  for (int r = 0; r < 6; ++r) {
    for (int c = 0; c < 6; ++c) msg.twist.covariance[6 * r + c] = covariance(r, c);
  }
  msg.acceleration = toVectorMsg(motion.state.acceleration);
  msg.tracks = motion.tracks;
  return msg;
}

void addDeformation(const DeformationMotion& deformation, int index,
                    calipso_msgs::ObjectDynamics& msg) {
  addModes(deformation.modes.amplitudes.row(index).transpose(),
           deformation.modes.velocities.row(index).transpose(), msg);
  addWind(deformation, deformation.times.at(index), msg);
}

void addModes(const Eigen::VectorXd& amplitudes, const Eigen::VectorXd& velocities,
              calipso_msgs::ObjectDynamics& msg) {
  for (Eigen::Index m = 0; m < amplitudes.size(); ++m) {
    msg.mode_amplitudes.push_back(static_cast<float>(amplitudes[m]));
    msg.mode_velocities.push_back(static_cast<float>(velocities[m]));
  }
}

void addWind(const DeformationMotion& deformation, double time, calipso_msgs::ObjectDynamics& msg) {
  if (!deformation.wind) return;
  msg.wind = {windMsg(time, deformation.wind->at(time), deformation.wind->covarianceAt(time))};
}

calipso_msgs::ObjectClipDynamics toMsg(const ObjectDynamics& object) {
  calipso_msgs::ObjectClipDynamics msg;
  msg.object = object.name;
  for (const Collision& collision : object.trajectory.collisions) {
    msg.collisions.push_back(toMsg(collision));
  }
  if (object.trajectory.gravity) {
    msg.falls = true;
    msg.gravity = toVectorMsg(object.trajectory.gravity->acceleration);
    msg.gravity_deviation = object.trajectory.gravity->deviation;
  }
  if (object.deformation) addDeformation(*object.deformation, msg);
  return msg;
}

calipso_msgs::ObjectDynamics withoutEstimate(const SceneObject& object) {
  calipso_msgs::ObjectDynamics msg;
  msg.object = object.name;
  msg.world_from_object = calipso::toMsg(object.initial_world_from_object);
  msg.centroid = toPointMsg(object.initial_world_from_object.translation());
  for (int i = 0; i < 6; ++i) msg.twist.covariance[7 * i] = kUnknownVariance;
  return msg;
}

sensor_msgs::Image flowToMsg(const cv::Mat& flow, const std_msgs::Header& header) {
  sensor_msgs::Image msg;
  cv_bridge::CvImage(header, sensor_msgs::image_encodings::TYPE_32FC2, flow).toImageMsg(msg);
  return msg;
}

}  // namespace calipso::flow
