#include "mgdd/control/guided_predictive_settings.hpp"

#include <array>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/control/spring_fields.hpp"

namespace mgdd::control {
namespace {

using S = GuidedPredictiveSettings;
using P = PlateSettings;
using L = FrictionLearnerSettings;
using R = BeliefReviewSettings;

constexpr Domain share = closed(0.0, 1.0);
constexpr Domain weight = closed(0.0, 1e9);
constexpr Domain rate = closed(0.0, 1e9);
constexpr Domain angle = closed(-1e3, 1e3);

constexpr std::array<Field<S>, n_guided_predictive_fields> table = joined(
    std::array{
        field<&S::sample_s>({"sample_s", "s", above(0.0, 1.0), "time between samples"}),
        field<&S::plate, &P::gain_deg_per_s2>(
            {"gain_deg_per_s2", "degree/second²", above(0.0, 1e9), "acceleration per duty"}),
        field<&S::plate, &P::time_constant_s>({"time_constant_s", "s", above(0.0, 1e3), "of the speed"}),
        field<&S::plate, &P::electrical_s>({"electrical_s", "s", closed(0.0, 1.0), "lag of the motor's torque"}),
    },
    spring_fields<&S::plate, &P::spring>(),
    std::array{
        field<&S::plate, &P::friction>({"friction", "-", closed(0.0, 0.5), "duty against dry friction, at the start"}),
        field<&S::plate, &P::closed_deg>({"closed_deg", "deg", angle, "lower end of the travel"}),
        field<&S::plate, &P::open_deg>({"open_deg", "deg", angle, "upper end of the travel"}),
        field<&S::prediction_step_s>({"prediction_step_s", "s", above(0.0, 1.0), "step of the horizon"}),
        field<&S::error_weight>({"error_weight", "1/degree²", weight, "of the squared error at each step"}),
        field<&S::speed_weight>({"speed_weight", "second²/degree²", weight, "of the squared speed at each step"}),
        field<&S::duty_change_weight>({"duty_change_weight", "-", weight, "of the squared change of each move"}),
        field<&S::lower>({"lower", "-", lower_duty, "least duty"}),
        field<&S::upper>({"upper", "-", upper_duty, "largest duty"}),
        field<&S::duty_rate_per_s>({"duty_rate_per_s", "1/second", above(0.0, 1e9), "largest change of the duty"}),
        field<&S::lowest_deg>({"lowest_deg", "deg", angle, "least angle of the prediction"}),
        field<&S::highest_deg>({"highest_deg", "deg", angle, "largest angle of the prediction"}),
        field<&S::angle_limit_weight>({"angle_limit_weight", "1/degree²", weight, "of the squared angle beyond these"}),
        field<&S::observer_angle_per_s>(
            {"observer_angle_per_s", "1/second", rate, "sum of the rates at which the errors of angle and speed die"}),
        field<&S::observer_speed_per_s2>({"observer_speed_per_s2", "1/second²", rate, "and their product"}),
        field<&S::noise_deg>({"noise_deg", "deg", above(0.0, 1e2), "standard deviation of the measured angle"}),
        field<&S::learner, &L::rate_per_s>(
            {"learning_rate_per_s", "1/second", rate, "share of what explains an innovation that is learnt"}),
        field<&S::learner, &L::gain_weight>(
            {"gain_weight", "-", weight, "first variance of the gain factor over that of a friction level"}),
        field<&S::learner, &L::damping_weight>({"damping_weight", "-", weight, "of the damping factor"}),
        field<&S::learner, &L::level_memory_s>(
            {"level_memory_s", "s", above(0.0, 1e6), "sliding after which a level is as uncertain as at first"}),
        field<&S::learner, &L::memory_s>({"memory_s", "s", above(0.0, 1e6), "the same for gain and damping"}),
        field<&S::learner, &L::least_gain_factor>(
            {"least_gain_factor", "-", above(0.0, 1.0), "least learnt gain over the given one"}),
        field<&S::learner, &L::largest_gain_factor>(
            {"largest_gain_factor", "-", closed(1.0, 10.0), "largest learnt gain over the given one"}),
        field<&S::review, &R::worse>(
            {"rollback_ratio", "-", closed(1.0, 1e9), "of squared innovations, from which a belief predicts worse"}),
        field<&S::review, &R::roll_back_s>(
            {"rollback_s", "s", above(0.0, 1e6), "sliding over which a worse belief is given up"}),
        field<&S::review, &R::certify_s>(
            {"certify_s", "s", above(0.0, 1e6), "sliding over which a better belief is certified"}),
        field<&S::bias_rate_per_deg_s>(
            {"bias_rate_per_deg_s", "1/(degree*second)", rate, "without learning: rate of the one bias"}),
        field<&S::trim_rate_per_deg_s>(
            {"trim_rate_per_deg_s", "1/(degree*second)", rate, "without learning: rate of the trim"}),
        field<&S::reference_lag_s>({"reference_lag_s", "s", closed(0.0, 10.0), "lag of the rate of the reference"}),
        field<&S::reference_jump_deg_per_s>(
            {"reference_jump_deg_per_s", "degree/second", above(0.0, 1e9), "a faster reference steps and has no rate"}),
    });

constexpr std::array<std::pair<Prediction, std::string_view>, 2> predictions{
    {{Prediction::nonlinear, "nonlinear"}, {Prediction::linear, "linear"}}};
constexpr std::array<std::pair<SideSwitching, std::string_view>, 2> switchings{
    {{SideSwitching::predicted, "predicted"}, {SideSwitching::measured, "measured"}}};

}  // namespace

std::span<const Field<S>, n_guided_predictive_fields> guided_predictive_fields() noexcept {
  return table;
}
Names<Prediction> prediction_names() noexcept {
  return predictions;
}
Names<SideSwitching> side_switching_names() noexcept {
  return switchings;
}

void validate(const S& s) {
  require_fields(table, s);
  require_duty_range(s.lower, s.upper);
  const P& p = s.plate;
  if (!(p.closed_deg < p.open_deg)) {
    throw ParameterError("open_deg", p.open_deg, "must be > closed_deg = " + text(p.closed_deg), "deg");
  }
  if (!(s.lowest_deg < s.highest_deg)) {
    throw ParameterError("highest_deg", s.highest_deg, "must be > lowest_deg = " + text(s.lowest_deg), "deg");
  }
  require_within("delay_samples", s.delay_samples, 0, longest_guided_delay);
  require_within("gauss_newton_steps", s.gauss_newton_steps, 1, 100);
  int steps = 0;
  for (std::size_t i = 0; i < s.move_steps.size(); ++i) {
    require_within("move_steps[" + std::to_string(i) + "]", s.move_steps[i], 1, longest_guided_horizon);
    steps += s.move_steps[i];
  }
  if (steps > longest_guided_horizon) {
    throw ParameterError("move_steps", static_cast<double>(steps),
                         "must add up to at most " + std::to_string(longest_guided_horizon) + " steps");
  }
}

void require_usable_belief(const PlateBelief<double>& belief, const S& settings, const char* prefix) {
  const auto check = [prefix](const char* name, double value, double lowest, double highest) {
    require_within("state column '" + std::string(prefix) + name + "'", value, lowest, highest);
  };
  constexpr double room = 1e-6;  // of float
  check("gain_factor", belief.gain_factor, settings.learner.least_gain_factor - room,
        settings.learner.largest_gain_factor + room);
  check("damping_factor", belief.damping_factor, least_damping_factor - room, largest_damping_factor + room);
  check("friction_above", belief.above.friction, 0.0, 0.5 + room);
  check("friction_below", belief.below.friction, 0.0, 0.5 + room);
  check("bias_above", belief.above.bias, -0.5 - room, 0.5 + room);
  check("bias_below", belief.below.bias, -0.5 - room, 0.5 + room);
}

}  // namespace mgdd::control
