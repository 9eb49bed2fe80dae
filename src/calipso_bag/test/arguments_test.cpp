#include "calipso_bag/arguments.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

using calipso::bag::Arguments;

namespace {

Arguments parse(std::vector<const char*> words) {
  words.insert(words.begin(), "tool");
  return Arguments(static_cast<int>(words.size()), const_cast<char**>(words.data()), 2, {"seconds"},
                   {"compressed"}, "usage: tool A B");
}

}  // namespace

TEST(Arguments, HelpIsNoError) { EXPECT_EXIT(parse({"--help"}), ::testing::ExitedWithCode(0), ""); }

TEST(Arguments, ReadsWordsKeysAndFlagsInAnyOrder) {
  const Arguments arguments = parse({"--seconds", "2.5", "a", "--compressed", "b"});
  EXPECT_EQ(arguments.word(0), "a");
  EXPECT_EQ(arguments.word(1), "b");
  EXPECT_DOUBLE_EQ(arguments.number("seconds", 0.0), 2.5);
  EXPECT_TRUE(arguments.has("compressed"));
}

TEST(Arguments, FallsBackWhereNothingIsGiven) {
  EXPECT_DOUBLE_EQ(parse({"a", "b"}).number("seconds", 7.0), 7.0);
}

TEST(Arguments, RejectsWhatIsNotAboveZero) {
  EXPECT_DOUBLE_EQ(parse({"a", "b", "--seconds", "0.1"}).positive("seconds", 7.0), 0.1);
  EXPECT_DOUBLE_EQ(parse({"a", "b"}).positive("seconds", 0.0), 0.0);  // a default may be nothing
  for (const char* value : {"0", "-1", "nan", "inf"}) {
    EXPECT_THROW(parse({"a", "b", "--seconds", value}).positive("seconds", 7.0),
                 std::invalid_argument)
        << value;
  }
}

TEST(Arguments, RejectsWhatItDoesNotKnow) {
  EXPECT_THROW(parse({"a"}), std::invalid_argument);
  EXPECT_THROW(parse({"a", "b", "c"}), std::invalid_argument);
  EXPECT_THROW(parse({"a", "b", "--what"}), std::invalid_argument);
  EXPECT_THROW(parse({"a", "b", "--seconds"}), std::invalid_argument);
  EXPECT_THROW(parse({"a", "b", "--seconds", "2x"}).number("seconds", 0.0), std::invalid_argument);
}
