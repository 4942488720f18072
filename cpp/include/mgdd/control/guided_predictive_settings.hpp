// Settings of the guided predictive controller: the guide, the horizon, the performance function, constraints, observer
// and learning. Angles in deg, duty -1..1, time in s. Defaults fit the throttle P1. Offline code.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <tuple>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/control/belief_review.hpp"
#include "mgdd/control/delay_bank.hpp"
#include "mgdd/control/duty_range.hpp"
#include "mgdd/control/friction_learner.hpp"
#include "mgdd/control/plate_model.hpp"
#include "mgdd/control/sent_duties.hpp"

namespace mgdd::control {

inline constexpr int n_guided_moves = 3;
inline constexpr int longest_guided_horizon = 64;  ///< prediction steps

/// What the horizon is predicted with.
enum class Prediction {
  nonlinear,  ///< springs and friction as they are
  linear,     ///< the spring of the measured side without end, friction only fed forward: a linear-quadratic step
};

/// How a prediction knows its side of limp-home.
enum class SideSwitching {
  predicted,  ///< by the predicted angle
  measured,   ///< that of the last measurement, with a dead band of 0.3 deg
};

struct GuidedPredictiveSettings {
  double sample_s = 1e-3;
  Plate plate{};                 ///< the guide
  int delay_samples = 1;         ///< from a duty to its effect, beside the electrical lag: 0 to `longest_control_delay`
  int delay_search_samples = 6;  ///< longer delays among which the readings choose, with learning; 0: none

  // The horizon.
  Prediction prediction = Prediction::nonlinear;
  SideSwitching switching = SideSwitching::predicted;
  double prediction_step_s = 2e-3;
  std::array<int, n_guided_moves> move_steps{3, 5, 12};  ///< prediction steps for which each duty is held
  int gauss_newton_steps = 1;                            ///< at most, per sample

  // The performance function: per prediction step, and per change from move to move.
  double error_weight = 1.0;        ///< per deg²
  double speed_weight = 0.0;        ///< per (deg/s)²
  double duty_change_weight = 4.0;  ///< per duty²

  // Constraints: hard for the duty and its rate; predicted angles beyond theirs cost `angle_limit_weight` per deg².
  DutyRange duty{};
  double duty_rate_per_s = 1e4;
  double lowest_deg = -1e3;
  double highest_deg = 1e3;
  double angle_limit_weight = 20.0;

  // The observer, and what it learns.
  double observer_angle_per_s = 430.0;
  double observer_speed_per_s2 = 34549.0;
  double noise_deg = 0.03;  ///< of the measured angle: what counts as motion
  bool friction_learning = true;
  FrictionLearnerSettings learner{};
  BeliefReviewSettings review{};
  double bias_rate_per_deg_s = 4.0;  ///< without learning
  double trim_rate_per_deg_s = 0.3;  ///< without learning: invisible to the prediction

  // The reference.
  ReferenceRate reference{};

  int n_steps() const noexcept { return move_steps[0] + move_steps[1] + move_steps[2]; }

  bool operator==(const GuidedPredictiveSettings&) const = default;
};

/// All numbers of the settings, in the order in which Python shows them.
std::span<const Field<GuidedPredictiveSettings>> guided_predictive_fields() noexcept;
inline auto fields_of(const GuidedPredictiveSettings&) {
  using S = GuidedPredictiveSettings;
  return std::tuple{
      guided_predictive_fields(),
      field<&S::prediction>("prediction", "what the horizon is predicted with"),
      field<&S::switching>("switching", "how it knows its side of limp-home"),
      field<&S::delay_samples>({"delay_samples", "-", closed(0.0, longest_control_delay), "from a duty to its effect"}),
      field<&S::delay_search_samples>(
          {"delay_search_samples", "-", closed(0.0, most_delays - 1), "by which the delay may be longer than stated"}),
      field<&S::move_steps>("move_steps", "prediction steps for which each duty is held"),
      field<&S::gauss_newton_steps>({"gauss_newton_steps", "-", closed(1.0, 100.0), "at most, per sample"}),
      field<&S::friction_learning>("friction_learning", "learn friction levels and gain")};
}

/// ParameterError naming field, value and bound.
void validate(const GuidedPredictiveSettings& settings);

/// ParameterError for levels that learning with these settings could not have reached.
void require_usable_belief(const PlateBelief<double>& belief, const GuidedPredictiveSettings& settings,
                           const char* prefix = "");

}  // namespace mgdd::control
