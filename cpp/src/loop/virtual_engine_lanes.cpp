#include "mgdd/loop/virtual_engine_lanes.hpp"

#include <algorithm>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::loop {
namespace {

std::vector<VirtualEngine> checked(std::vector<VirtualEngine> benches) {
  require_within("number of benches", static_cast<double>(benches.size()), 1.0,
                 static_cast<double>(VirtualEngineLanes::width));
  for (const VirtualEngine& bench : benches) {
    if (!side_by_side(bench, benches[0])) {
      throw ParameterError(
          "benches side by side must have a constant gamma, one input and no limit on t_evo_k, and be alike in "
          "geometry, "
          "gas, step_cad, integrator, burn_shape and wall_heat_model");
    }
  }
  return benches;
}

}  // namespace

bool side_by_side(const VirtualEngine& one, const VirtualEngine& other) noexcept {
  const BenchSettings &a = one.settings(), &b = other.settings();
  const auto simple = [](const BenchSettings& s) {
    return s.inputs.size() == 1 && std::find(s.limits.begin(), s.limits.end(), "t_evo_k") == s.limits.end();
  };
  return simple(a) && simple(b) && a.cylinder.gas.gamma_model == engine::GammaModel::constant &&
         a.cylinder.gas == b.cylinder.gas && a.cylinder.geometry == b.cylinder.geometry && a.step_cad == b.step_cad &&
         a.integrator == b.integrator && a.cylinder.burn.burn_shape == b.cylinder.burn.burn_shape &&
         a.cylinder.wall_heat.wall_heat_model == b.cylinder.wall_heat.wall_heat_model;
}

VirtualEngineLanes::VirtualEngineLanes(std::vector<VirtualEngine> benches, InstructionSet set)
    : benches_(checked(std::move(benches))), set_(set) {
  cycles_.use(benches_[0].model());
}

void VirtualEngineLanes::step(std::span<const double> soc_cad, std::span<BenchCycle> out) noexcept {
  for (std::size_t lane = 0; lane < size(); ++lane) {
    VirtualEngine& bench = benches_[lane];
    out[lane] = bench.begin(soc_cad.subspan(lane, 1));
    const engine::Cylinder& cylinder = bench.model().cylinder();  // as it has drifted
    cycles_.set_charge(lane, bench.charge_of(out[lane]), cylinder.wall_heat);
    cycles_.set_burn(lane, cylinder.burn, out[lane].soc_cad);
  }
  cycles_.run(size(), set_);
  for (std::size_t lane = 0; lane < size(); ++lane) {
    out[lane].unphysical = !cycles_.physical(lane);
    if (!out[lane].unphysical) out[lane].indicators = cycles_.indicators(lane);
    benches_[lane].conclude(out[lane]);
  }
}

}  // namespace mgdd::loop
