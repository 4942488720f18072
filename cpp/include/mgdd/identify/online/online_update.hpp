// The three on-line updates of PW-R with one interface: `update(duty, angle)` takes one sample and says whether the
// model changed. Units: duty, deg. noexcept, allocation-free; `take` runs whole columns.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/identify/online/recursive_gradient.hpp"
#include "mgdd/identify/online/recursive_pw_r.hpp"
#include "mgdd/identify/online/recursive_window.hpp"

namespace mgdd::identify {

/// The groups that an update may free, in the order of `free` in the settings.
inline constexpr std::array<std::string_view, 5> pw_r_groups{"tau_s", "gain_deg_per_s2_per_duty", "preload_duty",
                                                             "spring_duty_per_deg", "coulomb_duty"};

/// ParameterError for any other name.
inline std::array<bool, 5> free_groups(const std::vector<std::string>& names) {
  std::array<bool, 5> free{};
  for (const std::string& name : names) {
    const auto found = std::ranges::find(pw_r_groups, name);
    if (found == pw_r_groups.end()) {
      throw about("free", ParameterError("free: '" + name + "' is not a parameter of pw_r that can be updated"));
    }
    free[static_cast<std::size_t>(found - pw_r_groups.begin())] = true;
  }
  return free;
}

class RecursiveUpdate {
 public:
  explicit RecursiveUpdate(const RecursivePwRSettings& settings) : core_(settings) {}

  bool update(double duty, double angle_deg) noexcept { return core_.update(duty, angle_deg) == UpdateGate::updated; }
  throttle::PwR model() const noexcept { return core_.model(); }
  void require_usable() const { core_.require_usable(); }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    RecursivePwR::visit(self.core_, v);
  }

 private:
  RecursivePwR core_;
};

/// One step of the search every `iterate_every` samples.
class WindowUpdate {
 public:
  WindowUpdate(const WindowPwRSettings& settings, std::int64_t iterate_every)
      : core_(settings), iterate_every_(iterate_every) {
    if (iterate_every < 1) {
      throw ParameterError("iterate_every", iterate_every, "must be >= 1", "samples");
    }
  }

  bool update(double duty, double angle_deg) noexcept {
    core_.update(duty, angle_deg);
    return ++count_ % iterate_every_ == 0 && core_.iterate();
  }
  throttle::PwR model() const noexcept { return core_.model(); }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    WindowPwR::visit(self.core_, v);
    v("calls", self.count_, counts_end);
  }

 private:
  WindowPwR core_;
  std::int64_t iterate_every_;
  std::int64_t count_ = 0;
};

/// Errors below so many sigmas of the sensor teach nothing.
inline constexpr double noise_sigmas = 3.0;

/// Starts at the first known sample; the duty that acts until a measurement is that of the sample before.
class GradientUpdate {
 public:
  explicit GradientUpdate(const GradientPwRSettings& settings) : core_(settings) {}

  bool update(double duty, double angle_deg) noexcept {
    if (!started_) {
      if (!std::isfinite(angle_deg) || !std::isfinite(duty)) return false;  // a dropped sample is nowhere to start
      core_.start(angle_deg, duty);
      started_ = true;
      duty_ = duty;
      return false;
    }
    const auto before = core_.factors();
    core_.update(duty_, angle_deg);
    duty_ = duty;
    return core_.factors() != before;
  }
  throttle::PwR model() const noexcept { return core_.model(); }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    GradientPwR::visit(self.core_, v);
    v("started", self.started_);
    v("last_duty", self.duty_);
  }

 private:
  GradientPwR core_;
  bool started_ = false;
  double duty_ = 0.0;
};

/// Samples in order; how many of them changed the model.
template <class Update>
std::int64_t take(Update& update, std::span<const double> duty, std::span<const double> angle_deg) noexcept {
  std::int64_t changed = 0;
  for (std::size_t k = 0; k < std::min(duty.size(), angle_deg.size()); ++k)
    changed += update.update(duty[k], angle_deg[k]) ? 1 : 0;
  return changed;
}

}  // namespace mgdd::identify
