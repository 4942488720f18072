#include "mgdd/rig/monotonic_clock.hpp"

#ifdef __linux__

#include <cerrno>
#include <ctime>

namespace mgdd::rig {

std::int64_t monotonic_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

void sleep_until_ns(std::int64_t time_ns) noexcept {
  timespec until{};
  until.tv_sec = static_cast<time_t>(time_ns / 1'000'000'000);
  until.tv_nsec = static_cast<long>(time_ns % 1'000'000'000);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace mgdd::rig

#else

#include <chrono>
#include <thread>

namespace mgdd::rig {

std::int64_t monotonic_ns() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void sleep_until_ns(std::int64_t time_ns) noexcept {
  std::this_thread::sleep_until(std::chrono::steady_clock::time_point(
      std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::nanoseconds(time_ns))));
}

}  // namespace mgdd::rig

#endif
