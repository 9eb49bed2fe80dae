#include "thread_team.hpp"

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

#include "threads.hpp"

namespace calipso::fem {
namespace {

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

  // True when the wait was long enough to sleep.
  bool waitPast(unsigned seen) {
    constexpr int kSpins = 1000;
    for (int k = 0; k < kSpins; ++k) {
      if (value() != seen) return false;
      pause();
    }
    std::unique_lock<std::mutex> lock(mutex_);
    sleepers_.fetch_add(1);
    wake_.wait(lock, [&] { return value_.load() != seen; });
    sleepers_.fetch_sub(1);
    return true;
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
      if (passed_.waitPast(seen)) slept_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    arrived_.store(0);
    passed_.advance();
  }

  unsigned passed() const { return passed_.value(); }
  unsigned slept() const { return slept_.load(std::memory_order_relaxed); }

 private:
  std::atomic<int> arrived_{0};
  std::atomic<unsigned> slept_{0};
  Signal passed_;
};

// Where other processes keep the processors busy, threads wait for each other longer than they work: then the
// caller works alone for a while, and tries again after ever more regions.
class Concurrency {
 public:
  bool isWorthwhile() { return alone_ == 0 || --alone_ == 0; }

  void judge(unsigned barriers, unsigned slept) {
    constexpr unsigned kEnoughToJudge = 16;
    constexpr int kFirstPause = 16, kLongestPause = 512;
    if (barriers < kEnoughToJudge) return;
    if (4 * slept <= barriers) {
      pause_ = kFirstPause;
      return;
    }
    alone_ = pause_;
    pause_ = std::min(2 * pause_, kLongestPause);
  }

 private:
  int alone_ = 0, pause_ = 16;
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
    const unsigned passed = inner_.passed(), slept = inner_.slept();
    work(Crew(0, count));
    end_.wait(static_cast<int>(threads_.size()) + 1);
    concurrency_.judge(inner_.passed() - passed, inner_.slept() - slept);
    return true;
  }

  void barrier() { inner_.wait(count_); }

 private:
  void serve(int rank, unsigned seen) {
    for (;; ++seen) {
      start_.waitPast(seen);
      if (!work_) return;
      if (rank < count_) (*work_)(Crew(rank, count_));
      end_.wait(static_cast<int>(threads_.size()) + 1);   // of idle threads, too
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

void parallelFor(int n, int serial_below, const std::function<void(int, int)>& work) {
  if (n < serial_below) return work(0, n);
  runParallel([&](const Crew& crew) {
    const auto [begin, end] = crew.share(n);
    work(begin, end);
  });
}

}  // namespace calipso::fem
