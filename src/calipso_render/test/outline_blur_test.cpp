// Outlines of what is drawn are as soft as the video's.

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ball_setting.hpp"
#include "calipso_render/colour.hpp"
#include "frame/edge_blur.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// A bright disc on a dark, uneven ground, each pixel the mean of 64 points, then blurred, as lenses
// blur: in linear light.
cv::Mat disc(float blur, cv::Mat& labels) {
  constexpr int kSide = 160, kParts = 8;
  cv::RNG random(3);
  cv::Mat linear(kSide, kSide, CV_32FC3);
  labels = cv::Mat::zeros(kSide, kSide, CV_8U);
  for (int v = 0; v < kSide; ++v) {
    for (int u = 0; u < kSide; ++u) {
      int inside = 0;
      for (int k = 0; k < kParts * kParts; ++k) {
        const float x = u + (k % kParts + 0.5f) / kParts - 80.3f,
                    y = v + (k / kParts + 0.5f) / kParts - 79.6f;
        inside += x * x + y * y < 50.0f * 50.0f;
      }
      const float part = static_cast<float>(inside) / (kParts * kParts);
      linear.at<cv::Vec3f>(v, u) =
          cv::Vec3f::all(0.5f * part + (1.0f - part) * random.uniform(0.08f, 0.12f));
      labels.at<std::uint8_t>(v, u) = part > 0.5f ? 1 : 0;
    }
  }
  if (blur > 0.0f) cv::GaussianBlur(linear, linear, {0, 0}, blur);
  cv::Mat codes(linear.size(), CV_32FC3);
  std::transform(linear.begin<cv::Vec3f>(), linear.end<cv::Vec3f>(), codes.begin<cv::Vec3f>(),
                 [](const cv::Vec3f& x) {
                   return cv::Vec3f(codeFromLinear(x[0]), codeFromLinear(x[1]),
                                    codeFromLinear(x[2]));
                 });
  return codes;
}

TEST(OutlineBlur, IsThatOfThePicture) {
  for (const float blur : {0.0f, 0.5f, 0.8f, 1.5f}) {
    cv::Mat labels;
    const cv::Mat picture = disc(blur, labels);
    // The widths that are tried are 15 % apart; a pixel's own 0.29 hides what is below 0.2.
    EXPECT_NEAR(outlineBlur(picture, labels), blur, blur > 0.0f ? 0.15f : 0.2f) << blur;
  }
}

// Most of an outline has something soft along it (a shade, a wave).
TEST(OutlineBlur, IsThatOfTheSharpPart) {
  cv::Mat labels;
  const cv::Mat sharp = disc(0.3f, labels), soft = disc(1.5f, labels);
  cv::Mat picture = soft.clone();
  sharp.rowRange(0, 40).copyTo(picture.rowRange(0, 40));  // a fifth of the outline
  EXPECT_GT(outlineBlur(soft, labels), 1.2f);
  EXPECT_LT(outlineBlur(picture, labels), 0.6f);
}

TEST(OutlineBlur, IsTheUsualOneWithoutContrast) {
  cv::Mat labels;
  disc(0.0f, labels);
  cv::Mat noise(labels.size(), CV_32FC3);
  cv::randu(noise, cv::Scalar::all(90), cv::Scalar::all(110));
  EXPECT_EQ(outlineBlur(noise, labels), 0.3f);
  EXPECT_EQ(outlineBlur(noise, cv::Mat::zeros(labels.size(), CV_8U)), 0.3f);
}

// Colours as a video codec leaves them: blurred beside their luma.
cv::Mat withSoftColours(const cv::Mat& codes, float blur) {
  cv::Mat soft, out = codes.clone();
  cv::GaussianBlur(codes, soft, {0, 0}, blur);
  for (int v = 0; v < codes.rows; ++v) {
    for (int u = 0; u < codes.cols; ++u) {
      const cv::Vec3f &c = codes.at<cv::Vec3f>(v, u), &s = soft.at<cv::Vec3f>(v, u);
      out.at<cv::Vec3f>(v, u) = s + cv::Vec3f::all(lumaOf(c) - lumaOf(s));
    }
  }
  return out;
}

TEST(ColourBlur, IsThatOfThePicturesColours) {
  for (const float blur : {0.5f, 1.0f, 1.5f}) {
    cv::Mat labels;
    cv::Mat picture = disc(0.0f, labels);
    for (cv::Vec3f& c : cv::Mat_<cv::Vec3f>(picture)) c[0] *= 0.6f;  // yellow
    EXPECT_NEAR(colourBlur(withSoftColours(picture, blur), labels), blur, 0.2f) << blur;
    EXPECT_LT(outlineBlur(withSoftColours(picture, blur), labels), 0.35f) << blur;
  }
}

TEST(ColourBlur, IsNotToldByGrey) {
  cv::Mat labels;
  const cv::Mat picture = disc(1.0f, labels);
  EXPECT_EQ(colourBlur(picture, labels), 0.0f);
}

