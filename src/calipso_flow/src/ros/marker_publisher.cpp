#include "marker_publisher.hpp"

#include <Eigen/Eigenvalues>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"

namespace calipso::flow {
namespace {

constexpr char kTopic[] = "flow/markers";
constexpr float kConfident[] = {0.1f, 0.8f, 0.2f}, kOutlier[] = {0.9f, 0.2f, 0.1f};

visualization_msgs::Marker makeMarker(const std_msgs::Header& header, const std::string& ns,
                                      int type, double size) {
  visualization_msgs::Marker marker;
  marker.header = header;
  marker.ns = ns;
  marker.type = type;
  marker.action = visualization_msgs::Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = marker.scale.y = marker.scale.z = size;
  marker.color.r = 1.0f, marker.color.g = 0.8f, marker.color.b = 0.1f, marker.color.a = 1.0f;
  return marker;
}

// rviz takes a list without points for an error: what was drawn before is taken away instead.
void deleteIfEmpty(visualization_msgs::Marker& list) {
  if (list.points.empty()) list.action = visualization_msgs::Marker::DELETE;
}

visualization_msgs::Marker trackMarker(const ObjectDynamics& object, size_t index,
                                       const std_msgs::Header& header, double size) {
  auto marker =
      makeMarker(header, object.name + "/tracks", visualization_msgs::Marker::SPHERE_LIST, size);
  for (const Track& track : object.observations[index].tracks) {
    marker.points.push_back(toPointMsg(object.motions[index].world_from_object * track.point));
    const float* colour = track.inlier ? kConfident : kOutlier;
    std_msgs::ColorRGBA rgba;
    rgba.r = colour[0], rgba.g = colour[1], rgba.b = colour[2];
    rgba.a = static_cast<float>(0.3 + 0.7 * track.confidence);
    marker.colors.push_back(rgba);
  }
  deleteIfEmpty(marker);
  return marker;
}

visualization_msgs::Marker trajectoryMarker(const ObjectDynamics& object,
                                            const std_msgs::Header& header, double size) {
  auto marker = makeMarker(header, object.name + "/trajectory",
                           visualization_msgs::Marker::LINE_STRIP, 0.5 * size);
  for (const ObjectMotion& motion : object.motions) {
    marker.points.push_back(toPointMsg(motion.state.position));
  }
  return marker;
}

// From one point by a way; one that is too short to be seen is taken away. The head's length goes
// with the way: one of its own would turn a short arrow round.
visualization_msgs::Marker arrowMarker(const std_msgs::Header& header, const std::string& ns,
                                       const Eigen::Vector3d& from, const Eigen::Vector3d& way,
                                       double size) {
  auto arrow = makeMarker(header, ns, visualization_msgs::Marker::ARROW, size);
  arrow.scale.y = 2.0 * size, arrow.scale.z = 0.0;
  arrow.points = {toPointMsg(from), toPointMsg(from + way)};
  if (!(way.norm() > 0.5 * size)) arrow.action = visualization_msgs::Marker::DELETE;
  return arrow;
}

// The way the centroid goes in a tenth of a second.
visualization_msgs::Marker velocityMarker(const ObjectMotion& motion, const std::string& name,
                                          const std_msgs::Header& header, double size) {
  return arrowMarker(header, name + "/velocity", motion.state.position, 0.1 * motion.state.velocity,
                     size);
}

visualization_msgs::Marker collisionMarker(const ObjectDynamics& object,
                                           const std_msgs::Header& header, double size) {
  auto marker = makeMarker(header, object.name + "/collisions",
                           visualization_msgs::Marker::SPHERE_LIST, 3.0 * size);
  marker.color.g = 0.2f;
  for (const Collision& collision : object.trajectory.collisions) {
    marker.points.push_back(toPointMsg(collision.before.position));
  }
  deleteIfEmpty(marker);
  return marker;
}

// One deviation of the centroid's position in every direction.
visualization_msgs::Marker uncertaintyMarker(const ObjectMotion& motion, const std::string& name,
                                             const std_msgs::Header& header) {
  auto marker = makeMarker(header, name + "/uncertainty", visualization_msgs::Marker::SPHERE, 1.0);
  const Eigen::Vector3d variance = motion.state.covariance.diagonal().head<3>();
  marker.scale = toVectorMsg(2.0 * variance.cwiseMax(1e-12).cwiseSqrt());
  marker.pose.position = toPointMsg(motion.state.position);
  marker.color.a = 0.4f;
  return marker;
}

// The way the air goes in a tenth of a second, from the middle of the cloth that shows it, and one
// deviation about its tip.
std::vector<visualization_msgs::Marker> windMarkers(const ObjectDynamics& object, size_t index,
                                                    const std_msgs::Header& header, double size) {
  if (!object.deformation || !object.deformation->wind) return {};
  const WindEstimate& wind = *object.deformation->wind;
  const double time = object.deformation->times.at(index);
  const Eigen::Vector3d from = object.motions[index].state.position,
                        tip = from + 0.1 * wind.at(time);
  auto arrow = arrowMarker(header, object.name + "/wind", from, tip - from, size);
  arrow.color.r = 0.3f, arrow.color.b = 1.0f;
  auto ball = makeMarker(header, object.name + "/wind uncertainty",
                         visualization_msgs::Marker::SPHERE, 1.0);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(0.01 * wind.covarianceAt(time));
  ball.scale = toVectorMsg(2.0 * axes.eigenvalues().cwiseMax(1e-12).cwiseSqrt());
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const double hand = axes.eigenvectors().determinant() < 0.0 ? -1.0 : 1.0;
  pose.linear() << axes.eigenvectors().leftCols<2>(), hand * axes.eigenvectors().col(2);
  pose.translation() = tip;
  ball.pose = toMsg(pose);
  ball.color = arrow.color;
  ball.color.a = 0.3f;
  return {arrow, ball};
}

}  // namespace

MarkerPublisher::MarkerPublisher(ros::NodeHandle& nh)
    : publisher_(nh.advertise<visualization_msgs::MarkerArray>(kTopic, 2)) {}

void MarkerPublisher::publish(size_t index, const ros::Time& stamp) const {
  if (publisher_.getNumSubscribers() == 0) return;
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = topics::kWorldFrame;
  visualization_msgs::MarkerArray all;
  for (const ObjectDynamics& object : objects_) {
    const visualization_msgs::MarkerArray of_object = markersOf(object, index, header);
    all.markers.insert(all.markers.end(), of_object.markers.begin(), of_object.markers.end());
  }
  publisher_.publish(all);
}

visualization_msgs::MarkerArray markersOf(const ObjectDynamics& object, size_t index,
                                          const std_msgs::Header& header) {
  const double size = 0.02 * object.diagonal;
  const ObjectMotion& motion = object.motions.at(index);
  visualization_msgs::MarkerArray markers;
  markers.markers = {
      trackMarker(object, index, header, 0.5 * size), trajectoryMarker(object, header, size),
      velocityMarker(motion, object.name, header, size), collisionMarker(object, header, size),
      uncertaintyMarker(motion, object.name, header)};
  for (const auto& marker : windMarkers(object, index, header, size))
    markers.markers.push_back(marker);
  return markers;
}

}  // namespace calipso::flow
