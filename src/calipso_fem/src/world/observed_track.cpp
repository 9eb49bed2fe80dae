#include "calipso_fem/world/observed_track.hpp"

#include <algorithm>

namespace calipso::fem {
namespace {

Eigen::Isometry3d interpolate(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double s) {
  Eigen::Isometry3d p = Eigen::Isometry3d::Identity();
  p.linear() =
      Eigen::Quaterniond(a.linear()).slerp(s, Eigen::Quaterniond(b.linear())).toRotationMatrix();
  p.translation() = (1.0 - s) * a.translation() + s * b.translation();
  return p;
}

}  // namespace

ObservedTrack::ObservedTrack(const Eigen::Isometry3d& world_from_object_at_key_frame)
    : key_pose_(world_from_object_at_key_frame) {}

void ObservedTrack::add(const ObservedMotion& sample) {
  moves_ = moves_ || sample.moving || sample.mode_amplitudes.size() > 0;
  const auto at = std::lower_bound(
      samples_.begin(), samples_.end(), sample,
      [](const ObservedMotion& a, const ObservedMotion& b) { return a.time < b.time; });
  if (at != samples_.end() && at->time == sample.time)
    *at = sample;
  else
    samples_.insert(at, sample);
}

ObservedMotion ObservedTrack::at(double time) const {
  ObservedMotion m;
  m.world_from_object = key_pose_;
  m.time = time;
  if (!moves_) return m;  // a clip in which the object rests: the alignment is the best pose known
  const auto after = std::lower_bound(samples_.begin(), samples_.end(), time,
                                      [](const ObservedMotion& s, double t) { return s.time < t; });
  if (after == samples_.begin()) return samples_.front();
  if (after == samples_.end()) return samples_.back();
  const ObservedMotion &a = *(after - 1), &b = *after;
  const double s = (time - a.time) / (b.time - a.time);
  m.moving = s < 0.5 ? a.moving : b.moving;
  m.world_from_object = interpolate(a.world_from_object, b.world_from_object, s);
  m.centroid = (1.0 - s) * a.centroid + s * b.centroid;
  m.linear = (1.0 - s) * a.linear + s * b.linear;
  m.angular = (1.0 - s) * a.angular + s * b.angular;
  m.acceleration = (1.0 - s) * a.acceleration + s * b.acceleration;
  if (a.mode_amplitudes.size() == b.mode_amplitudes.size()) {
    m.mode_amplitudes = (1.0 - s) * a.mode_amplitudes + s * b.mode_amplitudes;
    m.mode_velocities = (1.0 - s) * a.mode_velocities + s * b.mode_velocities;
  }
  return m;
}

}  // namespace calipso::fem
