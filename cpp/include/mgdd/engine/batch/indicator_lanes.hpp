// The indicators of sixteen cycles side by side: their arithmetic runs in vectors and gives the bits of one cycle.
// noexcept, no heap.
#pragma once

#include <array>
#include <cstddef>

#include "mgdd/engine/batch/lane.hpp"
#include "mgdd/engine/cycle_indicators.hpp"
#include "mgdd/engine/indicators.hpp"
#include "mgdd/math/dispatch.hpp"
#include "mgdd/math/lanes.hpp"

namespace mgdd::engine {

class IndicatorLanes {
 public:
  /// What the trace of a lane has given.
  void set(std::size_t l, const TraceFigures<double>& figures, const Charge<double>& charge) noexcept;
  /// Indicators of all lanes but their burn angles, which become NaN; gamma is constant.
  void compute(const CycleVolumes<double>& volumes, double gamma, InstructionSet set) noexcept;
  void set_burn_angles(std::size_t l, double ca10_cad, double ca50_cad, double ca90_cad) noexcept;

  Indicators<double> get(std::size_t l) const noexcept;
  /// One indicator, by its place in `indicator_fields()`.
  double get(std::size_t l, std::size_t field) const noexcept { return (out_[l / width].*fields[field].member)[at(l)]; }

 private:
  static constexpr std::size_t width = 4;
  using Wide = Lanes<static_cast<int>(width)>;
  static constexpr auto fields = indicator_fields<Wide>();
  static constexpr std::size_t groups = block_lanes / width;
  static int at(std::size_t l) noexcept { return static_cast<int>(l % width); }

  std::array<TraceFigures<Wide>, groups> figures_{};
  std::array<Charge<Wide>, groups> charges_{};
  std::array<Indicators<Wide>, groups> out_{};
};

}  // namespace mgdd::engine
