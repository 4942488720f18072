// The clock of a loop: nanoseconds of CLOCK_MONOTONIC, as Python's time.monotonic_ns, and a sleep until such a time.
// Where a system has no absolute sleep on that clock, the standard library's steady clock serves. Real-time safe.
#pragma once

#include <cstdint>

namespace mgdd::rig {

std::int64_t monotonic_ns() noexcept;

/// Returns at once where that time is over; a signal does not end it.
void sleep_until_ns(std::int64_t time_ns) noexcept;

}  // namespace mgdd::rig
