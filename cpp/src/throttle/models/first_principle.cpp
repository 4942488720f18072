#include "mgdd/throttle/models/first_principle.hpp"

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
  require_positive("ramp_deg", ramp_deg, "deg");
  require_within("substeps", substeps, 1, 100);
  require_within("open_deg", open_deg, closed_deg + 1.0, 180.0, "deg");
  require_within("delay_samples", delay_samples, 0.0, max_delay_samples);
  require_positive("tanh_deg_per_s", tanh_deg_per_s, "deg/s");
  if (friction != Friction::coulomb && friction != Friction::tanh) {
    throw ParameterError("friction", name_of(friction_names(), friction),
                         "must be coulomb or tanh, the groups have one level");
  }
}

dynamics::Values<double, 9> first_principle_of(const Throttle& t) noexcept {
  const PwR p = pw_r_of(t);
  return {p.above.tau_s,
          p.above.gain_deg_per_s2_per_duty,
          p.above.preload_duty,
          p.above.spring_duty_per_deg,
          p.above.coulomb_duty,
          p.below.preload_duty,
          p.below.spring_duty_per_deg,
          t.limp_home_deg,
          1e-3 * t.inductance_mh / (t.resistance_ohm + t.driver_resistance_ohm)};
}

}  // namespace mgdd::throttle
