#include "mgdd/rig/control_cycle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/variant.hpp"
#include "mgdd/rig/monotonic_clock.hpp"

namespace mgdd::rig {
namespace {

constexpr int most_frames = 4096;  // of a cycle: a sender without end must not hold the loop
constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

void require_finite(std::string_view name, double value) {
  if (!std::isfinite(value)) throw ParameterError(name, value, "must be finite");
}

// At rest with the bridge open, where the plate is now: what was learnt stays where the controller can keep it.
template <class Controller>
void start_again(Controller& controller, double angle_deg) noexcept {
  if constexpr (requires { controller.take_over(angle_deg, 0.0); }) {
    controller.take_over(angle_deg, 0.0);
  } else {
    controller.reset();
  }
}

}  // namespace

void validate(const CycleSettings& s) {
  require_finite("initial_reference_deg", s.initial_reference_deg);
  if (s.stop_frames < 1 || s.stop_frames > 1000) {
    throw ParameterError("stop_frames", s.stop_frames, "must be in [1, 1000]");
  }
  if (s.reference_timeout_s) require_positive("reference_timeout_s", *s.reference_timeout_s, "s");
}

ControlCycle::ControlCycle(const CycleSettings& settings, AnyTransport transport,
                           const loop::ThrottleController& controller, const FrameCodec& codec, const SafetyGate& gate)
    : settings_((validate(settings), settings)),
      transport_(std::move(transport)),
      controller_(controller),
      codec_(codec),
      gate_(gate),
      setpoint_({settings.initial_reference_deg, monotonic_ns()}),
      queue_(settings.queue_capacity),
      samples_(settings.sample_capacity),
      reference_deg_(settings.initial_reference_deg),
      stop_frames_left_(settings.stop_frames) {
  const bool free = std::visit([](auto& t) { return t->claim().take(); }, transport_);
  if (!free) throw RigError("the transport serves another loop: make one for each loop");
}

ControlCycle::~ControlCycle() {
  on(transport_, [](auto& t) { t->claim().give_back(); });
}

void ControlCycle::take_frames(SafetyFacts& facts) noexcept {
  Frame frame;
  for (int i = 0; i < most_frames && on(transport_, [&](auto& t) noexcept { return t->receive(frame); }); ++i) {
    const FrameVerdict verdict = codec_.read(frame, measurements_);
    if (verdict == FrameVerdict::bad) {
      ++facts.bad_frames;
      counts_.bad_frames.add();
    } else if (verdict == FrameVerdict::good) {
      facts.good_frames += codec_.brought_angle() && measurements_.oldest_ns() ? 1 : 0;
      counts_.good_frames.add();
    } else if (verdict == FrameVerdict::foreign) {
      counts_.foreign_frames.add();
    }
  }
}

void ControlCycle::follow_reference(const Turn& turn) noexcept {
  const Setpoint& latest = setpoint_.read();
  if (latest.set_ns > reference_ns_) {
    reference_deg_ = latest.deg;
    reference_ns_ = heard_ns_ = latest.set_ns;
  }
  if (gate_.state() != SafetyState::run) {
    heard_ns_ = turn.woken_ns;
    return;
  }
  for (std::int64_t skipped = turn.skipped; skipped >= 0; --skipped) {
    if (!queue_.pop(reference_deg_)) break;
    heard_ns_ = turn.woken_ns;
  }
}

SafetyRequest ControlCycle::wanted(const Turn& turn) noexcept {
  SafetyRequest request = SafetyRequest::none;
  requests_.pop(request);
  const bool late = settings_.reference_timeout_s && gate_.state() == SafetyState::run &&
                    static_cast<double>(turn.woken_ns - heard_ns_) > *settings_.reference_timeout_s * 1e9;
  if (late) counts_.reference_timeouts.add();
  if (turn.stopping) return SafetyRequest::disarm;
  return late ? SafetyRequest::abort : request;
}

double ControlCycle::asked(bool fresh) noexcept {
  const bool driven = gate_.state() == SafetyState::run;
  const double angle_deg = measurements_.of(Measured::angle_deg);
  if (driven && !was_driven_ && has_run_) {
    on(controller_, [&](auto& c) noexcept { start_again(c, angle_deg); });
  }
  was_driven_ = driven;
  has_run_ = has_run_ || driven;
  if (!driven) return nothing;
  return on(controller_,
            [&](auto& c) noexcept -> double { return c.step(reference_deg_, fresh ? angle_deg : nothing); });
}

void ControlCycle::send(const Drive& drive) noexcept {
  last_result_ = SendResult::sent;
  if (!settings_.transmit || !drive.send) return;
  Frame frame;
  if (!codec_.write(drive, reference_deg_, frame)) {
    counts_.unencodable.add();
    last_result_ = SendResult::failed;
    return;
  }
  const std::int64_t before_ns = monotonic_ns();
  last_result_ = on(transport_, [&](auto& t) noexcept { return t->send(frame); });
  sending_.add(monotonic_ns() - before_ns);
}

void ControlCycle::publish() noexcept {
  while (const auto event = gate_.audit().pop())
    events_.push(*event);
  state_.store(gate_.state(), std::memory_order_relaxed);
  reason_.store(gate_.reason(), std::memory_order_relaxed);
  cause_.store(gate_.cause(), std::memory_order_relaxed);
}

bool ControlCycle::turn(const Turn& turn) noexcept {
  SafetyFacts facts;
  take_frames(facts);
  LoopSample sample;
  if (const auto oldest_ns = measurements_.oldest_ns()) {
    sample.age_ns = std::max<std::int64_t>(turn.woken_ns - *oldest_ns, 0);
    facts.age_s = static_cast<double>(sample.age_ns) * 1e-9;
    age_.add(sample.age_ns);
  }
  facts.sensor_v = {measurements_.of(Measured::first_v), measurements_.of(Measured::second_v)};
  facts.angle_deg = measurements_.of(Measured::angle_deg);
  facts.bus = bus_state();
  facts.sent = last_result_ == SendResult::sent;
  facts.missed_deadlines = turn.missed;
  follow_reference(turn);
  facts.request = wanted(turn);
  gate_.observe(facts);

  const bool fresh = facts.good_frames > 0;
  if (fresh) counts_.fresh.add();
  sample.asked_duty = asked(fresh);
  sample.drive = gate_.command(was_driven_ ? sample.asked_duty : 0.0);
  if (was_driven_) {
    on(controller_, [&](auto& c) noexcept {
      if constexpr (requires { c.set_sent(sample.drive.duty); }) c.set_sent(sample.drive.duty);
    });
  }
  send(sample.drive);
  publish();

  sample.cycle = turn.number;
  sample.deadline_ns = turn.deadline_ns;
  sample.lateness_ns = turn.woken_ns - turn.deadline_ns;
  sample.missed = turn.missed;
  sample.reference_deg = reference_deg_;
  sample.measured = measurements_.value;
  sample.state = gate_.state();
  sample.cause = gate_.cause();
  sample.result = last_result_;
  sample.fresh = fresh;
  sample.good_frames = facts.good_frames;
  sample.bad_frames = facts.bad_frames;
  sample.bus = facts.bus;
  sample.request = facts.request;
  sample.compute_ns = monotonic_ns() - turn.woken_ns;
  samples_.push(sample);
  if (turn.stopping) --stop_frames_left_;
  return stop_frames_left_ > 0;
}

void ControlCycle::set_reference(double deg) {
  require_finite("reference_deg", deg);
  const std::lock_guard lock(handing_over_);
  setpoint_.write({deg, monotonic_ns()});
}

void ControlCycle::queue_references(std::span<const double> deg) {
  for (const double value : deg)
    require_finite("reference_deg", value);
  const std::lock_guard lock(handing_over_);
  const std::size_t room = queue_.capacity() - queue_.size();
  if (deg.size() > room) {
    throw RigError(std::to_string(deg.size()) + " references do not fit: there is room for " + std::to_string(room) +
                   " of " + std::to_string(queue_.capacity()) + ", queue_capacity");
  }
  for (const double value : deg)
    queue_.push(value);
}

bool ControlCycle::request(SafetyRequest request) {
  const std::lock_guard lock(handing_over_);
  return requests_.push(request);
}

BusState ControlCycle::bus_state() const noexcept {
  return on(transport_, [](const auto& t) noexcept { return t->bus_state(); });
}
const TransportCounts& ControlCycle::transport_counts() const noexcept {
  return on(transport_, [](const auto& t) noexcept -> const TransportCounts& { return t->counts(); });
}
const BusMonitor& ControlCycle::bus_monitor() const noexcept {
  return on(transport_, [](const auto& t) noexcept -> const BusMonitor& { return t->monitor(); });
}

}  // namespace mgdd::rig
