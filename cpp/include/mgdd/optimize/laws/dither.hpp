// The sinusoidal perturbation of extremum seeking and the phase that sensors put between it and its echo in J.
// d_i(k) = sin(2 pi n_i k / M): several inputs share one window of M cycles on integer frequencies n_i
// (Ghaffari, Krstic and Nesic 2012). Each component of J may come through its own delay and lag.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "mgdd/common/record.hpp"
#include "mgdd/optimize/ask_tell/seeker.hpp"

namespace mgdd::optimize {

/// What stands between the plant and one component of J: D cycles of transport, then y += (1 - exp(-1/tau)) (x - y).
struct ComponentLag {
  double delay_cycles = 0.0;  ///< D >= 0
  double lag_cycles = 0.0;    ///< tau >= 0; 0 = none

  bool operator==(const ComponentLag&) const = default;
};

constexpr auto fields_of(const ComponentLag&) {
  return std::array{field<&ComponentLag::delay_cycles>("delay_cycles", "transport delay in cycles"),
                    field<&ComponentLag::lag_cycles>("lag_cycles", "time constant of the lag in cycles")};
}

struct DitherSettings {
  Inputs amplitude{};             ///< per input, in its unit, > 0; empty: its scale
  int period = 10;                ///< M, cycles of the common window, >= 4
  std::vector<int> harmonics{1};  ///< n_i, one per input
};

template <auto place>
constexpr auto dither_fields() {
  using D = DitherSettings;
  return std::tuple{
      field<place, &D::amplitude>("amplitude", "of the dither, per input"),
      field<place, &D::period>("period", "cycles of the common window"),
      field<place, &D::harmonics>("harmonics", "oscillations per window, one per input", DefaultForm::none)};
}

/// ParameterError for a period below 4, or for harmonics that mix: n_i = n_j, 2 n_j or n_j +- n_k, or 2 n_i >= M.
void validate(const DitherSettings& settings, Eigen::Index inputs);
void validate(const std::vector<ComponentLag>& components);
/// ParameterError whose message has `at` in front.
void validate(const ComponentLag& lag, const std::string& at);

/// The last reading of a seeker that dithers, which stands in where one is missing while others are on their way.
class LastReading {
 public:
  LastReading(const std::vector<ComponentLag>& components, std::size_t limits)
      : late_(std::any_of(components.begin(), components.end(),
                          [](const ComponentLag& c) { return c != ComponentLag{}; })),
        components_(components.size(), 0.0),
        limits_(limits, 0.0) {}

  void keep(const Reading& reading) noexcept {
    std::copy(reading.components.begin(), reading.components.end(), components_.begin());
    std::copy(reading.limits.begin(), reading.limits.end(), limits_.begin());
    known_ = true;
  }
  bool stands_in() const noexcept { return late_ && known_; }
  Reading reading() const noexcept { return {components_, limits_}; }
  void forget() noexcept { known_ = false; }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    if (!self.late_) return;
    v("last_known", self.known_);
    v("last_components", self.components_);
    v("last_limits", self.limits_);
  }

 private:
  bool late_, known_ = false;
  std::vector<double> components_, limits_;
};

/// Amplitude and phase of delay and discrete lag at n cycles per window of M.
struct SensorResponse {
  double gain = 1.0;
  double phase_rad = 0.0;  ///< lag of the echo, >= 0
};
SensorResponse sensor_response(const ComponentLag& lag, int harmonic, int period) noexcept;

/// Tables of the perturbation and of the demodulating signals; constant after construction, free of allocation in use.
class Dither {
 public:
  Dither(const DitherSettings& settings, const std::vector<ComponentLag>& components);

  int period() const noexcept { return period_; }
  std::size_t components() const noexcept { return components_; }

  /// d_i at phase k of the window.
  double perturbation(int phase, Eigen::Index input) const noexcept {
    return sine_[static_cast<std::size_t>(phase) * inputs_ + static_cast<std::size_t>(input)];
  }
  /// sin(omega_i k - psi) / gain: multiplied with the component's reading and averaged it gives A_i J'_i / 2.
  double demodulation(int phase, std::size_t component, Eigen::Index input) const noexcept {
    const std::size_t row = static_cast<std::size_t>(phase) * components_ + component;
    return echo_[row * inputs_ + static_cast<std::size_t>(input)];
  }

 private:
  int period_;
  std::size_t inputs_, components_;
  std::vector<double> sine_, echo_;
};

}  // namespace mgdd::optimize
