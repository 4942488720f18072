// What happens before a cycle runs: its crank grid and the checks of its inputs.
#include <cmath>
#include <cstddef>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/engine/burn.hpp"
#include "mgdd/engine/cycle.hpp"

namespace mgdd::engine {

std::vector<double> crank_grid(const Cylinder& cylinder, double step_cad) {
  if (!(step_cad >= step_lower_cad && step_cad <= step_upper_cad)) {
    throw ParameterError("step_cad = " + text(step_cad) + " °CA: must be in [0.001, 5]");
  }
  const double span = cylinder.evo_cad - cylinder.ivc_cad;
  // A remainder below a millionth of a step comes from rounding: it lengthens the last step instead of making one.
  const auto steps = static_cast<std::size_t>(std::ceil(span / step_cad - 1e-6));
  std::vector<double> angles(steps + 1);
  for (std::size_t k = 0; k < steps; ++k)
    angles[k] = cylinder.ivc_cad + static_cast<double>(k) * step_cad;
  angles[steps] = cylinder.evo_cad;
  return angles;
}

void validate_cycle(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad) {
  validate(cylinder);
  validate(point);
  validate_timing("soc_cad", soc_cad, cylinder);
  const double first_kpa = point.intake_pressure_kpa + cylinder.ivc_pressure_rise_kpa;
  if (!(first_kpa > 0.0)) {
    throw ParameterError("ivc_pressure_rise_kpa = " + text(cylinder.ivc_pressure_rise_kpa) + " kPa: p(IVC) is " +
                         text(first_kpa) + " kPa at intake_pressure_kpa = " + text(point.intake_pressure_kpa) +
                         ", must be > 0");
  }
  const Burn<double> burn(cylinder, soc_cad, burn_duration_cad(cylinder, point));
  if (burn.start_cad() < cylinder.ivc_cad) {
    throw ParameterError("second_delay_cad = " + text(cylinder.second_delay_cad) + " °CA: the burn starts at " +
                         text(burn.start_cad()) + " °CA aTDC, before ivc_cad = " + text(cylinder.ivc_cad));
  }
}

}  // namespace mgdd::engine
