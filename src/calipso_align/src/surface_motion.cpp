#include "surface_motion.hpp"

#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_align/mask_edge.hpp"
#include "calipso_scene/median.hpp"

namespace calipso::align {
namespace {

constexpr std::array<double, 3> kBlurs = {4.0, 2.0, 1.0};  // px
constexpr int kIterations = 6;                             // per blur
constexpr size_t kFewest = 20;                             // samples that tell a pose

// About so many pixels of a mask, evenly spread.
std::vector<cv::Point> thinnedOut(const cv::Mat& mask) {
  constexpr int kAbout = 800;
  const int step = std::max(1, cv::countNonZero(mask) / kAbout);
  std::vector<cv::Point> points;
  int met = 0;
  for (int v = 0; v < mask.rows; ++v)
    for (int u = 0; u < mask.cols; ++u)
      if (mask.at<uchar>(v, u) && met++ % step == 0) points.emplace_back(u, v);
  return points;
}

struct FlowMatch {
  Eigen::Vector3d point;  // key frame, m
  Eigen::Vector2d pixel;  // where the flow has it now
};

std::vector<FlowMatch> flowMatches(const cv::Mat& flow, const cv::Mat& core, const Camera& camera,
                                   const DepthRendering& before, const BodyPose& pose) {
  const Eigen::Isometry3d key_from_camera = pose.camera_from_key.inverse();
  std::vector<FlowMatch> matches;
  for (const cv::Point& p : thinnedOut(core)) {
    const cv::Vec2f back = flow.at<cv::Vec2f>(p);
    const double u = p.x + back[0], v = p.y + back[1];
    const double depth = before.at(cvRound(u), cvRound(v));
    if (depth > 0.0)
      matches.push_back({key_from_camera * Eigen::Vector3d(depth * camera.ray(u, v)), {p.x, p.y}});
  }
  return matches;
}

StepEquations flowEquations(const std::vector<FlowMatch>& matches, const Camera& camera,
                            const BodyPose& pose) {
  constexpr double kLeastPx = 0.4;
  std::vector<double> lengths;
  for (const FlowMatch& match : matches)
    lengths.push_back((camera.project(pose.camera_from_key * match.point) - match.pixel).norm());
  const double scale = std::max(kLeastPx, 1.7 * median(lengths));  // two deviations
  StepEquations equations;
  for (size_t i = 0; i < matches.size(); ++i) {
    const Eigen::Vector3d p = pose.camera_from_key * matches[i].point;
    const Eigen::Vector2d residual = matches[i].pixel - camera.project(p);
    const double weight = credible(lengths[i] * lengths[i] / (scale * scale));
    const Eigen::Matrix<double, 2, 6> J = pose.jacobian(camera, p);
    for (int k = 0; k < 2; ++k) equations.add(weight, residual[k], J.row(k).transpose());
  }
  return equations;
}

// A part of a picture at some blur: value and gradient of every pixel.
struct BlurredPart {
  cv::Rect part;
  cv::Mat values;  // CV_32FC3
};

BlurredPart blurred(const cv::Mat& grey, const cv::Rect& part, double sigma) {
  cv::Mat value, by_u, by_v, values;
  grey(part).convertTo(value, CV_32F);
  cv::GaussianBlur(value, value, cv::Size(), sigma);
  cv::Sobel(value, by_u, CV_32F, 1, 0, 1, 0.5);
  cv::Sobel(value, by_v, CV_32F, 0, 1, 1, 0.5);
  cv::merge(std::vector<cv::Mat>{value, by_u, by_v}, values);
  return {part, values};
}

// A point of the surface and what it looked like.
struct Sample {
  Eigen::Vector3d point;                  // key frame, m
  std::array<float, kBlurs.size()> grey;  // at each blur
};

std::vector<Sample> samplesOf(const std::vector<BlurredPart>& levels, const Camera& camera,
                              const DepthRendering& before, const BodyPose& pose) {
  const Eigen::Isometry3d key_from_camera = pose.camera_from_key.inverse();
  std::vector<Sample> samples;
  for (const cv::Point& p : thinnedOut(insideOf(before.depth > 0.0f))) {
    const cv::Point at = p + before.roi.tl();
    Sample sample{key_from_camera * Eigen::Vector3d(before.depth(p) * camera.ray(at.x, at.y)), {}};
    for (size_t k = 0; k < levels.size(); ++k)
      sample.grey[k] = levels[k].values.at<cv::Vec3f>(at - levels[k].part.tl())[0];
    samples.push_back(sample);
  }
  return samples;
}

struct Comparison {
  StepEquations equations;
  double difference = 0.0;
};

Comparison compare(const std::vector<Sample>& samples, size_t level, const BlurredPart& now,
                   const Camera& camera, const BodyPose& pose) {
  constexpr double kNoise = 6.0;         // grey levels, of light that changes
  constexpr double kSystematicPx = 0.4;  // how far the surface may be off
  constexpr double kIndependent = 10.0;  // so many samples are wrong alike
  const cv::Rect inner(0, 0, now.part.width - 1, now.part.height - 1);
  Comparison result;
  for (const Sample& sample : samples) {
    const Eigen::Vector3d p = pose.camera_from_key * sample.point;
    const Eigen::Vector2d pixel = camera.project(p) - Eigen::Vector2d(now.part.x, now.part.y);
    const int u = cvFloor(pixel.x()), v = cvFloor(pixel.y());
    if (p.z() <= 0.0 || !inner.contains({u, v})) {
      result.difference += 1.0;
      continue;
    }
    const float a = static_cast<float>(pixel.x() - u), b = static_cast<float>(pixel.y() - v);
    const cv::Vec3f *row = now.values.ptr<cv::Vec3f>(v) + u,
                    *next = now.values.ptr<cv::Vec3f>(v + 1) + u;
    const cv::Vec3f seen =
        (1 - b) * ((1 - a) * row[0] + a * row[1]) + b * ((1 - a) * next[0] + a * next[1]);
    const Eigen::Vector2d gradient(seen[1], seen[2]);
    const double residual = sample.grey[level] - seen[0];
    const double variance =
        kNoise * kNoise + kSystematicPx * kSystematicPx * gradient.squaredNorm();
    const double squared = residual * residual / (4.0 * variance);
    result.difference += squared / (1.0 + squared);
    result.equations.add(credible(squared) / (variance * kIndependent), residual,
                         pose.jacobian(camera, p).transpose() * gradient);
  }
  result.difference /= samples.size();
  return result;
}

// The part of the picture that a body which goes from one of these poses to the others may cover.
cv::Rect coveredPart(const Camera& camera, const cv::Rect& before, const BodyPose& from,
                     const std::vector<BodyPose>& poses) {
  constexpr int kMarginPx = 24;
  const auto centreOf = [&](const BodyPose& pose) {
    return camera.project(pose.camera_from_key * pose.centre);
  };
  cv::Rect part = before;
  for (const BodyPose& pose : poses) {
    const Eigen::Vector2d shift = centreOf(pose) - centreOf(from);
    if (shift.norm() < camera.width)
      part |= before + cv::Point(cvRound(shift.x()), cvRound(shift.y()));
  }
  return cv::Rect(part.x - kMarginPx, part.y - kMarginPx, part.width + 2 * kMarginPx,
                  part.height + 2 * kMarginPx) &
         cv::Rect(0, 0, camera.width, camera.height);
}

}  // namespace

SurfaceLook followSurface(const FramePair& frames, const cv::Mat& core, const Camera& camera,
                          const DepthRendering& before, const Eigen::Isometry3d& velocity,
                          BodyPose& pose) {
  const std::vector<FlowMatch> matches = flowMatches(frames.flow, core, camera, before, pose);
  std::vector<BodyPose> starts = {pose, pose};
  starts[1].camera_from_key = velocity * pose.camera_from_key;
  for (int k = 0; k < kIterations && matches.size() >= kFewest; ++k)
    starts[0].move(solve(flowEquations(matches, camera, starts[0])));

  const cv::Rect part = coveredPart(camera, before.roi, pose, starts);
  std::vector<BlurredPart> then, now;
  for (const double blur : kBlurs) {
    then.push_back(blurred(frames.previous, part, blur));
    now.push_back(blurred(frames.now, part, blur));
  }
  const std::vector<Sample> samples = samplesOf(then, camera, before, pose);
  SurfaceLook best;
  if (samples.size() < kFewest) return best;
  for (BodyPose end : starts) {
    for (size_t level = 0; level < now.size(); ++level)
      for (int k = 0; k < kIterations; ++k)
        end.move(solve(compare(samples, level, now[level], camera, end).equations));
    const Comparison found = compare(samples, now.size() - 1, now.back(), camera, end);
    if (found.difference >= best.difference) continue;
    best = {found.difference, found.equations.matrix};
    pose = end;
  }
  return best;
}

}  // namespace calipso::align
