#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ball_samples.hpp"
#include "light/gloss_fit.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// A glossy ball's rim mirrors the sky with a strength that its highlight does not have.
TEST(SurroundingsStrength, IsFoundBesideTheHighlights) {
  LightFit fit = plainFit(Light());
  fit.light.direction = Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized();
  fit.gloss = {0.005f, 0.1f, 0.02f};
  LightEvidence evidence = ballUnder(fit.light);
  for (LightSample& s : evidence.samples)
    s.radiance += specularShading(fit.light, fit.gloss, s.normal, s.view, 1.0f);
  fit.gloss.around = 0.0f;
  EXPECT_NEAR(surroundingsStrength(evidence, fit), 0.02f, 0.003f);  // errors of 1 %
  EXPECT_LT(surroundingsStrength(ballUnder(fit.light), fit), 0.003f);
}

// Pixels of a ball around the highlight that a lobe of roughness m makes on it, as a picture has
// them, which ends at 1.
std::vector<HighlightSample> clippedHighlight(const Light& light, float m, int& clipped) {
  const Eigen::Vector3f view(0, -1, 0), h = (light.direction + view).normalized(),
                                        s = h.unitOrthogonal(), t = h.cross(s);
  std::vector<HighlightSample> highlights;
  cv::RNG random(5);
  for (int i = -30; i <= 30; ++i) {
    for (int j = -30; j <= 30; ++j) {
      const Eigen::Vector3f n = (h + 0.015f * (i * s + j * t)).normalized();
      LightSample at{n, n, view, {}, 0, SkySeen::all(n)};
      at.radiance = diffuseShading(light, n, 1.0f).mul(cv::Vec3f(0.2f, 0.4f, 0.6f)) *
                        static_cast<float>(1.0 + random.gaussian(0.01)) +
                    specularShading(light, {0.05f, m, 0.0f}, n, view, 1.0f);
      clipped += at.radiance[2] > 1.0f;
      for (int c = 0; c < 3; ++c) at.radiance[c] = std::min(1.0f, at.radiance[c]);
      highlights.push_back({at, 0.0f});
    }
  }
  return highlights;
}

// The middle of a bright highlight says only that it is as bright as the picture; its flanks tell
// how rough the surface is. What 1.1 degrees of error of the normals blur is allowed for.
TEST(FitGloss, ReadsAClippedHighlightByItsFlanks) {
  for (const float m : {0.06f, 0.1f}) {
    LightFit fit = plainFit(Light());
    fit.light.direction = Eigen::Vector3f(0.4f, -0.6f, 0.7f).normalized();
    int clipped = 0;
    const std::optional<SeenGloss> found =
        fitGloss(clippedHighlight(fit.light, std::hypot(m, 0.028f), clipped), fit, {});
    EXPECT_GT(clipped, 5);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->gloss.roughness, m, 0.05f * m);
    EXPECT_NEAR(found->gloss.specular, 0.05f, 0.005f);
    EXPECT_LT(found->smoothest, m);
    EXPECT_GT(found->roughest, m);
  }
}

// A highlight no wider than pixels and normals make it: how smooth the surface is below that is not
// told, and the smoothest that is tried (0.03) is no better a guess than the others.
TEST(FitGloss, TakesTheMiddleOfWhatANarrowHighlightLeaves) {
  LightFit fit = plainFit(Light());
  fit.light.direction = Eigen::Vector3f(0.4f, -0.6f, 0.7f).normalized();
  int clipped = 0;
  std::vector<HighlightSample> highlights = clippedHighlight(fit.light, 0.19f, clipped);
  cv::RNG random(7);
  for (HighlightSample& h : highlights) {
    h.spread = 0.135f;  // with the normals' error it makes a lobe of 0.193
    h.at.radiance *= 1.0f + static_cast<float>(random.gaussian(0.25));
  }
  const std::optional<SeenGloss> found = fitGloss(highlights, fit, {});
  ASSERT_TRUE(found);
  EXPECT_GT(found->gloss.roughness, 0.035f);
  EXPECT_LT(found->gloss.roughness, 0.09f);
  EXPECT_GT(found->roughest, 0.09f);
  EXPECT_NEAR(found->gloss.specular, 0.05f, 0.005f);
}

