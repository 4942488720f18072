// The ratio of specific heats of the charge against temperature [K], dimensionless.
#pragma once

#include "mgdd/engine/cylinder.hpp"

namespace mgdd::engine {

/// gamma(T): constant (Tan 2018), linear (Gatowski et al. 1984) or polynomial (Brunt, Rai and Emtage 1998).
template <class T>
T gamma_at(const GasParameters<T>& c, const T& temperature_k) noexcept {
  switch (c.gamma_model) {
    case GammaModel::linear:
      return c.gamma_linear_300k + c.gamma_linear_slope_per_k * (temperature_k - 300.0);
    case GammaModel::polynomial:
      return c.gamma_polynomial_c0 +
             temperature_k * (c.gamma_polynomial_c1_per_k + temperature_k * c.gamma_polynomial_c2_per_k2);
    case GammaModel::constant:
      break;
  }
  return c.gamma;
}

}  // namespace mgdd::engine
