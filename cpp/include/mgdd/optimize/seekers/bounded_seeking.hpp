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
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/seekers/dither.hpp"
#include "mgdd/optimize/seekers/first_readings.hpp"
#include "mgdd/optimize/seekers/seeker_core.hpp"

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

class BoundedSeeking : public SeekerCore<BoundedSeekingSettings> {
 public:
  explicit BoundedSeeking(BoundedSeekingSettings settings);

  const Inputs& ask() noexcept;
  TellStatus tell(const Reading& reading) noexcept;
  /// New operating point: forget the limits; the estimate goes on.
  void restart() noexcept {
    first_.restart();
    forget();
  }

  /// Mean of the applied input over the last window; the start before there is one.
  /// Phase per unit of J in use; none while the first readings are taken.
  std::optional<double> kappa() const noexcept;

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
    SeekerCore::visit_core(self, v);
    v("seen", self.seen_, counts_end);
    v("window", self.window_);
    FirstReadings::visit(self.first_, v);
  }

 private:
  friend SeekerCore;
  void begin_anew() noexcept { restart(); }
  void learn(const Reading& reading, const Inputs& applied) noexcept;
  FirstReadings first_;
  Inputs omega_;
  InputMatrix metric_;
  std::int64_t seen_ = 0;
  std::vector<double> window_;  // last M applied inputs
};

}  // namespace mgdd::optimize
