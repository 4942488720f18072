// NOx proxy from the maximum bulk gas temperature: a correlation to be fitted, not kinetics. Temperatures in K, NOx in
// ppm. Valid at fixed intake oxygen only; bulk maxima (1800 to 2200 K) lie below flame temperature.
#pragma once

#include <cmath>

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
};

}  // namespace mgdd::engine
