// Bounded extremum seeking (Scheinker and Krstic 2014): the measurement enters only the phase of an oscillation, so
// that no step is ever larger than a omega, whatever J does. One step per cycle:
//   theta_i <- theta_i + a_i omega_i cos(omega_i k - kappa J),    omega_i = 2 pi n_i/M     (J maximised)
// and the mean drifts at kappa a^2 omega/2 times the slope (Lie bracket average). No mean to remove, no filter.
// ask and tell are noexcept and allocation-free.
#pragma once

#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "mgdd/common/record.hpp"
#include "mgdd/optimize/seekers/clamp_watch.hpp"
#include "mgdd/optimize/seekers/constraint_filter.hpp"
#include "mgdd/optimize/seekers/dither.hpp"
#include "mgdd/optimize/seekers/first_readings.hpp"
#include "mgdd/optimize/seekers/seeker.hpp"

namespace mgdd::optimize {

struct BoundedSeekingSettings {
  SearchSpace space;
  DitherSettings dither;          ///< amplitude is the size a of the oscillation
  std::optional<double> kappa{};  ///< phase per unit of J [rad], > 0; none: by `curvature` or first readings
  bool maximize = true;
  std::vector<Limit> limits;
  std::optional<double> curvature{};  ///< J'' if known

  std::vector<std::string> advice() const;
};
inline auto fields_of(const BoundedSeekingSettings&) {
  using S = BoundedSeekingSettings;
  return std::tuple{
      space_fields<&S::space>(),
      dither_fields<&S::dither>(),
      field<&S::kappa>("kappa", "phase per unit of J"),
      field<&S::maximize>("maximize", "False to minimise J"),
      field<&S::limits>("limits", "measured quantities to keep"),
      field<&S::curvature>("curvature", "J'' where it is known"),
  };
}

class BoundedSeeking {
 public:
  explicit BoundedSeeking(BoundedSeekingSettings settings);

  const Inputs& ask() noexcept;
  TellStatus tell(const Reading& reading) noexcept;
  /// New operating point: forget the limits; the estimate goes on.
  void restart() noexcept {
    first_.restart();
    filter_.forget();
    clamp_.forget();
    protocol_.failures.forget();
  }

  /// Mean of the applied input over the last window; the start before there is one.
  const Inputs& estimate() const noexcept { return estimate_; }
  /// Phase per unit of J in use; none while the first readings are taken.
  std::optional<double> kappa() const noexcept;
  const BoundedSeekingSettings& settings() const noexcept { return settings_; }
  /// The input of the last ask; what the plant made of it stands in the reading.
  const Inputs& applied() const noexcept { return protocol_.sent(applied_); }
  const Protocol& protocol() const noexcept { return protocol_; }
  std::size_t component_count() const noexcept { return 1; }
  /// What has been learnt of the limits.
  const ConstraintFilter& filter() const noexcept { return filter_; }
  std::size_t limit_count() const noexcept { return settings_.limits.size(); }

  /// Moves the estimate, within the bounds; `by` is finite. A search that goes on elsewhere is restarted first.
  void shift_estimate(const Inputs& by) noexcept;

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const {
    require_within_space("estimate", estimate_, settings_.space);
    require_within_space("applied", applied_, settings_.space);
    first_.require_usable();
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    Protocol::visit(self.protocol_, v);
    v("applied", self.applied_);
    v("estimate", self.estimate_);
    v("seen", self.seen_);
    v("window", self.window_);
    ConstraintFilter::visit(self.filter_, v);
    ClampWatch::visit(self.clamp_, v);
    FirstReadings::visit(self.first_, v);
  }

 private:
  BoundedSeekingSettings settings_;
  ConstraintFilter filter_;
  ClampWatch clamp_;
  Protocol protocol_;
  FirstReadings first_;
  Inputs applied_, estimate_, omega_;
  InputMatrix metric_;
  std::int64_t seen_ = 0;
  std::vector<double> window_;  // last M applied inputs
};

}  // namespace mgdd::optimize
