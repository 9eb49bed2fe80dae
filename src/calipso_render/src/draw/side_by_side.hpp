#pragma once

#include <omp.h>

#include <exception>
#include <functional>
#include <vector>

namespace calipso::render {

// Pieces of work that do not need each other's results, each on one thread, begun in their order: the
// longest should be the first. Those of one that is itself such a piece are shared with the threads
// that have nothing left to do.
// @param at_once else one after the other, their loops on all threads
inline void doAll(bool at_once, const std::vector<std::function<void()>>& works) {
  std::vector<std::exception_ptr> failures(works.size());  // none may leave the region
  const auto attempt = [&](std::size_t i) {
    try {
      works[i]();
    } catch (...) {
      failures[i] = std::current_exception();
    }
  };
  if (at_once && omp_in_parallel()) {
    for (std::size_t i = 0; i < works.size(); ++i) {
#pragma omp task firstprivate(i) shared(attempt)
      attempt(i);
    }
#pragma omp taskwait
  } else {
#pragma omp parallel for schedule(dynamic, 1) if (at_once && works.size() > 1)
    for (std::size_t i = 0; i < works.size(); ++i) attempt(i);
  }
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

// The same at once on few threads, so that nobody waits at the end of every short loop in them.
// @param alike whether the threads get about as much to do
template <class... Work>
void sideBySide(bool alike, const Work&... work) {
  constexpr int kFewThreads = 3;
  doAll(alike && omp_get_max_threads() <= kFewThreads, {work...});
}

}  // namespace calipso::render
