// NOx from the maximum bulk gas temperature: a correlation to be fitted, not kinetics, as map, as soft sensor that a
// slow analyser corrects, and as fit to a sweep. Temperatures in K, NOx in ppm. Valid at fixed intake oxygen, or with
// the oxygen factor; bulk maxima (1800 to 2200 K) lie below flame temperature. noexcept, no heap, but for the fit.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string_view>
#include <tuple>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"

namespace mgdd::engine {

/// Constants of both maps; the defaults are plausible placeholders of a light-duty diesel, to be fitted to the user's
/// sweep.
struct NoxProxy {
  double reference_temperature_k = 1900.0;
  double reference_nox_ppm = 1200.0;
  double activation_temperature_k = 16000.0;  ///< b of the Arrhenius map; b / T0^2 is the slope of the other

  /// NOx = NOx0 exp(b1 (T_max - T0)) with b1 = b / T0^2.
  double affine_log_ppm(double t_max_k) const noexcept {
    const double slope = activation_temperature_k / (reference_temperature_k * reference_temperature_k);
    return reference_nox_ppm * std::exp(slope * (t_max_k - reference_temperature_k));
  }

  /// NOx = NOx0 exp(-b (1/T_max - 1/T0)).
  double arrhenius_ppm(double t_max_k) const noexcept {
    return reference_nox_ppm * std::exp(-activation_temperature_k * (1.0 / t_max_k - 1.0 / reference_temperature_k));
  }

  bool operator==(const NoxProxy&) const = default;
};

constexpr auto fields_of(const NoxProxy&) {
  using P = NoxProxy;
  return std::array{
      field<&P::reference_temperature_k>({"reference_temperature_k", "K", above(0.0), "T0 of the map"}),
      field<&P::reference_nox_ppm>({"reference_nox_ppm", "ppm", above(0.0), "NOx at T0"}),
      field<&P::activation_temperature_k>({"activation_temperature_k", "K", above(0.0), "b of the Arrhenius map"}),
  };
}

/// ParameterError for a constant that is not > 0.
void validate(const NoxProxy& proxy);

enum class NoxMap { affine_log, arrhenius };

inline constexpr double air_o2_fraction = 0.209;  ///< [-] by volume

/// A proxy with the map that is used and the intake oxygen: NOx = map(T_max) (x_O2 / 0.209)^n.
struct NoxModel {
  NoxProxy proxy{};
  NoxMap map = NoxMap::affine_log;
  double intake_o2_fraction = air_o2_fraction;  ///< [-] below 0.209 with exhaust gas recirculation
  double o2_exponent = 3.0;                     ///< [-] 2 to 4, to be fitted

  double ppm(double t_max_k) const noexcept {
    const double at_air = map == NoxMap::arrhenius ? proxy.arrhenius_ppm(t_max_k) : proxy.affine_log_ppm(t_max_k);
    if (intake_o2_fraction == air_o2_fraction) return at_air;
    return at_air * std::pow(intake_o2_fraction / air_o2_fraction, o2_exponent);
  }

  bool operator==(const NoxModel&) const = default;
};

constexpr auto fields_of(const NoxModel&) {
  using M = NoxModel;
  return std::tuple{
      field<&M::proxy>("proxy", "constants of the map", DefaultForm::none),
      field<&M::map>("map", "form of the map"),
      field<&M::intake_o2_fraction>({"intake_o2_fraction", "-", above(0.0, 1.0), "intake oxygen by volume"}),
      field<&M::o2_exponent>({"o2_exponent", "-", closed(0.0, 10.0), "exponent of the oxygen factor"}),
  };
}

/// ParameterError names field, value and bound.
void validate(const NoxModel& model);

/// The soft sensor: NOx of each cycle from its T_max at once, its level held to a slow analyser:
/// b_{k+1} = b_k + c (ln NOx_analyser - ln NOx_delayed - b_k), NOx_delayed being the uncorrected soft value after the
/// analyser's own delay and lag, so that b -> the analyser's log-ratio at the rate c whatever the delay.
struct SoftSensor {
  NoxModel model{};
  double correction_gain = 0.01;  ///< c per cycle, in [0, 1]; 0 = never corrected

  /// Value without correction.
  double raw_ppm(double t_max_k) const noexcept { return model.ppm(t_max_k); }
  double corrected_ppm(double t_max_k, double ln_bias) const noexcept { return model.ppm(t_max_k) * std::exp(ln_bias); }
  /// The bias after one reading; a reading or a value that is not positive leaves it alone.
  double next_bias(double ln_bias, double analyser_ppm, double delayed_soft_ppm) const noexcept {
    if (!(analyser_ppm > 0.0 && delayed_soft_ppm > 0.0)) return ln_bias;
    return ln_bias + correction_gain * (std::log(analyser_ppm / delayed_soft_ppm) - ln_bias);
  }

  bool operator==(const SoftSensor&) const = default;
};

constexpr auto fields_of(const SoftSensor&) {
  return std::tuple{
      field<&SoftSensor::model>("model", "NOx from the maximum gas temperature", DefaultForm::none),
      field<&SoftSensor::correction_gain>(
          {"correction_gain", "-", closed(0.0, 1.0), "share of the log-ratio per cycle"}),
  };
}

void validate(const SoftSensor& sensor);

/// Least squares of ln NOx on the argument of a map, with its spread.
struct NoxFit {
  NoxProxy proxy{};  ///< at the reference temperature that was asked for
  NoxMap map = NoxMap::affine_log;
  std::size_t points = 0;
  double residual_ln = 0.0;               ///< [-] standard deviation of ln NOx about the fit, points - 2 degrees
  double reference_nox_stderr_ppm = 0.0;  ///< of NOx0, delta method
  double activation_temperature_stderr_k = 0.0;
};

/// Fits NOx0 and b to a sweep at fixed oxygen, fuel and boost. DataError for fewer than 5 points, values that are not
/// positive and finite, temperatures that do not differ, or NOx that does not rise with T_max; ShapeError for unequal
/// lengths.
NoxFit fit_nox_proxy(std::span<const double> t_max_k, std::span<const double> nox_ppm, NoxMap map,
                     double reference_temperature_k = NoxProxy{}.reference_temperature_k);

}  // namespace mgdd::engine
