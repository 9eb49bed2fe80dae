#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calipso_render/appearance.hpp"
#include "calipso_render/colour.hpp"
#include "calipso_render/noise.hpp"
#include "calipso_render/pixel_format.hpp"

namespace calipso::render {
namespace {

TEST(Colour, EveryCodeComesBack) {
  for (int code = 0; code < 256; ++code) {
    const float linear = linearFromCode(static_cast<std::uint8_t>(code));
    EXPECT_EQ(quantise(codeFromLinear(linear)), code);
    EXPECT_NEAR(codeFromLinear(linear), code, 0.02f);
  }
}

TEST(Colour, OutOfRangeAndNanAreClamped) {
  EXPECT_EQ(codeFromLinear(-1.0f), 0.0f);
  EXPECT_EQ(codeFromLinear(7.0f), 255.0f);
  EXPECT_EQ(codeFromLinear(std::nanf("")), 0.0f);
}

TEST(PixelFormat, RefusesWhatItCannotEdit) {
  for (const std::string encoding : {"mono16", "16UC3", "bayer_rggb8", ""}) {
    try {
      pixelFormat(encoding);
      FAIL() << encoding << " was accepted";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find("'" + encoding + "'"), std::string::npos);
    }
  }
}

TEST(PixelFormat, WritesOnlyChangedPixelsAndKeepsAlpha) {
  for (const auto& [name, count] : {std::pair<std::string, int>{"bgr8", 3},
                                    {"rgb8", 3},
                                    {"mono8", 1},
                                    {"bgra8", 4},
                                    {"rgba8", 4}}) {
    const PixelFormat format = pixelFormat(name);
    ASSERT_EQ(channels(format), count);
    cv::Mat image(2, 2, CV_8UC(count));
    for (std::size_t i = 0; i < image.total() * count; ++i)
      image.data[i] = static_cast<std::uint8_t>(40 + 3 * i);
    const cv::Mat before = image.clone();
    cv::Mat bgr = toBgr(image, format).clone();
    bgr.at<cv::Vec3b>(1, 0) = {9, 9, 9};
    bgr.at<cv::Vec3b>(0, 1) = {200, 200, 200};  // differs, but is not flagged
    cv::Mat changed = cv::Mat::zeros(2, 2, CV_8U);
    changed.at<std::uint8_t>(1, 0) = 1;
    writeChanged(bgr, changed, format, image);
    for (int c = 0; c < count; ++c) {
      const std::uint8_t expected = c == 3 ? before.ptr(1)[c] : 9;
      EXPECT_EQ(image.ptr(1)[c], expected) << name;
      EXPECT_EQ(image.ptr(0)[count + c], before.ptr(0)[count + c]) << name;
    }
  }
}

// Four pictures of 120 x 120 px with noise of 3 code values about 100.
// @param draw what frame k holds besides: (k, picture)
template <typename Draw>
std::vector<cv::Mat> noisyFrames(Draw draw) {
  cv::RNG random(3);
  std::vector<cv::Mat> frames;
  for (int k = 0; k < 4; ++k) {
    cv::Mat noise(120, 120, CV_32FC3), frame;
    random.fill(noise, cv::RNG::NORMAL, 100.0, 3.0);
    draw(k, noise);
    noise.convertTo(frame, CV_8U);
    frames.push_back(frame);
  }
  return frames;
}

TEST(Noise, EstimatesWhatWasAdded) {
  const std::vector<cv::Mat> frames = noisyFrames([](int, cv::Mat&) {});
  const std::vector<cv::Mat> everywhere(4, cv::Mat(120, 120, CV_8U, cv::Scalar(255)));
  EXPECT_NEAR(NoiseModel::estimate(frames, everywhere).deviation(1, 100.0f), 3.0f,
              0.3f);  // 10 %: sampling
  EXPECT_NEAR(NoiseModel::estimate({frames[0]}, {everywhere[0]}).deviation(1, 100.0f), 3.0f,
              0.3f);  // one picture
}

// A white ball that flies by, unknown to the masks, shows the camera's brightest colours alone.
TEST(Noise, IsNotWhatMoves) {
  const std::vector<cv::Mat> frames = noisyFrames([](int k, cv::Mat& picture) {
    cv::circle(picture, {20 + 25 * k, 60}, 10, cv::Scalar::all(250.0), -1);
  });
  const std::vector<cv::Mat> everywhere(4, cv::Mat(120, 120, CV_8U, cv::Scalar(255)));
  // Five knots from 96 on: 1.25^5 = 3.05 times 3; the passing itself has 90.
  EXPECT_LT(NoiseModel::estimate(frames, everywhere).deviation(1, 250.0f), 10.0f);
}

// Water that ripples by a few code values over two thirds of the picture.
TEST(Noise, IsNotWhatRipples) {
  cv::RNG random(4);
  const std::vector<cv::Mat> frames = noisyFrames([&](int, cv::Mat& picture) {
    cv::Mat ripples(80, 120, CV_32FC3);
    random.fill(ripples, cv::RNG::NORMAL, 0.0, 8.0);
    picture.rowRange(0, 80) += ripples;
  });
  const std::vector<cv::Mat> everywhere(4, cv::Mat(120, 120, CV_8U, cv::Scalar(255)));
  EXPECT_LT(NoiseModel::estimate(frames, everywhere).deviation(1, 100.0f), 4.0f);
}

// Black bars above and below a picture, or a burnt-out sky, hold most of the samples.
TEST(Noise, IsNotBoundByWhatIsClipped) {
  for (const double clipped : {0.0, 255.0}) {
    cv::RNG random(3);
    std::vector<cv::Mat> frames;
    for (int k = 0; k < 4; ++k) {
      cv::Mat noise(120, 120, CV_32FC3), frame;
      random.fill(noise, cv::RNG::NORMAL, 128.0, 3.0);
      noise.rowRange(0, 80).setTo(cv::Scalar::all(clipped));
      noise.convertTo(frame, CV_8U);
      frames.push_back(frame);
    }
    const std::vector<cv::Mat> everywhere(4, cv::Mat(120, 120, CV_8U, cv::Scalar(255)));
    for (const std::size_t count : {4, 1}) {
      const NoiseModel model =
          NoiseModel::estimate({frames.begin(), frames.begin() + count},
                               {everywhere.begin(), everywhere.begin() + count});
      EXPECT_NEAR(model.deviation(1, 128.0f), 3.0f, 0.3f) << clipped << ", " << count;
    }
  }
}

TEST(Noise, StillPicturesHaveNone) {
  const std::vector<cv::Mat> frames(3, cv::Mat(64, 64, CV_8UC3, cv::Scalar::all(90)));
  EXPECT_LT(
      NoiseModel::estimate(frames, std::vector<cv::Mat>(3, cv::Mat(64, 64, CV_8U, cv::Scalar(255))))
          .deviation(0, 90.0f),
      0.4f);  // rounding
}

TEST(NoiseField, HangsOnStampAndPixelAlone) {
  const NoiseModel model;
  const NoiseField a(model, 5), b(model, 5), c(model, 6);
  int different = 0;
  double sum = 0.0, squares = 0.0;
  for (int v = 0; v < 256; ++v) {
    for (int u = 0; u < 256; ++u) {
      ASSERT_EQ(a.at(u, v, 1), b.at(u, v, 1));
      different += a.at(u, v, 1) != c.at(u, v, 1);
      sum += a.at(u, v, 1), squares += a.at(u, v, 1) * a.at(u, v, 1);
    }
  }
  EXPECT_GT(different, 60000);
  EXPECT_NEAR(sum / 65536, 0.0, 1e-3);
  EXPECT_NEAR(squares / 65536, 1.0, 1e-2);
}

TEST(SampleBicubic, ReproducesAPlaneAndThePixelsThemselves) {
  cv::Mat plane(12, 15, CV_32FC4), random(12, 15, CV_32FC4);
  for (int v = 0; v < 12; ++v) {
    for (int u = 0; u < 15; ++u)
      plane.at<cv::Vec4f>(v, u) = cv::Vec4f(1.0f + 2.0f * u, 3.0f + v, 50.0f + u - v, 4.0f);
  }
  cv::RNG numbers(2);
  numbers.fill(random, cv::RNG::UNIFORM, 0.0, 1.0);
  for (int v = 0; v < 12; ++v) {
    for (int u = 0; u < 15; ++u)
      EXPECT_LT(cv::norm(sampleBicubic(random, float(u), float(v)) - random.at<cv::Vec4f>(v, u)),
                1e-6)
          << u << ", " << v;
  }
  for (float v = 1.0f; v < 10.0f; v += 0.37f) {
    for (float u = 1.0f; u < 13.0f; u += 0.41f) {
      EXPECT_LT(cv::norm(sampleBicubic(plane, u, v) -
                         cv::Vec4f(1.0f + 2.0f * u, 3.0f + v, 50.0f + u - v, 4.0f)),
                1e-4)
          << u << ", " << v;
    }
  }
}

}  // namespace
}  // namespace calipso::render
