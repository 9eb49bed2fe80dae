#pragma once

#include <omp.h>

#include <exception>

namespace calipso::render {

// Two pieces of work that do not need each other's results: on few threads at the same time, each
// on one of them, so that nobody waits at the end of every short loop in them; else one after the
// other, their loops on all threads.
// @param alike whether they take about as long
template <class First, class Second>
void sideBySide(bool alike, const First& first, const Second& second) {
  constexpr int kFewThreads = 3;
  std::exception_ptr failures[2];  // none may leave the region
  const auto attempt = [](const auto& work, std::exception_ptr& failure) {
    try {
      work();
    } catch (...) {
      failure = std::current_exception();
    }
  };
#pragma omp parallel sections if (alike && omp_get_max_threads() <= kFewThreads)
  {
#pragma omp section
    attempt(first, failures[0]);
#pragma omp section
    attempt(second, failures[1]);
  }
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

}  // namespace calipso::render
