#include "mgdd/throttle/models/first_principle.hpp"

#include <cmath>
#include <numbers>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/throttle/models/pw_r.hpp"

namespace mgdd::throttle {

static_assert(dynamics::DescribedFamily<FirstPrinciple> && dynamics::on_every_scalar<FirstPrinciple>);
static_assert(dynamics::StartsAtRest<FirstPrincipleModel<double>> &&
              dynamics::Liftable<FirstPrincipleModel<double>, Dual<3>>);

void FirstPrinciple::validate() const {
  require_within("closed_deg", closed_deg, -180.0, 179.0, "deg");
  require_within("substeps", substeps, 1, 100);
  require_within("open_deg", open_deg, closed_deg + 1.0, 180.0, "deg");
  require_positive("tanh_deg_per_s", tanh_deg_per_s, "deg/s");
  if (friction != Friction::coulomb && friction != Friction::tanh) {
    throw ParameterError("friction", name_of(friction), "must be coulomb or tanh, the groups have one level");
  }
}

FirstPrinciple::Groups<double> first_principle_of(const Throttle& t) noexcept {
  const PwR p = pw_r_of(t);
  const bool drops = (t.friction == Friction::stribeck || t.friction == Friction::lugre) && t.coulomb_nm > 0.0;
  const double drop = t.stiction_nm / t.coulomb_nm - 1.0;
  const double over_rad = 180.0 / std::numbers::pi;
  return {p.above.tau_s,
          p.above.gain_deg_per_s2_per_duty,
          p.above.preload_duty,
          p.above.spring_duty_per_deg,
          p.above.coulomb_duty,
          p.below.preload_duty,
          p.below.spring_duty_per_deg,
          t.limp_home_deg,
          1e-3 * t.inductance_mh / (t.resistance_ohm + t.driver_resistance_ohm),
          drops ? drop : 0.0,
          over_rad * t.stribeck_rad_per_s,
          t.preload_ramp_deg,
          0.0,
          t.friction == Friction::lugre ? over_rad * t.coulomb_nm / t.bristle_nm_per_rad : 0.0,
          0.5 * t.bristle_damping_nms_per_rad / std::sqrt(t.bristle_nm_per_rad * t.inertia_kgm2),
          t.backlash == Backlash::none ? 0.0 : t.backlash_half_deg,
          t.viscous_nms_per_rad / t.damping_nms_per_rad(),
          0.0,
          0.5};
}

}  // namespace mgdd::throttle
