#include "../src/outline_search.hpp"

#include <gtest/gtest.h>

#include <random>

namespace calipso::align {
namespace {

std::vector<Feature> randomFeatures(int count, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<float> place(-40.0f, 300.0f), turn(0.0f, 6.28f);
  std::vector<Feature> features;
  for (int i = 0; i < count; ++i) {
    const float a = turn(generator);
    features.push_back({place(generator), place(generator), 25 * std::cos(a), 25 * std::sin(a)});
  }
  return features;
}

int exhaustive(const std::vector<Feature>& all, const Feature& a, float reject, float reject_turn) {
  int best = -1;
  float least = std::numeric_limits<float>::max();
  for (size_t k = 0; k < all.size(); ++k) {
    const Feature& b = all[k];
    const float distance = (a.u - b.u) * (a.u - b.u) + (a.v - b.v) * (a.v - b.v);
    const float turn = (a.nu - b.nu) * (a.nu - b.nu) + (a.nv - b.nv) * (a.nv - b.nv);
    if (distance < reject * reject && turn < reject_turn && distance + turn < least) {
      least = distance + turn;
      best = static_cast<int>(k);
    }
  }
  return best;
}

TEST(OutlineSearch, FindsWhatAnExhaustiveSearchFinds) {
  for (const int count : {1, 7, 600}) {
    const std::vector<Feature> all = randomFeatures(count, count);
    const OutlineSearch search(all, 60.0f, 800.0f);
    for (const Feature& query : randomFeatures(300, 99)) {
      EXPECT_EQ(search.nearest(query), exhaustive(all, query, 60.0f, 800.0f));
    }
  }
}

TEST(OutlineSearch, NowherePairsWithNothing) {
  std::vector<Feature> all = randomFeatures(5, 3);
  all[2] = kNowhere;
  const OutlineSearch search(all, 1e4f, 1e9f);
  EXPECT_EQ(search.nearest(kNowhere), -1);
  for (const Feature& query : randomFeatures(50, 4)) EXPECT_NE(search.nearest(query), 2);
  EXPECT_EQ(OutlineSearch({}, 1.0f, 1.0f).nearest(all[0]), -1);
}

}  // namespace
}  // namespace calipso::align
