#include "calipso_bag/play_schedule.hpp"

#include <gtest/gtest.h>

using calipso::bag::playSchedule;

TEST(PlaySchedule, WithoutScalesTheClipIsPlayedAsItIs) {
  const auto played = playSchedule({10, 20, 35}, {});
  ASSERT_EQ(played.size(), 3u);
  EXPECT_EQ(played[2].source, 2);
  EXPECT_EQ(played[2].time_ns, 35);
}

TEST(PlaySchedule, SlowMotionDividesTheIntervalsFromItsInstantOn) {
  const auto played = playSchedule({0, 100, 200, 300}, {{100, 0.5}});
  const std::vector<std::pair<int, std::int64_t>> expected = {{0, 0},   {1, 100}, {1, 150},
                                                              {2, 200}, {2, 250}, {3, 300}};
  ASSERT_EQ(played.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(played[i].source, expected[i].first);
    EXPECT_EQ(played[i].time_ns, expected[i].second);
  }
}

TEST(PlaySchedule, TheLatestScaleCountsInWhateverOrderTheyCome) {
  EXPECT_EQ(playSchedule({0, 100, 200}, {{100, 1.0}, {0, 0.25}}).size(), 4u + 1u + 1u);
}

TEST(PlaySchedule, StampsStayAscendingWhenThePartsDoNotDivideTheInterval) {
  const auto played = playSchedule({0, 100}, {{0, 1.0 / 3.0}});
  ASSERT_EQ(played.size(), 4u);
  for (std::size_t i = 1; i < played.size(); ++i)
    EXPECT_LT(played[i - 1].time_ns, played[i].time_ns);
}
