// Numbered jobs on several threads, the one pool of the core: the results stand where the caller puts them by job
// number, so they do not depend on the number of threads; nor does the exception that comes back. Not real-time safe.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <vector>

namespace mgdd {

/// Threads that `parallel_for` uses: `wanted`, or one per core where it is 0; at most one per job, at least one.
std::size_t thread_count(std::size_t jobs, std::size_t wanted) noexcept;

/// Whether the job at work should give up: the caller wants to stop, or a job of a lower number failed. A long job
/// looks now and then; the look costs two atomic loads. A job that was told so counts as not finished.
class StopRequest {
 public:
  StopRequest(const std::atomic<bool>& stopped, const std::atomic<std::size_t>& failed, std::size_t job) noexcept
      : stopped_(stopped), failed_(failed), job_(job) {}
  bool operator()() noexcept {
    obeyed_ = obeyed_ || stopped_ || failed_ < job_;
    return obeyed_;
  }
  bool obeyed() const noexcept { return obeyed_; }

 private:
  const std::atomic<bool>& stopped_;
  const std::atomic<std::size_t>& failed_;
  std::size_t job_;
  bool obeyed_ = false;
};

/// One job; `worker` counts from 0 below `thread_count(jobs, threads)` and is the index of a workspace.
using ParallelJob = std::function<void(std::size_t job, std::size_t worker, StopRequest& stop)>;

/// Runs jobs 0 to jobs - 1, begun in this order, and says which are finished: all of them unless `stop` asked for an
/// end. The calling thread polls `stop` about every 50 ms; without `stop` it works along. After a failure no further
/// job begins, and the exception of the lowest failed job is thrown once every thread is idle, as a plain loop would.
std::vector<bool> parallel_for(std::size_t jobs, std::size_t threads, const ParallelJob& run,
                               const std::function<bool()>& stop = {});

}  // namespace mgdd
