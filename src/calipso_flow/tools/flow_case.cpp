#include "flow_case.hpp"

#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <stdexcept>

#include "calipso_flow/dense_flow.hpp"
#include "json_entry.hpp"

namespace calipso::flow {
namespace {

constexpr float kFloTag = 202021.25f;  // spells PIEH
constexpr float kUnknownFlow = 1e9f;   // larger values mark unknown pixels
constexpr int kLargestSide = 1 << 15;

cv::Mat readPicture(const std::string& path) {
  const cv::Mat picture = cv::imread(path, cv::IMREAD_COLOR);
  if (picture.empty()) throw std::runtime_error(path + " is no picture that can be read");
  return picture;
}

double endPointError(const cv::Mat& flow, const cv::Mat& truth) {
  double sum = 0.0;
  int count = 0;
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      const cv::Vec2f t = truth.at<cv::Vec2f>(y, x);
      if (!(std::abs(t[0]) < kUnknownFlow && std::abs(t[1]) < kUnknownFlow)) continue;
      sum += cv::norm(flow.at<cv::Vec2f>(y, x) - t);
      ++count;
    }
  }
  return sum / std::max(1, count);
}

cv::Mat farneback(const cv::Mat& from, const cv::Mat& to) {
  cv::Mat a, b, flow;
  cv::cvtColor(from, a, cv::COLOR_BGR2GRAY);
  cv::cvtColor(to, b, cv::COLOR_BGR2GRAY);
  cv::calcOpticalFlowFarneback(a, b, flow, 0.5, 4, 15, 3, 5, 1.2, 0);
  return flow;
}

}  // namespace

cv::Mat readFlo(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  float tag = 0.0f;
  int32_t width = 0, height = 0;
  file.read(reinterpret_cast<char*>(&tag), 4);
  file.read(reinterpret_cast<char*>(&width), 4);
  file.read(reinterpret_cast<char*>(&height), 4);
  const bool sane = width > 0 && height > 0 && width < kLargestSide && height < kLargestSide;
  if (!file || tag != kFloTag || !sane) {
    throw std::runtime_error(path + " is no .flo file: its tag or size is wrong");
  }
  cv::Mat flow(height, width, CV_32FC2);
  file.read(reinterpret_cast<char*>(flow.data), flow.total() * flow.elemSize());
  if (!file)
    throw std::runtime_error(path + " ends before its " + std::to_string(height) + " rows");
  return flow;
}

std::vector<std::string> evaluateFlow(const std::string& directory) {
  const cv::Mat from = readPicture(directory + "/frame10.png");
  const cv::Mat to = readPicture(directory + "/frame11.png");
  const cv::Mat truth = readFlo(directory + "/flow10.flo");
  if (truth.size() != from.size()) {
    throw std::runtime_error(directory + ": flow10.flo and frame10.png differ in size");
  }
  DenseFlow ultrafast(DenseFlow::Preset::kUltrafast), fast(DenseFlow::Preset::kFast),
      medium(DenseFlow::Preset::kMedium);
  const std::vector<std::pair<std::string, std::function<cv::Mat()>>> methods = {
      {"dis_ultrafast", [&] { return ultrafast.compute(from, to); }},
      {"dis_fast", [&] { return fast.compute(from, to); }},
      {"dis_medium", [&] { return medium.compute(from, to); }},
      {"farneback", [&] { return farneback(from, to); }}};
  std::vector<std::string> entries;
  for (const auto& [name, compute] : methods) {
    const std::clock_t start = std::clock();
    const cv::Mat flow = compute();
    const double ms = 1e3 * (std::clock() - start) / CLOCKS_PER_SEC;
    JsonEntry entry;
    entry.text("case", std::filesystem::path(directory).filename().string()).null("object");
    entry.text("method", name).number("endpoint_error_px", endPointError(flow, truth));
    entries.push_back(entry.number("ms_frame", ms).str());
  }
  return entries;
}

}  // namespace calipso::flow
