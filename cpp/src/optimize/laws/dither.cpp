#include "mgdd/optimize/laws/dither.hpp"

#include <cmath>
#include <complex>
#include <cstdlib>
#include <numbers>
#include <string>

#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double turn = 2.0 * std::numbers::pi;
constexpr int longest_period = 1'000'000;

[[noreturn]] void refuse_harmonics(const std::string& why) {
  throw about("harmonics", ParameterError("harmonics: " + why + "; for example period 40 with harmonics 4, 5, 7"));
}

}  // namespace

void validate(const DitherSettings& settings, Eigen::Index inputs) {
  validate_entries("amplitude", settings.amplitude, inputs, 0.0, 1e12);
  if (settings.period < 4 || settings.period > longest_period) {
    throw ParameterError("period", settings.period,
                         "must be at least 4 cycles (and at most 1000000) to tell a slope from a mean");
  }
  const std::vector<int>& n = settings.harmonics;
  if (n.size() == 1 && inputs > 1) {
    throw about("harmonics",
                ShapeError("harmonics has 1 entry: " + std::to_string(inputs) +
                           " inputs need one each, on a longer period; for example period 40 with harmonics 4, 5, 7"));
  }
  if (static_cast<Eigen::Index>(n.size()) != inputs) {
    throw about("harmonics", ShapeError("harmonics has " + std::to_string(n.size()) + " entries: must have " +
                                        std::to_string(inputs) + ", one per entry of start"));
  }
  for (std::size_t i = 0; i < n.size(); ++i) {
    if (n[i] < 1 || 2 * n[i] >= settings.period) {
      refuse_harmonics("n = " + std::to_string(n[i]) +
                       " must be at least 1 and below half of period = " + std::to_string(settings.period));
    }
    // What J bends makes of two harmonics: their sum, which the window folds back, and their difference.
    const auto is_own = [&](int mixed) { return mixed == n[i] || settings.period - mixed == n[i]; };
    for (std::size_t j = 0; j < n.size(); ++j) {
      if (j != i && n[i] == n[j]) refuse_harmonics("n = " + std::to_string(n[i]) + " is used twice");
      for (std::size_t k = 0; k <= j; ++k) {
        if (is_own(n[j] + n[k]) || n[i] == std::abs(n[j] - n[k])) {
          refuse_harmonics(std::to_string(n[j]) + " and " + std::to_string(n[k]) + " mix to " + std::to_string(n[i]) +
                           " over " + std::to_string(settings.period) + " cycles: curvature would be read as a slope");
        }
      }
    }
  }
}

void validate(const std::vector<ComponentLag>& components) {
  if (components.empty()) throw about("components", ShapeError("components is empty: J has at least one component"));
  for (std::size_t c = 0; c < components.size(); ++c)
    validate(components[c], "components[" + std::to_string(c) + "].");
}

void validate(const ComponentLag& lag, const std::string& at) {
  for (const auto& [name, value] :
       {std::pair{"delay_cycles", lag.delay_cycles}, std::pair{"lag_cycles", lag.lag_cycles}}) {
    if (!(value >= 0.0 && value <= 1e6)) throw in_context(at, ParameterError(name, value, "must lie in [0, 1e6]"));
  }
}

SensorResponse sensor_response(const ComponentLag& lag, int harmonic, int period) noexcept {
  const double omega = turn * harmonic / period;
  SensorResponse out{1.0, omega * lag.delay_cycles};
  if (lag.lag_cycles > 0.0) {
    const double keep = std::exp(-1.0 / lag.lag_cycles);
    const std::complex<double> denominator = 1.0 - std::polar(keep, -omega);
    out.gain = (1.0 - keep) / std::abs(denominator);
    out.phase_rad += std::arg(denominator);
  }
  return out;
}

Dither::Dither(const DitherSettings& settings, const std::vector<ComponentLag>& components)
    : period_(settings.period), inputs_(settings.harmonics.size()), components_(components.size()) {
  const auto steps = static_cast<std::size_t>(period_);
  sine_.resize(steps * inputs_);
  echo_.resize(steps * components_ * inputs_);
  for (std::size_t k = 0; k < steps; ++k) {
    const double angle = turn * static_cast<double>(k) / period_;
    for (std::size_t i = 0; i < inputs_; ++i)
      sine_[k * inputs_ + i] = std::sin(angle * settings.harmonics[i]);
    for (std::size_t c = 0; c < components_; ++c) {
      const std::size_t row = k * components_ + c;
      for (std::size_t i = 0; i < inputs_; ++i) {
        const int ni = settings.harmonics[i];
        const SensorResponse r = sensor_response(components[c], ni, period_);
        echo_[row * inputs_ + i] = std::sin(angle * ni - r.phase_rad) / r.gain;
      }
    }
  }
}

}  // namespace mgdd::optimize
