#include "mgdd/throttle/demand/orifice.hpp"

#include <algorithm>
#include <cmath>

#include "mgdd/throttle/demand/intake.hpp"

namespace mgdd::throttle {
namespace {

// With x = r^(1/7): Psi = sqrt(7) x^5 sqrt(1 - x^2), for gamma = 1.4.
FlowFunction nozzle(double ratio) noexcept {
  const double x2 = std::pow(ratio, 2.0 / 7.0);
  const double root = std::sqrt(1.0 - x2);
  return {std::sqrt(7.0) * x2 * x2 * std::sqrt(x2) * root, (5.0 * (1.0 - x2) / x2 - 1.0) / (std::sqrt(7.0) * root)};
}

}  // namespace

FlowFunction flow_function(double ratio) noexcept {
  if (!(ratio > critical_ratio)) return {choked_flow, 0.0};
  if (ratio <= straight_from_ratio) return nozzle(ratio);
  const double slope = -nozzle(straight_from_ratio).value / (1.0 - straight_from_ratio);
  return {slope * (std::min(ratio, 1.0) - 1.0), slope};
}

FlowFunction flow_function(double ratio, double pressure_loss) noexcept {
  const FlowFunction plain = flow_function(ratio);
  const double kept = 1.0 - pressure_loss * ratio;
  return {kept * plain.value, kept * plain.slope - pressure_loss * plain.value};
}

double flow_per_area(const GasState& upstream) noexcept {
  return upstream.pressure_pa / std::sqrt(air_gas_constant * upstream.temperature_k);
}

OrificeFlow orifice_flow(double effective_m2, const GasState& upstream, const GasState& downstream,
                         double pressure_loss) noexcept {
  const bool forward = !(downstream.pressure_pa > upstream.pressure_pa);
  const GasState& from = forward ? upstream : downstream;
  const GasState& to = forward ? downstream : upstream;
  const double ratio = to.pressure_pa / from.pressure_pa;
  const FlowFunction psi = flow_function(ratio, pressure_loss);
  const double flow = effective_m2 * flow_per_area(from);
  if (forward) return {flow * psi.value, flow * psi.slope / from.pressure_pa};
  return {-flow * psi.value, -flow * (psi.value - ratio * psi.slope) / from.pressure_pa};
}

}  // namespace mgdd::throttle
