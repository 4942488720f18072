// Up to sixteen virtual benches side by side: their cycles in SIMD lanes, drift, scatter and sensors one by one; the
// numbers of `EngineBench` to rounding, whoever stands beside it. Angles in °CA aTDC. `step` is noexcept,
// allocation-free.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mgdd/engine/batch/cycle_lanes.hpp"
#include "mgdd/loop/engine_bench.hpp"
#include "mgdd/math/dispatch.hpp"

namespace mgdd::loop {

/// Whether two benches may run side by side: a constant gamma, one input, no limit on t_evo_k, and alike in geometry,
/// gas, crank grid, integrator and the laws of burn and wall heat.
bool side_by_side(const EngineBench& one, const EngineBench& other) noexcept;

class EngineBenchLanes {
 public:
  static constexpr std::size_t width = engine::block_lanes;

  /// ParameterError for none, more than sixteen, or benches that may not run side by side.
  explicit EngineBenchLanes(std::vector<EngineBench> benches, InstructionSet set = instruction_set());
  EngineBenchLanes(const EngineBenchLanes&) = delete;  // the lanes point to a model of the benches
  EngineBenchLanes& operator=(const EngineBenchLanes&) = delete;
  EngineBenchLanes(EngineBenchLanes&&) noexcept = default;
  EngineBenchLanes& operator=(EngineBenchLanes&&) noexcept = default;
  ~EngineBenchLanes() = default;

  std::size_t size() const noexcept { return benches_.size(); }
  EngineBench& bench(std::size_t lane) noexcept { return benches_[lane]; }

  /// Runs one cycle of each, as `EngineBench::step`. One entry per bench.
  void step(std::span<const double> soc_cad, std::span<BenchCycle> out) noexcept;

 private:
  std::vector<EngineBench> benches_;
  engine::CycleLanes<double> cycles_;
  InstructionSet set_;
};

}  // namespace mgdd::loop
