// rosrun calipso_align evaluate_segmentation [options] SCENE...   one JSON object per object and
// line, no roscore: the key frame from what the user gave, against the true masks, and the masks
// tracked from it. Times are CPU times of the process, in ms.
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <map>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "calipso_align/key_frame.hpp"
#include "calipso_align/mask_tracker.hpp"
#include "calipso_align/metrics.hpp"
#include "calipso_scene/help.hpp"
#include "run_evaluation.hpp"

namespace {

namespace fs = std::filesystem;
using namespace calipso;
using namespace calipso::align;

constexpr char kUsage[] =
    "usage: evaluate_segmentation [--grabcut] [--track] [--no-depth] [--pictures DIR] SCENE...\n"
    "  --grabcut        also cv::grabCut, 5 iterations, on the same rectangles and strokes\n"
    "  --track          also the masks of the other frames, from the found key frame and from the\n"
    "                   true one\n"
    "  --no-depth       leave a scene's depth image unused\n"
    "  --pictures DIR   writes what is wrong over the picture: red taken in, blue left out\n";

struct Arguments {
  bool grabcut = false, track = false, use_depth = true;
  std::string pictures;
  std::vector<std::string> paths;
};

Arguments parse(int argc, char** argv) {
  helpIfAsked(argc, argv, kUsage);
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--grabcut")
      arguments.grabcut = true;
    else if (word == "--track")
      arguments.track = true;
    else if (word == "--no-depth")
      arguments.use_depth = false;
    else if (word == "--pictures" && i + 1 < argc)
      arguments.pictures = argv[++i];
    else if (word.rfind("--", 0) == 0)
      throw std::invalid_argument("unknown option or missing value: " + word + "\n" + kUsage);
    else
      arguments.paths.push_back(word);
  }
  if (arguments.paths.empty()) throw std::invalid_argument(kUsage);
  return arguments;
}

double cpuMs() {
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * now.tv_sec + 1e-6 * now.tv_nsec;
}

template <class Action>
double cpuMsOf(const Action& action) {
  const double start = cpuMs();
  action();
  return cpuMs() - start;
}

cv::Mat readFrame(const Scene& scene, int frame) {
  const std::string path = scene.framePath(frame);
  const cv::Mat image = cv::imread(path, cv::IMREAD_COLOR);
  if (image.empty()) throw std::runtime_error(path + ": no readable image");
  return image;
}

// True labels of a frame; empty where a mask is missing.
cv::Mat trueLabels(const Scene& scene, int frame) {
  cv::Mat labels = cv::Mat::zeros(scene.camera.height, scene.camera.width, CV_8U);
  for (const SceneObject& object : scene.objects) {
    const std::string path =
        scene.directory + "/masks/" + object.name + numbered("_%06d.png", frame);
    const cv::Mat mask = cv::imread(path, cv::IMREAD_GRAYSCALE);
    if (mask.empty()) return {};
    labels.setTo(object.index, mask > 127);
  }
  return labels;
}

// Distances both ways between two contours' known points, px.
std::vector<double> contourDistances(const std::vector<ContourLoop>& a,
                                     const std::vector<ContourLoop>& b) {
  std::vector<double> distances;
  const auto oneWay = [&](const std::vector<ContourLoop>& from,
                          const std::vector<ContourLoop>& to) {
    for (const ContourLoop& loop : from)
      for (size_t i = 0; i < loop.points.size(); ++i) {
        if (!loop.known[i]) continue;
        double nearest = 1e9;
        for (const ContourLoop& other : to)
          for (size_t j = 0; j < other.points.size(); ++j) {
            const Eigen::Vector2d p = other.points[j];
            const Eigen::Vector2d d = other.points[(j + 1) % other.points.size()] - p;
            const double t = std::clamp(
                (loop.points[i] - p).dot(d) / std::max(1e-12, d.squaredNorm()), 0.0, 1.0);
            nearest = std::min(nearest, (loop.points[i] - p - t * d).squaredNorm());
          }
        distances.push_back(std::sqrt(nearest));
      }
  };
  oneWay(a, b);
  oneWay(b, a);
  std::sort(distances.begin(), distances.end());
  return distances;
}

cv::Mat grabCut(const cv::Mat& image, const SegmentationTarget& target, const cv::Mat& strokes) {
  cv::Mat mask(image.size(), CV_8U, cv::Scalar(cv::GC_BGD)), background, foreground;
  mask(target.rect & cv::Rect(cv::Point(), image.size())).setTo(cv::GC_PR_FGD);
  if (!strokes.empty()) {
    mask.setTo(cv::GC_BGD, (strokes > 0) & (strokes != target.label));
    mask.setTo(cv::GC_FGD, strokes == target.label);
  }
  cv::setRNGSeed(1);
  cv::grabCut(image, mask, target.rect, background, foreground, 5, cv::GC_INIT_WITH_MASK);
  return (mask & 1) > 0;
}

