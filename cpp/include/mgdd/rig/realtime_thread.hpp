// A thread that calls a function at every point of an even grid of times: absolute deadlines, the scheduling class of
// real-time tasks where the system grants it, and an account of what was late. Its loop neither allocates, locks,
// throws nor prints if the function does not; making, starting and stopping it is offline code.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "mgdd/rig/deadline_grid.hpp"
#include "mgdd/rig/latency_histogram.hpp"
#include "mgdd/rig/shared_count.hpp"

namespace mgdd::rig {

struct ScheduleSettings {
  double period_s = 1e-3;
  bool realtime = true;     ///< asks for SCHED_FIFO
  int priority = 50;        ///< of SCHED_FIFO, 1 to 99
  bool lock_memory = true;  ///< asks for mlockall, until the process ends
};
/// ParameterError naming field, value and bound.
void validate(const ScheduleSettings& settings);

/// What the system granted; a note says why not.
struct ScheduleGrant {
  bool realtime = false;
  bool memory_locked = false;
  std::string realtime_note, memory_note;
};

/// Account of a loop; one thread writes, any thread reads.
struct TurnTiming {
  LatencyHistogram lateness;  ///< from the grid point to the beginning, of skipped turns too
  LatencyHistogram compute;   ///< from the beginning of a turn to its end
  SharedCount turns;
  SharedCount missed;       ///< deadlines: a turn skipped, or over too late
  SharedCount late;         ///< those of them whose turn ran, but too long
  SharedCount longest_row;  ///< most deadlines missed in a row
};

class RealtimeThread {
 public:
  /// One turn; false ends the loop. Must not throw: an exception ends the program.
  using TurnFunction = std::function<bool(const Turn&)>;

  /// ParameterError for bad settings. `patience_s`: how long the destructor waits for the end.
  RealtimeThread(const ScheduleSettings& settings, TurnFunction turn, double patience_s = 2.0);
  RealtimeThread(const RealtimeThread&) = delete;
  RealtimeThread& operator=(const RealtimeThread&) = delete;
  /// Asks for the end and waits for it; a turn that hangs longer keeps what it uses and is left alone.
  ~RealtimeThread();

  /// Returns once the thread runs; what the system refuses is in `grant`. RigError where it was started before or where
  /// the system has no thread left.
  void start();
  /// Turns see `stopping` from now on; they say when they are done.
  void request_stop() noexcept;
  /// Whether the loop has ended, after at most so long. Not started counts as ended.
  bool wait(double timeout_s) const;

  [[nodiscard]] bool started() const noexcept;
  [[nodiscard]] bool running() const noexcept;
  [[nodiscard]] const ScheduleGrant& grant() const noexcept;
  [[nodiscard]] const TurnTiming& timing() const noexcept;

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
  double patience_s_;
};

}  // namespace mgdd::rig
