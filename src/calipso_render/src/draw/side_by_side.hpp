#pragma once

#include <omp.h>

#include <exception>
#include <functional>

namespace calipso::render {

// Pieces of work that do not need each other's results: on few threads at the same time, each on one
// of them, so that nobody waits at the end of every short loop in them; else one after the other,
// their loops on all threads. They are begun in their order: the longest should be the first.
// @param alike whether the threads get about as much to do
template <class... Work>
void sideBySide(bool alike, const Work&... work) {
  constexpr int kFewThreads = 3, kCount = sizeof...(work);
  const std::function<void()> works[] = {work...};
  std::exception_ptr failures[kCount];  // none may leave the region
#pragma omp parallel for schedule(dynamic, 1) if (alike && omp_get_max_threads() <= kFewThreads)
  for (int i = 0; i < kCount; ++i) {
    try {
      works[i]();
    } catch (...) {
      failures[i] = std::current_exception();
    }
  }
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

}  // namespace calipso::render
