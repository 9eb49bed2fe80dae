#include "filling_case.hpp"

#include <opencv2/imgproc.hpp>
#include <opencv2/photo.hpp>
#include <opencv2/xphoto/inpainting.hpp>

#include "../measures.hpp"
#include "../picture_file.hpp"
#include "../truth.hpp"
#include "calipso_render/inpaint.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::render {
namespace {

constexpr int kMargin = 3;     // px by which the masks are grown
constexpr double kRadius = 5;  // px, of Telea's and Navier-Stokes' neighbourhood

cv::Mat ours(const cv::Mat& bgr, const cv::Mat& hole) {
  cv::Mat image, filled;
  bgr.convertTo(image, CV_32F);
  inpaint(image, hole, cv::Mat()).image.convertTo(filled, CV_8U);
  return filled;
}

cv::Mat openCv(const cv::Mat& bgr, const cv::Mat& hole, int method) {
  cv::Mat filled;
  cv::inpaint(bgr, hole, filled, kRadius, method);
  return filled;
}

// FSR works on the whole picture; its mask says what is known.
cv::Mat frequencySelective(const cv::Mat& bgr, const cv::Mat& hole) {
  cv::Mat filled;
  cv::xphoto::inpaint(bgr, hole == 0, filled, cv::xphoto::INPAINT_FSR_FAST);
  return filled;
}

}  // namespace

std::vector<FillingResult> compareFilling(const std::string& scene_directory,
                                          const std::string& pictures,
                                          const std::function<double()>& clock_ms) {
  const Scene scene = loadScene(scene_directory);
  const cv::Mat objects = loadLabels(scene, 0) != 0, hole = grow(objects, kMargin);
  cv::Mat bgr = loadFrame(scene, 0).clone();
  bgr.setTo(cv::Scalar::all(0), hole);
  const auto truth = loadPlate(scene, 0);
  const std::vector<std::pair<std::string, std::function<cv::Mat()>>> methods = {
      {"calipso", [&] { return ours(bgr, hole); }},
      {"telea", [&] { return openCv(bgr, hole, cv::INPAINT_TELEA); }},
      {"navier_stokes", [&] { return openCv(bgr, hole, cv::INPAINT_NS); }},
      {"xphoto_fsr_fast", [&] { return frequencySelective(bgr, hole); }}};
  std::vector<FillingResult> results;
  for (const auto& [name, fill] : methods) {
    const double start = clock_ms();
    const cv::Mat filled = fill();
    FillingResult r{name, std::nullopt, std::nullopt,
                    static_cast<double>(cv::countNonZero(hole)) / hole.total(), clock_ms() - start};
    if (truth)
      r.psnr_db = psnr(filled, *truth, objects),
      r.gradient_ratio = gradientRatio(filled, *truth, objects);
    if (!pictures.empty())
      writePicture(pictures + "/" + scene.name + "_filled_" + name + ".png", filled);
    results.push_back(r);
  }
  return results;
}

}  // namespace calipso::render