// CV_8UC1: 1 where the objects are, as `input` has them.
cv::Mat labelsOf(const FrameInput& input, const Prepared& prepared) {
  const Actor now = makeActor(prepared.surfaces[0], input.objects[0].vertices, input.camera);
  const VisibilityBuffer seen({0, 0, kWidth, kHeight}, {&now.screen});
  cv::Mat labels = cv::Mat::zeros(kHeight, kWidth, CV_8U);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u)
      if (seen.idAt(u, v) != VisibilityBuffer::kNothing) labels.at<std::uint8_t>(v, u) = 1;
  return labels;
}

std::shared_ptr<const Prepared> learntFrom(const ClipFrame& key) {
  ClipSample clip;
  clip.add(key);
  return std::make_shared<const Prepared>(prepare(clip, {ballAt(kCentre)}, params()));
}

cv::Mat drawnBy(Renderer& renderer, const FrameInput& input) {
  cv::Mat codes;
  renderer.composite(input).bgr.convertTo(codes, CV_32F);
  return codes;
}

// A ball that is moved in a blurred picture has an outline as soft as before; one that stays is the
// picture's, to the byte.
TEST(Renderer, DrawnOutlinesAreAsSoftAsTheVideos) {
  ClipFrame key = frameWithBall(ballAt(kCentre));
  cv::Mat linear = linearFromCode(key.bgr);
  cv::GaussianBlur(linear, linear, {0, 0}, 1.0);
  key.bgr = codeFromLinear(linear);
  const auto prepared = learntFrom(key);
  ASSERT_NEAR(prepared->outline_blur, 1.0f, 0.2f);
  auto sharp = std::make_shared<Prepared>(*prepared);
  sharp->outline_blur = 0.0f;

  const FrameInput moved = ballMovedLeft(key, *prepared);
  const cv::Mat labels = labelsOf(moved, *prepared);
  Renderer renderer(prepared, params()), sharp_renderer(sharp, params());
  const float soft = outlineBlur(drawnBy(renderer, moved), labels),
              hard = outlineBlur(drawnBy(sharp_renderer, moved), labels);
  // The texture is of the blurred picture, which adds to both.
  EXPECT_GT(soft, 0.9f * prepared->outline_blur);
  EXPECT_LT(soft, 1.5f * prepared->outline_blur);
  EXPECT_LT(hard, 0.75f * soft);

  FrameInput still = moved;
  still.objects[0].vertices = prepared->surfaces[0].key_vertices;
  EXPECT_EQ(cv::norm(renderer.composite(still).bgr, key.bgr, cv::NORM_INF), 0.0);
}

// A ball of another colour than the table, as a codec leaves it.
ClipFrame codedBall(const Eigen::Vector3d& centre) {
  ClipFrame frame = frameWithBall(ballAt(centre));
  cv::Mat codes;
  frame.bgr.convertTo(codes, CV_32F);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u)
      if (frame.labels.at<std::uint8_t>(v, u) != 0) codes.at<cv::Vec3f>(v, u)[0] *= 0.5f;
  withSoftColours(codes, 1.3f).convertTo(frame.bgr, CV_8U);
  return frame;
}

TEST(Renderer, DrawnColoursAreAsSoftAsTheVideos) {
  const ClipFrame key = codedBall(kCentre);
  const auto prepared = learntFrom(key);
  ASSERT_NEAR(prepared->colour_blur, 1.3f, 0.3f);
  auto crisp = std::make_shared<Prepared>(*prepared);
  crisp->colour_blur = 0.0f;

  const FrameInput moved = ballMovedLeft(key, *prepared);
  const cv::Mat labels = labelsOf(moved, *prepared);
  Renderer renderer(prepared, params()), crisp_renderer(crisp, params());
  const cv::Mat soft = drawnBy(renderer, moved), hard = drawnBy(crisp_renderer, moved);
  EXPECT_NEAR(colourBlur(soft, labels), prepared->colour_blur, 0.4f);
  EXPECT_LT(colourBlur(hard, labels), 0.6f * prepared->colour_blur);
  // Their brightness is what it was.
  cv::Mat differs;
  cv::transform(soft - hard, differs, cv::Matx13f(0.114f, 0.587f, 0.299f));
  EXPECT_LE(cv::norm(differs, cv::NORM_INF), 1.5);
}

// A ball that the video has 2 px beside its place in the key frame: its plain middle looks as there,
// but nothing of the key frame's rim is carried over to its own.
TEST(Renderer, ColoursOfWhatHasHardlyMovedInTheVideoAreAsSoft) {
  const ClipFrame key = codedBall(kCentre);
  auto prepared = std::make_shared<Prepared>(*learntFrom(key));
  prepared->moves[0] = true;
  const Eigen::Vector3d there = kCentre + Eigen::Vector3d(0.01, 0, 0);
  const ClipFrame now = codedBall(there);
  FrameInput in{now.bgr, now.labels, now.camera, 7, {}, {}};
  ObjectInFrame ball;
  ball.name = "ball", ball.edited = true;
  ball.observed = ball.world_from_object = ballAt(there).world_from_object;
  ball.vertices = transformed(prepared->surfaces[0].object_vertices, *ball.observed);
  in.objects = {ball};
  RenderParams drawn = params();
  drawn.keep_still = false;
  Renderer renderer(prepared, drawn);
  EXPECT_NEAR(colourBlur(drawnBy(renderer, in), now.labels), prepared->colour_blur, 0.4f);
}

}  // namespace
}  // namespace calipso::render
