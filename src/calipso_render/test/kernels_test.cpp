#include "draw/kernels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>

#include "calipso_render/appearance.hpp"
#include "calipso_render/colour.hpp"
#include "calipso_render/light.hpp"
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
  std::vector<float> colours[5];
  for (int i = 0; i < 1007; ++i)
    colours[0].push_back(random_.uniform(-0.1f, 1.2f)),
        colours[1].push_back(random_.uniform(0.0f, 0.02f)),
        colours[2].push_back(random_.uniform(0.0f, 1.0f)),
        colours[3].push_back(random_.uniform(0.0f, 1.0f)),
        colours[4].push_back(random_.uniform(0.0f, 3.0f));
  const float* const planes[] = {colours[0].data(), colours[1].data(), colours[2].data(),
                                 colours[3].data(), colours[4].data()};
  const NoiseField field(NoiseModel(), 3);
  const NoiseRows noise{{field.row(5, 0), field.row(5, 1), field.row(5, 2)}};
  NoiseCurves curves;
  for (int i = 0; i < 24; ++i)
    curves.start[i / 8][i % 8] = random_.uniform(0.0f, 4.0f),
                            curves.rise[i / 8][i % 8] = random_.uniform(-0.01f, 0.01f);
  for (const int count : {1, 7, 64, 65, 1000}) {
    std::vector<cv::Vec3b> plain(1000), fast(1000);
    plainKernels().encode(curves, planes, noise, 200, count, plain.data());
    avx2Kernels()->encode(curves, planes, noise, 200, count, fast.data());
    EXPECT_EQ(plain, fast) << count;
  }
}

// A run whose every value is random.
SurfaceRun randomRun(cv::RNG& random) {
  SurfaceRun run;
  for (int k = 0; k < SurfaceRun::kRoom; ++k) {
    for (int c = 0; c < 3; ++c)
      run.sight[c][k] = random.uniform(-2.0f, 2.0f), run.colour[c][k] = random.uniform(0.0f, 1.0f),
      run.normal[c][k] = random.uniform(-1.0f, 1.0f),
      run.ambient[c][k] = random.uniform(0.0f, 1.0f);
    const Eigen::Vector3f n =
        Eigen::Vector3f(run.normal[0][k], run.normal[1][k], run.normal[2][k]).normalized();
    for (int c = 0; c < 3; ++c) run.normal[c][k] = n[c];
    run.sky[k] = random.uniform(0.0f, 1.0f), run.sun[k] = random.uniform(0.0f, 1.0f);
    run.key_u[k] = random.uniform(-3.0f, 33.0f), run.key_v[k] = random.uniform(-3.0f, 23.0f);
  }
  return run;
}

Light someLight(int terms) {
  Light light;
  light.direction = Eigen::Vector3f(0.3f, -0.5f, 0.8f).normalized();
  light.ambient[0] = {0.3f, 0.4f, 0.5f};
  for (int i = 1; i < terms; ++i)
    light.ambient[i] = {0.1f, -0.05f * static_cast<float>(i), 0.02f * static_cast<float>(i)};
  return light;
}

SurfaceShade shadeOf(const Light& light, int terms, float specular) {
  SurfaceShade shade{{light.direction.x(), light.direction.y(), light.direction.z()},
                     {light.sun[0], light.sun[1], light.sun[2]},
                     {},
                     {},
                     terms,
                     specular,
                     0.3f,
                     {0.02f, 0.02f, 0.03f},
                     {1.0f, 0.5f, 0.25f},
                     0.03f};
  for (int c = 0; c < 3; ++c) {
    shade.least[c] = 0.02f * light.ambient[0][c];
    for (int i = 0; i < 9; ++i) shade.ambient[i][c] = light.ambient[i][c];
  }
  return shade;
}

