// The cycle of Tan 2018 as printed, with its powers by std::pow: what the arranged forms are measured against.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/burn.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/wall_heat.hpp"

namespace mgdd::engine {

// Trapezoid, triangle, constant gamma and Woschni as printed: per step p^0.8, T^-0.55, w^0.8 and, where `motored_table`
// is false, (V_ref / V)^gamma. Geometry stands in tables, as in the model, and the indicators are the model's own.
struct LiteralCycle {
  Cylinder c;
  std::vector<double> angle, volume, area, motored;

  explicit LiteralCycle(const CycleModel<double>& model) : c(model.cylinder()) {
    for (const double a : model.angles_cad()) {
      angle.push_back(a);
      volume.push_back(model.geometry().volume_m3(a));
      area.push_back(model.geometry().wall_area_m2(volume.back()));
      motored.push_back(std::pow(volume.front() / volume.back(), c.gas.gamma));
    }
  }

  template <bool MotoredTable>
  void run(const Charge<double>& charge, const Geometry<double>& g, double soc, CycleWorkspace<double>& work) const {
    const Burn<double> burn(c.burn, soc, charge.burn_duration_cad);
    const double bore_power = c.wall_heat.wall_heat_scale * woschni_c1_bar_m * std::pow(g.bore_m, -0.2);
    const double speed = g.mean_piston_speed_m_per_s(charge.speed_rpm);
    const double reference_k = charge.pressure_pa * volume[0] / charge.gas_j_per_k;
    double pressure = charge.pressure_pa;
    double burned = burn.fraction(angle[0]);
    work.pressure_pa[0] = pressure;
    for (std::size_t k = 0; k + 1 < angle.size(); ++k) {
      const double temperature = pressure * volume[k] / charge.gas_j_per_k;
      const double ratio = MotoredTable ? motored[k] : std::pow(volume[0] / volume[k], c.gas.gamma);
      const double rise = pressure / charge.pressure_pa - ratio;
      const double velocity =
          woschni_velocity(c.wall_heat.woschni_c2, angle[k] >= soc ? c.wall_heat.woschni_cp_m_per_sk : 0.0, speed,
                           g.swept_m3 / volume[0], reference_k, rise);
      const double film = bore_power * std::pow(pressure / units::pa_per_bar, 0.8) * std::pow(temperature, -0.55) *
                          std::pow(velocity, 0.8);
      const double time_s = (angle[k + 1] - angle[k]) / (units::cad_per_s_per_rpm * charge.speed_rpm);
      work.heat_loss_j[k] = film * area[k] * (temperature - c.wall_heat.wall_temperature_k) * time_s;
      const double next_burned = burn.fraction(angle[k + 1]);
      work.heat_release_j[k] = charge.fuel_heat_j * (next_burned - burned);
      burned = next_burned;
      const double heat = work.heat_release_j[k] - work.heat_loss_j[k];
      const double half = 0.5 * (volume[k + 1] - volume[k]);
      const double inner = c.gas.gamma - 1.0;
      pressure = (pressure * (volume[k] / inner - half) + heat) / (volume[k + 1] / inner + half);
      work.pressure_pa[k + 1] = pressure;
    }
    work.heat_loss_j.back() = 0.0;
  }
};

// Name of the first indicator that differs by more than 1e-9 (of its size, or of 1); empty if none does.
inline std::string disagreement(const Indicators<double>& a, const Indicators<double>& b) {
  for (const auto& f : indicator_fields<double>()) {
    const double x = a.*(f.member);
    const double y = b.*(f.member);
    if (!(std::abs(x - y) <= 1e-9 * std::max(1.0, std::abs(x)))) return std::string(f.name);
  }
  return {};
}

}  // namespace mgdd::engine
