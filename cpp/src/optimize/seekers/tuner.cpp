#include "mgdd/optimize/seekers/tuner.hpp"

#include <algorithm>
#include <cmath>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double default_rms = 0.2, default_distance = 5.0, default_arrival = 0.45, default_amplitude_max = 1.8;  // L
constexpr double default_cycles = 50.0;
constexpr double reserve = 0.85;  // noise makes arrival later than the mean path: plan for this share of the wish
constexpr int batch_period = 6, continuous_period = 10;
constexpr double periods_of_lag = 2.4;  // a compensated period of 2.4 tau still passes 0.36 of the echo
constexpr double slow_periods = 6.0;    // per cycle by which the echo comes late unknown: omega u <= 60 degrees
constexpr double delay_doubt = 0.2, delay_doubt_least = 2.0;  // share of D + tau, and cycles
constexpr double delays_per_tau = 3.0;  // an integrator with delay D is well damped for tau >= 3 D

/// A specification with what was left open filled in; only `cycles` waits for the method.
struct Filled {
  TunedMethod method;
  double noise_sd, curvature;
  ComponentLag lag;
  bool compensated;
  double delay_uncertainty, rms, distance, arrival, amplitude_max;
  std::optional<double> cycles;
};

double positive(std::string_view name, double value, std::string_view remedy = "") {
  if (value > 0.0 && std::isfinite(value)) return value;
  throw ParameterError(name, value, "must be > 0" + std::string(remedy));
}

Filled filled(const TuningSpec& s) {
  const double noise =
      positive("noise_sd", s.noise_sd, "; repeat one set-point some twenty times and take the standard deviation of J");
  const double bend =
      positive("|curvature|", std::abs(s.curvature), "; measure J at three timings or more and fit a parabola");
  validate(std::vector<ComponentLag>{s.lag});
  const double length = std::sqrt(noise / bend);
  const double whole_lag = s.lag.delay_cycles + s.lag.lag_cycles;
  const double doubt = whole_lag > 0.0 ? std::max(delay_doubt * whole_lag, delay_doubt_least) : 0.0;
  const Filled w{.method = s.method,
                 .noise_sd = noise,
                 .curvature = bend,
                 .lag = s.lag,
                 .compensated = s.compensated,
                 .delay_uncertainty = s.delay_uncertainty.value_or(doubt),
                 .rms = positive("rms", s.rms.value_or(default_rms * length)),
                 .distance = positive("distance", s.distance.value_or(default_distance * length)),
                 .arrival = positive("arrival", s.arrival.value_or(default_arrival * length)),
                 .amplitude_max = positive("amplitude_max", s.amplitude_max.value_or(default_amplitude_max * length)),
                 .cycles = s.cycles};
  if (w.cycles) positive("cycles", *w.cycles);
  if (!(w.delay_uncertainty >= 0.0 && std::isfinite(w.delay_uncertainty))) {
    throw ParameterError("delay_uncertainty", w.delay_uncertainty,
                         "must be >= 0 and finite; 0 for a delay known exactly");
  }
  if (!(w.arrival < w.distance)) {
    throw ParameterError("arrival", w.arrival, "must be below distance = " + text(w.distance));
  }
  return w;
}

Tuning tune_spsa(const Filled& w) {
  Tuning t;
  t.method = TunedMethod::spsa;
  t.period = 2;
  if (w.lag.delay_cycles > 0.0 || w.lag.lag_cycles > 0.0 || w.delay_uncertainty > 0.0) {
    throw about(
        "method",
        ParameterError("method = 'spsa': takes a measurement without delay and lag; hold each set-point until the "
                       "sensor has settled, or use 'batch'"));
  }
  const double wished = w.cycles.value_or(default_cycles);
  const double ratio = w.arrival / w.distance;
  const double q = std::min(0.5, 1.0 - std::pow(ratio, 2.0 / (reserve * wished)));
  const auto rms_at = [&](double c, double rate) {
    return w.noise_sd / (c * w.curvature) * std::sqrt(rate / (2.0 * (2.0 - rate)));
  };
  t.amplitude = std::min(w.amplitude_max, rms_at(1.0, q) / w.rms);
  t.gain = q / w.curvature;
  t.rate = std::max(2.0 * t.amplitude, 1.2 * q * w.distance);
  t.time_constant_cycles = -2.0 / std::log1p(-q);
  t.rms = rms_at(t.amplitude, q);
  t.cycles = t.time_constant_cycles * std::log(1.0 / ratio);
  t.dither_cost = 0.5 * w.curvature * t.amplitude * t.amplitude;
  if (t.cycles > wished) {
    t.reasons.push_back("cycles = " + text(wished) + " is too few: half of the way per iteration takes " +
                        text(t.cycles));
  }
  return t;
}