// The surroundings of an object, three times as large, with what is wrong in colour.
void writeErrors(const std::string& path, const cv::Mat& image, const cv::Mat& found,
                 const cv::Mat& truth) {
  const cv::Rect box = cv::boundingRect(found | truth);
  const cv::Rect roi = cv::Rect(box.x - 12, box.y - 12, box.width + 24, box.height + 24) &
                       cv::Rect(cv::Point(), image.size());
  cv::Mat tinted = image.clone();
  tinted.setTo(cv::Scalar(0, 0, 255), found & ~truth);
  tinted.setTo(cv::Scalar(255, 60, 0), truth & ~found);
  cv::Mat plain, marked, both;
  cv::resize(image(roi), plain, cv::Size(), 3, 3, cv::INTER_NEAREST);
  cv::resize(tinted(roi), marked, cv::Size(), 3, 3, cv::INTER_NEAREST);
  if (roi.width > roi.height)
    cv::vconcat(plain, marked, both);
  else
    cv::hconcat(plain, marked, both);
  cv::imwrite(path, both);
}

struct Tracking {
  std::map<int, std::vector<double>> iou;  // per label
  double ms_per_frame = 0.0;
};

Tracking track(const Scene& scene, const cv::Mat& start, const std::map<int, ModelSurface>& models,
               const std::string& pictures) {
  Tracking result;
  MaskTracker tracker(readFrame(scene, 0), start, models);
  int frames = 0;
  for (int frame = 1; frame < scene.frame_count; ++frame) {
    const cv::Mat truth = trueLabels(scene, frame);
    if (truth.empty()) break;
    const cv::Mat image = readFrame(scene, frame);
    TrackedMask tracked;
    result.ms_per_frame += cpuMsOf([&] { tracked = tracker.track(image); });
    ++frames;
    for (const SceneObject& object : scene.objects) {
      const cv::Mat found = tracked.labels == object.index, right = truth == object.index;
      result.iou[object.index].push_back(intersectionOverUnion(found, right));
      if (pictures.empty() || frame % 4 != 0) continue;
      writeErrors(pictures + "/" + scene.name + "_" + object.name + numbered("_%06d.png", frame),
                  image, found, right);
    }
  }
  result.ms_per_frame /= std::max(1, frames);
  return result;
}

void putTracking(const char* suffix, const Tracking& tracking, int label) {
  const auto found = tracking.iou.find(label);
  if (found == tracking.iou.end()) return;
  const std::vector<double>& iou = found->second;
  std::printf(", \"tracked_iou%s\": %.4f, \"tracked_iou_min%s\": %.4f, \"ms_track%s\": %.1f",
              suffix, std::accumulate(iou.begin(), iou.end(), 0.0) / iou.size(), suffix,
              *std::min_element(iou.begin(), iou.end()), suffix, tracking.ms_per_frame);
}

void evaluate(const std::string& path, const Arguments& arguments) {
  const Scene scene = loadScene(path);
  const cv::Mat image = readFrame(scene, 0), strokes = loadStrokes(scene);
  std::optional<Segmenter> segmenter;
  KeyFrame key;
  const double ms_first = cpuMsOf([&] {
    segmenter.emplace(makeSegmenter(image, scene, arguments.use_depth));
    segmenter->segment(strokes);
  });
  const double ms_stroke = cpuMsOf([&] { segmenter->segment(strokes); });
  const double ms_contour =
      cpuMsOf([&] { key = segmentKeyFrame(image, *segmenter, strokes); }) - ms_stroke;
  const std::vector<SegmentationTarget>& targets = segmenter->targets();
  const cv::Mat truth = trueLabels(scene, 0);
  const bool track_it = arguments.track && !truth.empty();
  const Tracking tracked =
      track_it ? track(scene, key.labels, key.models, arguments.pictures) : Tracking();
  const Tracking ideal = track_it ? track(scene, truth, key.models, "") : Tracking();

  for (size_t k = 0; k < targets.size(); ++k) {
    std::printf(
        "{\"case\": \"%s\", \"object\": \"%s\", \"ms_segment\": %.1f, \"ms_stroke\": %.1f, "
        "\"ms_contour\": %.1f",
        scene.name.c_str(), targets[k].name.c_str(), ms_first, ms_stroke, ms_contour);
    const cv::Mat found = key.labels == targets[k].label;
    if (!truth.empty()) {
      const cv::Mat right = truth == targets[k].label;
      const std::vector<double> d =
          contourDistances(key.contours[k].loops, traceLoops(truth, targets[k].label, {}));
      std::printf(", \"mask_iou\": %.4f, \"contour_mean_px\": %.3f, \"contour_p95_px\": %.3f",
                  intersectionOverUnion(found, right),
                  std::accumulate(d.begin(), d.end(), 0.0) / std::max<size_t>(1, d.size()),
                  d.empty() ? 0.0 : d[d.size() * 95 / 100]);
      if (!arguments.pictures.empty())
        writeErrors(arguments.pictures + "/" + scene.name + "_" + targets[k].name + ".png", image,
                    found, right);
      if (arguments.grabcut) {
        cv::Mat other;
        const double ms = cpuMsOf([&] { other = grabCut(image, targets[k], strokes); });
        std::printf(", \"grabcut_iou\": %.4f, \"ms_grabcut\": %.1f",
                    intersectionOverUnion(other, right), ms);
      }
    }
    putTracking("", tracked, targets[k].label);
    putTracking("_from_truth", ideal, targets[k].label);
    std::printf("}\n");
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) { return runEvaluation(argc, argv, parse, evaluate); }
