#include "mgdd/control/guided_predictive_settings.hpp"

#include <array>
#include <string>

#include "mgdd/common/error.hpp"

namespace mgdd::control {
namespace {

using Gp = GuidedPredictiveSettings;
using L = FrictionLearnerSettings;
using R = BeliefReviewSettings;

constexpr Domain price = closed(0.0, 1e9);
constexpr Domain rate = closed(0.0, 1e9);
constexpr Domain angle = closed(-1e3, 1e3);

constexpr auto guided_predictive_table = joined(
    std::array{
        field<&Gp::sample_s>({"sample_s", "s", above(0.0, 1.0), "time between samples"}),
    },
    plate_fields<&Gp::plate>(),
    std::array{
        field<&Gp::prediction_step_s>({"prediction_step_s", "s", above(0.0, 1.0), "step of the horizon"}),
        field<&Gp::error_weight>({"error_weight", "1/degree²", price, "of the squared error at each step"}),
        field<&Gp::speed_weight>({"speed_weight", "second²/degree²", price, "of the squared speed at each step"}),
        field<&Gp::duty_change_weight>({"duty_change_weight", "-", price, "of the squared change of each move"}),
    },
    duty_fields<&Gp::duty>(),
    std::array{
        field<&Gp::duty_rate_per_s>({"duty_rate_per_s", "1/second", above(0.0, 1e9), "largest change of the duty"}),
        field<&Gp::lowest_deg>({"lowest_deg", "deg", angle, "least angle of the prediction"}),
        field<&Gp::highest_deg>({"highest_deg", "deg", angle, "largest angle of the prediction"}),
        field<&Gp::angle_limit_weight>({"angle_limit_weight", "1/degree²", price, "of the squared angle beyond these"}),
        field<&Gp::observer_angle_per_s>(
            {"observer_angle_per_s", "1/second", rate, "sum of the rates at which the errors of angle and speed die"}),
        field<&Gp::observer_speed_per_s2>({"observer_speed_per_s2", "1/second²", rate, "and their product"}),
        field<&Gp::noise_deg>({"noise_deg", "deg", above(0.0, 1e2), "standard deviation of the measured angle"}),
        field<&Gp::learner, &L::rate_per_s>(
            {"learning_rate_per_s", "1/second", rate, "share of what explains an innovation that is learnt"}),
        field<&Gp::learner, &L::gain_weight>(
            {"gain_weight", "-", price, "first variance of the gain factor over that of a friction level"}),
        field<&Gp::learner, &L::damping_weight>({"damping_weight", "-", price, "of the damping factor"}),
        field<&Gp::learner, &L::level_memory_s>(
            {"level_memory_s", "s", above(0.0, 1e6), "sliding after which a level is as uncertain as at first"}),
        field<&Gp::learner, &L::memory_s>({"memory_s", "s", above(0.0, 1e6), "the same for gain and damping"}),
        field<&Gp::learner, &L::least_gain_factor>(
            {"least_gain_factor", "-", above(0.0, 1.0), "least learnt gain over the given one"}),
        field<&Gp::learner, &L::largest_gain_factor>(
            {"largest_gain_factor", "-", closed(1.0, 10.0), "largest learnt gain over the given one"}),
        field<&Gp::review, &R::worse>(
            {"rollback_ratio", "-", closed(1.0, 1e9), "of squared innovations, from which a belief predicts worse"}),
        field<&Gp::review, &R::roll_back_s>(
            {"rollback_s", "s", above(0.0, 1e6), "sliding over which a worse belief is given up"}),
        field<&Gp::review, &R::certify_s>(
            {"certify_s", "s", above(0.0, 1e6), "sliding over which a better belief is certified"}),
        field<&Gp::bias_rate_per_deg_s>(
            {"bias_rate_per_deg_s", "1/(degree*second)", rate, "without learning: rate of the one bias"}),
        field<&Gp::trim_rate_per_deg_s>(
            {"trim_rate_per_deg_s", "1/(degree*second)", rate, "without learning: rate of the trim"}),
    },
    reference_fields<&Gp::reference>());

}  // namespace

std::span<const Field<Gp>> guided_predictive_fields() noexcept {
  return guided_predictive_table;
}

void validate(const Gp& s) {
  require_fields(fields_of(s), s);
  validate(s.duty);
  require_travel(s.plate);
  if (!(s.lowest_deg < s.highest_deg)) {
    fail(ParameterError("highest_deg", s.highest_deg, "must be > lowest_deg = " + text(s.lowest_deg), "deg"));
  }
  int steps = 0;
  for (std::size_t i = 0; i < s.move_steps.size(); ++i) {
    require_within("move_steps[" + std::to_string(i) + "]", s.move_steps[i], 1, longest_guided_horizon);
    steps += s.move_steps[i];
  }
  if (steps > longest_guided_horizon) {
    fail(ParameterError("move_steps", static_cast<double>(steps),
                        "must add up to at most " + std::to_string(longest_guided_horizon) + " steps"));
  }
}

void require_usable_belief(const PlateBelief<double>& belief, const Gp& settings, const char* prefix) {
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
