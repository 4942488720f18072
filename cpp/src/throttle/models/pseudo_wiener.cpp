#include "mgdd/throttle/models/pseudo_wiener.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::throttle {
namespace {

constexpr std::array<std::pair<Friction, std::string_view>, 2> frictions{{
    {Friction::coulomb, "set_valued"},
    {Friction::tanh, "tanh"},
}};

constexpr std::array<FieldInfo, n_pw_r> pw_r_fields{{
    {"above_tau_s", "s", log_scale(0.005, 0.3), "time constant J/b above limp-home"},
    {"above_gain_deg_per_s2_per_duty", "deg/s² per duty", log_scale(1e4, 4e5),
     "acceleration per duty G above limp-home"},
    {"above_preload_duty", "-", closed(0.0, 0.5), "preload beta above limp-home"},
    {"above_spring_duty_per_deg", "duty/deg", log_scale(1e-5, 2e-2), "spring kappa above limp-home"},
    {"above_coulomb_duty", "-", log_scale(0.003, 0.3), "dry friction delta above limp-home"},
    {"above_square_per_deg", "1/deg", closed(-5e-3, 5e-3), "c2 of the static map above limp-home"},
    {"above_cube_per_deg2", "1/deg²", closed(-5e-5, 5e-5), "c3 of the static map above limp-home"},
    {"below_tau_s", "s", log_scale(0.005, 0.3), "time constant J/b below limp-home"},
    {"below_gain_deg_per_s2_per_duty", "deg/s² per duty", log_scale(1e4, 4e5),
     "acceleration per duty G below limp-home"},
    {"below_preload_duty", "-", closed(0.0, 0.5), "preload beta below limp-home"},
    {"below_spring_duty_per_deg", "duty/deg", log_scale(1e-5, 2e-2), "spring kappa below limp-home"},
    {"below_coulomb_duty", "-", log_scale(0.003, 0.3), "dry friction delta below limp-home"},
    {"below_square_per_deg", "1/deg", closed(-5e-3, 5e-3), "c2 of the static map below limp-home"},
    {"below_cube_per_deg2", "1/deg²", closed(-5e-5, 5e-5), "c3 of the static map below limp-home"},
    {"limp_home_deg", "deg", closed(0.0, 90.0), "limp-home angle"},
}};
constexpr std::array<FieldInfo, n_pw_w> pw_w_fields{{
    {"first_s", "s", log_scale(1e-3, 20.0), "first lag"},
    {"second_s", "s", log_scale(1e-3, 20.0), "second lag"},
    {"base_deg", "deg", closed(-500.0, 500.0), "output at the lowest knot"},
    {"rise_1_deg", "deg", closed(0.0, 5000.0), "rise from knot 1 to 2"},
    {"rise_2_deg", "deg", closed(0.0, 5000.0), "rise from knot 2 to 3"},
    {"rise_3_deg", "deg", closed(0.0, 5000.0), "rise from knot 3 to 4"},
    {"rise_4_deg", "deg", closed(0.0, 5000.0), "rise from knot 4 to 5"},
    {"rise_5_deg", "deg", closed(0.0, 5000.0), "rise from knot 5 to 6"},
    {"rise_6_deg", "deg", closed(0.0, 5000.0), "rise from knot 6 to 7"},
    {"limp_home_deg", "deg", closed(0.0, 90.0), "limp-home angle"},
}};
constexpr std::array<FieldInfo, n_pw_p> pw_p_fields{{
    {"first_s", "s", log_scale(1e-3, 20.0), "first lag"},
    {"second_s", "s", log_scale(1e-3, 20.0), "second lag"},
    {"offset_deg", "deg", closed(-500.0, 500.0), "output at zero play, from limp-home"},
    {"radius_1_duty", "-", closed(0.0, 0.5), "half width of play 1"},
    {"gain_1_deg_per_duty", "deg/duty", closed(0.0, 20000.0), "gain of play 1"},
    {"radius_2_duty", "-", closed(0.0, 0.5), "half width of play 2"},
    {"gain_2_deg_per_duty", "deg/duty", closed(0.0, 20000.0), "gain of play 2"},
    {"radius_3_duty", "-", closed(0.0, 0.5), "half width of play 3"},
    {"gain_3_deg_per_duty", "deg/duty", closed(0.0, 20000.0), "gain of play 3"},
    {"radius_4_duty", "-", closed(0.0, 0.5), "half width of play 4"},
    {"gain_4_deg_per_duty", "deg/duty", closed(0.0, 20000.0), "gain of play 4"},
    {"radius_5_duty", "-", closed(0.0, 0.5), "half width of play 5"},
    {"gain_5_deg_per_duty", "deg/duty", closed(0.0, 20000.0), "gain of play 5"},
    {"radius_6_duty", "-", closed(0.0, 0.5), "half width of play 6"},
    {"gain_6_deg_per_duty", "deg/duty", closed(0.0, 20000.0), "gain of play 6"},
    {"radius_7_duty", "-", closed(0.0, 0.5), "half width of play 7"},
    {"gain_7_deg_per_duty", "deg/duty", closed(0.0, 20000.0), "gain of play 7"},
    {"radius_8_duty", "-", closed(0.0, 0.5), "half width of play 8"},
    {"gain_8_deg_per_duty", "deg/duty", closed(0.0, 20000.0), "gain of play 8"},
    {"limp_home_deg", "deg", closed(0.0, 90.0), "limp-home angle"},
}};

template <class Model>
void check_numbers(const Model& p, PseudoWienerKind kind) {
  const auto values = numbers(p);
  const auto rows = fields(kind);
  for (std::size_t i = 0; i < values.size(); ++i)
    require_in(rows[i], *values[i]);
  p.frame.validate();
  if (!(p.limp_home_deg >= p.frame.closed_deg && p.limp_home_deg <= p.frame.open_deg)) {
    require_within("limp_home_deg", p.limp_home_deg, p.frame.closed_deg, p.frame.open_deg, "deg");
  }
}

void check_map(const PwRSide& s, double reach_deg, std::string_view side) {
  for (int i = 0; i <= 20; ++i) {
    const double x = reach_deg * i / 20.0;
    const double slope = 1.0 + x * (2.0 * s.square_per_deg + 3.0 * x * s.cube_per_deg2);
    if (!(slope >= 0.2)) {
      throw ParameterError(std::string(side) + "_square_per_deg = " + text(s.square_per_deg) + ", " +
                           std::string(side) + "_cube_per_deg2 = " + text(s.cube_per_deg2) +
                           ": the slope of the static map must stay >= 0.2, it is " + text(slope) + " at " + text(x) +
                           " deg from limp-home");
    }
  }
}

// Every kind on every scalar of the contract.
template <class P>
constexpr bool fulfilled =
    dynamics::ModelFamily<PseudoWienerFamily<P>> && dynamics::on_every_scalar<PseudoWienerFamily<P>> &&
    ThrottleModel<decltype(model_of(std::declval<const P&>()))>;
static_assert(fulfilled<PwR> && fulfilled<PwW> && fulfilled<PwP>);

}  // namespace

