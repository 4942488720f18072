// What a seeker, a fit or a learner does when the user says nothing: a change of one of these numbers is a breaking
// change.
#include <gtest/gtest.h>

#include <cmath>

#include "mgdd/optimize/ask_tell/seekers.hpp"
#include "mgdd/optimize/learning/iterative_learning.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"
#include "mgdd/optimize/least_squares/recursive_least_squares.hpp"
#include "support/names.hpp"

namespace mgdd::optimize {
namespace {

TEST(OptimizeNumbers, DefaultsOfAFit) {
  const LeastSquaresOptions o;
  EXPECT_EQ(o.max_iterations, 200);
  EXPECT_EQ(o.cost_tolerance, 1e-12);
  EXPECT_EQ(o.step_tolerance, 1e-10);
  EXPECT_EQ(o.gradient_tolerance, 1e-12);
  EXPECT_EQ(o.initial_damping, 1e-3);
  EXPECT_EQ(o.correlation_limit, 0.98);
  EXPECT_EQ(o.rank_tolerance, 1e-10);
  EXPECT_TRUE(o.evaluate_together);
  EXPECT_EQ(Parameter{}, (Parameter{"", -unlimited, unlimited, false}));
  EXPECT_EQ(IdentifiabilityLimits{}.correlation, 0.98);
  EXPECT_EQ(IdentifiabilityLimits{}.rank_tolerance, 1e-10);
  const RecursiveSettings<2> r;
  EXPECT_EQ(r.start, (Eigen::Vector2d(0.0, 0.0)));
  EXPECT_EQ(r.start_variance, (Eigen::Vector2d(1.0, 1.0)));
  EXPECT_EQ(r.forgetting, 0.998);
  EXPECT_EQ(r.trace_cap, 1e6);
}

void expect_dither(const DitherSettings& d, double amplitude) {
  EXPECT_EQ(d.amplitude, scalar_input(amplitude));
  EXPECT_EQ(d.period, 10);
  EXPECT_EQ(d.harmonics, std::vector<int>{1});
}

TEST(OptimizeNumbers, DefaultsOfTheSeekers) {
  const ExtremumSeekingSettings e;
  EXPECT_EQ(e.space.start, scalar_input(0.0));
  EXPECT_EQ(e.space.lower, scalar_input(-unlimited));
  EXPECT_EQ(e.space.upper, scalar_input(unlimited));
  expect_dither(ExtremumSeeking(e).settings().dither, 1.0);
  EXPECT_EQ(e.form, MeanRemoval::batch);
  EXPECT_EQ(e.gain.size(), 0);
  EXPECT_EQ(e.washout_pole, 0.9);
  EXPECT_EQ(e.low_pass, 1.0);
  EXPECT_EQ(e.components, std::vector<ComponentLag>{ComponentLag{}});
  EXPECT_EQ(ComponentLag{}, (ComponentLag{0.0, 0.0}));
  EXPECT_FALSE(e.hold_cycles || e.curvature);
  EXPECT_EQ(e.amplitude_floor, 1.0);
  EXPECT_EQ(e.full_gradient, 0.0);
  EXPECT_EQ(e.limit_amplitude, 0.5);
  EXPECT_TRUE(e.maximize);
  const GradientDescentSettings g;
  EXPECT_FALSE(g.curvature);
  EXPECT_EQ(g.step_size.size(), 0);
  EXPECT_EQ(GradientDescent(g).settings().difference, scalar_input(1.0));
  EXPECT_EQ(GradientDescent(g).settings().tolerance, scalar_input(0.02));
  EXPECT_EQ(g.iterations, 60);
  EXPECT_TRUE(g.maximize);
  const GoldenSectionSettings s;
  EXPECT_EQ(s.noise_sd, 0.0);
  EXPECT_EQ(s.significance, 2.0);
  EXPECT_EQ(s.samples_max, 8);
  EXPECT_EQ(s.tolerance, 0.0);
  EXPECT_TRUE(s.maximize);
  const Limit limit;
  EXPECT_EQ(limit, (Limit{"", 0.0, 0.0, LimitMethod::switching, 1.0, 0.0}));
}

TEST(OptimizeNumbers, DefaultsOfSpsaByForm) {
  const SpsaSettings s;
  EXPECT_EQ(s.form, SpsaForm::first_order);
  EXPECT_EQ(s.schedule, GainSchedule::decreasing);
  EXPECT_EQ(s.stability, 50.0);
  EXPECT_EQ(s.gain_exponent, 0.602);
  EXPECT_EQ(Spsa(s).settings().perturbation, scalar_input(1.5));
  EXPECT_EQ(s.perturbation_exponent, 0.101);
  EXPECT_EQ(s.averaging, 1);
  EXPECT_FALSE(s.blocking);
  EXPECT_EQ(s.gain.size() + s.step_max.size() + s.initial_hessian.size(), 0);
  EXPECT_FALSE(s.curvature);
  EXPECT_EQ(s.noise_sd, 0.0);
  EXPECT_EQ(s.hessian_prior, 20.0);
  EXPECT_EQ(s.limit_amplitude, 0.5);
  EXPECT_EQ(s.seed, 0u);
  EXPECT_TRUE(s.maximize);
  const auto made = [](SpsaForm form) {
    SpsaSettings t;
    t.form = form;
    t.perturbation = scalar_input(0.9);
    return Spsa(t).settings();
  };
  EXPECT_EQ(made(SpsaForm::first_order).gain.size(), 0);
  EXPECT_EQ(made(SpsaForm::second_order).gain, scalar_input(3.0));
  EXPECT_DOUBLE_EQ(made(SpsaForm::first_order).step_max[0], 1.2);
  EXPECT_DOUBLE_EQ(made(SpsaForm::second_order).step_max[0], 1.2);
}

TEST(OptimizeNumbers, DefaultsOfLearning) {
  const LearningSettings l;
  EXPECT_EQ(l.law, LearningLaw::p);
  EXPECT_EQ(l.lower, -unlimited);
  EXPECT_EQ(l.upper, unlimited);
  EXPECT_EQ(l.rate, unlimited);
  EXPECT_TRUE(l.guard);
  EXPECT_EQ(lifted_ceiling, 1000u);
  EXPECT_EQ(IterativeLearning::history_length, 1000u);
  LearningSettings filtered;
  filtered.initial.assign(20, 0.0);
  filtered.impulse_response = {0.0, 0.0, 0.4, 0.2};
  filtered.law = LearningLaw::q_filter;
  const LearningUpdate law(filtered);
  EXPECT_EQ(law.cutoff(), 0.2);
  EXPECT_EQ(law.lead(), 0u);
  EXPECT_EQ(law.relative_degree(), 2u);
  EXPECT_EQ(law.samples(), 18u);
  EXPECT_EQ(law.taps(), std::vector<double>{0.5 / 0.4});
}

TEST(OptimizeNumbers, NamesOfTheOptions) {
  test::expect_names<MeanRemoval>({{MeanRemoval::batch, "batch"},
                                   {MeanRemoval::moving_average, "moving_average"},
                                   {MeanRemoval::washout, "washout"}});
  test::expect_names<SpsaForm>({{SpsaForm::first_order, "first_order"}, {SpsaForm::second_order, "second_order"}});
  test::expect_names<GainSchedule>({{GainSchedule::decreasing, "decreasing"}, {GainSchedule::constant, "constant"}});
  test::expect_names<LimitMethod>(
      {{LimitMethod::switching, "switching"}, {LimitMethod::penalty, "penalty"}, {LimitMethod::barrier, "barrier"}});
  test::expect_names<LearningLaw>({{LearningLaw::p, "p"},
                                   {LearningLaw::d, "d"},
                                   {LearningLaw::pd, "pd"},
                                   {LearningLaw::q_filter, "q_filter"},
                                   {LearningLaw::norm_optimal, "norm_optimal"}});
}

}  // namespace
}  // namespace mgdd::optimize
