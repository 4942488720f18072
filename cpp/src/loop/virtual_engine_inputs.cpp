// What the inputs of the bench make of the charge and of the cylinder.
#include <algorithm>
#include <cmath>

#include "mgdd/engine/recirculation.hpp"
#include "mgdd/loop/virtual_engine.hpp"

namespace mgdd::loop {
namespace {

// What the operating point has where nobody has asked for anything; of the timing, the latest.
double value_of_point(BenchInput input, const BenchSettings& s, const engine::OperatingPoint& point) noexcept {
  switch (input) {
    case BenchInput::intake_pressure_kpa:
      return point.intake_pressure_kpa;
    case BenchInput::burn_duration_cad:
      return engine::burn_duration_cad(s.cylinder.burn, point);
    case BenchInput::second_fraction:
      return s.cylinder.burn.second_fraction;
    case BenchInput::egr:
      return 0.0;
    case BenchInput::soc_cad:
      break;
  }
  return timing_window(s.cylinder)[1];
}

}  // namespace

BenchInputs VirtualEngine::applied_of(std::span<const double> inputs) const noexcept {
  BenchInputs out{};
  for (std::size_t i = 0; i < windows_.size(); ++i) {
    const bool given = i < inputs.size() && !std::isnan(inputs[i]);
    const double before = cycle_ > 0 ? last_inputs_[i] : value_of_point(settings_.inputs[i], settings_, point());
    out[i] = std::clamp(given ? inputs[i] : before, windows_[i][0], windows_[i][1]);
  }
  return out;
}

// The charge of these inputs; the model becomes that of the cycle, as drift, recirculation and fuel split have it.
VirtualEngine::Filling VirtualEngine::fill(std::int64_t cycle, const BenchInputs& inputs) noexcept {
  const std::size_t index = index_at(cycle);
  const engine::Charge<double>& prepared = prepared_[index].charge;
  Filling out{prepared, settings_.true_nox.intake_o2_fraction, prepared.fuel_heat_j};
  if (!model_moves_ && settings_.inputs.size() == 1) return out;
  engine::OperatingPoint point = settings_.schedule[index].point;
  engine::Cylinder cylinder = drifted_cylinder(cycle);
  double egr = 0.0;
  for (std::size_t i = 1; i < settings_.inputs.size(); ++i) {
    switch (settings_.inputs[i]) {
      case BenchInput::intake_pressure_kpa:
        if (point.trapped_mass_g) *point.trapped_mass_g *= inputs[i] / point.intake_pressure_kpa;
        point.intake_pressure_kpa = inputs[i];
        break;
      case BenchInput::burn_duration_cad:
        point.burn_duration_cad = inputs[i];
        break;
      case BenchInput::second_fraction:
        cylinder.burn.second_fraction = inputs[i];
        break;
      case BenchInput::egr:
        egr = inputs[i];
        break;
      case BenchInput::soc_cad:
        break;
    }
  }
  if (settings_.inputs.size() > 1) {
    out.charge = model_.charge(point);
    const engine::Recirculation gas =
        engine::recirculation(egr, engine::mass_of_gas_g(out.charge.gas_j_per_k), point.fuel_mg);
    out.intake_o2_fraction = gas.intake_o2_fraction;
    out.charge.fuel_heat_j *= std::fmin(1.0, gas.lambda);  // the rest finds no oxygen
    cylinder.gas.gamma += gas.gamma_change;
    cylinder.gas.gamma_linear_300k += gas.gamma_change;
    cylinder.gas.gamma_polynomial_c0 += gas.gamma_change;
  }
  if (model_moves_) model_.set_cylinder(cylinder);
  return out;
}

}  // namespace mgdd::loop
