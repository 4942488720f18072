// From the pedal to the throttle plate, as a torque-based engine controller computes it: pedal -> torque -> air flow ->
// manifold pressure -> opening -> reference of the position controller. Parameters in field units, SI and radians
// inside. `DemandTracker::step` is noexcept and allocation-free. Structure: Tan 2018, figure 2-2; equations: headers of
// this folder.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <tuple>

#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/throttle/demand/bore.hpp"
#include "mgdd/throttle/demand/intake.hpp"
#include "mgdd/throttle/demand/pedal_map.hpp"

namespace mgdd::throttle {

/// How the reference follows the demand.
struct ReferenceShape {
  double pressure_lag_s = 0.05;       ///< of the wanted manifold pressure
  double filling_share = 1.0;         ///< [-] fed forward of the air that fills the manifold on the way
  double lowest_flow_function = 0.1;  ///< [-] Psi is taken no lower
  double highest_ratio = 0.95;        ///< [-] of a measured pressure that the opening is computed from
  double reference_rate_deg_per_s = 800.0;
  double reference_bandwidth_per_s = 80.0;  ///< of the lag behind the rate limit
  double widest_deg = 90.0;

  bool operator==(const ReferenceShape&) const = default;
};

struct DemandChain {
  PedalMap pedal_map{};
  EngineTorque torque{};
  IntakeAir air{};
  ThrottleBore bore{};
  ReferenceShape reference{};

  bool operator==(const DemandChain&) const = default;
};

/// All numbers but the table of the pedal, in the order in which Python shows them.
std::span<const Field<DemandChain>> demand_fields() noexcept;
inline auto fields_of(const DemandChain&) {
  return std::tuple{demand_fields(), field<&DemandChain::pedal_map>(
                                         "pedal_map", "torque that the pedal wants over the speed", DefaultForm::none)};
}

/// ParameterError naming field, value and bound.
void validate(const DemandChain& chain);

/// Steady demand.
struct Demand {
  double torque_nm = 0.0;  ///< wanted
  double air_kg_per_s = 0.0;
  double pressure_pa = 0.0;  ///< in the manifold; above the ambient one where the engine cannot make the torque
  double opening_deg = 0.0;
};

/// One sample of the chain.
struct TrackedDemand {
  double torque_nm = 0.0;      ///< wanted
  double pressure_pa = 0.0;    ///< wanted, lagged
  double air_kg_per_s = 0.0;   ///< into the cylinders at that pressure
  double opening_deg = 0.0;    ///< that lets the air through, with what fills the manifold
  double reference_deg = 0.0;  ///< the same, rate-limited and filtered
};

/// Prepared for evaluation; immutable.
class DemandModel {
 public:
  /// ParameterError for bad parameters.
  explicit DemandModel(const DemandChain& chain);

  const DemandChain& chain() const noexcept { return chain_; }
  const PlateOpening& plate() const noexcept { return plate_; }

  /// Below the first speed of the pedal map the torque that is wanted there; below 300 rpm all is as at these.
  Demand steady(double pedal_percent, double speed_rpm) const noexcept;
  /// The same without the opening.
  Demand wanted(double pedal_percent, double speed_rpm) const noexcept;
  /// Opening that lets an air flow through against a manifold pressure: what lies above `highest_ratio` of the ambient
  /// pressure is taken from `wanted_pa`, and just below it a share of both.
  double opening_deg(double air_kg_per_s, double pressure_pa, double wanted_pa) const noexcept;

 private:
  DemandChain chain_;
  PlateOpening plate_;
};

class DemandTracker {
 public:
  /// ParameterError for bad parameters or a sample time outside [1e-5, 1] s.
  DemandTracker(const DemandChain& chain, double sample_s);

  /// Reference of this sample. Inputs that are not finite repeat the last ones; without any pedal and speed yet the
  /// reference is the angle taken over, else 0; without any measured pressure yet it is the wanted one. The first
  /// demand is taken as steady, so that nothing bumps.
  TrackedDemand step(double pedal_percent, double speed_rpm, double pressure_pa) noexcept;

  /// As made.
  void reset() noexcept;
  /// The next reference goes on from this angle, at the allowed rate. Ignored if it is not finite.
  void take_over(double reference_deg) noexcept;

  const DemandModel& model() const noexcept { return model_; }
  double sample_s() const noexcept { return sample_s_; }

  /// ParameterError for a restored state that cannot be.
  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("pedal_percent", self.pedal_percent_);
    v("speed_rpm", self.speed_rpm_);
    v("pressure_pa", self.pressure_pa_);
    v("wanted_pa", self.wanted_pa_);
    v("limited_deg", self.limited_deg_);
    v("reference_deg", self.reference_deg_);
  }

 private:
  DemandModel model_;
  double sample_s_, pressure_share_, reference_share_, most_deg_;
  std::optional<double> pedal_percent_, speed_rpm_, pressure_pa_;  // of the last sample, once finite
  std::optional<double> wanted_pa_;                                // lagged
  std::optional<double> limited_deg_, reference_deg_;              // behind the rate limit, and behind the filter
};

}  // namespace mgdd::throttle
