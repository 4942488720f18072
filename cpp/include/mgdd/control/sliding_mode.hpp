// Sliding-mode controller of a throttle plate: the duty that keeps the plate on s = 0 by the model, and a law that
// drives s there: a boundary layer, its implicit form, or super-twisting. With y the angle, r_f the filtered reference
// and e = y - r_f:  s = de/dt + bandwidth (e + integral_per_s * integral of e)  [deg/s].
// Angles in deg, duty -1..1, time in s. `step` is noexcept and allocation-free, on double and float.
// Surface and boundary layer: Slotine and Li 1991, chapter 7. Implicit form: Acary and Brogliato 2010. Super-twisting:
// Levant 1993, its root implicit and its sign a narrow saturation (our discrete form). Defaults fit the throttle P1.
#pragma once

#include <cstddef>
#include <span>
#include <tuple>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/control/duty_range.hpp"
#include "mgdd/control/filtered_rate.hpp"
#include "mgdd/control/plate.hpp"

namespace mgdd::control {

/// How s is driven to zero.
enum class ReachingLaw {
  boundary_layer,  ///< switching sat(s/layer); chatters where the layer is thinner than one sample carries s
  implicit,        ///< the backward Euler step of the same: the layer grows by what one sample carries s
  super_twisting,  ///< continuous duty; removes a disturbance whose rate is below `twist_per_s`
};

struct SlidingModeSettings {
  double sample_s = 1e-3;
  ReachingLaw reaching = ReachingLaw::implicit;

  // The model.
  Plate plate{.friction = 0.076};         ///< springs at the measured angle, friction along the reference's rate
  double friction_rate_deg_per_s = 17.2;  ///< at which the friction is full

  // The surface.
  double bandwidth_per_s = 136.0;
  double integral_per_s = 3.03;
  double integral_layers = 3.0;         ///< integrates only while |s| is below so many layers
  double reference_pole_per_s = 170.0;  ///< double pole of the reference's filter
  double derivative_lag_s = 3e-3;       ///< of the measured speed

  // The reaching law.
  double switching = 0.793;                ///< [-] boundary layer and implicit
  double layer_deg = 3.46;                 ///< times bandwidth: the layer of s; 0 only where implicit
  double root_per_root_deg_per_s = 0.015;  ///< [sqrt(s/deg)] super-twisting: duty per sqrt(|s|)
  double twist_per_s = 2.0;                ///< super-twisting: rate of the duty that removes the disturbance

  DutyRange duty{};

  bool operator==(const SlidingModeSettings&) const = default;
};

/// All numbers of the settings, in the order in which Python shows them.
std::span<const Field<SlidingModeSettings>> sliding_mode_fields() noexcept;
inline auto fields_of(const SlidingModeSettings&) {
  return std::tuple{sliding_mode_fields(),
                    field<&SlidingModeSettings::reaching>("reaching", "law that drives the plate to the surface")};
}

/// ParameterError naming field, value and bound.
void validate(const SlidingModeSettings& settings);

template <class T>
class BasicSlidingMode {
 public:
  explicit BasicSlidingMode(const SlidingModeSettings& settings);

  /// Duty of this sample. Inputs that are not finite repeat the last ones; before the first ones it is 0. The filtered
  /// reference starts at the first measurement.
  T step(T reference_deg, T measurement_deg) noexcept;

  /// As made: no integral, no rates.
  void reset() noexcept;

  const SlidingModeSettings& settings() const noexcept { return settings_; }
  T surface_deg_per_s() const noexcept { return surface_; }
  T duty() const noexcept { return duty_; }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    FilteredRate<T>::visit(self.measurement_, Prefixed<V>{v, "measurement_"});
    v("started", self.started_);
    visit_number(v, "reference", self.reference_);
    visit_number(v, "first_filtered", self.first_);
    visit_number(v, "second_filtered", self.second_);
    visit_number(v, "integral_deg_s", self.integral_deg_s_);
    visit_number(v, "twist", self.twist_);
    visit_number(v, "surface_deg_per_s", self.surface_);
    visit_number(v, "duty", self.duty_);
  }

 private:
  struct Reached {
    T duty;   // of the reaching law
    T twist;  // its integral after this sample
  };
  Reached reach() const noexcept;
  T layer() const noexcept;  // of the law [deg/s]

  SlidingModeSettings settings_;
  dynamics::LagPair<T> filter_;
  FilteredRate<T> measurement_;
  bool started_ = false;
  T reference_{0.0};
  T first_{0.0}, second_{0.0};  // the reference behind one lag and behind two
  T integral_deg_s_{0.0};
  T twist_{0.0};
  T surface_{0.0};
  T duty_{0.0};
};

using SlidingMode = BasicSlidingMode<double>;
extern template class BasicSlidingMode<double>;
extern template class BasicSlidingMode<float>;

}  // namespace mgdd::control
