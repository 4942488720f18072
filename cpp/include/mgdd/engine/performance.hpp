// The performance J of one cycle: a sum of at most eight terms of measured signals, to be maximised.
// A term is weight * x / reference, or, with a limit `above` > 0, the hinge weight * max(0, (x - above) / above)^2; a
// penalty has a negative weight. Each component stays visible, since sensors of unequal delay need demodulation of
// their own. `components` and `value` are noexcept and allocation-free; `Performance` is trivially copyable.
// Source: Tan 2018, section 5.3 (efficiency, NOx, peak pressure rise); the weights are ours.
#pragma once

#include <array>
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <span>
#include <string_view>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/engine/indicators.hpp"

namespace mgdd::engine {

enum class PerformanceSignal {
  efficiency_percent,  ///< gross indicated efficiency times 100
  imep_gross_bar,
  imep_closed_bar,
  nox_ppm,  ///< of whatever sensor the caller routes here
  p_max_bar,
  dp_max_bar_per_cad,
  t_max_k,
};
inline constexpr std::size_t performance_signal_count = names<PerformanceSignal>().size();

/// Unit of a signal as printed.
std::string_view unit_of(PerformanceSignal signal) noexcept;

/// What one cycle measured, in the order of `PerformanceSignal`.
struct PerformanceSignals {
  std::array<double, performance_signal_count> values{};

  double& operator[](PerformanceSignal s) noexcept { return values[static_cast<std::size_t>(s)]; }
  double operator[](PerformanceSignal s) const noexcept { return values[static_cast<std::size_t>(s)]; }
};

/// The signals of a simulated cycle, with the NOx that a sensor or a model gives [ppm].
PerformanceSignals signals_of(const Indicators<double>& cycle, double nox_ppm) noexcept;

struct PerformanceTerm {
  PerformanceSignal signal = PerformanceSignal::efficiency_percent;
  double weight = 1.0;            ///< unit of J per unit of x / reference; negative for a penalty
  double reference = 1.0;         ///< > 0, in the unit of the signal; not used by a hinge
  std::optional<double> above{};  ///< hinge limit > 0, in the unit of the signal

  double value(double x) const noexcept;
  bool operator==(const PerformanceTerm&) const = default;
};

class Performance {
 public:
  static constexpr std::size_t max_terms = 8;

  /// Efficiency only: J = efficiency in percent.
  Performance() noexcept;
  /// One to eight terms; ParameterError names term, field, value and bound.
  explicit Performance(std::span<const PerformanceTerm> terms);
  Performance(std::initializer_list<PerformanceTerm> terms)
      : Performance(std::span<const PerformanceTerm>(terms.begin(), terms.size())) {}

  std::span<const PerformanceTerm> terms() const noexcept { return {terms_.data(), count_}; }
  std::size_t size() const noexcept { return count_; }
  bool uses(PerformanceSignal signal) const noexcept;

  /// Writes one value per term to the front of `out`, which must hold `size()`; returns their sum J.
  double components(const PerformanceSignals& signals, std::span<double> out) const noexcept;
  double value(const PerformanceSignals& signals) const noexcept;

  bool operator==(const Performance& other) const noexcept;

 private:
  std::array<PerformanceTerm, max_terms> terms_{};
  std::size_t count_ = 1;
};

inline constexpr double default_nox_weight_percent_per_ppm = 0.004;

/// J = 100 eta.
Performance efficiency_only() noexcept;
/// J = 100 eta - w_N NOx, w_N >= 0 [%/ppm].
Performance efficiency_and_nox(double nox_weight_percent_per_ppm = default_nox_weight_percent_per_ppm);

}  // namespace mgdd::engine
