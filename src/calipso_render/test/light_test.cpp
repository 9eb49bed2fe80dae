#include "calipso_render/light.hpp"

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <random>

#include "ball_samples.hpp"
#include "calipso_render/colour.hpp"
#include "calipso_render/light_fit.hpp"
#include "calipso_render/ray_shadow.hpp"
#include "draw/ray_scene.hpp"
#include "light/ambient_fit.hpp"
#include "light/light_search.hpp"
#include "light/reflectance_cost.hpp"
#include "light/sun_prior.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();

Eigen::Vector3d direction(double x, double y, double z) {
  return Eigen::Vector3d(x, y, z).normalized();
}

TEST(DiffuseShading, SunAddsItsCosine) {
  Light light;
  light.ambient[0] = {0.2f, 0.2f, 0.2f}, light.sun = {0.6f, 0.5f, 0.4f};
  const Eigen::Vector3f slanted = Eigen::Vector3f(0.6f, 0.0f, 0.8f);
  EXPECT_NEAR(diffuseShading(light, slanted, 1.0f)[0], 0.2f + 0.6f * 0.8f, 1e-6f);
  EXPECT_NEAR(diffuseShading(light, slanted, 0.0f)[0], 0.2f, 1e-6f);
  EXPECT_NEAR(diffuseShading(light, -slanted, 1.0f)[2], 0.2f, 1e-6f);  // turned away
}

// What lies at the rim of a rough surface keeps its own colour.
TEST(SpecularShading, MirrorsTheSurroundingsLessAtTheRimsOfRoughSurfaces) {
  Light light;
  light.sun = {0, 0, 0}, light.ambient[0] = {1, 1, 1};
  const Eigen::Vector3f n = Eigen::Vector3f::UnitZ(),
                        at_rim = Eigen::Vector3f(1, 0, 0.1f).normalized();
  const auto growth = [&](float m, float around) {
    const Gloss gloss{0.04f, m, around};
    return specularShading(light, gloss, n, at_rim, 0.0f)[0] /
           specularShading(light, gloss, n, n, 0.0f)[0];
  };
  // 1 + 14 (1 - n.v)^5
  const float smooth = 1.0f + 14.0f * std::pow(1.0f - at_rim.z(), 5.0f);
  EXPECT_NEAR(growth(0.03f, 0.02f), smooth, 1e-3f * smooth);
  EXPECT_LT(growth(0.12f, 0.02f), 0.9f * smooth);
  EXPECT_LT(growth(0.35f, 0.02f), 0.4f * smooth);
  // What is stronger than any dielectric's is not this gloss.
  EXPECT_NEAR(growth(0.35f, kMostAround), smooth, 1e-3f * smooth);
}

// A polished object has no outline brighter than what it mirrors; half of the light's unit is all.
TEST(SpecularShading, MirrorsNoMoreThanAllThatReachesIt) {
  Light light;
  light.sun = {0, 0, 0}, light.ambient[0] = {1, 1, 1};
  const Eigen::Vector3f n = Eigen::Vector3f::UnitZ(),
                        at_rim = Eigen::Vector3f(1, 0, 1e-3f).normalized();
  for (const float around : {0.03f, 0.04f, 0.2f, 0.5f}) {
    const Gloss gloss{around, 0.15f, around};
    const float mirrored = specularShading(light, gloss, n, at_rim, 0.0f)[0];
    EXPECT_LE(mirrored, kAllAround * (1.0f + 1e-5f)) << around;
    EXPECT_GT(mirrored, 0.85f * kAllAround) << around;
    EXPECT_NEAR(specularShading(light, gloss, n, n, 0.0f)[0], around, 1e-6f);
  }
  EXPECT_FLOAT_EQ(grazingGrowth({0.0f, kSmooth, 0.0f}), kGrazing);
}

TEST(TorranceSparrow, PeaksAtTheMirrorDirectionOfSmoothSurfaces) {
  const Eigen::Vector3f n = Eigen::Vector3f::UnitZ(), l = Eigen::Vector3f(0.6f, 0, 0.8f);
  EXPECT_GT(torranceSparrow(n, l, {-0.6f, 0, 0.8f}, 0.1f),
            100.0f * torranceSparrow(n, l, {0.6f, 0, 0.8f}, 0.1f));
  EXPECT_EQ(torranceSparrow(n, {0.6f, 0, -0.8f}, {-0.6f, 0, 0.8f}, 0.1f),
            0.0f);  // light from below
}

