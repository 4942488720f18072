// Extremum seeking by a sinusoidal dither, one step per engine cycle, with the mean of J removed in one of three ways.
// Scheme: Tan, Nesic and Mareels 2006 (one integrator, no filters); washout form: Choi, Krstic, Ariyur and Lee 2002;
// batch form: regression over a period with the estimate held (Hunnekens et al. 2014 in spirit).
// Near an optimum of curvature J'' the estimate approaches with time constant tau = 2/(g_r A |J''|) cycles.
// ask and tell are noexcept and allocation-free.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/seeker_core.hpp"
#include "mgdd/optimize/laws/dither.hpp"
#include "mgdd/optimize/watch/first_readings.hpp"

namespace mgdd::optimize {

enum class MeanRemoval { batch, moving_average, washout };

struct ExtremumSeekingSettings {
  SearchSpace space;
  DitherSettings dither;
  MeanRemoval form = MeanRemoval::batch;
  Inputs gain{};              ///< g_r, input unit per unit of J; empty: for tau of 4 M by `curvature` or first readings
  Inputs rate{};              ///< largest change of the estimate per cycle; empty: A/M in batches, else 3 A/M
  Inputs recovery_rate{};     ///< the same on the way back below a limit; empty: `rate` where that is given, else A
  double washout_pole = 0.9;  ///< h of (z - 1)/(z - h)
  double low_pass = 1.0;      ///< b of y += b (x - y) after demodulation; 1 = off
  std::vector<ComponentLag> components{ComponentLag{}};
  std::optional<int> hold_cycles{};  ///< estimate held at the start and after `restart`; none: one window

  /// Vanishing dither: A shrinks to this share of the amplitude where |J'| is below `full_gradient`; 1 = off.
  double amplitude_floor = 1.0;
  double full_gradient = 0.0;    ///< |dJ/dtheta| at which the dither is full, > 0 where the floor is below 1
  double limit_amplitude = 0.5;  ///< share of the amplitude while a limit holds the estimate back
  bool maximize = true;
  std::vector<Limit> limits;
  std::optional<double> curvature{};  ///< J'' if known: makes the gain, or lets `advice` judge the one given

  /// What averaging theory says against these settings, in sentences; empty if nothing (or J'' is not known).
  std::vector<std::string> advice() const;
};
inline auto fields_of(const ExtremumSeekingSettings&) {
  using S = ExtremumSeekingSettings;
  return std::tuple{
      space_fields<&S::space>(),
      field<&S::form>("form", "how the mean of J is removed"),
      dither_fields<&S::dither>(),
      field<&S::gain>("gain", "adaptation gain, per input"),
      field<&S::rate>("rate", "largest change of the estimate per cycle, per input"),
      field<&S::recovery_rate>("recovery_rate", "largest change on the way back below a limit, per input"),
      field<&S::washout_pole>("washout_pole", "pole of the high-pass"),
      field<&S::low_pass>("low_pass", "share of the new value after demodulation"),
      field<&S::components>("components", "delay and lag of each component of J", DefaultForm::none),
      field<&S::hold_cycles>("hold_cycles", "cycles that the estimate is held at the start"),
      field<&S::amplitude_floor>("amplitude_floor", "share of the dither that is left where J is flat"),
      field<&S::full_gradient>("full_gradient", "slope of J at which the dither is full"),
      field<&S::limit_amplitude>("limit_amplitude", "share of the dither while a limit holds the estimate back"),
      field<&S::maximize>("maximize", "False to minimise J"),
      field<&S::limits>("limits", "measured quantities to keep"),
      field<&S::curvature>("curvature", "J'' where it is known"),
  };
}

class ExtremumSeeking : public SeekerCore<ExtremumSeeking, ExtremumSeekingSettings> {
 public:
  /// Throws ParameterError or ShapeError naming the field.
  explicit ExtremumSeeking(ExtremumSeekingSettings settings);

  /// The input to apply in this cycle. Asking again before tell gives the same.
  const Inputs& ask() noexcept;

  /// The operating point has changed: forget window and limits, keep the estimate, hold it again.
  void restart() noexcept;

  /// Last estimate of dJ/dtheta of the maximised objective.
  const Inputs& gradient() const noexcept { return gradient_; }
  double amplitude_share() const noexcept { return share_; }
  /// g_r in use; empty while the first readings are taken.
  Inputs gain() const noexcept;

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
    v("phase", self.phase_, self.settings_.dither.period);
    v("seen", self.seen_, counts_end);
    v("held", self.held_, counts_end);
    v("share", self.share_);
    v("window", self.window_);
    v("mean", self.mean_);
    v("sum", self.sum_);
    v("smooth", self.smooth_);
    v("slow", self.slow_);
    v("origin", self.origin_);
    v("limited_cycles", self.limited_cycles_, counts_end);
    FirstReadings::visit(self.first_, v);
    LastReading::visit(self.last_, v);
  }

 private:
  friend SeekerCore;
  bool judged_together() const noexcept { return first_.open(); }
  void begin_anew() noexcept { restart(); }
  void learn(const Reading& reading, const Inputs& applied) noexcept {
    last_.keep(reading);
    learn_from(reading, applied);
  }
  void miss(const Inputs& applied) noexcept {
    if (first_.open()) {
      first_.skip(applied);
    } else if (last_.stands_in()) {
      learn_from(last_.reading(), applied);
    }
  }
  void learn_from(const Reading& reading, const Inputs& applied) noexcept;
  bool remove_mean(const Reading& reading, const Inputs& applied) noexcept;
  void move(Inputs step, const Inputs& rate) noexcept;
  void end_of_window() noexcept;
  double sign() const noexcept { return settings_.maximize ? 1.0 : -1.0; }

  Dither dither_;
  FirstReadings first_;
  LastReading last_;
  Inputs gradient_;
  std::int64_t phase_ = 0;      // of the window
  std::int64_t seen_ = 0;       // cycles since the last restart
  std::int64_t held_ = 0;       // cycles that the estimate is still held
  double share_ = 1.0;          // amplitude now over the amplitude of the settings
  std::vector<double> window_;  // last M readings of every component (moving average)
  std::vector<double> mean_;    // window sum or washout state, per component
  Inputs sum_;                  // demodulated sum of the window
  Inputs smooth_;
  Inputs slow_;                 // mean of smooth_ over about a window: what steps along a limit
  std::vector<double> origin_;  // first reading of the window, taken off before summing
  std::int64_t limited_cycles_ = 0;
};

}  // namespace mgdd::optimize
