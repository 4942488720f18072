#include "mgdd/common/parallel.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <limits>
#include <mutex>
#include <thread>

namespace mgdd {
namespace {

constexpr std::chrono::milliseconds between_polls(50);

class Run {
 public:
  Run(std::size_t jobs, const ParallelJob& job) : job_(job), finished_(jobs, 0) {}

  // Takes jobs until there are none; exceptions stay in here.
  void work(std::size_t worker) noexcept {
    for (std::size_t job = next_++; job < finished_.size(); job = next_++) {
      StopRequest request(stopped_, failed_, job);
      if (request()) break;
      try {
        job_(job, worker, request);
        finished_[job] = request.obeyed() ? 0 : 1;
      } catch (...) {
        const std::lock_guard lock(mutex_);
        if (job < failed_) {
          failed_ = job;
          failure_ = std::current_exception();
        }
      }
    }
    const std::lock_guard lock(mutex_);
    ++idle_;
    changed_.notify_all();
  }

  void wait(std::size_t threads, const std::function<bool()>& stop) {
    std::unique_lock lock(mutex_);
    while (!changed_.wait_for(lock, between_polls, [&] { return idle_ == threads; })) {
      lock.unlock();
      if (stop()) stopped_ = true;
      lock.lock();
    }
  }

  void stop() noexcept { stopped_ = true; }

  std::vector<bool> result() const {
    if (failure_) std::rethrow_exception(failure_);
    return {finished_.begin(), finished_.end()};
  }

 private:
  const ParallelJob& job_;
  std::vector<std::uint8_t> finished_;  // bytes: threads write neighbours
  std::atomic<std::size_t> next_{0};
  std::atomic<std::size_t> failed_{std::numeric_limits<std::size_t>::max()};
  std::atomic<bool> stopped_{false};
  std::exception_ptr failure_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t idle_ = 0;
};

}  // namespace

std::size_t thread_count(std::size_t jobs, std::size_t wanted) noexcept {
  const std::size_t cores = std::max(1u, std::thread::hardware_concurrency());
  return std::clamp(wanted > 0 ? wanted : cores, std::size_t{1}, std::max(jobs, std::size_t{1}));
}

std::vector<bool> parallel_for(std::size_t jobs, std::size_t threads, const ParallelJob& run,
                               const std::function<bool()>& stop) {
  Run all(jobs, run);
  const std::size_t count = thread_count(jobs, threads);
  {
    std::vector<std::jthread> pool;
    const std::size_t first = stop ? 0 : 1;  // without `stop` the caller is worker 0
    try {
      for (std::size_t worker = first; worker < count; ++worker)
        pool.emplace_back([&all, worker] { all.work(worker); });
    } catch (...) {
      if (stop && pool.empty()) throw;  // fewer threads than asked for only take longer
    }
    if (stop) {
      try {
        all.wait(pool.size(), stop);
      } catch (...) {
        all.stop();
        throw;
      }
    } else {
      all.work(0);
    }
  }
  return all.result();
}

}  // namespace mgdd