Tuning tune_dither(const Filled& w) {
  const bool batch = w.method == TunedMethod::batch;
  if (!batch && !w.compensated && (w.lag.delay_cycles > 0.0 || w.lag.lag_cycles > 0.0)) {
    throw about("method",
                ParameterError(
                    "method = 'moving_average': behind a lag that is not compensated its window slows the approach by "
                    "more than these forms say; use 'batch', or compensate"));
  }
  const double whole_lag = w.lag.delay_cycles + w.lag.lag_cycles;
  const bool lagged = whole_lag > 0.0 || w.delay_uncertainty > 0.0;
  Tuning t;
  t.method = w.method;
  t.period = batch ? batch_period : continuous_period;
  if (lagged) {
    // An error of the lag turns the echo by less than the same error of the delay: d psi/d tau < omega.
    const double unknown = w.delay_uncertainty + (w.compensated ? 0.0 : whole_lag);
    const double needed = std::max(slow_periods * unknown, w.compensated ? periods_of_lag * w.lag.lag_cycles : 0.0);
    t.period = std::max(t.period, static_cast<int>(std::ceil(needed)));
  }
  const SensorResponse sensor = sensor_response(w.lag, 1, t.period);
  t.sensor_gain = sensor.gain;
  t.sensor_phase_rad = sensor.phase_rad;
  t.delay_uncertainty = w.delay_uncertainty;
  const double echo = w.compensated ? sensor.gain : sensor.gain * std::cos(sensor.phase_rad);
  const double noise = w.noise_sd / echo;
  const double period = t.period;
  const double tau_least =
      std::max((lagged && w.compensated ? 4.0 : 2.0) * period, delays_per_tau * (whole_lag + w.delay_uncertainty));
  const double decades = std::log(w.distance / w.arrival);
  const double wished = w.cycles.value_or(std::max(default_cycles, (period + tau_least * decades) / reserve));
  const double tau_wished = (reserve * wished - period) / decades;
  const auto rms_at = [&](double amplitude, double tau) {
    const double stepping = batch ? std::sqrt(1.0 - period / (2.0 * tau)) : 1.0;
    return noise / (amplitude * w.curvature * std::sqrt(tau) * stepping);
  };
  const double tau = std::max(tau_least, tau_wished);
  t.amplitude = std::min(w.amplitude_max, rms_at(1.0, tau) / w.rms);
  t.time_constant_cycles = tau;
  t.gain = 2.0 / (t.amplitude * w.curvature * tau);
  if (!w.compensated) t.gain /= echo;
  t.rate = (batch ? 1.0 : 3.0) * t.amplitude / period;
  t.rms = rms_at(t.amplitude, tau);
  // Where the rate clips, the way down to e = rate tau is a straight line.
  const double linear = std::max(w.arrival, std::min(w.distance, t.rate * tau));
  t.cycles = period + (w.distance - linear) / t.rate + tau * std::log(linear / w.arrival);
  t.dither_cost = 0.25 * w.curvature * t.amplitude * t.amplitude;
  if (t.cycles > wished) {
    t.reasons.push_back("cycles = " + text(wished) + " is too few: with a period of " + std::to_string(t.period) +
                        " and a time constant of " + text(tau) + " cycles the way takes " + text(t.cycles));
  }
  return t;
}

}  // namespace

Tuning tune(const TuningSpec& spec) {
  const Filled w = filled(spec);
  Tuning t = w.method == TunedMethod::spsa ? tune_spsa(w) : tune_dither(w);
  t.jitter_cost = 0.5 * w.curvature * t.rms * t.rms;
  if (t.rms > w.rms * (1.0 + 1e-9)) {
    const double amplitude = t.amplitude * t.rms / w.rms;
    const double longer = t.time_constant_cycles * t.rms * t.rms / (w.rms * w.rms);
    t.reasons.push_back("rms = " + text(w.rms) + " is out of reach with amplitude_max = " + text(w.amplitude_max) +
                        ": expect " + text(t.rms) + "; an amplitude of " + text(amplitude) +
                        " or a time constant of about " + text(longer) + " cycles would do");
  }
  t.met = t.reasons.empty();
  return t;
}

}  // namespace mgdd::optimize