Names<Friction> dry_friction_names() noexcept {
  return frictions;
}

std::span<const FieldInfo> fields(PseudoWienerKind kind) noexcept {
  switch (kind) {
    case PseudoWienerKind::pw_r:
      return pw_r_fields;
    case PseudoWienerKind::pw_w:
      return pw_w_fields;
    case PseudoWienerKind::pw_p:
      return pw_p_fields;
  }
  return {};
}

void PseudoWienerFrame::validate() const {
  require_within("closed_deg", closed_deg, -10.0, 90.0, "deg");
  require_within("open_deg", open_deg, 10.0, 120.0, "deg");
  if (!(open_deg > closed_deg)) {
    throw ParameterError("open_deg", open_deg, "must be above closed_deg = " + text(closed_deg), "deg");
  }
  require_within("sample_s", sample_s, 1e-5, 0.1, "s");
  require_within("substeps", substeps, 1.0, 1000.0);
  require_within("delay_samples", delay_samples, 0.0, max_delay_samples);
}

PseudoWienerFrame PseudoWienerFrame::at_sample(double new_sample_s) const {
  PseudoWienerFrame frame = *this;
  frame.sample_s = new_sample_s;
  const double delay = delay_samples * sample_s / new_sample_s;
  const double whole = std::round(delay);
  frame.delay_samples = std::abs(delay - whole) < 1e-9 ? whole : delay;  // rounding makes no fraction
  if (frame.delay_samples > max_delay_samples) {
    throw about("delay_samples",
                ParameterError("delay_samples = " + text(frame.delay_samples) + " at sample_s = " + text(new_sample_s) +
                               " s: must be in [0, " + text(max_delay_samples) + "]; for a delay of " +
                               text(1e3 * delay_samples * sample_s) +
                               " ms take sample_s >= " + text(delay_samples * sample_s / max_delay_samples) + " s"));
  }
  frame.validate();
  return frame;
}

