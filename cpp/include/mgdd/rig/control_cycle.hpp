// One turn of a throttle loop over a bus: take what arrived, judge it, ask the controller, pass its duty through the
// safety gate, send, and keep a sample. The controller is stepped in the state `run` only and sees NaN, which repeats
// the last angle, in a cycle without a new one. Angles in deg, duty -1..1.
// `turn` is noexcept, allocation-free and lock-free; other threads hand over references and requests, and take samples
// and events out. Making a cycle is offline code.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <variant>

#include "mgdd/loop/throttle_controllers.hpp"
#include "mgdd/rig/deadline_grid.hpp"
#include "mgdd/rig/frame_codec.hpp"
#include "mgdd/rig/latency_histogram.hpp"
#include "mgdd/rig/latest_value.hpp"
#include "mgdd/rig/ring_transport.hpp"
#include "mgdd/rig/safety_gate.hpp"
#include "mgdd/rig/socketcan_transport.hpp"
#include "mgdd/rig/spsc_ring.hpp"

namespace mgdd::rig {

using AnyTransport = std::variant<std::shared_ptr<RingTransport>, std::shared_ptr<SocketCanTransport>>;

struct CycleSettings {
  double initial_reference_deg = 0.0;
  bool transmit = true;  ///< false: everything but sending, a dry run
  int stop_frames = 5;   ///< commands with an open bridge before silence
  std::optional<double>
      reference_timeout_s{};             ///< a driven loop without a new reference for so long aborts; none: never
  std::size_t sample_capacity = 16'384;  ///< of the samples that wait to be taken, a power of two
  std::size_t queue_capacity = 65'536;   ///< of references that wait for their cycle, a power of two
};
/// ParameterError naming field, value and bound.
void validate(const CycleSettings& settings);

/// What a cycle did.
struct LoopSample {
  std::int64_t cycle = 0;        ///< number of its grid point
  std::int64_t deadline_ns = 0;  ///< its time
  std::int64_t lateness_ns = 0;
  std::int64_t compute_ns = 0;  ///< from waking until the command had left
  std::int64_t missed = 0;      ///< deadlines since the cycle before
  std::int64_t age_ns = -1;     ///< of the oldest number that the loop needs; negative: none yet
  double reference_deg = 0.0;
  std::array<double, n_measured> measured{};  ///< last good ones
  double asked_duty = 0.0;                    ///< by the controller; NaN while it is not stepped
  Drive drive{};
  SafetyState state = SafetyState::init;
  SafetyReason cause = SafetyReason::none;
  SendResult result = SendResult::sent;
  bool fresh = false;  ///< a new angle arrived
  // What else the gate was told: with it a record gives every drive again.
  std::int64_t good_frames = 0, bad_frames = 0;
  BusState bus = BusState::active;
  SafetyRequest request = SafetyRequest::none;
};

/// One thread writes, any thread reads.
struct CycleCounts {
  SharedCount good_frames, bad_frames, foreign_frames;
  SharedCount fresh;               ///< cycles with a new angle
  SharedCount reference_timeouts;  ///< cycles that asked for an abort
  SharedCount unencodable;         ///< commands that have no place in their signals
};

class ControlCycle {
 public:
  /// ParameterError for bad settings, RigError where the transport serves another loop.
  ControlCycle(const CycleSettings& settings, AnyTransport transport, const loop::ThrottleController& controller,
               const FrameCodec& codec, const SafetyGate& gate);
  ControlCycle(const ControlCycle&) = delete;
  ControlCycle& operator=(const ControlCycle&) = delete;
  ~ControlCycle();

  /// False after the last frame of a stop.
  bool turn(const Turn& turn) noexcept;

  // Any thread; these may wait for each other, the loop never does.
  /// Holds from the next cycle on. ParameterError unless finite.
  void set_reference(double deg);
  /// One reference per cycle in the state `run`, after those that wait already; the last one holds. ParameterError
  /// unless all are finite, RigError where they do not fit; nothing is queued then.
  void queue_references(std::span<const double> deg);
  /// False where too many wait.
  bool request(SafetyRequest request);

  // One thread.
  bool pop_sample(LoopSample& sample) noexcept { return samples_.pop(sample); }
  bool pop_event(AuditEntry& event) noexcept { return events_.pop(event); }

  // Any thread.
  [[nodiscard]] SafetyState state() const noexcept { return state_.load(std::memory_order_relaxed); }
  [[nodiscard]] SafetyReason reason() const noexcept { return reason_.load(std::memory_order_relaxed); }
  [[nodiscard]] SafetyReason cause() const noexcept { return cause_.load(std::memory_order_relaxed); }
  [[nodiscard]] const CycleCounts& counts() const noexcept { return counts_; }
  [[nodiscard]] const LatencyHistogram& age() const noexcept { return age_; }
  [[nodiscard]] const LatencyHistogram& sending() const noexcept { return sending_; }
  [[nodiscard]] const SpscRing<LoopSample>& samples() const noexcept { return samples_; }
  [[nodiscard]] const SpscRing<AuditEntry>& events() const noexcept { return events_; }
  [[nodiscard]] std::size_t queued_references() const noexcept { return queue_.size(); }
  [[nodiscard]] BusState bus_state() const noexcept;
  [[nodiscard]] const TransportCounts& transport_counts() const noexcept;
  [[nodiscard]] const BusMonitor& bus_monitor() const noexcept;

  /// As the loop left it; not while the loop runs.
  [[nodiscard]] const loop::ThrottleController& controller() const noexcept { return controller_; }

 private:
  struct Setpoint {
    double deg = 0.0;
    std::int64_t set_ns = 0;
  };
  static constexpr std::size_t request_capacity = 16, event_capacity = 256;

  void take_frames(SafetyFacts& facts) noexcept;
  void follow_reference(const Turn& turn) noexcept;
  SafetyRequest wanted(const Turn& turn) noexcept;
  double asked(bool fresh) noexcept;
  void send(const Drive& drive) noexcept;
  void publish() noexcept;

  CycleSettings settings_;
  AnyTransport transport_;
  loop::ThrottleController controller_;
  FrameCodec codec_;
  SafetyGate gate_;

  std::mutex handing_over_;  // writers of the three below
  LatestValue<Setpoint> setpoint_;
  SpscRing<double> queue_;
  SpscRing<SafetyRequest> requests_{request_capacity};

  SpscRing<LoopSample> samples_;
  SpscRing<AuditEntry> events_{event_capacity};
  CycleCounts counts_;
  LatencyHistogram age_, sending_;
  std::atomic<SafetyState> state_{SafetyState::init};
  std::atomic<SafetyReason> reason_{SafetyReason::none}, cause_{SafetyReason::none};

  // Of the loop alone.
  Measurements measurements_{};
  double reference_deg_;
  std::int64_t reference_ns_ = 0;  // when that of the slot was set
  std::int64_t heard_ns_ = 0;      // when there was a new one, or none was needed
  SendResult last_result_ = SendResult::sent;
  bool was_driven_ = false, has_run_ = false;
  int stop_frames_left_;
};

}  // namespace mgdd::rig
