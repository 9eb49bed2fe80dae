#pragma once

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace calipso::render {

// Every sweep visits every other band first, then those between, on all threads. Bands beside each
// other never have their turn at the same time, and always one after the other as on one thread:
// each may read its neighbours' rims.
// @param visit called with band and sweep, both from 0
template <class Visit>
void sweepBands(int bands, int sweeps, const Visit& visit) {
  const int firsts = (bands + 1) / 2;
  std::vector<std::atomic<int>> done(bands);  // sweeps
  // Whom a turn waits for has begun before it.
#pragma omp parallel for schedule(monotonic : dynamic, 1)
  for (int turn = 0; turn < sweeps * bands; ++turn) {
    const int sweep = turn / bands, i = turn % bands,
              band = i < firsts ? 2 * i : 2 * (i - firsts) + 1;
    for (int other = std::max(0, band - 1); other <= std::min(bands - 1, band + 1); ++other) {
      const int least = other % 2 < band % 2 ? sweep + 1 : sweep;
      while (done[other].load(std::memory_order_acquire) < least) std::this_thread::yield();
    }
    visit(band, sweep);
    done[band].store(sweep + 1, std::memory_order_release);
  }
}

}  // namespace calipso::render
