// Jobs on threads: every job once, the same results and the same exception on any number of threads, and a stop that
// keeps what is finished.
#include "mgdd/common/parallel.hpp"

#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>

#include "support/test.hpp"

namespace mgdd {
namespace {

TEST(Parallel, EveryJobRunsOnceWhateverTheThreads) {
  for (const std::size_t threads : {0u, 1u, 2u, 7u, 50u}) {
    std::vector<std::atomic<int>> runs(40);
    std::mutex mutex;
    std::set<std::size_t> workers;
    const std::vector<bool> finished =
        parallel_for(runs.size(), threads, [&](std::size_t job, std::size_t worker, StopRequest& stop) {
          EXPECT_FALSE(stop());
          ++runs[job];
          const std::lock_guard lock(mutex);
          workers.insert(worker);
        });
    EXPECT_EQ(finished, std::vector<bool>(40, true));
    for (const auto& count : runs)
      EXPECT_EQ(count, 1);
    EXPECT_LT(*workers.rbegin(), thread_count(40, threads));
  }
  EXPECT_TRUE(parallel_for(0, 4, [](std::size_t, std::size_t, StopRequest&) { FAIL(); }).empty());
}

TEST(Parallel, CountsThreads) {
  EXPECT_EQ(thread_count(3, 8), 3u);
  EXPECT_EQ(thread_count(8, 3), 3u);
  EXPECT_EQ(thread_count(0, 8), 1u);
  EXPECT_GE(thread_count(1000, 0), 1u);
}

TEST(Parallel, OneThreadWithoutStopIsAPlainLoop) {
  const std::thread::id here = std::this_thread::get_id();
  std::vector<std::size_t> order;
  parallel_for(5, 1, [&](std::size_t job, std::size_t, StopRequest&) {
    EXPECT_EQ(std::this_thread::get_id(), here);
    order.push_back(job);
  });
  EXPECT_EQ(order, (std::vector<std::size_t>{0, 1, 2, 3, 4}));
}

TEST(Parallel, TheExceptionOfTheLowestFailedJobComesBack) {
  for (const bool polled : {false, true}) {
    for (const std::size_t threads : {1u, 2u, 4u, 9u}) {
      std::atomic<std::size_t> begun{0};
      const auto job = [&](std::size_t i, std::size_t, StopRequest& request) {
        ++begun;
        while (i > 5 && !request())
          std::this_thread::yield();
        if (i == 3) std::this_thread::sleep_for(std::chrono::milliseconds(20));  // the later failure comes first
        if (i == 3 || i == 5) throw std::runtime_error("job " + std::to_string(i));
      };
      const std::function<bool()> stop = polled ? std::function<bool()>([] { return false; }) : nullptr;
      try {
        parallel_for(200, threads, job, stop);
        FAIL();
      } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "job 3") << threads;
      }
      EXPECT_LE(begun, 6u + threads);  // later jobs wait for a failure, then none is begun
    }
  }
}

TEST(Parallel, AFailureEndsLaterJobsThatLook) {
  const auto job = [&](std::size_t i, std::size_t, StopRequest& stop) {
    if (i == 0) throw std::runtime_error("first");
    while (!stop())
      std::this_thread::yield();
  };
  EXPECT_THROW(parallel_for(4, 4, job), std::runtime_error);
}

TEST(Parallel, StopKeepsWhatIsFinished) {
  std::atomic<int> looks{0};
  const std::vector<bool> finished = parallel_for(
      100, 2,
      [](std::size_t job, std::size_t, StopRequest& stop) {
        while (job >= 10 && !stop())
          std::this_thread::sleep_for(std::chrono::milliseconds(1));
      },
      [&] { return ++looks >= 2; });
  for (std::size_t job = 0; job < finished.size(); ++job)
    EXPECT_EQ(finished[job], job < 10) << job;
}

TEST(Parallel, AnExceptionOfTheStopCallbackEndsTheWorkAndComesBack) {
  const auto job = [](std::size_t, std::size_t, StopRequest& stop) {
    while (!stop())
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  };
  EXPECT_THROW(parallel_for(8, 2, job, []() -> bool { throw std::logic_error("signal"); }), std::logic_error);
}

}  // namespace
}  // namespace mgdd
