// Segmentation against cv::grabCut with five iterations, on a textured 1280 x 720 picture drawn
// here.
#include <benchmark/benchmark.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_align/contour.hpp"
#include "calipso_align/mask_tracker.hpp"
#include "calipso_align/segmentation.hpp"

namespace {

using namespace calipso::align;

const cv::Size kSize(1280, 720);
const cv::Rect kRect(360, 120, 560, 480);

// A striped ellipse, shifted by `shift` px, on a mottled background; true mask in `mask`.
cv::Mat picture(double shift, cv::Mat* mask = nullptr) {
  cv::RNG rng(5);
  cv::Mat coarse(45, 80, CV_8UC3), image;
  rng.fill(coarse, cv::RNG::UNIFORM, 90, 170);
  cv::resize(coarse, image, kSize, 0, 0, cv::INTER_CUBIC);
  cv::Mat inside = cv::Mat::zeros(kSize, CV_8U);
  const cv::Point centre(640 + cvRound(shift), 360);
  cv::ellipse(inside, centre, {240, 200}, 20, 0, 360, 255, cv::FILLED);
  for (int y = 0; y < kSize.height; ++y)
    for (int x = 0; x < kSize.width; ++x)
      if (inside.at<uchar>(y, x))
        image.at<cv::Vec3b>(y, x) =
            std::sin(0.06 * (x - centre.x)) > 0 ? cv::Vec3b(40, 60, 190) : cv::Vec3b(60, 180, 200);
  cv::Mat noise(kSize, CV_16SC3), noisy;
  rng.fill(noise, cv::RNG::NORMAL, 0, 5);
  cv::add(image, noise, noisy, cv::noArray(), CV_8UC3);
  if (mask) *mask = inside;
  return noisy;
}

cv::Mat strokes(bool second) {
  cv::Mat marks = cv::Mat::zeros(kSize, CV_8U);
  cv::line(marks, {520, 360}, {760, 360}, 1, 5);
  if (second) cv::line(marks, {400, 140}, {880, 140}, kBackgroundStroke, 5);
  return marks;
}

double wrongPercent(const cv::Mat& found, const cv::Mat& truth) {
  return 100.0 * cv::countNonZero(found(kRect) != truth(kRect)) / kRect.area();
}

void firstSegmentation(benchmark::State& state) {
  cv::Mat truth;
  const cv::Mat image = picture(0.0, &truth);
  cv::Mat found;
  for (auto _ : state) {
    Segmenter segmenter(image, {{"object", 1, kRect, {}, {}}});
    found = segmenter.segment(strokes(false)).clone();
  }
  state.counters["wrong_percent"] = wrongPercent(found > 0, truth);
}
BENCHMARK(firstSegmentation)->Unit(benchmark::kMillisecond);

void anotherStroke(benchmark::State& state) {
  cv::Mat truth;
  const cv::Mat image = picture(0.0, &truth), first = strokes(false), second = strokes(true);
  Segmenter segmenter(image, {{"object", 1, kRect, {}, {}}});
  segmenter.segment(first);
  bool flip = false;
  for (auto _ : state) benchmark::DoNotOptimize(segmenter.segment((flip = !flip) ? second : first));
  state.counters["wrong_percent"] = wrongPercent(segmenter.labels() > 0, truth);
}
BENCHMARK(anotherStroke)->Unit(benchmark::kMillisecond);

void openCvGrabCut(benchmark::State& state) {
  cv::Mat truth, mask;
  const cv::Mat image = picture(0.0, &truth);
  for (auto _ : state) {
    cv::Mat background, foreground;
    mask = cv::Mat(kSize, CV_8U, cv::Scalar(cv::GC_BGD));
    mask(kRect).setTo(cv::GC_PR_FGD);
    mask.setTo(cv::GC_FGD, strokes(false) == 1);
    cv::grabCut(image, mask, kRect, background, foreground, 5, cv::GC_INIT_WITH_MASK);
  }
  state.counters["wrong_percent"] = wrongPercent((mask & 1) > 0, truth);
}
BENCHMARK(openCvGrabCut)->Unit(benchmark::kMillisecond);

void contour(benchmark::State& state) {
  cv::Mat truth;
  const cv::Mat image = picture(0.0, &truth);
  const cv::Mat labels = truth / 255;
  for (auto _ : state) benchmark::DoNotOptimize(extractContour(image, labels, 1, "object"));
}
BENCHMARK(contour)->Unit(benchmark::kMillisecond);

void trackedFrame(benchmark::State& state) {
  cv::Mat truth;
  const cv::Mat image = picture(0.0, &truth), moved = picture(8.0);
  MaskTracker tracker(image, truth / 255);
  bool flip = false;
  for (auto _ : state) benchmark::DoNotOptimize(tracker.track((flip = !flip) ? moved : image));
}
BENCHMARK(trackedFrame)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
