// What the cycles of one operating point share, whatever their fuel and timing: the way from IVC to the start of
// combustion, which is the motored cycle, and the way from the end of combustion to EVO, which depends on the pressure
// there alone. The second is tabulated over that pressure and interpolated (barycentric form; Berrut and Trefethen
// 2004) to better than 1e-6 of the work. SI.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "mgdd/engine/batch/cycle_block.hpp"
#include "mgdd/engine/cycle.hpp"

namespace mgdd::engine {

/// Sums and peaks of a motored cycle up to a sample.
struct MotoredSample {
  double pressure, work, loss;  ///< work is twice the trapezoid, as in a block
  double p_best, p_at, energy_best, energy_at, rise_best, rise_at;
};

/// What is left of each lane from a sample after the burn to EVO.
struct TailLanes {
  std::array<std::size_t, block_lanes> from;  ///< sample >= tail_from()
  Lane<double> pressure;                      ///< there
  Lane<double> work, loss, last_pressure;
  std::array<bool, block_lanes> known;  ///< false: the table does not reach or resolve that pressure
};

class SharedPoint {
 public:
  /// Tables for the charge and the wall heat of the block's first lane. Allocates; `set` for its own integrations.
  void prepare(const CycleTables& tables, const CycleBlock<double>& block, WallHeatModel wall, InstructionSet set);

  /// State and sums of all lanes at a sample of the motored cycle.
  void begin(std::size_t k, CycleBlock<double>& block) const noexcept;
  /// Before combustion, at a sample from IVC to the latest start of combustion.
  const MotoredSample& motored(std::size_t k) const noexcept { return motored_[k]; }
  /// First sample of the tail: after the top dead centre, so that no peak lies in it.
  std::size_t tail_from() const noexcept { return tail_from_; }
  /// Fills what is left and known.
  void find(TailLanes& tails, InstructionSet set) noexcept;

 private:
  static constexpr std::size_t n_nodes = block_lanes;
  void run_motored(const CycleTables& t, const CycleBlock<double>& block, WallHeatModel wall);
  bool run_tail(const CycleTables& t, const CycleBlock<double>& block, double lowest_pa, WallHeatModel wall,
                InstructionSet set);
  void prepare_row(std::size_t k) noexcept;
  bool reaches(std::size_t k, double pressure_pa) noexcept;

  std::size_t tail_from_ = 0, n_ = 0;
  bool has_tail_ = false;
  std::vector<MotoredSample> motored_;
  // Of each node and sample, from tail_from_ on: its pressure, and work and heat that are left.
  std::vector<Lane<double>> trace_;
  std::vector<double> work_left_, loss_left_;
  std::vector<double> coldest_pa_;  // pressure at which the gas has the temperature of the wall
  // Barycentric interpolation over the logarithm of the pressure, prepared when a sample is first asked for.
  std::vector<double> log_pressure_, weight_;
  enum class Row : unsigned char { unknown, good, unresolved };
  std::vector<Row> row_;
};

}  // namespace mgdd::engine