TEST(TorranceSparrow, LobeAgreesWithItsFloatTwin) {
  const Eigen::Vector3d n = direction(0.1, 0.2, 1), l = direction(0.5, -0.3, 0.8),
                        v = direction(-0.4, 0.5, 0.7);
  const double twin = torranceSparrow(n.cast<float>(), l.cast<float>(), v.cast<float>(), 0.3f);
  EXPECT_NEAR(torranceSparrowLobe(n, l, v, 0.3).value, twin, 1e-5 * twin + 1e-7);
}

// Every block of the Jacobian against central differences.
TEST(ReflectanceCost, DerivativesMatchDifferences) {
  ReflectanceCost::Sample s;
  s.normal = direction(0.2, -0.3, 0.9), s.view = direction(-0.3, -0.6, 0.7), s.up = kUp;
  s.radiance = {0.2, 0.3, 0.4}, s.visible = 0.8, s.scale = 0.3;
  s.even = 0.7, s.lean = 0.4, s.thrown_sun = 0.05, s.below = {0.5, 1.0, 1.5};
  const ReflectanceCost cost(s);
  const int sizes[] = {3, 3, 3, 1, 3, 2};
  for (const double m : {0.15, 0.5}) {
    std::vector<std::vector<double>> x = {{0, 0, 0},          {-1.0, -1.1, -0.9},
                                          {-0.3, -0.4, -0.6}, {0.4},
                                          {-0.7, -1.2, -0.5}, {std::log(0.1), std::log(m)}};
    const Eigen::Vector3d l = direction(0.4, -0.1, 0.8);
    for (int i = 0; i < 3; ++i) x[0][i] = l[i];
    std::vector<double*> blocks, jacobians;
    std::vector<std::vector<double>> J;
    for (int b = 0; b < 6; ++b) blocks.push_back(x[b].data()), J.emplace_back(3 * sizes[b]);
    for (auto& j : J) jacobians.push_back(j.data());
    double r[3], plus[3], minus[3];
    ASSERT_TRUE(cost.Evaluate(blocks.data(), r, jacobians.data()));
    // The direction lives on the sphere: compared along tangents, stepping on the sphere.
    const Eigen::Vector3d tangents[] = {l.unitOrthogonal(), l.cross(l.unitOrthogonal())};
    const double h = 1e-6;
    for (const Eigen::Vector3d& t : tangents) {
      const auto at = [&](double step, double* out) {
        const Eigen::Vector3d moved = (l + step * t).normalized();
        for (int i = 0; i < 3; ++i) x[0][i] = moved[i];
        cost.Evaluate(blocks.data(), out, nullptr);
      };
      at(h, plus), at(-h, minus), at(0.0, r);
      for (int c = 0; c < 3; ++c) {
        const double analytic =
            J[0][3 * c] * t[0] + J[0][3 * c + 1] * t[1] + J[0][3 * c + 2] * t[2];
        EXPECT_NEAR(analytic, (plus[c] - minus[c]) / (2 * h), 1e-5) << "direction, m = " << m;
      }
    }
    for (int b = 1; b < 6; ++b) {
      for (int i = 0; i < sizes[b]; ++i) {
        const double kept = x[b][i];
        x[b][i] = kept + h, cost.Evaluate(blocks.data(), plus, nullptr);
        x[b][i] = kept - h, cost.Evaluate(blocks.data(), minus, nullptr);
        x[b][i] = kept;
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(J[b][c * sizes[b] + i], (plus[c] - minus[c]) / (2 * h), 1e-6)
              << b << ", " << i;
      }
    }
  }
}

TEST(SunPriorCost, DerivativesMatchDifferences) {
  const SunPriorCost cost(direction(0.1, -0.2, 0.9), 1.7);
  std::vector<std::vector<double>> x = {{0.4, -0.1, 0.8}, {-1.0, -1.1, -0.9}, {-0.3, -0.4, -0.6}};
  std::vector<std::vector<double>> J(3, std::vector<double>(12));
  std::vector<double*> blocks, jacobians;
  for (int b = 0; b < 3; ++b) blocks.push_back(x[b].data()), jacobians.push_back(J[b].data());
  double r[4], plus[4], minus[4];
  ASSERT_TRUE(cost.Evaluate(blocks.data(), r, jacobians.data()));
  const double h = 1e-6;
  for (int b = 0; b < 3; ++b) {
    for (int i = 0; i < 3; ++i) {
      const double kept = x[b][i];
      x[b][i] = kept + h, cost.Evaluate(blocks.data(), plus, nullptr);
      x[b][i] = kept - h, cost.Evaluate(blocks.data(), minus, nullptr);
      x[b][i] = kept;
      for (int c = 0; c < 4; ++c)
        EXPECT_NEAR(J[b][3 * c + i], (plus[c] - minus[c]) / (2 * h), 1e-6) << b << ", " << i;
    }
  }
}

