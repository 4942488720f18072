#include "mgdd/rig/realtime_thread.hpp"

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/rig/monotonic_clock.hpp"

#ifdef __linux__
#include <linux/capability.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#endif

namespace mgdd::rig {
namespace {

constexpr double shortest_period_s = 5e-5, longest_period_s = 1.0;

#ifdef __linux__

std::string reason_of(int error) {
  return std::generic_category().message(error);
}

void ask_for_realtime(std::thread& thread, int priority, ScheduleGrant& grant) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  const int error = pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &parameters);
  grant.realtime = error == 0;
  if (error != 0) {
    grant.realtime_note = reason_of(error) + ": give the user rtprio in /etc/security/limits.conf, or CAP_SYS_NICE";
  }
}

bool may_lock_all_memory() noexcept {
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY) return true;
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  std::array<__user_cap_data_struct, 2> sets{};
  if (syscall(SYS_capget, &header, sets.data()) != 0) return false;
  return (sets[0].effective & (1u << CAP_IPC_LOCK)) != 0;
}

// Under a limit, locking what is to come would let later allocations fail anywhere in the process.
void ask_for_memory(ScheduleGrant& grant) {
  if (!may_lock_all_memory()) {
    grant.memory_note = "the limit of locked memory is not infinite: set memlock in /etc/security/limits.conf";
    return;
  }
  grant.memory_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  if (!grant.memory_locked) grant.memory_note = reason_of(errno);
}

// Timers of ordinary threads may ring 50 us late; those of SCHED_FIFO do not.
void ask_for_exact_timers() noexcept {
  prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
}

#else

void ask_for_realtime(std::thread&, int, ScheduleGrant& grant) {
  grant.realtime_note = "asked for on Linux only";
}
void ask_for_memory(ScheduleGrant& grant) {
  grant.memory_note = "asked for on Linux only";
}
void ask_for_exact_timers() noexcept {}

#endif

}  // namespace

void validate(const ScheduleSettings& s) {
  require_within("period_s", s.period_s, shortest_period_s, longest_period_s, "s");
  if (s.priority < 1 || s.priority > 99) throw ParameterError("priority", s.priority, "must be in [1, 99]");
}

struct RealtimeThread::Shared {
  ScheduleSettings settings;
  TurnFunction turn;
  TurnTiming timing;
  ScheduleGrant grant;
  std::thread thread;
  std::atomic<bool> stop{false}, go{false}, running{false};
  bool started = false;
  bool ended = false;
  mutable std::mutex mutex;  // of `ended`; the loop takes it once it is over
  mutable std::condition_variable over;

  void loop() noexcept {
    const auto period_ns = static_cast<std::int64_t>(std::llround(settings.period_s * 1e9));
    DeadlineGrid grid(monotonic_ns() + period_ns, period_ns);
    for (bool more = true; more;) {
      sleep_until_ns(grid.next_ns());
      const std::int64_t woken_ns = monotonic_ns();
      timing.lateness.add(woken_ns - grid.next_ns());
      if (grid.skip(woken_ns) == 0) {
        Turn now = grid.begin(woken_ns);
        now.stopping = stop.load(std::memory_order_relaxed);
        more = turn(now);
        const std::int64_t end_ns = monotonic_ns();
        timing.compute.add(end_ns - woken_ns);
        timing.turns.add();
        if (!grid.finish(end_ns)) timing.late.add();
      }
      timing.missed.set(static_cast<std::uint64_t>(grid.missed()));
      timing.longest_row.set(static_cast<std::uint64_t>(grid.longest_row()));
    }
  }

  void run() {
    ask_for_exact_timers();
    go.wait(false);
    loop();
    running = false;
    const std::lock_guard lock(mutex);
    ended = true;
    over.notify_all();
  }
};

RealtimeThread::RealtimeThread(const ScheduleSettings& settings, TurnFunction turn, double patience_s)
    : shared_(std::make_shared<Shared>()), patience_s_(patience_s) {
  validate(settings);
  shared_->settings = settings;
  shared_->turn = std::move(turn);
}

RealtimeThread::~RealtimeThread() {
  request_stop();
  if (!shared_->thread.joinable()) return;
  if (wait(patience_s_)) {
    shared_->thread.join();
  } else {
    shared_->thread.detach();
  }
}

void RealtimeThread::start() {
  Shared& s = *shared_;
  if (s.started) throw RigError("the loop was started before: make a new one");
  try {
    s.thread = std::thread([kept = shared_] { kept->run(); });
  } catch (const std::system_error& error) {
    throw RigError(std::string("no thread for the loop: ") + error.what());
  }
  s.started = true;
  s.running = true;
  if (s.settings.lock_memory) ask_for_memory(s.grant);
  if (s.settings.realtime) ask_for_realtime(s.thread, s.settings.priority, s.grant);
  s.go = true;
  s.go.notify_one();
}

void RealtimeThread::request_stop() noexcept {
  shared_->stop = true;
}

bool RealtimeThread::wait(double timeout_s) const {
  if (!shared_->started) return true;
  std::unique_lock lock(shared_->mutex);
  return shared_->over.wait_for(lock, std::chrono::duration<double>(timeout_s), [&] { return shared_->ended; });
}

bool RealtimeThread::started() const noexcept {
  return shared_->started;
}
bool RealtimeThread::running() const noexcept {
  return shared_->running;
}
const ScheduleGrant& RealtimeThread::grant() const noexcept {
  return shared_->grant;
}
const TurnTiming& RealtimeThread::timing() const noexcept {
  return shared_->timing;
}

}  // namespace mgdd::rig
