// Figures of one measured cycle after another: level, work, peaks, rise rate, burn angles, exponents, knock. What the
// cycles share is prepared once; a cycle then costs some ten nanoseconds a sample. noexcept, no heap.
// Angles °CA aTDC, pressure bar. Sources: Heywood 1988, chapters 2 and 9; knock: Brecq and Le Corre 2005.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/pressure/angles.hpp"
#include "mgdd/engine/pressure/rise_rate.hpp"
#include "mgdd/engine/pressure/trace_options.hpp"
#include "mgdd/math/band_pass.hpp"
#include "mgdd/math/dual.hpp"
#include "mgdd/math/weighted_sum.hpp"

namespace mgdd::engine {

/// What cannot be had from the angles of a record is NaN.
struct CycleFigures {
  double pegging_bar = 0.0;  ///< added to the trace
  double imep_closed_bar = undefined<double>();
  double imep_gross_bar = undefined<double>();  ///< -180 to 180
  double imep_net_bar = undefined<double>();    ///< 720 degrees; the first sample follows the last
  double pmep_bar = undefined<double>();        ///< net less gross: negative where the gas exchange takes work
  double p_max_bar = undefined<double>();
  double p_max_cad = undefined<double>();
  double dp_max_bar_per_cad = undefined<double>();
  double dp_max_cad = undefined<double>();
  double heat_net_j = undefined<double>();  ///< highest cumulative net heat of the window
  double ca10_cad = undefined<double>();    ///< of that heat; NaN for a cycle that does not burn
  double ca50_cad = undefined<double>();
  double ca90_cad = undefined<double>();
  double n_compression = undefined<double>();
  double n_expansion = undefined<double>();
  double mapo_bar = undefined<double>();       ///< largest absolute oscillation in the band
  double impo_bar_cad = undefined<double>();   ///< integral of its absolute value
  double sepo_bar2_cad = undefined<double>();  ///< integral of its square
};

/// A single figure of a record by name.
template <class Record>
struct Figure {
  std::string_view name;
  double Record::* member;
};
inline constexpr std::array<Figure<CycleFigures>, 18> cycle_figures{{
    {"pegging_bar", &CycleFigures::pegging_bar},
    {"imep_closed_bar", &CycleFigures::imep_closed_bar},
    {"imep_gross_bar", &CycleFigures::imep_gross_bar},
    {"imep_net_bar", &CycleFigures::imep_net_bar},
    {"pmep_bar", &CycleFigures::pmep_bar},
    {"p_max_bar", &CycleFigures::p_max_bar},
    {"p_max_cad", &CycleFigures::p_max_cad},
    {"dp_max_bar_per_cad", &CycleFigures::dp_max_bar_per_cad},
    {"dp_max_cad", &CycleFigures::dp_max_cad},
    {"heat_net_j", &CycleFigures::heat_net_j},
    {"ca10_cad", &CycleFigures::ca10_cad},
    {"ca50_cad", &CycleFigures::ca50_cad},
    {"ca90_cad", &CycleFigures::ca90_cad},
    {"n_compression", &CycleFigures::n_compression},
    {"n_expansion", &CycleFigures::n_expansion},
    {"mapo_bar", &CycleFigures::mapo_bar},
    {"impo_bar_cad", &CycleFigures::impo_bar_cad},
    {"sepo_bar2_cad", &CycleFigures::sepo_bar2_cad},
}};

/// Where the polytropic exponents are fitted.
inline constexpr double compression_from_cad = -100.0, compression_to_cad = -40.0;
inline constexpr double expansion_from_cad = 60.0, expansion_to_cad = 120.0;
/// A cycle burns if its net heat exceeds this share of the internal energy of the charge where the window starts.
inline constexpr double burning_share = 0.05;
/// Window of the heat where the options give none.
inline constexpr double idle_heat_from_cad = -10.0, idle_heat_to_cad = 90.0;

class Indicating {
 public:
  struct Workspace {
    std::vector<double> sound, heat;
  };

  /// `angle_cad` must have passed `check_trace`. ParameterError for an option outside its domain or a gamma that is not
  /// constant; DataError with fewer than 20 samples from IVC to EVO, or without the angles that pegging reads.
  Indicating(const std::vector<double>& angle_cad, const Cylinder& cylinder, double speed_rpm,
             const TraceOptions& options);

  [[nodiscard]] std::size_t samples() const noexcept { return angle_cad_.size(); }
  [[nodiscard]] const std::vector<double>& angle_cad() const noexcept { return angle_cad_; }
  [[nodiscard]] Workspace make_workspace() const;

  /// `pressure_bar` has a sample per angle. All figures are NaN where one of them is not finite.
  CycleFigures operator()(const double* pressure_bar, Workspace& work) const noexcept;

  /// Samples [first, last) from IVC to EVO.
  [[nodiscard]] SampleRange closed() const noexcept { return closed_; }
  /// Sound of a cycle in the band, over the samples of `knock_samples`; empty where the sampling does not reach it.
  [[nodiscard]] std::span<const double> oscillation(const double* pressure_bar, Workspace& work) const noexcept;
  [[nodiscard]] SampleRange knock_samples() const noexcept { return knock_; }

 private:
  void add_heat(CycleFigures& out, const double* pressure_bar, Workspace& work) const noexcept;
  void add_exponents(CycleFigures& out, const double* pressure_bar) const noexcept;
  void add_knock(CycleFigures& out, const double* pressure_bar, Workspace& work) const noexcept;

  std::vector<double> angle_cad_, volume_l_;
  SampleRange closed_, heat_, knock_;  // samples [first, last)
  double gamma_, step_cad_;
  WeightedSum pegging_, work_closed_, work_gross_, work_net_;  // works over swept volume, bar
  double closed_change_ = 0.0;                                 // of volume over swept volume
  WeightedSum compression_, expansion_;
  RiseRate rise_;
  std::optional<BandPass> band_;
};

/// Figures of the cycles of a record, one below the other, shared out over `threads` (0: one per core). ShapeError for
/// another length than a whole number of cycles; DataError as `check_trace` for a cycle, counted from 1.
std::vector<CycleFigures> indicate_cycles(const Indicating& indicating, std::span<const double> record,
                                          std::size_t threads = 0);

}  // namespace mgdd::engine