TEST_F(Avx2, SamplesTheSameValues) {
  cv::Mat image(20, 30, CV_32FC4);
  random_.fill(image, cv::RNG::UNIFORM, -0.2, 1.0);
  for (int i = 0; i < 20; ++i) {
    SurfaceRun plain = randomRun(random_), fast = plain;
    plainKernels().sample(image, 3, 60, plain), avx2Kernels()->sample(image, 3, 60, fast);
    EXPECT_EQ(std::memcmp(&plain, &fast, sizeof(plain)), 0);
  }
}

TEST_F(Avx2, ShadesTheSame) {
  for (const int terms : {1, 4, 9}) {
    const SurfaceShade shade = shadeOf(someLight(terms), terms, 0.05f);
    SurfaceRun plain = randomRun(random_), fast = plain;
    plainKernels().shade(shade, 2, 58, plain), avx2Kernels()->shade(shade, 2, 58, fast);
    EXPECT_EQ(std::memcmp(&plain, &fast, sizeof(plain)), 0) << terms;
  }
}

TEST_F(Avx2, LocatesTheSamePlaces) {
  std::vector<TriangleMap> maps(40);
  for (TriangleMap& map : maps) {
    for (auto* part : {&map.key, &map.normal}) {
      for (auto& line : *part) {
        for (float& x : line) x = random_.uniform(0.1f, 1.0f);
      }
    }
    map.u = random_.uniform(0.0f, 50.0f), map.v = random_.uniform(0.0f, 50.0f);
    map.traits = static_cast<std::uint8_t>(random_.uniform(0, 2) * TriangleMap::kTurned);
  }
  const auto keyOf = [](const TriangleMap& map, float u, float v, int axis) {
    const auto at = [&](int c) {
      return map.key[0][c] + map.key[1][c] * (u - map.u) + map.key[2][c] * (v - map.v);
    };
    return at(axis) / at(2);
  };
  std::vector<std::uint32_t> ids;
  for (std::uint32_t id = 0; id < maps.size(); ++id)
    ids.insert(ids.end(), random_.uniform(1, 20), id);
  const PixelStretch stretch{20, 61, 2, {5, 6}};
  const SightLines sight{{0.1f, -0.2f, 1.0f}, {0.01f, 0.0f, -0.002f}};
  SurfaceRun plain{};
  for (int k = 0; k < SurfaceRun::kRoom; ++k) plain.column[k] = static_cast<float>(k) + 1.0f;
  SurfaceRun fast = plain;
  const unsigned traits = plainKernels().locate(maps.data(), ids.data(), stretch, sight, plain);
  EXPECT_EQ(avx2Kernels()->locate(maps.data(), ids.data(), stretch, sight, fast), traits);
  EXPECT_EQ(std::memcmp(&plain, &fast, sizeof(plain)), 0);
  for (int k = 0; k < stretch.count; ++k) {
    const float u = plain.key_u[stretch.offset + k];
    ASSERT_NEAR(u, keyOf(maps[ids[k]], 3.0f + k, 20.0f, 0) - 5.0f, 1e-3f * (1.0f + std::abs(u)))
        << k;
  }
}

