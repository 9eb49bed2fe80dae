#pragma once

#include <algorithm>
#include <functional>
#include <utility>

namespace calipso::fem {

// One thread's place in a parallel region.
class Crew {
 public:
  Crew(int rank, int count) : rank_(rank), count_(count) {}
  int rank() const { return rank_; }
  int count() const { return count_; }
  // This thread's share [first, second) of 0..n, in blocks of `grain`.
  std::pair<int, int> share(int n, int grain = 1) const {
    const long blocks = (n + grain - 1) / grain;
    const auto cut = [&](long k) {
      return static_cast<int>(std::min<long>(n, blocks * k / count_ * grain));
    };
    return {cut(rank_), cut(rank_ + 1)};
  }
  // Returns when every thread of the region has come here.
  void barrier() const;

 private:
  int rank_, count_;
};

// Runs work(crew) on as many threads as setThreads() allows; rank 0 is the caller. A call from
// inside a region, or while another thread has one, runs with a crew of one: results must not
// depend on the crew's size. Waiting threads spin for some microseconds, then sleep.
void runParallel(const std::function<void(const Crew&)>& work);

// work(begin, end) for shares of 0..n; on the calling thread where n is below `serial_below`.
void parallelFor(int n, int serial_below, const std::function<void(int, int)>& work);

// work(k) for k below `count`, one after the other on each thread; a single one may use all threads
// itself. What the first k throws that does is thrown once all are through.
void eachOnAThread(int count, const std::function<void(int)>& work);

}  // namespace calipso::fem
