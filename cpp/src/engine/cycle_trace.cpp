#include "mgdd/engine/cycle_trace.hpp"

#include <algorithm>
#include <cstddef>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/burn.hpp"

namespace mgdd::engine {

CycleTrace trace_cycle(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad, double step_cad,
                       Integrator integrator) {
  validate_cycle(cylinder, point, soc_cad);
  const CycleModel<double> model(cylinder, crank_grid(cylinder, step_cad), integrator);
  CycleWorkspace<double> work = model.make_workspace();
  const Charge<double> charge = model.charge(point);
  model.run(charge, soc_cad, work);
  model.require_physical(work);

  CycleTrace out;
  out.indicators = model.indicators(charge, soc_cad, work);
  out.trapped_mass_g = mass_of_gas_g(charge.gas_j_per_k);
  out.fuel_heat_j = charge.fuel_heat_j;
  out.burn_duration_cad = charge.burn_duration_cad;
  out.angle_cad.assign(model.angles_cad().begin(), model.angles_cad().end());
  const std::size_t n = out.angle_cad.size();
  for (std::vector<double>* column :
       {&out.pressure_bar, &out.volume_l, &out.temperature_k, &out.burned_fraction, &out.heat_release_j_per_cad,
        &out.heat_loss_j_per_cad, &out.work_booked_j, &out.energy_change_j}) {
    column->assign(n, 0.0);
  }
  const Burn<double> burn(cylinder.burn, soc_cad, charge.burn_duration_cad);
  for (std::size_t k = 0; k < n; ++k) {
    out.pressure_bar[k] = work.pressure_pa[k] / units::pa_per_bar;
    out.volume_l[k] = model.volume_m3()[k] / units::m3_per_l;
    out.temperature_k[k] = work.pressure_pa[k] * model.volume_m3()[k] / charge.gas_j_per_k;
    if (charge.fuel_heat_j > 0.0) out.burned_fraction[k] = burn.fraction(out.angle_cad[k]);
    if (k == 0) continue;
    const double step = out.angle_cad[k] - out.angle_cad[k - 1];
    out.heat_release_j_per_cad[k] = work.heat_release_j[k - 1] / step;
    out.heat_loss_j_per_cad[k] = work.heat_loss_j[k - 1] / step;
    out.work_booked_j[k] = model.booked_work_j(k - 1, work);
    out.energy_change_j[k] = model.energy_change_j(k - 1, work);
  }
  return out;
}

std::vector<Indicators<double>> scan_timings(const Cylinder& cylinder, const OperatingPoint& point,
                                             std::span<const double> soc_cad, double step_cad, Integrator integrator) {
  for (const double soc : soc_cad)
    validate_timing("soc_cad", soc, cylinder);
  if (!soc_cad.empty()) validate_cycle(cylinder, point, *std::ranges::min_element(soc_cad));
  const CycleModel<double> model(cylinder, crank_grid(cylinder, step_cad), integrator);
  CycleWorkspace<double> work = model.make_workspace();
  const Charge<double> charge = model.charge(point);
  std::vector<Indicators<double>> rows(soc_cad.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    model.run(charge, soc_cad[i], work);
    model.require_physical(work);
    rows[i] = model.indicators(charge, soc_cad[i], work);
  }
  return rows;
}

}  // namespace mgdd::engine
