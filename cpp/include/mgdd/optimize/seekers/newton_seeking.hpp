// Newton extremum seeking (Ghaffari, Krstic and Nesic 2012): dither, gradient and Hessian by demodulation, and a
// Riccati filter Gamma -> H^-1, so that the rate of approach does not depend on the curvature of the map. The estimate
// is held until H and Gamma have settled. ask and tell are noexcept and allocation-free.
#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/seekers/dither.hpp"
#include "mgdd/optimize/seekers/first_readings.hpp"
#include "mgdd/optimize/seekers/seeker_core.hpp"

namespace mgdd::optimize {

struct NewtonSeekingSettings {
  SearchSpace space;
  DitherSettings dither;
  double time_constant_cycles = 40.0;  ///< tau of the approach
  double hessian_rate = 0.03;          ///< low-pass of H per cycle
  double riccati_rate = 0.02;          ///< w_r
  Inputs initial_hessian{};            ///< diagonal of H0, < 0, J unit per squared input unit; empty: of first readings
  Inputs initial_inverse{};            ///< diagonal of Gamma0, < 0; empty: the inverse of H0
  std::optional<double> largest_inverse{};  ///< bound of |Gamma|, > 0; none: five times the largest of Gamma0
  int hold_cycles = 300;                    ///< estimate held at the start
  Inputs rate{};                            ///< per cycle; empty: 3 A/M
  std::vector<ComponentLag> components{ComponentLag{}};
  double limit_amplitude = 0.5;  ///< share of the amplitude while a limit holds the estimate back
  bool maximize = true;
  std::vector<Limit> limits;

  std::vector<std::string> advice() const;
};
inline auto fields_of(const NewtonSeekingSettings&) {
  using S = NewtonSeekingSettings;
  return std::tuple{
      space_fields<&S::space>(),
      dither_fields<&S::dither>(),
      field<&S::time_constant_cycles>("time_constant_cycles", "of the approach"),
      field<&S::hessian_rate>("hessian_rate", "low-pass of the Hessian per cycle"),
      field<&S::riccati_rate>("riccati_rate", "rate of the Riccati filter per cycle"),
      field<&S::initial_hessian>("initial_hessian", "diagonal to begin with"),
      field<&S::initial_inverse>("initial_inverse", "diagonal of the inverse to begin with"),
      field<&S::largest_inverse>("largest_inverse", "bound of its norm"),
      field<&S::hold_cycles>("hold_cycles", "cycles that the estimate is held at the start"),
      field<&S::rate>("rate", "largest change of the estimate per cycle, per input"),
      field<&S::components>("components", "delay and lag of each component of J", DefaultForm::none),
      field<&S::limit_amplitude>("limit_amplitude", "share of the dither while a limit holds the estimate back"),
      field<&S::maximize>("maximize", "False to minimise J"),
      field<&S::limits>("limits", "measured quantities to keep"),
  };
}

class NewtonSeeking : public SeekerCore<NewtonSeekingSettings> {
 public:
  explicit NewtonSeeking(NewtonSeekingSettings settings);

  const Inputs& ask() noexcept;
  TellStatus tell(const Reading& reading) noexcept;
  /// New operating point: clear the window and the limits, keep estimate and Hessian, hold for one window.
  void restart() noexcept;

  const Inputs& gradient() const noexcept { return gradient_; }
  const InputMatrix& hessian() const noexcept { return hessian_; }
  const InputMatrix& inverse_hessian() const noexcept { return inverse_; }

  /// Moves the estimate, within the bounds; `by` is finite. A search that goes on elsewhere is restarted first.
  void shift_estimate(const Inputs& by) noexcept {
    move_within(estimate_, by, settings_.space, settings_.dither.amplitude);
  }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const {
    require_within_space("estimate", estimate_, settings_.space);
    if (!(share_ > 0.0 && share_ <= 1.0)) throw ParameterError("state column 'share' must lie in (0, 1]");
    first_.require_usable();
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    SeekerCore::visit_core(self, v);
    v("gradient", self.gradient_);
    v("slow", self.slow_);
    v("hessian", self.hessian_);
    v("inverse", self.inverse_);
    v("phase", self.phase_, self.settings_.dither.period);
    v("seen", self.seen_, counts_end);
    v("held", self.held_, counts_end);
    v("share", self.share_);
    v("limited_cycles", self.limited_cycles_, counts_end);
    v("window", self.window_);
    FirstReadings::visit(self.first_, v);
    LastReading::visit(self.last_, v);
  }

 private:
  friend SeekerCore;
  void begin_anew() noexcept;
  void learn(const Reading& reading, const Inputs& applied) noexcept;
  void update_inverse() noexcept;
  double largest_inverse() const noexcept;

  Dither dither_;
  FirstReadings first_;
  LastReading last_;
  Inputs gradient_;
  Inputs slow_;  // mean of the slope over about a window: what steps along a limit
  InputMatrix hessian_, inverse_;
  std::int64_t phase_ = 0, seen_ = 0, held_ = 0;
  double share_ = 1.0;
  std::int64_t limited_cycles_ = 0;
  std::vector<double> window_;
};

}  // namespace mgdd::optimize
