// From measured noise, curvature and sensor delay to amplitude, period and gain of a seeker, with what averaging theory
// predicts for them, and the reasons where a specification is infeasible. Closed forms (J = J* + J''/2 e^2, noise
// sigma):
//   continuous: tau = 2/(g A |J''|),  rms = sigma/(A |J''| sqrt(tau)),  cycles = M + tau ln(e0/eps)
//   batch:      the same rms over sqrt(1 - M/(2 tau))
//   SPSA (constant gain): q = a |J''|, rms = sigma/(c |J''|) sqrt(q/(2 (2 - q))), cycles = 2 ln(eps/e0)/ln(1 - q)
//   cost of the dither: |J''|/2 A^2/2 (SPSA: c^2) and of the jitter: |J''|/2 rms^2, in units of J
// Lengths that the user leaves open scale with L = sqrt(sigma/|J''|), where J has fallen by half a noise. Offline
// code.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/optimize/seekers/dither.hpp"

namespace mgdd::optimize {

enum class TunedMethod { batch, moving_average, spsa };

struct TuningSpec {
  TunedMethod method = TunedMethod::batch;
  double noise_sd = std::numeric_limits<double>::quiet_NaN();   ///< of J from cycle to cycle, > 0
  double curvature = std::numeric_limits<double>::quiet_NaN();  ///< J'' at the optimum; its sign is not used
  ComponentLag lag{};                                           ///< between plant and J
  bool compensated = true;  ///< the seeker knows the lag and turns its demodulation back
  // None: left open.
  std::optional<double> delay_uncertainty{};  ///< cycles, u; a fifth of D + tau, 2 at least
  std::optional<double> rms{};                ///< of the estimate at the end; 0.2 L
  std::optional<double> cycles{};             ///< to arrive; 50, more where a lag asks for it
  std::optional<double> distance{};           ///< e0, at the start; 5 L
  std::optional<double> arrival{};            ///< eps, what counts as arrived; 0.45 L
  std::optional<double> amplitude_max{};      ///< 1.8 L
};

struct Tuning {
  TunedMethod method = TunedMethod::batch;
  double amplitude = 0.0;  ///< A, or c of SPSA
  int period = 0;          ///< M; measurements per iteration of SPSA
  double gain = 0.0;       ///< g_r, or the constant a of SPSA
  double rate = 0.0;       ///< largest change per cycle (SPSA: per iteration)
  double time_constant_cycles = 0.0;
  double rms = 0.0;          ///< predicted
  double cycles = 0.0;       ///< predicted, from `distance` to `arrival`
  double dither_cost = 0.0;  ///< mean loss of J by the dither
  double jitter_cost = 0.0;  ///< ... and by the rms error
  double sensor_gain = 1.0;  ///< of the lag at the dither's frequency
  double sensor_phase_rad = 0.0;
  double delay_uncertainty = 0.0;  ///< cycles by which the delay may be wrong
  bool met = true;
  std::vector<std::string> reasons;  ///< why not, with the figures that would do
};

/// ParameterError for noise or curvature that is missing or zero, or a number of the specification that is not
/// positive.
Tuning tune(const TuningSpec& spec);

}  // namespace mgdd::optimize
