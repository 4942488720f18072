// Identification of pseudo-Wiener models: exact recovery, unmodelled dynamics, coverage, ranking of the three kinds.
#include <gtest/gtest.h>

#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/identify/throttle/pseudo_wiener_fit.hpp"
#include "support/throttle_records.hpp"

namespace mgdd::identify {
namespace {

using test_support::Signal;
using throttle::PwR;

const std::array<double, 5> truth{0.0197, 83597.0, 0.1292, 4.96e-4, 0.0927};  // tau, G, beta, kappa, delta

/// The start from which the printed recovery figures were found.
PwR far_start() {
  PwR p;
  for (auto* s : {&p.above, &p.below}) {
    s->tau_s = 0.03;
    s->gain_deg_per_s2_per_duty = 5e4;
    s->preload_duty = 0.1;
    s->spring_duty_per_deg = 1e-3;
    s->coulomb_duty = 0.05;
  }
  return p;
}

PseudoWienerFitOptions one_search() {
  PseudoWienerFitOptions o;
  o.only_given_start = true;
  return o;
}

template <class P>
Signal free_run(const P& p, const Signal& duty, double start_deg) {
  const auto model = throttle::model_of(p);
  auto state = model.at_rest(start_deg, 0.0);
  Signal y(duty.size());
  dynamics::simulate(model, state, std::span<const double>(duty), std::span<double>(y));
  return y;
}
Signal free_run(const throttle::PseudoWiener& p, const Signal& duty, double start_deg) {
  return std::visit([&](const auto& q) { return free_run(q, duty, start_deg); }, p);
}

TEST(PseudoWienerFit, StaysCloseBehindNoiseInductanceAndStribeckFriction) {
  const auto log =
      test_support::throttle_log(test_support::log_throttle(), test_support::chirp(0.15, 0.20, 0.2, 6.0, 12.0), 1);
  const auto fit = fit_pseudo_wiener({{log.duty, log.angle_deg}}, far_start(), one_search());
  const std::array<double, 5> share{0.08, 0.05, 0.01, 0.08, 0.04};
  for (int i = 0; i < 5; ++i) {
    const double expected = truth[static_cast<std::size_t>(i)];
    EXPECT_NEAR(fit.report.values[i], expected, share[static_cast<std::size_t>(i)] * expected) << i;
  }
  EXPECT_GE(test_support::fit_percent(log.angle_deg, free_run(fit.model, log.duty, log.angle_deg[0])), 98.0);
}

TEST(PseudoWienerFit, SidesAreFittedApartFromOneLog) {
  PwR two;
  two.below.preload_duty = 0.16;
  two.below.spring_duty_per_deg = 3e-3;
  two.limp_home_deg = 30.0;
  const Signal duty = test_support::chirp(0.0, 0.30, 0.3, 5.0, 8.0);
  PwR start = two;
  start.below = start.above;
  PseudoWienerFitOptions o = one_search();
  o.sides = Sides::both;
  o.search.cost_tolerance = 1e-14;
  o.free = {"preload_duty", "spring_duty_per_deg", "coulomb_duty"};
  const auto fit = fit_pseudo_wiener({{duty, free_run(two, duty, 30.0)}}, start, o);
  ASSERT_EQ(fit.report.names.size(), 6u);
  const PwR& found = std::get<PwR>(fit.model);
  EXPECT_NEAR(found.below.preload_duty, 0.16, 3e-4);
  EXPECT_NEAR(found.below.spring_duty_per_deg, 3e-3, 3e-5);
  EXPECT_NEAR(found.above.preload_duty, 0.1292, 1e-4);
}

}  // namespace
}  // namespace mgdd::identify
