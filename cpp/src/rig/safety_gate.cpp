#include "mgdd/rig/safety_gate.hpp"

#include <algorithm>
#include <cmath>

#include "mgdd/common/bounds.hpp"
#include "mgdd/control/monitoring.hpp"
#include "mgdd/dynamics/lag.hpp"

namespace mgdd::rig {
namespace {

using Reason = SafetyReason;
using Request = SafetyRequest;

constexpr double longest_s = 1e9;  // of an age: finite, so that a state can be saved

const SafetyEnvelope& checked(const SafetyEnvelope& envelope) {
  validate(envelope);
  return envelope;  // NOLINT(bugprone-return-const-ref-from-parameter): the caller holds it
}

// From 0 to 1 with speed and acceleration 0 at both ends.
double grown(double x) noexcept {
  return x >= 1.0 ? 1.0 : x * x * x * (10.0 + x * (6.0 * x - 15.0));
}

}  // namespace

SafetyGate::SafetyGate(const SafetyEnvelope& envelope) : envelope_(checked(envelope)) {
  s_.since_sensor.fill(-1.0);
}

void SafetyGate::enter(SafetyState to, SafetyReason reason) noexcept {
  if (s_.state == to) return;
  double& count = s_.counts[static_cast<std::size_t>(reason)];
  count += 1.0;
  s_.audit.push({s_.cycle, s_.state, to, reason, static_cast<std::int64_t>(count)});
  s_.state = to;
  s_.reason = reason;
  s_.duty = s_.running = s_.streaks[still] = 0.0;
}

void SafetyGate::note(SafetyReason reason) noexcept {
  s_.healthy = 0.0;
  if (s_.cause == Reason::none || (is_fault(reason) && !is_fault(s_.cause))) s_.cause = reason;
}

void SafetyGate::note_after(Streak which, double growth, bool failing, double most, SafetyReason reason) noexcept {
  double& streak = s_.streaks[which];
  streak = control::leaky(streak, growth, failing, most);
  if (failing && streak >= most) note(reason);
}

void SafetyGate::react() noexcept {
  if (is_fault(s_.cause)) {
    enter(SafetyState::fault, s_.cause);
  } else if (s_.cause != Reason::none && (s_.state == SafetyState::armed || s_.state == SafetyState::run)) {
    enter(SafetyState::limp, s_.cause);
  }
}

// Frames of one cycle come in an order that nobody tells: all bad ones first is the worst for this cycle, all good ones
// first for the next.
void SafetyGate::look_at_frames(const SafetyFacts& f, double cycles) noexcept {
  const auto good = static_cast<double>(f.good_frames), broken = static_cast<double>(f.bad_frames);
  double& row = s_.streaks[bad];
  row = good > 0.0 && broken == 0.0 ? 0.0 : row + broken;
  if (row >= envelope_.bad_frames) note(Reason::bad_frames);
  if (good > 0.0) row = broken;

  const double told_s = std::min(f.age_s, longest_s);
  const double passed_s = cycles * envelope_.cycle_s;
  s_.silence_s = std::min(control::aged(f.age_s >= 0.0, told_s, s_.silence_s, passed_s), longest_s);
  const bool old = control::older(s_.silence_s, envelope_.largest_age_cycles * envelope_.cycle_s, envelope_.cycle_s);
  note_after(stale, cycles, old, envelope_.held_cycles + 1.0, Reason::stale);
  s_.holding = old;
}

void SafetyGate::look_at_sensors(const SafetyFacts& f, double cycles) noexcept {
  const SafetyEnvelope& e = envelope_;
  for (double& since : s_.since_sensor)
    since += since < 0.0 ? 0.0 : cycles;
  if (f.good_frames > 0) {
    const control::PairCheck pair =
        control::check_pair(f.sensor_v, closed(e.sensor_low_v, e.sensor_high_v),
                            f.sensor_v[0] + f.sensor_v[1] - e.sensor_sum_v, e.sensor_sum_tolerance_v);
    bool steep = false;
    for (std::size_t i = 0; i < 2; ++i) {
      if (!pair.in_range[i]) continue;
      const double reach_v = e.sensor_slope_v_per_s * e.cycle_s * s_.since_sensor[i];
      const bool reached = s_.since_sensor[i] < 0.0 || std::abs(f.sensor_v[i] - s_.sensor_v[i]) <= reach_v;
      steep = steep || !reached;
      if (!reached) continue;
      s_.sensor_v[i] = f.sensor_v[i];
      s_.since_sensor[i] = 0.0;
    }
    const Domain travel = closed(e.closed_deg - e.travel_margin_deg, e.open_deg + e.travel_margin_deg);
    const bool inside = travel.contains(f.angle_deg);
    if (inside) s_.angle_deg = f.angle_deg;
    s_.sensor_cause = !pair.all_in_range() ? Reason::sensor_range
                      : !pair.agree        ? Reason::sensor_disagreement
                      : steep              ? Reason::sensor_slope
                      : !inside            ? Reason::travel
                                           : Reason::none;
  }
  const bool failing = s_.sensor_cause != Reason::none;
  note_after(sensor, f.good_frames > 0 ? 1.0 : 0.0, failing, e.sensor_cycles, s_.sensor_cause);
}

void SafetyGate::look_at_motor(double cycles) noexcept {
  const SafetyEnvelope& e = envelope_;
  s_.heat += dynamics::lag_share(e.heat_time_constant_s, cycles * e.cycle_s) * (s_.duty * s_.duty - s_.heat);
  s_.hot = rms_duty() > (s_.hot ? e.rms_duty_to_arm : e.rms_duty_limit);
  if (s_.hot) note(Reason::heat);

  const bool pushed = s_.state == SafetyState::run && std::abs(s_.duty) >= e.stall_duty;
  double& row = s_.streaks[still];
  control::follow_standstill(!pushed, s_.angle_deg, e.stall_move_deg, s_.anchor_deg, row);
  if (!pushed) return;
  row += cycles;
  if (control::lasted(row, e.cycle_s, e.stall_s)) note(Reason::stall);
}

void SafetyGate::observe(const SafetyFacts& facts) noexcept {
  SafetyFacts f = facts;
  for (std::int64_t* number : {&f.good_frames, &f.bad_frames, &f.missed_deadlines})
    *number = std::max<std::int64_t>(*number, 0);
  const auto late = static_cast<double>(f.missed_deadlines);
  const double cycles = 1.0 + late;
  s_.cycle += 1 + f.missed_deadlines;
  s_.observed = true;
  s_.cause = Reason::none;
  s_.send = f.bus != BusState::off;
  look_at_frames(f, cycles);
  look_at_sensors(f, cycles);
  look_at_motor(cycles);
  if (f.bus >= envelope_.bus_fault_from) note(Reason::bus_fault);
  note_after(unsent, 1.0, !f.sent, envelope_.unsent_cycles, Reason::not_sent);
  double& row = s_.streaks[missed];
  row = late > 0.0 ? row + late : 0.0;
  if (row >= envelope_.missed_deadlines) note(Reason::deadlines);
  if (s_.streaks[invalid] >= envelope_.invalid_duties) note(Reason::invalid_duty);
  const bool quiet = s_.cause == Reason::none && f.bad_frames == 0 && !s_.holding && f.sent &&
                     f.missed_deadlines == 0 && s_.sensor_cause == Reason::none;
  s_.healthy = quiet ? s_.healthy + static_cast<double>(f.good_frames) : 0.0;
  react();
  (void)request(f.request);
}

double SafetyGate::limited(double duty) noexcept {
  const SafetyEnvelope& e = envelope_;
  s_.running += 1.0;
  const double inside = std::clamp(duty, -e.duty_limit, e.duty_limit);
  if (inside != duty) ++s_.clamped;
  const double asked = inside * (e.ramp_s > 0.0 ? grown(s_.running * e.cycle_s / e.ramp_s) : 1.0);
  const double step = e.slew_per_s * e.cycle_s;
  const double reached = std::clamp(asked, s_.duty - step, s_.duty + step);
  if (reached != asked) ++s_.slewed;
  return reached;
}

Drive SafetyGate::command(double duty) noexcept {
  if (!s_.observed) note(Reason::not_observed);
  s_.observed = false;
  const bool is_number = std::isfinite(duty);
  note_after(invalid, 1.0, !is_number, envelope_.invalid_duties, Reason::invalid_duty);
  react();
  if (s_.state == SafetyState::run && is_number && !s_.holding) s_.duty = limited(duty);
  return drive();
}

SafetyReason SafetyGate::readiness() const noexcept {
  if (s_.cause != Reason::none) return s_.cause;
  return s_.healthy >= envelope_.good_frames ? Reason::none : Reason::too_few_frames;
}

SafetyReason SafetyGate::move_on(bool allowed, SafetyState to) noexcept {
  if (!allowed) return Reason::wrong_state;
  const Reason against = readiness();
  if (against == Reason::none) enter(to, Reason::requested);
  return against;
}

SafetyReason SafetyGate::request(SafetyRequest request) noexcept {
  const SafetyState now = s_.state;
  const bool on = now == SafetyState::armed || now == SafetyState::run;
  switch (request) {
    case Request::none:
      return Reason::none;
    case Request::arm:
      return move_on(now == SafetyState::init, SafetyState::armed);
    case Request::run:
      return move_on(now == SafetyState::armed, SafetyState::run);
    case Request::reset:
      return move_on(now == SafetyState::limp || now == SafetyState::fault,
                     now == SafetyState::limp ? SafetyState::armed : SafetyState::init);
    case Request::stop:
      if (now != SafetyState::run) return Reason::wrong_state;
      enter(SafetyState::armed, Reason::requested);
      return Reason::none;
    case Request::disarm:
      if (!on) return Reason::wrong_state;
      enter(SafetyState::init, Reason::requested);
      return Reason::none;
    case Request::abort:
      s_.healthy = 0.0;
      if (on) enter(SafetyState::limp, Reason::aborted);
      return Reason::none;
  }
  return Reason::wrong_state;
}

double SafetyGate::rms_duty() const noexcept {
  return std::sqrt(s_.heat);
}

std::int64_t SafetyGate::count(SafetyReason reason) const noexcept {
  return static_cast<std::int64_t>(s_.counts[static_cast<std::size_t>(reason)]);
}

void SafetyGate::require_usable() const {
  const double most = s_.state == SafetyState::run ? envelope_.duty_limit : 0.0;
  require_within("state column 'duty'", s_.duty, -most, most);
  require_within("state column 'heat'", s_.heat, 0.0, 1.0);
  require_within("state column 'silence_s'", s_.silence_s, 0.0, longest_s, "s");
  require_within("state column 'healthy_frames'", s_.healthy, 0.0, unbounded);
  require_within("state column 'running'", s_.running, 0.0, unbounded);
  for (const double streak : s_.streaks)
    require_within("state column 'streaks'", streak, 0.0, unbounded);
  for (const double count : s_.counts)
    require_within("state column 'counts'", count, 0.0, unbounded);
  const double now = static_cast<double>(s_.cycle);
  require_within("state column 'cycle'", now, 0.0, unbounded);
}

}  // namespace mgdd::rig
