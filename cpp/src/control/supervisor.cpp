#include "mgdd/control/supervisor.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/control/monitoring.hpp"

namespace mgdd::control {
namespace {

using Mode = SupervisorMode;
using Reason = SupervisorReason;

constexpr double fast_moves = 8.0;  // so many times the speed of a jam: the plate moves, without waiting for the way
constexpr double swings = 6.0;      // changes of side: three periods, more than the ringing of a loop that is damped
constexpr double quick_lag = 1.0 / 3.0;  // of the balance's

const SupervisorSettings& checked(const SupervisorSettings& settings) {
  validate(settings);
  return settings;  // NOLINT(bugprone-return-const-ref-from-parameter): the caller holds it
}

}  // namespace

ThrottleSupervisor::State::State(const SupervisorSettings& s) noexcept
    : reference_deg(s.plate.spring.limp_home_deg),
      angle_deg(s.plate.spring.limp_home_deg),
      silence_s(s.late_s),
      supply_v(s.nominal_supply_v) {}

ThrottleSupervisor::ThrottleSupervisor(const SupervisorSettings& settings)
    : settings_(checked(settings)),
      lag_(settings.balance_lag_s, settings.balance_lag_s, settings.sample_s),
      quick_share_(dynamics::lag_share(quick_lag * settings.balance_lag_s, settings.sample_s)),
      state_(settings) {}

// The first reason of an open bridge stays; of limits the later one in the list, of held samples the last one.
void ThrottleSupervisor::raise(Mode mode, Reason reason) noexcept {
  State& s = state_;
  s.quiet = 0.0;
  if (mode != Mode::holding) s.latched = std::max(s.latched, mode);
  const bool newer = mode > s.order.mode || (mode == s.order.mode && mode == Mode::holding) ||
                     (mode == s.order.mode && mode == Mode::limited && reason > s.order.reason);
  if (!newer) return;
  s.order.mode = mode;
  s.order.reason = reason;
}

bool ThrottleSupervisor::raise_after(Count which, bool failing, double after_s, Mode mode, Reason reason) noexcept {
  double& count = state_.counts[which];
  const double most = std::ceil(after_s / settings_.sample_s);
  count = is_input(which) ? leaky(count, 1.0, failing, most) : failing ? count + 1.0 : 0.0;
  const bool raised = failing && lasted(count, settings_.sample_s, after_s);
  if (raised) raise(mode, reason);
  return raised;
}

double ThrottleSupervisor::usable_reference_deg() const noexcept {
  const double upper = state_.restricted ? settings_.limited_open_deg : settings_.plate.open_deg;
  return std::clamp(state_.reference_deg, settings_.plate.closed_deg, upper);
}

void ThrottleSupervisor::look_at_reference(double reference_deg) noexcept {
  const bool missing = !std::isfinite(reference_deg);
  if (missing) {
    raise(Mode::holding, Reason::missing_reference);
  } else {
    if (reference_deg < settings_.plate.closed_deg || reference_deg > settings_.plate.open_deg) {
      raise(Mode::limited, Reason::reference_range);
    }
    state_.reference_deg = reference_deg;
  }
  (void)raise_after(no_reference, missing, settings_.silence_s, Mode::limp_home, Reason::missing_reference);
}

void ThrottleSupervisor::look_at_angles(const SupervisorInputs& in) noexcept {
  const SupervisorSettings& set = settings_;
  State& s = state_;
  const bool arrived = (std::isfinite(in.angle_deg[0]) || std::isfinite(in.angle_deg[1])) && in.age_s >= 0.0;
  s.silence_s = aged(arrived, in.age_s, s.silence_s, set.sample_s);
  const Reason silent = arrived ? Reason::stale_sample : Reason::missing_sample;
  const bool late = older(s.silence_s, set.late_s, set.sample_s);
  s.trusted = !late;
  if (!arrived || late) raise(Mode::holding, silent);
  if (lasted(s.silence_s / set.sample_s, set.sample_s, set.silence_s)) raise(Mode::limp_home, silent);
  (void)raise_after(no_angle, !arrived || late, set.silence_s, Mode::limp_home, silent);
  if (!arrived || late) return;

  const Domain range = closed(set.plate.closed_deg - set.range_margin_deg, set.plate.open_deg + set.range_margin_deg);
  const PairCheck check = check_pair(in.angle_deg, range, in.angle_deg[0] - in.angle_deg[1], set.disagreement_deg);
  const bool disagree = check.all_in_range() && !check.agree;
  const Reason wrong = disagree ? Reason::sensor_disagreement : Reason::sensor_range;
  const bool bad = !check.healthy();
  if (bad) raise(Mode::holding, wrong);
  (void)raise_after(bad_sensor, bad, set.sensor_s, Mode::limp_home, wrong);
  if (in.sensor_fault) raise(Mode::limp_home, bad ? wrong : Reason::sensor_disagreement);
  s.trusted = check.in_range[check.usable()] && !disagree;
  if (s.trusted) s.angle_deg = in.angle_deg[check.usable()];
}

void ThrottleSupervisor::look_at_supply(double supply_v) noexcept {
  const bool known = std::isfinite(supply_v);
  const SupervisorSettings& set = settings_;
  state_.supply_v = known ? supply_v : set.nominal_supply_v;
  const bool is_low = known && supply_v < set.supply_low_v, is_lost = known && supply_v < set.supply_lost_v;
  if (raise_after(low, is_low, set.supply_s, Mode::limited, Reason::supply_low)) state_.restricted = true;
  (void)raise_after(lost, is_lost, set.supply_s, Mode::limp_home, Reason::supply_lost);
  if (is_low) state_.quiet = 0.0;
}

// Equivalent disturbance, both lags on every term: excess - rate/(tau G) - acceleration/G.
void ThrottleSupervisor::follow_balance(double excess) noexcept {
  const SupervisorSettings& set = settings_;
  State& s = state_;
  auto& f = s.filtered;
  if (!s.filtering) {
    s.filtering = true;
    s.anchor_deg = s.last_deg = f[angle_once] = f[angle_twice] = s.angle_deg;
    f[excess_once] = f[excess_twice] = f[rate] = f[quick_rate] = 0.0;
  }
  const double before_deg = f[angle_twice], before = f[rate];
  lag_.step(f[angle_once], f[angle_twice], s.angle_deg);
  lag_.step(f[excess_once], f[excess_twice], excess);
  f[rate] = (f[angle_twice] - before_deg) / set.sample_s;
  f[quick_rate] += quick_share_ * ((s.angle_deg - s.last_deg) / set.sample_s - f[quick_rate]);
  s.last_deg = s.angle_deg;
  const double inertia = (f[rate] - before) / (set.sample_s * set.plate.gain_deg_per_s2);
  const double braking = f[rate] / (set.plate.time_constant_s * set.plate.gain_deg_per_s2);
  s.imbalance = f[excess_twice] - braking - inertia;
  s.motion = std::abs(braking) + std::abs(inertia);
}

// Whether the plate is pushed: neither with its spring nor without it would a free one stand still.
bool ThrottleSupervisor::look_for_jam(double duty, double excess, double friction, double known) noexcept {
  const SupervisorSettings& set = settings_;
  State& s = state_;
  const double error = usable_reference_deg() - s.angle_deg, way = std::copysign(1.0, error);
  const bool pushed =
      std::abs(error) > set.jam_error_deg && way * excess > known + set.load && way * duty > friction + set.load;
  const bool fast = std::abs(s.filtered[quick_rate]) * set.jam_s > fast_moves * set.jam_move_deg;
  follow_standstill(!pushed || fast, s.angle_deg, set.jam_move_deg, s.anchor_deg, s.counts[jam]);
  (void)raise_after(jam, pushed, set.jam_s, Mode::limp_home, Reason::jammed);
  return pushed;
}

// A plate driven towards limp-home harder than its friction needs: nothing pulls it there. Inertia and back-EMF count
// as unknown, so that fast moves cannot show it.
void ThrottleSupervisor::look_for_spring(double known) noexcept {
  const SupervisorSettings& set = settings_;
  State& s = state_;
  const double distance = s.angle_deg - set.plate.spring.limp_home_deg;
  const double beyond = -std::copysign(1.0, distance) * s.imbalance - known - s.motion;
  const bool near = std::abs(distance) <= set.spring_band_deg;
  s.evidence_s = near ? 0.0 : std::max(0.0, s.evidence_s + set.sample_s * beyond);
  if (s.evidence_s >= set.spring_evidence_s) raise(Mode::limp_home, Reason::spring_lost);
}

// A loop at its limit: the error changes sides, again and again, under a reference that stands.
void ThrottleSupervisor::look_for_oscillation(double error) noexcept {
  const SupervisorSettings& set = settings_;
  State& s = state_;
  s.on_side += 1.0;
  if (std::abs(usable_reference_deg() - s.stands_deg) > set.oscillation_deg) {
    s.stands_deg = usable_reference_deg();
    s.error_side = s.side_changes = 0.0;
  }
  if (lasted(s.on_side, set.sample_s, set.oscillation_s)) s.side_changes = 0.0;
  if (!(std::abs(error) > set.oscillation_deg)) return;
  const double side = std::copysign(1.0, error);
  if (side == -s.error_side) {
    s.side_changes += 1.0;
    s.on_side = 0.0;
  }
  s.error_side = side;
  if (s.side_changes >= swings) raise(Mode::limp_home, Reason::oscillation);
}

void ThrottleSupervisor::look_at_motion() noexcept {
  const SupervisorSettings& set = settings_;
  State& s = state_;
  if (!s.trusted || s.order.bridge_open) {
    s.filtering = false;
    for (const Count which : {jam, too_far_closed, too_far_open, overload})
      s.counts[which] = 0.0;
    s.imbalance = s.evidence_s = s.error_side = s.side_changes = 0.0;
    return;
  }
  const double duty = s.order.duty * s.supply_v / set.nominal_supply_v;
  const double held = set.plate.spring.at(s.angle_deg), excess = duty - held;
  const double friction = set.plate.friction * (1.0 + set.uncertainty);
  const double known = friction + set.uncertainty * std::abs(held);
  follow_balance(excess);
  if (look_for_jam(duty, excess, friction, known)) {
    s.evidence_s = 0.0;  // a plate that is pushed and stands has its spring
  } else {
    look_for_spring(known);
  }
  const double error = usable_reference_deg() - s.angle_deg;
  for (const auto& [side, beyond] : {std::pair{too_far_closed, error}, std::pair{too_far_open, -error}})
    (void)raise_after(side, beyond > set.tracking_error_deg, set.tracking_s, Mode::limp_home, Reason::tracking);
  look_for_oscillation(error);
  const bool away =
      s.angle_deg > set.plate.closed_deg + set.jam_error_deg && s.angle_deg < set.plate.open_deg - set.jam_error_deg;
  (void)raise_after(overload, away && std::abs(s.order.duty) > set.overload_duty, set.overload_s, Mode::limp_home,
                    Reason::overload);
}

void ThrottleSupervisor::test_return() noexcept {
  State& s = state_;
  if (!s.order.bridge_open) {
    s.open = 0.0;
    s.test = ReturnTest::none;
    return;
  }
  s.open += 1.0;
  const bool there =
      s.trusted && std::abs(s.angle_deg - settings_.plate.spring.limp_home_deg) <= settings_.limp_home_band_deg;
  const bool due = lasted(s.open, settings_.sample_s, settings_.return_s);
  s.test = there ? ReturnTest::passed : due && s.trusted ? ReturnTest::failed : ReturnTest::pending;
}

SupervisorView ThrottleSupervisor::observe(const SupervisorInputs& inputs) noexcept {
  State& s = state_;
  s.order.mode = s.latched;
  s.quiet += 1.0;
  look_at_reference(inputs.reference_deg);
  look_at_angles(inputs);
  look_at_supply(inputs.supply_v);
  test_return();
  look_at_motion();
  return {usable_reference_deg(), s.angle_deg};
}

SupervisorOrder ThrottleSupervisor::decide(double duty) noexcept {
  State& s = state_;
  const bool invalid = !std::isfinite(duty) && s.latched != Mode::limp_home;
  if (invalid) raise(Mode::holding, Reason::invalid_duty);
  (void)raise_after(no_duty, invalid, settings_.silence_s, Mode::limp_home, Reason::invalid_duty);
  const bool holds = !s.trusted || invalid;
  s.order.bridge_open = s.latched == Mode::limp_home;
  s.order.duty =
      s.order.bridge_open ? 0.0 : std::clamp(holds ? settings_.plate.spring.at(s.angle_deg) : duty, -1.0, 1.0);
  return s.order;
}

SupervisorReason ThrottleSupervisor::acknowledge() noexcept {
  State& s = state_;
  const bool returned = s.latched != Mode::limp_home || s.test == ReturnTest::passed;
  if (!returned || !lasted(s.quiet, settings_.sample_s, settings_.healthy_s)) return s.order.reason;
  s.latched = s.order.mode = Mode::normal;
  s.order.reason = Reason::none;
  s.order.bridge_open = s.restricted = false;
  s.test = ReturnTest::none;
  return Reason::none;
}

void ThrottleSupervisor::require_usable() const {
  const State& s = state_;
  require_within("state column 'duty'", s.order.duty, -1.0, 1.0);
  require_within("state column 'silence_s'", s.silence_s, 0.0, unbounded);
  require_within("state column 'samples_open'", s.open, 0.0, unbounded);
  require_within("state column 'samples_quiet'", s.quiet, 0.0, unbounded);
  for (const double count : s.counts)
    require_within("state column 'counts'", count, 0.0, unbounded);
}

}  // namespace mgdd::control