void ObserverGains::validate() const {
  require_within("angle_gain", angle_gain, 0.0, 1.0);
  require_within("speed_gain_per_s", speed_gain_per_s, 0.0, 1e4, "1/s");
  require_within("bias_gain_duty_per_deg", bias_gain_duty_per_deg, 0.0, 1.0, "duty/deg");
  require_within("bias_limit_duty", bias_limit_duty, 0.0, 1.0);
  require_within("offset_gain", offset_gain, 0.0, 1.0);
}

void check_pw_r(const PseudoWienerFrame& frame, double ramp_deg, double tanh_deg_per_s, double dead_band_deg,
                Friction friction) {
  frame.validate();
  require_within("ramp_deg", ramp_deg, 1e-3, 10.0, "deg");
  require_within("tanh_deg_per_s", tanh_deg_per_s, 0.1, 1e3, "deg/s");
  require_within("dead_band_deg", dead_band_deg, 0.0, 10.0, "deg");
  if (friction != Friction::coulomb && friction != Friction::tanh) {
    throw ParameterError("friction", name_of(friction), "must be coulomb or tanh, PW-R has one level");
  }
}

void check_pw_w(const PseudoWienerFrame& frame, double knot_lower_duty, double knot_upper_duty) {
  frame.validate();
  require_within("knot_lower_duty", knot_lower_duty, -1.0, 1.0);
  require_within("knot_upper_duty", knot_upper_duty, -1.0, 1.0);
  if (!(knot_upper_duty > knot_lower_duty)) {
    throw ParameterError("knot_upper_duty", knot_upper_duty,
                         "must be above knot_lower_duty = " + text(knot_lower_duty));
  }
}

void check_pw_p(const PseudoWienerFrame& frame, int plays) {
  require_within("plays", plays, 1.0, max_plays);
  frame.validate();
}

template <>
void PwR::validate() const {
  validate_settings();
  check_numbers(*this, PseudoWienerKind::pw_r);
  check_map(above, frame.open_deg - limp_home_deg, "above");
  check_map(below, frame.closed_deg - limp_home_deg, "below");
}

template <>
void PwW::validate() const {
  validate_settings();
  check_numbers(*this, PseudoWienerKind::pw_w);
}

template <>
void PwP::validate() const {
  require_within("plays", plays, 1.0, max_plays);
  validate_settings();
  check_numbers(*this, PseudoWienerKind::pw_p);
}

PwR pw_r_of(const Throttle& t) noexcept {
  const double g = t.stall_torque_nm();
  const double deg = 180.0 / std::numbers::pi;
  PwR p;
  const auto side = [&](double preload_nm, double spring_nm_per_rad) {
    return PwRSide{.tau_s = t.inertia_kgm2 / t.damping_nms_per_rad(),
                   .gain_deg_per_s2_per_duty = deg * g / t.inertia_kgm2,
                   .preload_duty = preload_nm / g,
                   .spring_duty_per_deg = spring_nm_per_rad / (deg * g),
                   .coulomb_duty = t.coulomb_nm / g};
  };
  p.above = side(t.preload_above_nm, t.spring_above_nm_per_rad);
  p.below = side(t.preload_below_nm, t.spring_below_nm_per_rad);
  p.limp_home_deg = t.limp_home_deg;
  p.frame.closed_deg = t.closed_deg;
  p.frame.open_deg = t.open_deg;
  p.ramp_deg = t.preload_ramp_deg;
  return p;
}

PseudoWienerModel prepare(const PseudoWiener& parameters) {
  return std::visit([](const auto& p) -> PseudoWienerModel { return model_of(p); }, parameters);
}

void validate(const PseudoWiener& parameters) {
  std::visit([](const auto& p) { p.validate(); }, parameters);
}

PseudoWienerKind kind_of(const PseudoWiener& parameters) noexcept {
  return static_cast<PseudoWienerKind>(parameters.index());
}

// NOLINTNEXTLINE(bugprone-exception-escape): a variant of numbers always holds one of them
const PseudoWienerFrame& frame_of(const PseudoWiener& parameters) noexcept {
  return std::visit([](const auto& p) -> const PseudoWienerFrame& { return p.frame; }, parameters);
}

}  // namespace mgdd::throttle
