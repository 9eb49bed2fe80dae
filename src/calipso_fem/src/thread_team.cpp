#include "thread_team.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "threads.hpp"

namespace calipso::fem {
namespace {

using Clock = std::chrono::steady_clock;

inline void pause() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#endif
}

// A counter that threads wait on: they spin for some microseconds, then sleep.
class Signal {
 public:
  unsigned value() const { return value_.load(std::memory_order_acquire); }

  void advance() {
    value_.fetch_add(1);
    if (sleepers_.load() == 0) return;
    std::lock_guard<std::mutex> lock(mutex_);
    wake_.notify_all();
  }

  // The time slept.
  Clock::duration waitPast(unsigned seen) {
    constexpr int kSpins = 1000;
    for (int k = 0; k < kSpins; ++k) {
      if (value() != seen) return Clock::duration::zero();
      pause();
    }
    const Clock::time_point start = Clock::now();
    std::unique_lock<std::mutex> lock(mutex_);
    sleepers_.fetch_add(1);
    wake_.wait(lock, [&] { return value_.load() != seen; });
    sleepers_.fetch_sub(1);
    return Clock::now() - start;
  }

 private:
  std::atomic<unsigned> value_{0};
  std::atomic<int> sleepers_{0};
  std::mutex mutex_;
  std::condition_variable wake_;
};

class Barrier {
 public:
  void wait(int count) {
    const unsigned seen = passed_.value();
    if (arrived_.fetch_add(1) + 1 < count) {
      slept_.fetch_add(passed_.waitPast(seen).count(), std::memory_order_relaxed);
      return;
    }
    arrived_.store(0);
    passed_.advance();
  }

  // Of all threads together, so far.
  Clock::duration slept() const { return Clock::duration(slept_.load(std::memory_order_relaxed)); }

 private:
  std::atomic<int> arrived_{0};
  std::atomic<Clock::rep> slept_{0};
  Signal passed_;
};

// Where other processes keep the processors busy, threads sleep waiting for each other for about as
// long as the work takes: then the caller works alone for a while, and tries again after ever
// longer ones.
class Concurrency {
 public:
  bool isWorthwhile() const { return Clock::now() >= alone_until_; }

  void judge(Clock::duration passed, Clock::duration slept, int count) {
    constexpr Clock::duration kEnoughToJudge = std::chrono::milliseconds(2);
    constexpr double kWorthwhile = 0.6;  // share of the helpers' time that may be slept
    passed_ += passed;
    slept_ += slept;
    if (passed_ < kEnoughToJudge) return;
    if (static_cast<double>(slept_.count()) <= kWorthwhile * (count - 1) * passed_.count()) {
      pause_ = kFirstPause;
    } else {
      alone_until_ = Clock::now() + std::max(pause_, 4 * passed_);
      pause_ = std::min(2 * pause_, kLongestPause);
    }
    passed_ = slept_ = Clock::duration::zero();
  }

 private:
  static constexpr Clock::duration kFirstPause = std::chrono::milliseconds(10);
  static constexpr Clock::duration kLongestPause = std::chrono::milliseconds(500);
  Clock::time_point alone_until_;
  Clock::duration pause_ = kFirstPause, passed_{}, slept_{};
};

// The process's helper threads; started at first use, ended with the process.
class Team {
 public:
  ~Team() {
    work_ = nullptr;
    start_.advance();
    for (std::thread& t : threads_) t.join();
  }

  bool tryRun(int count, const std::function<void(const Crew&)>& work) {
    std::unique_lock<std::mutex> lock(busy_, std::try_to_lock);
    if (!lock.owns_lock() || !concurrency_.isWorthwhile()) return false;
    while (static_cast<int>(threads_.size()) + 1 < count) {
      const int rank = static_cast<int>(threads_.size()) + 1;
      threads_.emplace_back([this, rank, seen = start_.value()] { serve(rank, seen); });
    }
    count_ = count;
    work_ = &work;
    start_.advance();
    const Clock::time_point start = Clock::now();
    const Clock::duration slept = inner_.slept() + end_.slept();
    work(Crew(0, count));
    end_.wait(static_cast<int>(threads_.size()) + 1);
    concurrency_.judge(Clock::now() - start, inner_.slept() + end_.slept() - slept, count);
    return true;
  }

  void barrier() { inner_.wait(count_); }

 private:
  void serve(int rank, unsigned seen) {
    for (;; ++seen) {
      start_.waitPast(seen);
      if (!work_) return;
      if (rank < count_) (*work_)(Crew(rank, count_));
      end_.wait(static_cast<int>(threads_.size()) + 1);  // of idle threads, too
    }
  }

  std::mutex busy_;
  std::vector<std::thread> threads_;
  Signal start_;
  Barrier inner_, end_;
  Concurrency concurrency_;
  int count_ = 1;
  const std::function<void(const Crew&)>* work_ = nullptr;
};

Team& team() {
  static Team instance;
  return instance;
}

thread_local bool inside = false;

}  // namespace

void Crew::barrier() const {
  if (count_ > 1) team().barrier();
}

void runParallel(const std::function<void(const Crew&)>& work) {
  const int count = threadCount();
  const auto marked = [&work](const Crew& crew) {
    inside = true;
    work(crew);
    inside = false;
  };
  if (count > 1 && !inside && team().tryRun(count, marked)) return;
  work(Crew(0, 1));
}

void eachOnAThread(int count, const std::function<void(int)>& work) {
  if (count == 1) return work(0);
  std::vector<std::exception_ptr> failures(count);
  runParallel([&](const Crew& crew) {
    for (int k = crew.rank(); k < count; k += crew.count()) {
      try {
        work(k);
      } catch (...) {
        failures[k] = std::current_exception();
      }
    }
  });
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
}

void parallelFor(int n, int serial_below, const std::function<void(int, int)>& work) {
  if (n < serial_below) return work(0, n);
  runParallel([&](const Crew& crew) {
    const auto [begin, end] = crew.share(n);
    work(begin, end);
  });
}

}  // namespace calipso::fem