TEST_F(Avx2, SeesTheSameLight) {
  constexpr int kSide = 40, kCount = 500;
  std::vector<float> heights(kSide * kSide, -3e38f);
  for (int j = 8; j < 32; ++j) {
    for (int i = 8; i < 32; ++i) heights[j * kSide + i] = random_.uniform(0.0f, 1.0f);
  }
  ShadowTaps taps;
  taps.count = 24;
  for (int k = 0; k < taps.count; ++k)
    taps.x[k] = random_.uniform(-0.7f, 0.7f), taps.y[k] = random_.uniform(-0.7f, 0.7f);
  const ShadowTexels map{heights.data(),
                         kSide,
                         kSide,
                         kSide,
                         9.0f,
                         {{1.0f, 0.0f, 0.0f}, {0.0f, 1.0f, 0.0f}, {0.0f, 0.0f, 1.0f}},
                         {},
                         0.1f,
                         1.0f};
  std::vector<float> axes[6];
  for (int i = 0; i < kCount + 7; ++i) {
    for (const int c : {0, 1}) axes[c].push_back(random_.uniform(-0.5f, 4.5f));
    axes[2].push_back(random_.uniform(-0.2f, 1.0f));
    for (const int c : {3, 4, 5}) axes[c].push_back(c == 5 ? 1.0f : 0.0f);
  }
  const LightPoints points{{axes[0].data(), axes[1].data(), axes[2].data()},
                           {axes[3].data(), axes[4].data(), axes[5].data()}};
  std::vector<float> plain(kCount + 7), fast(kCount + 7);
  plainKernels().visible(map, taps, points, kCount, plain.data());
  avx2Kernels()->visible(map, taps, points, kCount, fast.data());
  EXPECT_EQ(plain, fast);
  EXPECT_GT(std::count_if(plain.begin(), plain.end(), [](float x) { return x > 0.0f && x < 1.0f; }),
            100);
}

TEST_F(Avx2, MakesTheSameSpans) {
  constexpr int kTriangles = 301;
  const cv::Rect region(3, 2, 90, 70);
  Triangles triangles;
  ScreenMesh mesh;
  mesh.triangles = &triangles;
  for (int t = 0; t < kTriangles; ++t) {
    const float u = random_.uniform(-10.0f, 110.0f), v = random_.uniform(-10.0f, 90.0f);
    triangles.emplace_back(3 * t, 3 * t + 1, 3 * t + 2);
    for (int i = 0; i < 3; ++i)
      mesh.points.emplace_back(u + random_.uniform(-9.0f, 9.0f), v + random_.uniform(-9.0f, 9.0f),
                               random_.uniform(0.1f, 2.0f));
  }
  mesh.points[30].setConstant(std::numeric_limits<float>::quiet_NaN());  // behind the camera
  mesh.points[61] = mesh.points[60];                                     // without area
  int most = kTriangles;
  for (const int hidden_side : {0, 1}) {
    mesh.hidden_side = hidden_side;
    std::vector<TriangleSpan> plain(kTriangles), fast(kTriangles);
    const int count = plainKernels().makeSpans(mesh, 5, kTriangles, 2u << 24, region, plain.data());
    ASSERT_EQ(avx2Kernels()->makeSpans(mesh, 5, kTriangles, 2u << 24, region, fast.data()), count);
    EXPECT_GT(count, 60);
    EXPECT_LT(count, most);
    most = count;
    EXPECT_EQ(std::memcmp(plain.data(), fast.data(), count * sizeof(TriangleSpan)), 0);
    for (int k = 0; k < count; ++k) {
      EXPECT_TRUE(plain[k].id != (2u << 24 | 10u) && plain[k].id != (2u << 24 | 20u));
      EXPECT_TRUE(k == 0 || plain[k].id > plain[k - 1].id);
      EXPECT_TRUE(plain[k].row_min >= 0 && plain[k].row_max < region.height);
      EXPECT_TRUE(plain[k].column_min >= 0 && plain[k].column_max < region.width);
    }
  }
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
        s.edge_u[k] = random_.uniform(-1.0f, 1.0f), s.edge_v[k] = random_.uniform(-1.0f, 1.0f),
        s.edge_0[k] = random_.uniform(0.0f, 10.0f);
      s.near_u = random_.uniform(-0.1f, 0.1f), s.near_v = random_.uniform(-0.1f, 0.1f),
      s.near_0 = random_.uniform(0.0f, 5.0f);
      s.id = static_cast<std::uint32_t>(&s - spans.data());
    }
    std::vector<int> which(spans.size());
    std::iota(which.begin(), which.end(), 0);
    const auto draw = [&](const Kernels& kernels, std::vector<std::uint32_t>& ids,
                          std::vector<float>& nearness, std::vector<float>& alone) {
      ids.assign(kRows * kStride, 999), nearness.assign(kRows * kStride, -1.0f), alone = nearness;
      kernels.fill(spans.data(), which.data(), 200, {ids.data(), nearness.data(), kStride, 3, 35});
      kernels.fill(spans.data(), which.data(), 200, {nullptr, alone.data(), kStride, 3, 35});
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
  constexpr int kRow = 2, kColumn = 1;
  const int pixels[64] = {};
  const SampledTile tile{0, 0, std::uint64_t{1} << (kRow * SampledTile::kSide + kColumn), pixels};
  for (std::uint32_t id = 0; id < 300; ++id) {
    TriangleSamples t;
    for (int k = 0; k < 3; ++k)
      t.edge_u[k] = random_.uniform(-1.0f, 1.0f), t.edge_v[k] = random_.uniform(-1.0f, 1.0f),
      t.edge_0[k] = random_.uniform(-1.0f, 3.0f);
    t.near_u = random_.uniform(-0.1f, 0.1f), t.near_v = random_.uniform(-0.1f, 0.1f),
    t.near_0 = random_.uniform(0.0f, 5.0f) + 0.01f * static_cast<float>(id);
    plainKernels().drawSamples(t, tile, id, &plain);
    avx2Kernels()->drawSamples(t, tile, id, &fast);
    ASSERT_EQ(plain.ids, fast.ids);
    ASSERT_EQ(plain.nearness, fast.nearness);
  }
  EXPECT_NE(plain.ids[0], VisibilityBuffer::kNothing);
}

