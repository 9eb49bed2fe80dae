#include "kernels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <opencv2/core.hpp>

#include "calipso_render/appearance.hpp"
#include "calipso_render/colour.hpp"
#include "calipso_render/noise.hpp"

namespace calipso::render {
namespace {

// The kernels for newer processors give the bits of the plain ones; without such a processor there
// is nothing to compare.
class Avx2 : public ::testing::Test {
 protected:
  void SetUp() override {
    if (avx2Kernels() == nullptr) GTEST_SKIP() << "no AVX2 on this processor";
  }
  cv::RNG random_{7};
};

TEST_F(Avx2, EncodesTheSameBytes) {
  std::vector<cv::Vec4f> colours(1000);
  for (cv::Vec4f& c : colours)
    c = {random_.uniform(-0.1f, 1.2f), random_.uniform(0.0f, 0.02f), random_.uniform(0.0f, 1.0f),
         random_.uniform(0.0f, 1.0f)};
  const NoiseField field(3);
  const NoiseRows noise{{field.row(5, 0), field.row(5, 1), field.row(5, 2)}};
  NoiseCurves curves;
  for (int i = 0; i < 24; ++i)
    curves.start[i / 8][i % 8] = random_.uniform(0.0f, 4.0f),
                            curves.rise[i / 8][i % 8] = random_.uniform(-0.01f, 0.01f);
  for (const int count : {1, 7, 64, 65, 1000}) {
    std::vector<cv::Vec3b> plain(colours.size()), fast(colours.size());
    plainKernels().encode(curves, colours.data(), noise, 200, count, plain.data());
    avx2Kernels()->encode(curves, colours.data(), noise, 200, count, fast.data());
    EXPECT_EQ(plain, fast) << count;
  }
}

TEST_F(Avx2, SamplesTheSameValues) {
  cv::Mat image(20, 30, CV_32FC4);
  random_.fill(image, cv::RNG::UNIFORM, -0.2, 1.0);
  std::vector<float> u, v;
  for (int i = 0; i < 500; ++i)
    u.push_back(random_.uniform(-3.0f, 33.0f)), v.push_back(random_.uniform(-3.0f, 23.0f));
  std::vector<cv::Vec4f> plain(u.size()), fast(u.size());
  plainKernels().sample(image, u.data(), v.data(), 500, plain.data());
  avx2Kernels()->sample(image, u.data(), v.data(), 500, fast.data());
  EXPECT_EQ(std::memcmp(plain.data(), fast.data(), plain.size() * sizeof(cv::Vec4f)), 0);
}

TEST_F(Avx2, LocatesTheSamePlaces) {
  std::vector<TriangleMap> maps(40);
  for (TriangleMap& map : maps) {
    for (auto& line : map.key) {
      for (float& x : line) x = random_.uniform(0.1f, 1.0f);
    }
    map.u = random_.uniform(0.0f, 50.0f), map.v = random_.uniform(0.0f, 50.0f);
  }
  std::vector<std::uint32_t> ids;
  for (std::uint32_t id = 0; id < maps.size(); ++id)
    ids.insert(ids.end(), random_.uniform(1, 20), id);
  const int count = static_cast<int>(ids.size());
  std::vector<float> plain_u(count + 7), plain_v(count + 7), u(count + 7), v(count + 7);
  plainKernels().locate(maps.data(), ids.data(), 3, 20, count, {5, 6}, plain_u.data(),
                        plain_v.data());
  avx2Kernels()->locate(maps.data(), ids.data(), 3, 20, count, {5, 6}, u.data(), v.data());
  for (int k = 0; k < count; ++k) {
    ASSERT_EQ(plain_u[k], u[k]) << k;
    ASSERT_EQ(plain_v[k], v[k]) << k;
    ASSERT_NEAR(u[k], maps[ids[k]].keyAt(3.0f + k, 20.0f).x() - 5.0f,
                1e-3f * (1.0f + std::abs(u[k])))
        << k;
  }
}

TEST_F(Avx2, SeesTheSameLight) {
  constexpr int kSide = 40;
  std::vector<float> heights(kSide * kSide, -3e38f);
  for (int j = 8; j < 32; ++j) {
    for (int i = 8; i < 32; ++i) heights[j * kSide + i] = random_.uniform(0.0f, 1.0f);
  }
  ShadowTaps taps;
  taps.count = 24;
  for (int k = 0; k < taps.count; ++k)
    taps.x[k] = random_.uniform(-0.7f, 0.7f), taps.y[k] = random_.uniform(-0.7f, 0.7f);
  int between = 0;
  for (int i = 0; i < 500; ++i) {
    const float s = random_.uniform(-5.0f, 45.0f), t = random_.uniform(-5.0f, 45.0f),
                h = random_.uniform(-0.2f, 1.0f);
    const float plain = plainKernels().visibleThrough({heights.data(), kSide, kSide, kSide, 9.0f},
                                                      taps, s, t, h, 6.0f);
    EXPECT_EQ(avx2Kernels()->visibleThrough({heights.data(), kSide, kSide, kSide, 9.0f}, taps, s, t,
                                            h, 6.0f),
              plain)
        << s << ", " << t;
    between += plain > 0.0f && plain < 1.0f;
  }
  EXPECT_GT(between, 100);
}

TEST_F(Avx2, FillsTheSameTriangles) {
  constexpr int kRows = 40, kStride = 48;
  for (const bool narrow : {true, false}) {
    std::vector<TriangleSpan> spans(200);
    for (TriangleSpan& s : spans) {
      s.column_min = random_.uniform(0, 20),
      s.column_max = s.column_min + (narrow ? random_.uniform(0, 8) : random_.uniform(8, 20));
      s.row_min = random_.uniform(0, 30), s.row_max = s.row_min + random_.uniform(0, 10);
      for (int k = 0; k < 4; ++k)
        s.column[k] = random_.uniform(0.0f, 20.0f) + (k < 2 ? 0.0f : 20.0f),
        s.row[k] = random_.uniform(0.0f, 40.0f), s.slope[k] = random_.uniform(-2.0f, 2.0f);
      s.near_u = random_.uniform(-0.1f, 0.1f), s.near_v = random_.uniform(-0.1f, 0.1f),
      s.near_0 = random_.uniform(0.0f, 5.0f);
      s.id = static_cast<std::uint32_t>(&s - spans.data());
    }
    const auto draw = [&](const Kernels& kernels, std::vector<std::uint32_t>& ids,
                          std::vector<float>& nearness, std::vector<float>& alone) {
      ids.assign(kRows * kStride, 999), nearness.assign(kRows * kStride, -1.0f), alone = nearness;
      kernels.fill(spans.data(), 200, {ids.data(), nearness.data(), kStride, 3, 35});
      kernels.fill(spans.data(), 200, {nullptr, alone.data(), kStride, 3, 35});
    };
    std::vector<std::uint32_t> plain_ids, ids;
    std::vector<float> plain_near, near, plain_alone, alone;
    draw(plainKernels(), plain_ids, plain_near, plain_alone),
        draw(*avx2Kernels(), ids, near, alone);
    EXPECT_EQ(ids, plain_ids);
    EXPECT_EQ(near, plain_near);
    EXPECT_EQ(alone, plain_alone);
    EXPECT_EQ(alone, near);
    EXPECT_GT(std::count_if(ids.begin(), ids.end(), [](std::uint32_t id) { return id != 999; }),
              300);
  }
}

TEST_F(Avx2, DrawsTheSameSamples) {
  EdgeCoverage::Pixel plain;
  plain.ids.fill(VisibilityBuffer::kNothing), plain.nearness.fill(VisibilityBuffer::kFar);
  EdgeCoverage::Pixel fast = plain;
  for (std::uint32_t id = 0; id < 300; ++id) {
    TriangleSamples t;
    for (int k = 0; k < 3; ++k)
      t.edge_u[k] = random_.uniform(-1.0f, 1.0f), t.edge_v[k] = random_.uniform(-1.0f, 1.0f),
      t.edge_0[k] = random_.uniform(-1.0f, 3.0f);
    t.near_u = random_.uniform(-0.1f, 0.1f), t.near_v = random_.uniform(-0.1f, 0.1f),
    t.near_0 = random_.uniform(0.0f, 5.0f) + 0.01f * static_cast<float>(id);
    plainKernels().drawSamples(t, 1, 2, id, plain);
    avx2Kernels()->drawSamples(t, 1, 2, id, fast);
    ASSERT_EQ(plain.ids, fast.ids);
    ASSERT_EQ(plain.nearness, fast.nearness);
  }
  EXPECT_NE(plain.ids[0], VisibilityBuffer::kNothing);
}

// What is sampled in a row and what is sampled alone must not differ where the two meet.
TEST(Kernels, SampleAsSampleBicubic) {
  constexpr int kCount = 200;
  cv::RNG random(3);
  cv::Mat image(20, 30, CV_32FC4);
  random.fill(image, cv::RNG::UNIFORM, 0.0, 1.0);
  std::vector<float> u(kCount), v(kCount);
  for (int i = 0; i < kCount; ++i)
    u[i] = random.uniform(-3.0f, 33.0f), v[i] = random.uniform(-3.0f, 23.0f);
  std::vector<cv::Vec4f> out(kCount);
  kernels().sample(image, u.data(), v.data(), kCount, out.data());
  for (int i = 0; i < kCount; ++i) {
    EXPECT_LT(cv::norm(out[i] - sampleBicubic(image, u[i], v[i]), cv::NORM_INF), 1e-6)
        << u[i] << ", " << v[i];
  }
}

}  // namespace
}  // namespace calipso::render
