#include "draw/side_by_side.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>

namespace calipso::render {
namespace {

std::vector<std::function<void()>> times(int count, const std::function<void()>& work) {
  return std::vector<std::function<void()>>(count, work);
}

TEST(DoAll, DoesPiecesOfPieces) {
  const int threads = omp_get_max_threads();
  for (const int count : {1, 2, 5}) {
    omp_set_num_threads(count);
    for (const bool at_once : {false, true}) {
      std::atomic<int> done{0};
      doAll(at_once, times(3, [&] { doAll(true, times(4, [&] { ++done; })); }));
      EXPECT_EQ(done, 12) << count << " threads";
    }
  }
  omp_set_num_threads(threads);
}

TEST(DoAll, ThrowsWhatAPieceOfAPieceThrowsWhenAllAreDone) {
  std::atomic<int> done{0};
  const auto fail = [&] {
    ++done;
    throw std::runtime_error("no memory");
  };
  EXPECT_THROW(doAll(true, times(3, [&] { doAll(true, times(4, fail)); })), std::runtime_error);
  EXPECT_EQ(done, 12);
}

}  // namespace
}  // namespace calipso::render
