#include "mgdd/engine/performance.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::engine {
namespace {

using enum PerformanceSignal;

constexpr std::array<std::string_view, performance_signal_count> signal_units{"%",   "bar",     "bar", "ppm",
                                                                              "bar", "bar/°CA", "K"};

void validate(const PerformanceTerm& term, std::size_t index) {
  const std::string owner = "terms[" + std::to_string(index) + "].";
  if (static_cast<std::size_t>(term.signal) >= performance_signal_count) {
    throw ParameterError(owner + "signal", static_cast<int>(term.signal), "is not a signal");
  }
  const std::string_view unit = unit_of(term.signal);
  if (!std::isfinite(term.weight)) {
    throw ParameterError(owner + "weight", term.weight, "must be finite");
  }
  require_positive(owner + "reference", term.reference, unit);
  if (term.above) require_positive(owner + "above", *term.above, unit);
}

}  // namespace

std::string_view unit_of(PerformanceSignal signal) noexcept {
  return signal_units[static_cast<std::size_t>(signal)];
}

PerformanceSignals signals_of(const Indicators<double>& cycle, double nox) noexcept {
  PerformanceSignals s;
  s[efficiency_percent] = 100.0 * cycle.efficiency_gross;
  s[imep_gross_bar] = cycle.imep_gross_bar;
  s[imep_closed_bar] = cycle.imep_closed_bar;
  s[nox_ppm] = nox;
  s[p_max_bar] = cycle.p_max_bar;
  s[dp_max_bar_per_cad] = cycle.dp_max_bar_per_cad;
  s[t_max_k] = cycle.t_max_k;
  return s;
}

double PerformanceTerm::value(double x) const noexcept {
  if (!above) return weight * x / reference;
  const double excess = std::max(0.0, (x - *above) / *above);
  return weight * excess * excess;
}

Performance::Performance() noexcept = default;

Performance::Performance(std::span<const PerformanceTerm> terms) : count_(terms.size()) {
  if (terms.empty() || terms.size() > max_terms) {
    throw about("terms", ParameterError("terms has " + std::to_string(terms.size()) + " entries: must be 1 to " +
                                        std::to_string(max_terms)));
  }
  for (std::size_t i = 0; i < terms.size(); ++i)
    validate(terms[i], i);
  std::copy(terms.begin(), terms.end(), terms_.begin());
}

bool Performance::uses(PerformanceSignal signal) const noexcept {
  return std::any_of(terms().begin(), terms().end(), [&](const PerformanceTerm& t) { return t.signal == signal; });
}

double Performance::components(const PerformanceSignals& signals, std::span<double> out) const noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i)
    sum += out[i] = terms_[i].value(signals[terms_[i].signal]);
  return sum;
}

double Performance::value(const PerformanceSignals& signals) const noexcept {
  std::array<double, max_terms> scratch{};
  return components(signals, scratch);
}

bool Performance::operator==(const Performance& other) const noexcept {
  return std::equal(terms().begin(), terms().end(), other.terms().begin(), other.terms().end());
}

Performance efficiency_only() noexcept {
  return {};
}

Performance efficiency_and_nox(double nox_weight_percent_per_ppm) {
  require_within("nox_weight_percent_per_ppm", nox_weight_percent_per_ppm, 0.0, 1e6, "%/ppm");
  return {{.signal = efficiency_percent}, {.signal = nox_ppm, .weight = -nox_weight_percent_per_ppm}};
}

}  // namespace mgdd::engine
