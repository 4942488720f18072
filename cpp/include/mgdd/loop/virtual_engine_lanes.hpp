// Up to sixteen virtual benches side by side: their cycles in SIMD lanes, drift, scatter and sensors one by one; the
// numbers of `VirtualEngine` to rounding, whoever stands beside it. Angles in °CA aTDC. `step` is noexcept,
// allocation-free.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mgdd/engine/batch/cycle_lanes.hpp"
#include "mgdd/loop/virtual_engine.hpp"
#include "mgdd/math/dispatch.hpp"

namespace mgdd::loop {

/// Whether two benches may run side by side: a constant gamma, one input, no limit on t_evo_k, and alike in geometry,
/// gas, crank grid, integrator and the laws of burn and wall heat.
bool side_by_side(const VirtualEngine& one, const VirtualEngine& other) noexcept;

class VirtualEngineLanes {
 public:
  static constexpr std::size_t width = engine::block_lanes;

  /// ParameterError for none, more than sixteen, or benches that may not run side by side.
  explicit VirtualEngineLanes(std::vector<VirtualEngine> benches, InstructionSet set = instruction_set());
  VirtualEngineLanes(const VirtualEngineLanes&) = delete;  // the lanes point to a model of the benches
  VirtualEngineLanes& operator=(const VirtualEngineLanes&) = delete;
  VirtualEngineLanes(VirtualEngineLanes&&) noexcept = default;
  VirtualEngineLanes& operator=(VirtualEngineLanes&&) noexcept = default;
  ~VirtualEngineLanes() = default;

  std::size_t size() const noexcept { return benches_.size(); }
  VirtualEngine& bench(std::size_t lane) noexcept { return benches_[lane]; }

  /// Runs one cycle of each, as `VirtualEngine::step`. One entry per bench.
  void step(std::span<const double> soc_cad, std::span<BenchCycle> out) noexcept;

 private:
  std::vector<VirtualEngine> benches_;
  engine::CycleLanes<double> cycles_;
  InstructionSet set_;
};

}  // namespace mgdd::loop