// What is sampled in a row and what is sampled alone must not differ where the two meet.
TEST(Kernels, SampleAsSampleBicubic) {
  cv::RNG random(3);
  cv::Mat image(20, 30, CV_32FC4);
  random.fill(image, cv::RNG::UNIFORM, 0.0, 1.0);
  for (int repeat = 0; repeat < 4; ++repeat) {
    SurfaceRun run = randomRun(random);
    kernels().sample(image, 0, SurfaceRun::kMost, run);
    for (int i = 0; i < SurfaceRun::kMost; ++i) {
      const cv::Vec4f alone = sampleBicubic(image, run.key_u[i], run.key_v[i]);
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(run.colour[c][i], alone[c], 1e-6f) << run.key_u[i] << ", " << run.key_v[i];
    }
  }
}

// Against the formulas point by point.
TEST(Kernels, ShadeAsSpecularShadingAndWhatIsDiffuse) {
  cv::RNG random(5);
  for (const int terms : {1, 4, 9}) {
    const Light light = someLight(terms);
    const SurfaceShade shade = shadeOf(light, terms, 0.05f);
    const SurfaceRun before = randomRun(random);
    SurfaceRun run = before;
    kernels().shade(shade, 0, SurfaceRun::kMost, run);
    for (int i = 0; i < SurfaceRun::kMost; ++i) {
      const auto at = [i](const float(&x)[3][SurfaceRun::kRoom]) {
        return Eigen::Vector3f(x[0][i], x[1][i], x[2][i]);
      };
      const Eigen::Vector3f n = at(run.normal), view = -at(run.sight).normalized();
      const Eigen::Vector3f around = at(run.ambient);
      const float lit = std::max(0.0f, n.dot(light.direction)) * run.sun[i];
      const cv::Vec3f diffuse = cv::Vec3f(around.x(), around.y(), around.z()) + light.sun * lit;
      const cv::Vec3f highlight = specularShading(
          light, {shade.specular, shade.roughness, shade.around}, n, view, run.sun[i], run.sky[i]);
      for (int c = 0; c < 3; ++c) {
        const float expected =
            before.colour[c][i] * shade.tint[c] * (diffuse[c] + shade.floor[c]) + highlight[c];
        EXPECT_NEAR(run.colour[c][i], expected, 2e-5f * (1.0f + std::abs(expected))) << terms;
      }
    }
  }
}

}  // namespace
}  // namespace calipso::render
