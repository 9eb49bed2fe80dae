#include "light/shaded_ground.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "calipso_render/sky_map.hpp"

namespace calipso::render {
namespace {

const Eigen::Vector3f kAbove(0.0f, 0.0f, 1.0f);

// Leaves `part` of a light where x < 0, all of it elsewhere.
class HalfShade : public Visibility {
 public:
  explicit HalfShade(float part) : part_(part) {}
  float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f&) const override {
    return p.x() < 0.0f ? part_ : 1.0f;
  }
  bool empty() const override { return false; }
  std::optional<float> uniform(const Eigen::Vector3f&, const Eigen::Vector3f&,
                               float) const override {
    return std::nullopt;
  }

 private:
  float part_;
};

Eigen::Vector3f downwards(float x) { return Eigen::Vector3f(x, 0.0f, -1.0f).normalized(); }

SupportPlane planeAt(double height) {
  SupportPlane plane;
  plane.offset = height;
  return plane;
}

// The sun has 0.6 of the light from above.
Light light() { return Light(); }

TEST(ShadedGround, IsDarkerInShade) {
  const HalfShade none(1.0f), dark(0.0f), half(0.5f);
  const ShadedGround sunless({planeAt(0.0)}, light(), {&dark}, none);
  EXPECT_NEAR(sunless.lit(kAbove, downwards(-1.0f)), 0.4f, 1e-5f);
  EXPECT_NEAR(sunless.lit(kAbove, downwards(1.0f)), 1.0f, 1e-5f);
  EXPECT_EQ(sunless.lit(kAbove, -downwards(1.0f)), 1.0f);  // the sky
  const ShadedGround two({planeAt(0.0)}, light(), {&half, &half}, none);
  EXPECT_NEAR(two.lit(kAbove, downwards(-1.0f)), 0.4f + 0.6f * 0.25f, 1e-5f);
  const ShadedGround skyless({planeAt(0.0)}, light(), {&none}, dark);
  EXPECT_NEAR(skyless.lit(kAbove, downwards(-1.0f)), 0.6f + 0.4f * skyLight(0.0f), 1e-5f);
}

// The first plane that is met counts, where it is, and a contact a little below it.
TEST(ShadedGround, IsTheFirstPlaneMet) {
  const HalfShade none(1.0f), dark(0.0f);
  SupportPlane step = planeAt(0.5);
  step.x_range = Eigen::Vector2d(-0.6, 3.0);
  const ShadedGround ground({planeAt(0.0), step}, light(), {&dark}, none);
  const Eigen::Vector3f right(0.6f, 0.0f, 1.0f);
  EXPECT_NEAR(ground.lit(right, downwards(-1.0f)), 1.0f, 1e-5f);                  // the step, lit
  EXPECT_NEAR(ground.lit(right, downwards(-1.4f)), 0.4f, 1e-5f);                  // and shaded
  EXPECT_NEAR(ground.lit({0.6f, 0.0f, 0.4f}, downwards(-1.0f)), 1.0f, 1e-5f);     // below it
  EXPECT_NEAR(ground.lit({-0.1f, 0.0f, 0.499f}, downwards(10.0f)), 0.4f, 1e-5f);  // a contact
  EXPECT_EQ(ShadedGround({}, light(), {&dark}, dark).lit(kAbove, downwards(-1.0f)), 1.0f);
}

}  // namespace
}  // namespace calipso::render
