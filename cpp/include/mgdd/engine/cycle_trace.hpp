// Whole cycles: the traces of one, and the indicators of many timings at one operating point. Conventional units,
// angles in °CA aTDC. Not real-time safe: allocates and throws; loops use CycleModel.
#pragma once

#include <span>
#include <vector>

#include "mgdd/engine/cycle.hpp"

namespace mgdd::engine {

/// One cycle sample by sample. Rates and books belong to the step that ends at the sample, and are zero at the first.
struct CycleTrace {
  Indicators<double> indicators{};
  double trapped_mass_g = 0.0;
  double fuel_heat_j = 0.0;
  double burn_duration_cad = 0.0;
  std::vector<double> angle_cad, pressure_bar, volume_l, temperature_k;
  std::vector<double> burned_fraction;  ///< zero where no fuel burns
  std::vector<double> heat_release_j_per_cad, heat_loss_j_per_cad;
  std::vector<double> work_booked_j, energy_change_j;  ///< of the first law, step by step
};

/// ParameterError for inputs outside their domain, ConvergenceError where no such cycle exists.
CycleTrace trace_cycle(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad, double step_cad,
                       Integrator integrator);

/// Indicators at each timing.
std::vector<Indicators<double>> scan_timings(const Cylinder& cylinder, const OperatingPoint& point,
                                             std::span<const double> soc_cad, double step_cad, Integrator integrator);

}  // namespace mgdd::engine