// What the search counts is what the fit does.
TEST(SunPriorCost, IsHalfItsSquare) {
  const SunPriorCost cost(kUp, 1.0);
  const double l[] = {0.0, 0.8, 0.6}, A[] = {-1.0, -1.2, -0.8}, L[] = {0.1, 0.2, 0.3};
  const double* blocks[] = {l, A, L};
  double r[4], expected = unusualHeight(0.6);
  cost.Evaluate(blocks, r, nullptr);
  for (int c = 0; c < 3; ++c) expected += unusualStrength(L[c] - A[c]);
  EXPECT_NEAR(0.5 * (r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]), expected, 1e-12);
}

TEST(FitLight, FindsTheSunOfABall) {
  const Eigen::Vector3f sun = Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized();
  LightEvidence evidence;
  evidence.samples = ballSamples(sun), evidence.clusters = 1;
  const LightFit fit = fitLight(evidence, kUp.cast<float>(), {0, -1, 0});
  ASSERT_TRUE(fit.determined);
  EXPECT_GT(fit.light.direction.dot(sun),
            std::cos(2.0 * M_PI / 180.0));  // 2 degrees: the gloss prior's pull
  EXPECT_NEAR(fit.light.sun[1] / fit.light.ambient[0][1], 2.0f, 0.2f);
  EXPECT_FALSE(fit.confirmed());  // by nothing but shading
}

// A ball whose top is of a grey ten times as dark as the rest: of one hue, but no shading.
// Of a grey picture all is one cluster: what differs is shading.
TEST(LightSamples, BrightnessIsNoColour) {
  const ObjectModel ball = ballAt({0.0, 0.1, 0.12});
  const ClipFrame frame = frameWithBall(ball);
  cv::Mat grey;
  cv::cvtColor(frame.bgr, grey, cv::COLOR_BGR2GRAY);
  cv::cvtColor(grey, grey, cv::COLOR_GRAY2BGR);
  const Surface surface = makeSurface(ball);
  View view{grey, frame.labels, frame.camera, {}};
  view.actors.push_back(makeActor(surface, surface.key_vertices, frame.camera));
  int clusters = 0;
  const std::vector<LightSample> samples = lightSamples({view}, {false}, clusters);
  ASSERT_GT(samples.size(), 100u);
  std::map<int, int> count;  // of no colour there may be more than a stray sample
  for (const LightSample& s : samples) ++count[s.cluster];
  int most = 0;
  for (const auto& [cluster, samples_of_it] : count) most = std::max(most, samples_of_it);
  EXPECT_GT(most + 4, static_cast<int>(samples.size()));
}

TEST(FitLight, TellsReflectancesOfOneHueApart) {
  const Eigen::Vector3f sun = Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized();
  LightEvidence evidence;
  evidence.samples = ballSamples(sun), evidence.clusters = 1;
  for (LightSample& s : evidence.samples)
    if (s.normal.z() > 0.6f) s.radiance *= 0.1f;
  const LightFit fit = fitLight(evidence, kUp.cast<float>(), {0, -1, 0});
  ASSERT_EQ(fit.albedos.size(), 2u);
  EXPECT_NEAR(fit.albedos[1][1] / fit.albedos[0][1], 10.0f, 1.5f);
  EXPECT_GT(fit.light.direction.dot(sun), std::cos(3.0 * M_PI / 180.0));
}

// A board's shading is the same under any sun.
TEST(SearchLight, TakesAUsualSunWhereNothingTellsOne) {
  LightEvidence evidence;
  evidence.clusters = 1;
  const Eigen::Vector3f n(0.0f, -0.8f, 0.6f);
  for (int i = 0; i < 200; ++i) {
    const float grain = 0.3f + 0.003f * static_cast<float>(i % 7 - 3);
    evidence.samples.push_back({n, n, n, cv::Vec3f::all(grain), 0, SkySeen::all(n)});
  }
  const std::vector<LightCandidate> found = searchLight(evidence, kUp.cast<float>(), 1);
  ASSERT_FALSE(found.empty());
  EXPECT_NEAR(found[0].direction.z(), kUsualHeight, 0.01);  // the search's last steps
  // ratios tried are 0.23 apart
  EXPECT_NEAR(std::log(found[0].sun[1] / found[0].ambient[1]), kUsualStrength, 0.12);
}