// A flat thing with a rounded edge: few places show the highlight, and errors of the shading farther
// off look like a broad one.
TEST(FitGloss, TakesTheNarrowerOfTwoThatExplainAsMuch) {
  LightFit fit = plainFit(Light());
  fit.light.direction = Eigen::Vector3f(0.4f, -0.6f, 0.7f).normalized();
  const Eigen::Vector3f h = (fit.light.direction + Eigen::Vector3f(0, -1, 0)).normalized();
  int clipped = 0, near = 0;
  cv::RNG random(7);
  std::vector<HighlightSample> few;
  for (HighlightSample s : clippedHighlight(fit.light, 0.08f, clipped)) {
    const float angle = std::acos(std::min(1.0f, h.dot(s.at.normal)));
    if (angle < 0.12f ? ++near % 7 != 0 : angle < 0.2f) continue;
    const auto shine = [&](const Gloss& gloss) {
      return specularShading(fit.light, gloss, s.at.normal, s.at.view, 1.0f);
    };
    s.at.radiance = diffuseShading(fit.light, s.at.normal, 1.0f).mul(cv::Vec3f(0.2f, 0.4f, 0.6f)) +
                    shine({0.007f, 0.08f, 0.0f});
    if (angle > 0.2f) s.at.radiance += shine({0.028f, 0.3f, 0.0f});
    s.at.radiance *= 1.0f + static_cast<float>(random.gaussian(0.05));
    few.push_back(s);
  }
  const std::optional<SeenGloss> found = fitGloss(few, fit, {});
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->gloss.roughness, 0.08f, 0.02f);
  EXPECT_GT(found->roughest, 0.2f);  // it says that the broad one explains it, too
}

// Three objects: two of one gloss, and one of another.
TEST(SeenGlosses, HoldEachObjectsOwnWhereItDiffers) {
  LightFit fit = plainFit(Light());
  fit.light.direction = Eigen::Vector3f(0.4f, -0.6f, 0.7f).normalized();
  std::vector<HighlightSample> all;
  int clipped = 0;
  for (const std::size_t object : {0, 1, 2}) {
    for (HighlightSample& h : clippedHighlight(fit.light, object == 2 ? 0.25f : 0.08f, clipped)) {
      h.object = object;
      all.push_back(h);
    }
  }
  fit.seen_gloss = seenGlosses(all, 4, fit, {});
  ASSERT_TRUE(fit.confirmed());  // by the highlights
  fit.gloss = fit.seen_gloss.of_all->gloss;
  EXPECT_FALSE(fit.seen_gloss.of_one[1]);
  EXPECT_NEAR(fit.glossOf(0).roughness, fit.glossOf(1).roughness, 1e-6f);
  EXPECT_NEAR(fit.glossOf(1).roughness, 0.08f, 0.015f);
  EXPECT_NEAR(fit.glossOf(2).roughness, 0.25f, 0.05f);
  EXPECT_NEAR(fit.glossOf(3).roughness, 0.08f, 0.015f);  // nothing is seen of it
  EXPECT_TRUE(fit.toldGloss(2)->leaves(0.25f));
  EXPECT_FALSE(fit.toldGloss(2)->leaves(0.08f));
}

// The pixels around a glossy ball's highlight speak for its light, and against one beside it.
// In later pictures, whose poses are off, the highlight is not where the model has it.
TEST(SeenGlosses, AreReadFromTheFirstPictureWhereTheOthersSayNothing) {
  LightFit fit = plainFit(Light());
  fit.light.direction = Eigen::Vector3f(0.4f, -0.6f, 0.7f).normalized();
  int clipped = 0;
  std::vector<HighlightSample> all = clippedHighlight(fit.light, 0.08f, clipped);
  for (int picture = 1; picture < 9; ++picture) {
    const float turn = 0.8f * static_cast<float>(picture);
    Light beside = fit.light;
    beside.direction += 0.5f * Eigen::Vector3f(std::cos(turn), 0.0f, std::sin(turn));
    beside.direction.normalize();
    for (HighlightSample& h : clippedHighlight(beside, 0.08f, clipped)) {
      h.at.picture = picture;
      all.push_back(h);
    }
  }
  ASSERT_FALSE(fitGloss(all, fit, {}));
  const SeenGlosses seen = seenGlosses(all, 1, fit, {});
  ASSERT_TRUE(seen.of_all);
  EXPECT_NEAR(seen.of_all->gloss.roughness, 0.08f, 0.015f);
  EXPECT_TRUE(seen.of_all->tells_direction);
}

TEST(TellDirection, BelievesALightOnlyWhereItsHighlightIs) {
  LightFit fit = plainFit(Light());
  fit.light.direction = Eigen::Vector3f(0.4f, -0.6f, 0.7f).normalized();
  fit.gloss = {0.02f, 0.2f, 0.0f};
  std::vector<HighlightSample> highlights;
  for (LightSample s : ballUnder(fit.light).samples) {
    s.radiance += specularShading(fit.light, fit.gloss, s.normal, s.view, 1.0f);
    highlights.push_back({s, 0.0f});
  }
  EXPECT_TRUE(tellDirection(highlights, fit, {}));
  fit.light.direction = Eigen::Vector3f(0.1f, -0.7f, 0.7f).normalized();  // 18 degrees off
  EXPECT_FALSE(tellDirection(highlights, fit, {}));
}

}  // namespace
}  // namespace calipso::render
