#include "calipso_scene/edit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "calipso_scene/material.hpp"

namespace calipso {
namespace {

const std::vector<std::string> kObjects = {"banana1", "banana2"};

std::string writeFile(const std::string& text) {
  const std::string path = testing::TempDir() + "edits.yaml";
  std::ofstream(path) << text;
  return path;
}

std::string errorOf(const std::string& yaml) {
  try {
    loadEdits(writeFile(yaml), kObjects);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(Edit, readsEveryFieldAndSortsByTime) {
  const auto edits = loadEdits(
      writeFile(
          "- {t: 0.5, object: banana2, kind: material, mode: factor, youngs_modulus: 0.01}\n"
          "- {t: 0.1, object: banana1, kind: pull, mode: target, vector: [0, 0, 0.08],\n"
          "   region: {kind: pixel, u: 420, v: 110, radius: 0.02}, ramp: 0.3, duration: 1}\n"),
      kObjects);
  ASSERT_EQ(edits.size(), 2u);
  EXPECT_EQ(edits[0].kind, EditKind::kPull);
  EXPECT_EQ(edits[0].mode, EditMode::kTarget);
  EXPECT_EQ(edits[0].region.kind, RegionKind::kPixel);
  EXPECT_EQ(edits[0].region.pixel, Eigen::Vector2d(420, 110));
  EXPECT_EQ(edits[0].vector, Eigen::Vector3d(0, 0, 0.08));
  EXPECT_EQ(edits[0].ramp, 0.3);
  EXPECT_EQ(edits[0].duration, 1.0);
  EXPECT_EQ(edits[1].youngs_modulus, 0.01);
  EXPECT_TRUE(std::isnan(edits[1].density));
}

TEST(Edit, anInfiniteDensityLetsNothingMoveAnObject) {
  const auto edits =
      loadEdits(writeFile("- {t: 0, object: banana1, kind: material, density: .inf}"), kObjects);
  EXPECT_TRUE(std::isinf(edits.at(0).density));
}

TEST(Edit, readsWhatTheKindsNeed) {
  const auto edits = loadEdits(
      writeFile(
          "- {t: 0, object: banana1, kind: duplicate, value: twin, translation: [0, 0, 0.1]}\n"
          "- {t: 0, object: twin, kind: appearance, color: [1, 0.5, 0.2], roughness: 0.4}\n"
          "- {t: 0, object: twin, other: banana2, kind: contact, value: exclude}\n"
          "- {t: 0, object: banana2, kind: contact, friction: 0, restitution: 0.9}\n"
          "- {t: 0.1, after: banana1, collision: 2, kind: speed_scale, factor: 0.5}\n"),
      kObjects);
  ASSERT_EQ(edits.size(), 5u);
  EXPECT_EQ(edits[0].new_name, "twin");
  EXPECT_EQ(edits[1].color, Eigen::Vector3d(1, 0.5, 0.2));
  EXPECT_EQ(edits[1].roughness, 0.4);
  EXPECT_TRUE(std::isnan(edits[1].specular));
  EXPECT_FALSE(edits[2].meet);
  EXPECT_EQ(edits[2].other, "banana2");
  EXPECT_TRUE(edits[3].meet);
  EXPECT_EQ(edits[3].friction, 0.0);
  EXPECT_EQ(edits[3].restitution, 0.9);
  EXPECT_EQ(edits[4].after, "banana1");
  EXPECT_EQ(edits[4].collision, 2);
}

TEST(Edit, windIsGivenOrAsInTheVideo) {
  const auto edits =
      loadEdits(writeFile("- {t: 0, object: banana1, kind: wind, vector: [3, 0, 0]}\n"
                          "- {t: 0, kind: wind, mode: estimated, factor: 2}\n"),
                kObjects);
  ASSERT_EQ(edits.size(), 2u);
  EXPECT_EQ(edits[0].mode, EditMode::kAbsolute);
  EXPECT_EQ(edits[1].mode, EditMode::kEstimated);
  EXPECT_EQ(edits[1].factor, 2.0);
}

TEST(Edit, emptyListsAreValid) {
  EXPECT_TRUE(loadEdits(writeFile(""), kObjects).empty());
  EXPECT_TRUE(loadEdits(writeFile("[]"), kObjects).empty());
}

TEST(Edit, namesRoundTrip) {
  for (const char* name :
       {"transform", "pull",   "fix",         "release",    "material",   "gravity", "velocity",
        "kind",      "remove", "reset",       "duplicate",  "insert",     "contact", "wind",
        "pressure",  "twist",  "speed_scale", "time_scale", "appearance", "light"}) {
    EXPECT_EQ(toString(editKindFromString(name)), name);
  }
  EXPECT_EQ(editModeFromString("", EditKind::kPull), EditMode::kForce);
  EXPECT_EQ(editModeFromString("", EditKind::kMaterial), EditMode::kAbsolute);
}

TEST(Edit, badInputNamesEntryFieldAndRemedy) {
  const auto expect = [](const std::string& yaml, const std::string& part) {
    EXPECT_NE(errorOf(yaml).find(part), std::string::npos) << yaml << "\n gave: " << errorOf(yaml);
  };
  expect("- {t: 0, object: apple, kind: remove}", "edit 1: object is 'apple'");
  expect("- {t: 0, object: banana1, kind: melt}", "kind is 'melt'; it must be one of");
  expect("- {t: .nan, object: banana1, kind: remove}", "t is");
  expect("- {t: -1, object: banana1, kind: remove}", "t is -1; it must be >= 0");
  expect("- {object: banana1, kind: remove}", "t is missing");
  expect("- {t: 0, object: banana1, kind: material, youngs_modulus: -5}", "youngs_modulus = -5");
  expect("- {t: 0, object: banana1, kind: material, poissons_ratio: 0.5}", "poissons_ratio = 0.5");
  expect("- {t: 0, object: banana1, kind: material}", "changes nothing");
  expect("- {t: 0, object: banana1, kind: pull, vektor: [0, 0, 1]}", "vektor is not a known key");
  expect("- {t: 0, object: banana1, kind: remove, t: 1}",
         "t is given twice; only one of them would count: leave one out");
  expect("- {t: 0, object: banana1, kind: pull, vector: [0, 0]}",
         "vector is '[0, 0]'; it must be a list of 3 numbers");
  expect("- t: 0\n  object: banana1\n  kind: pull\n  vector:\n  - 0\n  - 1\n",
         "vector is '[0, 1]'");
  expect("- remove banana1", "edit 1: is not a map");
  expect("- {t: 0, object: banana1, kind: pull, mode: factor}", "for kind 'pull'");
  expect("- {t: 0, object: banana1, kind: transform, scale: 0}", "scale = 0");
  expect("- {t: 0, object: banana1, kind: duplicate}", "value is missing");
  expect("- {t: 0, object: banana1, kind: duplicate, value: banana2}", "has already");
  expect("- {t: 0, kind: insert, model: ball.obj}", "value is missing");
  expect("- {t: 0, kind: insert, value: ball}", "model is missing");
  expect("- {t: 0, kind: insert, value: banana1, model: ball.obj}", "has already");
  expect("- {t: 0, object: banana1, kind: insert, value: ball, model: ball.obj}", "leave it out");
  expect("- {t: 0, kind: insert, value: ball, model: ball.obj, density: -1}", "density = -1");
  expect("- {t: 0, object: banana1, kind: contact, friction: -1}", "friction = -1");
  expect("- {t: 0, object: banana1, kind: contact, restitution: 1.5}", "restitution = 1.5");
  expect("- {t: 0, object: banana1, kind: contact, value: maybe}", "include, exclude");
  expect("- {t: 0, kind: time_scale, factor: 2}", "factor = 2");
  expect("- {t: 0, kind: time_scale, factor: 0.0001}",
         "factor = 0.0001 is not allowed; it must be in [0.001, 1]");
  expect("- {t: 0, kind: speed_scale, factor: 0}", "factor = 0");
  expect("- {t: 0, kind: speed_scale, factor: 1e6}", "(0, 100]");
  expect("- {t: 0, object: banana1, kind: appearance, roughness: 2}", "roughness = 2");
  expect("- {t: 0, object: banana1, kind: remove, after: apple}", "after is 'apple'");
  expect("- {t: 0, kind: wind, mode: factor}", "for kind 'wind'");
  expect("pull: 3", "not a list of edits");
  expect("- {t: 0, object: [", "not valid YAML");
}

TEST(Material, rangesAreChecked) {
  Material material;
  EXPECT_NO_THROW(validate(material));
  for (const double nu : {-1.0, 0.5, std::numeric_limits<double>::quiet_NaN()}) {
    material.poissons_ratio = nu;
    EXPECT_THROW(validate(material), std::invalid_argument) << nu;
  }
}

TEST(Material, defaultStiffnessScalesWithSizeAndGravity) {
  const double E = defaultMaterial(0.2, 9.81).youngs_modulus;
  EXPECT_DOUBLE_EQ(defaultMaterial(0.4, 9.81).youngs_modulus, 2.0 * E);
  EXPECT_DOUBLE_EQ(defaultMaterial(0.2, 2 * 9.81).youngs_modulus, 2.0 * E);
  EXPECT_DOUBLE_EQ(defaultMaterial(0.2, 0.0).youngs_modulus, E);
}

}  // namespace
}  // namespace calipso