TEST(FitLight, DoesNotDependOnTheNumberOfThreads) {
  LightEvidence evidence;
  evidence.samples = ballSamples(Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized());
  evidence.clusters = 1;
  const int threads = omp_get_max_threads();
  std::vector<LightFit> fits;
  for (const int count : {1, 2, 5}) {
    omp_set_num_threads(count);
    fits.push_back(fitLight(evidence, kUp.cast<float>(), {0, -1, 0}));
  }
  omp_set_num_threads(threads);
  for (const LightFit& fit : fits) {
    EXPECT_EQ(fit.light.direction, fits.front().light.direction);
    EXPECT_EQ(fit.light.sun, fits.front().light.sun);
    EXPECT_EQ(fit.cost, fits.front().cost);
  }
}

// A shadow of known direction outweighs shading that says otherwise.
TEST(FitLight, BelievesCastShadows) {
  const Eigen::Vector3f shading = Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized(),
                        shadow = Eigen::Vector3f(0.2f, -0.5f, 0.8f).normalized();
  LightEvidence evidence;
  evidence.samples = ballSamples(shading), evidence.clusters = 1;
  evidence.shadow_misfit = [&](const Eigen::Vector3f& l) {
    return -2000.0 * std::max(0.0f, l.dot(shadow) - 0.99f) / 0.01;
  };
  evidence.shadow_candidates = {Eigen::Vector3f(0.25f, -0.5f, 0.8f).normalized()};
  evidence.borders = [](const Eigen::Vector3f& l) { return SunByBorders{l, 0.01f}; };
  const LightFit fit = fitLight(evidence, kUp.cast<float>(), {0, -1, 0});
  EXPECT_TRUE(fit.from_shadows);
  ASSERT_TRUE(fit.by_borders);  // asked where the search put the sun
  EXPECT_EQ(fit.by_borders->direction, fit.light.direction);
  EXPECT_TRUE(fit.confirmed());
  EXPECT_GT(fit.light.direction.dot(shadow),
            std::cos(1.0 * M_PI / 180.0));  // 1 degree: the search's last steps
}

// A wall says nothing of how strong a sun is whose direction cast shadows tell.
TEST(FitLight, TakesAUsualStrengthWhereShadowsTellTheDirectionAlone) {
  const Eigen::Vector3f sun = Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized(), n(0, -1, 0);
  LightEvidence evidence;
  evidence.samples.assign(200, {n, n, n, cv::Vec3f(0.2f, 0.4f, 0.6f), 0, SkySeen::all(n)});
  evidence.clusters = 1;
  evidence.shadow_misfit = [sun](const Eigen::Vector3f& l) {
    return -2000.0 * std::max(0.0f, l.dot(sun) - 0.99f) / 0.01;
  };
  evidence.shadow_candidates = {sun};
  const LightFit fit = fitLight(evidence, kUp.cast<float>(), {0, -1, 0});
  ASSERT_TRUE(fit.from_shadows);
  const double usual = std::exp(kUsualStrength);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(fit.light.sun[c] / fit.light.ambient[0][c], usual, 0.3 * usual);
}

// What a glossy ball over ground that the picture shows mirrors from straight below it.
cv::Vec3f mirroredGround(const cv::Vec3f& colour, float brightness, LightFit& fit) {
  const Eigen::Vector3f sun = Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized();
  LightEvidence evidence = glossyBallWithShadow(sun);
  evidence.below = colour, evidence.below_brightness = brightness;
  fit = fitLight(evidence, kUp.cast<float>(), {0, -1, 0});
  const Eigen::Vector3f view(0.0f, -1.0f, 0.0f), n = (view - kUp.cast<float>()).normalized();
  return specularShading(fit.light, fit.gloss, n, view, 0.0f) *
         (1.0f / grazing(n.dot(view), grazingGrowth(fit.gloss)));
}

TEST(FitLight, LetsSurfacesMirrorTheGroundAsThePictureShowsIt) {
  const cv::Vec3f colour(0.6f, 1.0f, 1.4f);
  LightFit fit;
  const cv::Vec3f mirrored = mirroredGround(colour, 0.1f, fit);
  ASSERT_TRUE(fit.from_shadows);
  ASSERT_GT(fit.gloss.around, 0.0f);
  // A dielectric's part of it, whatever the fit says of the light from below.
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(mirrored[c], 0.04f * 0.1f * colour[c], 1e-5f);
  EXPECT_LT(cv::norm(fit.light.mirrored[0] - fit.light.mirrored[2] * -1.0f), 1e-6);  // not overhead
}

