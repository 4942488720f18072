// What happens before a cycle runs: its crank grid and the checks of its inputs.
#include <cmath>
#include <cstddef>
#include <vector>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/engine/burn.hpp"
#include "mgdd/engine/cycle.hpp"

namespace mgdd::engine {

std::vector<double> crank_grid(const Cylinder& cylinder, double step_cad) {
  require_within("step_cad", step_cad, step_lower_cad, step_upper_cad, "°CA");
  const double span = cylinder.geometry.evo_cad - cylinder.geometry.ivc_cad;
  // A remainder below a millionth of a step comes from rounding: it lengthens the last step instead of making one.
  const auto steps = static_cast<std::size_t>(std::ceil(span / step_cad - 1e-6));
  std::vector<double> angles(steps + 1);
  for (std::size_t k = 0; k < steps; ++k)
    angles[k] = cylinder.geometry.ivc_cad + static_cast<double>(k) * step_cad;
  angles[steps] = cylinder.geometry.evo_cad;
  return angles;
}

void validate_cycle(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad) {
  validate(cylinder);
  validate(point);
  validate_timing("soc_cad", soc_cad, cylinder);
  const double first_kpa = point.intake_pressure_kpa + cylinder.gas.ivc_pressure_rise_kpa;
  if (!(first_kpa > 0.0)) {
    throw ParameterError("ivc_pressure_rise_kpa", cylinder.gas.ivc_pressure_rise_kpa,
                         "p(IVC) is " + text(first_kpa) +
                             " kPa at intake_pressure_kpa = " + text(point.intake_pressure_kpa) + ", must be > 0",
                         "kPa");
  }
  const Burn<double> burn(cylinder.burn, soc_cad, burn_duration_cad(cylinder.burn, point));
  if (burn.start_cad() < cylinder.geometry.ivc_cad) {
    throw ParameterError("second_delay_cad", cylinder.burn.second_delay_cad,
                         "the burn starts at " + text(burn.start_cad()) +
                             " °CA aTDC, before ivc_cad = " + text(cylinder.geometry.ivc_cad),
                         "°CA");
  }
}

}  // namespace mgdd::engine
