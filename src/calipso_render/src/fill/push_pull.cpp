#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {
namespace {

constexpr float kLeastSupport = 1e-6f;  // sum of weights from which a colour is known

// A picture times its weight, which is the last channel.
template <int kChannels>
cv::Mat weighted(const cv::Mat& image, const cv::Mat& weight) {
  cv::Mat out(image.size(), CV_32FC(kChannels + 1));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    const float *colour = image.ptr<float>(v), *w = weight.ptr<float>(v);
    float* to = out.ptr<float>(v);
    for (int u = 0; u < out.cols; ++u, colour += kChannels, to += kChannels + 1) {
      for (int c = 0; c < kChannels; ++c) to[c] = w[u] * colour[c];
      to[kChannels] = w[u];
    }
  }
  return out;
}

// What was weighted, and how far it is to be trusted: a pixel with any support more than its weight
// says.
template <int kChannels>
void unweight(const cv::Mat& weighted, cv::Mat& image, cv::Mat& trust) {
  image.create(weighted.size(), CV_32FC(kChannels));
  trust.create(weighted.size(), CV_32F);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < image.rows; ++v) {
    const float* from = weighted.ptr<float>(v);
    float *colour = image.ptr<float>(v), *w = trust.ptr<float>(v);
    for (int u = 0; u < image.cols; ++u, colour += kChannels, from += kChannels + 1) {
      const float sum = from[kChannels];
      const float scale = sum > kLeastSupport ? 1.0f / sum : 0.0f;
      for (int c = 0; c < kChannels; ++c) colour[c] = scale * from[c];
      w[u] = std::min(4.0f * sum, 1.0f);
    }
  }
}

// The last level. What nothing supports there is as the rest, else it would be black.
cv::Mat coarsest(const cv::Mat& image, const cv::Mat& weight) {
  cv::Mat out = image.clone();
  const cv::Mat supported = weight > 4.0f * kLeastSupport;
  if (cv::countNonZero(supported) > 0) out.setTo(cv::mean(image, supported), supported == 0);
  return out;
}

template <int kChannels>
cv::Mat filled(const cv::Mat& image, const cv::Mat& weight) {
  if (image.cols <= 2 && image.rows <= 2) return coarsest(image, weight);
  cv::Mat half, half_image, half_trust, coarse;
  cv::pyrDown(weighted<kChannels>(image, weight), half,
              {(image.cols + 1) / 2, (image.rows + 1) / 2}, cv::BORDER_REPLICATE);
  unweight<kChannels>(half, half_image, half_trust);
  cv::pyrUp(filled<kChannels>(half_image, half_trust), coarse, {half.cols * 2, half.rows * 2});
  cv::Mat out(image.size(), CV_32FC(kChannels));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    const float *fine = image.ptr<float>(v), *smooth = coarse.ptr<float>(v),
                *weights = weight.ptr<float>(v);
    float* to = out.ptr<float>(v);
    for (int u = 0; u < out.cols; ++u, fine += kChannels, smooth += kChannels, to += kChannels) {
      const float w = std::min(1.0f, weights[u]);
      for (int c = 0; c < kChannels; ++c) to[c] = fine[c] * w + smooth[c] * (1.0f - w);
    }
  }
  return out;
}

}  // namespace

cv::Mat pushPull(const cv::Mat& image, const cv::Mat& weight) {
  CV_Assert((image.type() == CV_32FC3 || image.type() == CV_32FC1) && weight.type() == CV_32FC1 &&
            image.size() == weight.size());
  return image.channels() == 1 ? filled<1>(image, weight) : filled<3>(image, weight);
}

}  // namespace calipso::render