TEST(FitLight, LetsNoGroundBeBrighterThanWhite) {
  const cv::Vec3f colour(0.6f, 1.0f, 1.4f);
  LightFit fit;
  const cv::Vec3f mirrored = mirroredGround(colour, 50.0f, fit),
                  white = diffuseShading(fit.light, kUp.cast<float>(), 1.0f) * fit.gloss.around;
  EXPECT_NEAR(mirrored[2], 0.9f * white[2], 1e-5f);
  EXPECT_NEAR(mirrored[0] / mirrored[2], 0.6f / 1.4f, 1e-3f);  // its colour is kept
}

// A place that is dark wherever the shadow falls, like the dark below an object.
TEST(FitLight, IsNotToldByWhatAllDirectionsExplain) {
  const Eigen::Vector3f shading = Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized();
  LightEvidence evidence;
  evidence.samples = ballSamples(shading), evidence.clusters = 1;
  evidence.shadow_misfit = [](const Eigen::Vector3f& l) { return -200.0 - l.x(); };
  evidence.borders = [](const Eigen::Vector3f& l) { return SunByBorders{l, 0.01f}; };
  const LightFit fit = fitLight(evidence, kUp.cast<float>(), {0, -1, 0});
  EXPECT_FALSE(fit.from_shadows);
  EXPECT_FALSE(fit.by_borders);
  EXPECT_FALSE(fit.confirmed());
  EXPECT_GT(fit.light.direction.dot(shading), std::cos(2.0 * M_PI / 180.0));  // as without shadows
}

TEST(RefineAmbient, FindsTheLightOfASkyThatIsNotEven) {
  Light light;
  light.direction = Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized();
  light.ambient[4] = {0.06f, 0.04f, 0.02f}, light.ambient[7] = {-0.08f, -0.05f, -0.03f};
  LightFit fit = plainFit(light);
  ASSERT_TRUE(refineAmbient(ballUnder(light), fit));
  // On what is seen; harmonics that differ there by little trade places.
  for (const LightSample& s : ballUnder(light).samples) {
    const cv::Vec3f found = ambientAt(fit.light, s.normal), truth = ambientAt(light, s.normal);
    const float level = found[1] / truth[1];  // shared with the albedo
    EXPECT_NEAR(level, 1.0f, 0.08f);
  }
}

TEST(RefineAmbient, LeavesAnEvenSkyAsItIs) {
  Light light;
  light.direction = Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized();
  LightFit fit = plainFit(light);
  EXPECT_FALSE(refineAmbient(ballUnder(light), fit));
  EXPECT_EQ(fit.light.ambient[4], cv::Vec3f());
}

TEST(ThrownBack, IsOfTheSurfacesColourAndNoBrighter) {
  EXPECT_LT(cv::norm(thrownBack({0.4f, 0.4f, 0.4f}), cv::Vec3f::all(kThrownBack)), 1e-6);
  const cv::Vec3f blue = thrownBack({0.5f, 0.3f, 0.1f});
  EXPECT_GT(blue[0], kThrownBack);
  EXPECT_LT(blue[2], kThrownBack);
  EXPECT_NEAR(luminance(blue), kThrownBack, 1e-6f);
  EXPECT_LT(cv::norm(thrownBack({0, 0, 0}), cv::Vec3f::all(kThrownBack)), 1e-6);
}

TEST(FitLight, SaysWhenThereIsTooLittleToSee) {
  const LightFit fit = fitLight({}, kUp.cast<float>(), {0, -1, 0});
  EXPECT_FALSE(fit.determined);
  EXPECT_GT(fit.light.direction.z(), 0.0f);
}

TEST(RayShadow, AgreesWithGeometry) {
  const Points roof = {{-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}};
  const Triangles faces = {{0, 1, 2}, {0, 2, 3}};
  const RayShadow rays({{&roof, &faces}}, kUp, {0.05, 64});
  const Eigen::Vector3f up = Eigen::Vector3f::UnitZ();
  EXPECT_FLOAT_EQ(rays.visibility({0, 0, 0}, up), 0.0f);
  EXPECT_FLOAT_EQ(rays.visibility({2, 0, 0}, up), 1.0f);
  EXPECT_NEAR(rays.visibility({1, 0, 0}, up), 0.5f, 0.1f);  // half of the disc, by symmetry
  EXPECT_FLOAT_EQ(RayShadow({}, kUp, {}).visibility({0, 0, 0}, up), 1.0f);
}

}  // namespace
}  // namespace calipso::render
