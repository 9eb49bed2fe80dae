#include "calipso_fem/world/observed_wind.hpp"

#include <algorithm>
#include <cassert>

namespace calipso::fem {
namespace {

bool earlier(const ObservedWind& a, const ObservedWind& b) { return a.time < b.time; }

}  // namespace

void WindTrack::add(const ObservedWind& sample) {
  const auto at = std::lower_bound(samples_.begin(), samples_.end(), sample, earlier);
  if (at != samples_.end() && at->time == sample.time)
    *at = sample;
  else
    samples_.insert(at, sample);
}

Eigen::Vector3d WindTrack::at(double time) const {
  assert(!empty());
  ObservedWind wanted;
  wanted.time = time;
  const auto after = std::lower_bound(samples_.begin(), samples_.end(), wanted, earlier);
  if (after == samples_.begin()) return samples_.front().velocity;
  if (after == samples_.end()) return samples_.back().velocity;
  const ObservedWind &a = *(after - 1), &b = *after;
  const double s = (time - a.time) / (b.time - a.time);
  return (1.0 - s) * a.velocity + s * b.velocity;
}

double WindTrack::variance() const {
  assert(!empty());
  double sum = 0.0;
  for (const ObservedWind& sample : samples_) sum += sample.covariance.trace();
  return sum / (3.0 * static_cast<double>(samples_.size()));
}

WindTrack WindTrack::times(double factor) const {
  WindTrack scaled = *this;
  for (ObservedWind& sample : scaled.samples_) {
    sample.velocity *= factor;
    sample.covariance *= factor * factor;
  }
  return scaled;
}

}  // namespace calipso::fem
