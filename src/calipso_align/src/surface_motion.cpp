#include "surface_motion.hpp"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_align/mask_edge.hpp"
#include "calipso_scene/median.hpp"

namespace calipso::align {
namespace {

constexpr std::array<double, 3> kBlurs = {4.0, 2.0, 1.0};  // px
constexpr int kIterations = 6;                             // per blur
constexpr double kSettled = 1e-4;                          // rad; smaller steps show nowhere
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
  Eigen::Vector3d normal;                 // camera frame, before
  std::array<float, kBlurs.size()> grey;  // at each blur
};

// @param hidden  FramePair::hidden
std::vector<Sample> samplesOf(const std::vector<BlurredPart>& levels, const Camera& camera,
                              const DepthRendering& before, const BodyPose& pose,
                              const cv::Mat& hidden) {
  const Eigen::Isometry3d key_from_camera = pose.camera_from_key.inverse();
  const auto positionAt = [&](int u, int v) -> Eigen::Vector3d {
    return before.at(u, v) * camera.ray(u, v);
  };
  std::vector<Sample> samples;
  cv::Mat seen = before.depth > 0.0f;
  if (!hidden.empty()) seen.setTo(0, hidden(before.roi));
  for (const cv::Point& p : thinnedOut(insideOf(seen))) {
    const cv::Point at = p + before.roi.tl();
    Sample sample{key_from_camera * positionAt(at.x, at.y),
                  (positionAt(at.x, at.y + 1) - positionAt(at.x, at.y - 1))
                      .cross(positionAt(at.x + 1, at.y) - positionAt(at.x - 1, at.y))
                      .normalized(),
                  {}};
    for (size_t k = 0; k < levels.size(); ++k)
      sample.grey[k] = levels[k].values.at<cv::Vec3f>(at - levels[k].part.tl())[0];
    samples.push_back(sample);
  }
  return samples;
}

// Where a body may be now, and by which part it has become brighter: light . normal. What turns
// leaves its shading where it was, which else holds the pose back.
struct Guess {
  BodyPose pose;
  Eigen::Vector3d light = Eigen::Vector3d::Zero();
};

// Those that nothing may stand before.
std::vector<Sample> samplesSeen(const std::vector<Sample>& samples, const cv::Mat& as_before,
                                const Camera& camera, const BodyPose& pose) {
  if (as_before.empty()) return samples;
  std::vector<Sample> seen;
  for (const Sample& sample : samples) {
    const Eigen::Vector3d p = pose.camera_from_key * sample.point;
    if (p.z() <= 0.0) continue;
    const Eigen::Vector2d pixel = camera.project(p);
    const cv::Point at(cvRound(pixel.x()), cvRound(pixel.y()));
    if (!cv::Rect(cv::Point(), as_before.size()).contains(at) || !as_before.at<uchar>(at))
      seen.push_back(sample);
  }
  return seen.size() < kFewest ? samples : seen;
}

struct Comparison {
  double difference = 0.0;
  StepEquations equations;     // of the step alone: whatever the light does
  Eigen::Vector3d light_step;  // without a step
  Eigen::Matrix<double, 3, 6> light_by_step;

  // Returns by how much, in radians as the camera sees it.
  double improve(Guess& guess) const {
    const Vector6 step = solve(equations);
    const double distance = (guess.pose.camera_from_key * guess.pose.centre).norm();
    guess.pose.move(step);
    guess.light += light_step - light_by_step * step;
    return step.head<3>().norm() / distance + step.tail<3>().norm();
  }
};

Comparison compare(const std::vector<Sample>& samples, size_t level, const BlurredPart& now,
                   const Camera& camera, const Guess& guess) {
  constexpr double kNoise = 4.0;         // grey levels, of light that changes otherwise
  constexpr double kSystematicPx = 0.2;  // how far the surface may be off
  constexpr double kIndependent = 10.0;  // so many samples are wrong alike
  constexpr double kLight = 0.2;         // deviation of what the light changes
  const cv::Rect inner(0, 0, now.part.width - 1, now.part.height - 1);
  Comparison result;
  Eigen::Matrix<double, 9, 9> matrix = Eigen::Matrix<double, 9, 9>::Zero();  // its lower half
  Eigen::Matrix<double, 9, 1> right = Eigen::Matrix<double, 9, 1>::Zero(), full;
  matrix.diagonal().tail<3>().setConstant(1.0 / (kLight * kLight));
  right.tail<3>() = -guess.light / (kLight * kLight);
  for (const Sample& sample : samples) {
    const Eigen::Vector3d p = guess.pose.camera_from_key * sample.point;
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
    const double grey = sample.grey[level];
    const double residual = grey * (1.0 + guess.light.dot(sample.normal)) - seen[0];
    const double variance =
        kNoise * kNoise + kSystematicPx * kSystematicPx * gradient.squaredNorm();
    const double squared = residual * residual / (4.0 * variance);
    result.difference += squared / (1.0 + squared);
    const double weight = credible(squared) / (variance * kIndependent);
    full << guess.pose.jacobian(camera, p).transpose() * gradient, -grey * sample.normal;
    matrix.selfadjointView<Eigen::Lower>().rankUpdate(full, weight);
    right += weight * residual * full;
  }
  result.difference /= samples.size();
  const Eigen::Matrix3d light = matrix.bottomRightCorner<3, 3>().selfadjointView<Eigen::Lower>();
  const Eigen::Matrix<double, 3, 6> shared = matrix.bottomLeftCorner<3, 6>();
  result.light_step = light.inverse() * right.tail<3>();
  result.light_by_step = light.inverse() * shared;
  result.equations.matrix = matrix.topLeftCorner<6, 6>().selfadjointView<Eigen::Lower>();
  result.equations.matrix -= shared.transpose() * result.light_by_step;
  result.equations.right = right.head<6>() - shared.transpose() * result.light_step;
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
  const std::vector<Sample> samples = samplesOf(then, camera, before, pose, frames.hidden);
  SurfaceLook best;
  double told = best.difference;
  if (samples.size() < kFewest) return best;
  for (const BodyPose& start : starts) {
    Guess end{start};
    for (size_t level = 0; level < now.size(); ++level)
      for (int k = 0; k < kIterations; ++k)
        if (compare(samples, level, now[level], camera, end).improve(end) < kSettled) break;
    const Comparison found = compare(samples, now.size() - 1, now.back(), camera, end);
    if (found.difference >= best.difference) continue;
    best = {found.difference, found.equations.matrix};
    pose = end.pose;
    told = compare(samplesSeen(samples, frames.as_before, camera, end.pose), now.size() - 1,
                   now.back(), camera, end)
               .difference;
  }
  best.difference = told;
  return best;
}

}  // namespace calipso::align
