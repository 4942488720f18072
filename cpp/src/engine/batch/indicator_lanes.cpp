#include "mgdd/engine/batch/indicator_lanes.hpp"

namespace mgdd::engine {

void IndicatorLanes::set(std::size_t l, const TraceFigures<double>& f, const Charge<double>& charge) noexcept {
  TraceFigures<Wide>& to = figures_[l / width];
  const int i = at(l);
  const auto set_peak = [i](PeakSamples<Wide>& peak, const PeakSamples<double>& from) {
    peak.before_cad.set(i, from.before_cad);
    peak.at_cad.set(i, from.at_cad);
    peak.after_cad.set(i, from.after_cad);
    peak.before.set(i, from.before);
    peak.at.set(i, from.at);
    peak.after.set(i, from.after);
  };
  to.work_closed_j.set(i, f.work_closed_j);
  to.heat_loss_j.set(i, f.heat_loss_j);
  to.last_pressure_pa.set(i, f.last_pressure_pa);
  set_peak(to.pressure_pa, f.pressure_pa);
  set_peak(to.energy_j, f.energy_j);
  to.steep_from_cad.set(i, f.steep_from_cad);
  to.steep_to_cad.set(i, f.steep_to_cad);
  to.steep_from_pa.set(i, f.steep_from_pa);
  to.steep_to_pa.set(i, f.steep_to_pa);
  Charge<Wide>& c = charges_[l / width];
  c.intake_pa.set(i, charge.intake_pa);
  c.gas_j_per_k.set(i, charge.gas_j_per_k);
  c.fuel_heat_j.set(i, charge.fuel_heat_j);
  c.speed_rpm.set(i, charge.speed_rpm);
}

void IndicatorLanes::compute(const CycleVolumes<double>& volumes, double gamma, InstructionSet set) noexcept {
  dispatch(set, [&]() MGDD_INLINE_LAMBDA {
    const auto gamma_of = [gamma](const Wide&) MGDD_INLINE_LAMBDA { return Wide(gamma); };
    for (std::size_t g = 0; g < groups; ++g)
      out_[g] = indicators_of(figures_[g], charges_[g], volumes, gamma_of);
  });
}

void IndicatorLanes::set_burn_angles(std::size_t l, double ca10_cad, double ca50_cad, double ca90_cad) noexcept {
  Indicators<Wide>& to = out_[l / width];
  to.ca10_cad.set(at(l), ca10_cad);
  to.ca50_cad.set(at(l), ca50_cad);
  to.ca90_cad.set(at(l), ca90_cad);
}

Indicators<double> IndicatorLanes::get(std::size_t l) const noexcept {
  constexpr auto plain = indicator_fields<double>();
  Indicators<double> out;
  for (std::size_t i = 0; i < plain.size(); ++i)
    out.*plain[i].member = get(l, i);
  return out;
}

}  // namespace mgdd::engine
