#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/identify/output_error.hpp"
#include "mgdd/identify/throttle/smooth_fit.hpp"
#include "mgdd/math/dispatch.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::identify {
namespace {

using throttle::smooth_plant_example;
using throttle::SmoothPlant;
using Set = std::array<double, 10>;
using Model = dynamics::Rk4<SmoothPlant>;

struct Log {
  std::array<double, 3> start;
  std::vector<double> duty, angle_deg;
  double noise_deg = 0.0;  // root mean square of the noise that was drawn

  SmoothThrottleRecord record() const { return {1e-3, start, duty, angle_deg}; }
};

// Random levels held 80 samples, then a linear chirp 0.2 to 6 Hz, with a slow pull towards the middle angle.
Log make_log(std::size_t n, double offset, double amplitude, double middle_deg, double start_rad) {
  Log log{{start_rad, 0.0, 0.0}, {}, {}};
  const auto model = Model{}.prepare(smooth_plant_example, 1e-3);
  Values<double, 3> x = log.start;
  double trim = 0.0, squares = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    if (k % 80 == 0) trim = -0.002 * (x[0] * 180.0 / std::numbers::pi - middle_deg);
    const std::size_t half = n / 2;
    const double t = 1e-3 * static_cast<double>(k - half);
    const double phase = 2.0 * std::numbers::pi * (0.2 * t + 0.5 * 5.8 / (1e-3 * static_cast<double>(half)) * t * t);
    const double wave = k < half ? 2.0 * random::uniform(1, 0, k / 80) - 1.0 : std::sin(phase);
    const double noise = 0.05 * random::normal(1, 1, k);
    squares += noise * noise;
    log.duty.push_back(trim + offset + amplitude * wave);
    log.angle_deg.push_back(model.output(x) + noise);
    model.step(x, Values<double, 1>{log.duty.back()});
  }
  log.noise_deg = std::sqrt(squares / static_cast<double>(n));
  return log;
}

Set near_truth(std::uint64_t seed, double half_width) {
  Set set = smooth_plant_example;
  for (std::size_t i = 0; i < 10; ++i)
    set[i] *= 1.0 + half_width * (2.0 * random::uniform(seed, 2, i) - 1.0);
  return set;
}

TEST(SmoothThrottle, TheOnePassKernelHasTheNormalEquationsOfTheDualModel) {
  const Log log = make_log(1500, 0.0, 0.35, 15.0, 0.14);
  const Set set = near_truth(3, 0.2);
  const SimulationRecord record{.dt_s = 1e-3,
                                .input = log.duty,
                                .output = log.angle_deg,
                                .start = {0.14, 0.0, 0.0},
                                .free_start = {},
                                .weight = {}};
  OutputError residual(Model{}, set, std::vector<std::size_t>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}, std::vector{record});
  Eigen::VectorXd r(1500);
  Eigen::MatrixXd j(1500, 10);
  ASSERT_TRUE(residual(residual.start(), r, &j));
  NormalSums sums;
  (void)instruction_set();  // its first call reads the environment, which may allocate
  const test_support::AllocationCounter counter;
  accumulate(SmoothPlant{}, log.record(), 1500, set, sums);
  EXPECT_EQ(counter.count(), 0U);
  EXPECT_NEAR(sums.sum_squares / r.squaredNorm(), 1.0, 1e-12);
  for (Eigen::Index a = 0; a < 10; ++a) {
    const double norm = j.col(a).norm();
    EXPECT_NEAR(sums.gradient[static_cast<std::size_t>(a)] / (norm * r.norm()), j.col(a).dot(r) / (norm * r.norm()),
                1e-12);
    for (Eigen::Index b = 0; b < 10; ++b) {
      const double scale = norm * j.col(b).norm();
      EXPECT_NEAR(sums.jacobian_squared[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)] / scale,
                  j.col(a).dot(j.col(b)) / scale, 1e-12);
    }
  }
}

TEST(SmoothThrottle, EveryLaneHasTheBitsOfASetAlone) {
  const Log log = make_log(400, 0.0, 0.35, 15.0, 0.14);
  std::array<Set, smooth_throttle_lanes> sets{};
  for (std::size_t lane = 0; lane < sets.size(); ++lane)
    sets[lane] = near_truth(10 + lane, 0.3);
  std::array<NormalSums, smooth_throttle_lanes> together;
  accumulate(SmoothPlant{}, log.record(), 400, std::span<const Set, smooth_throttle_lanes>(sets),
             std::span<NormalSums, smooth_throttle_lanes>(together));
  for (std::size_t lane = 0; lane < sets.size(); ++lane) {
    NormalSums alone;
    accumulate(SmoothPlant{}, log.record(), 400, sets[lane], alone);
    EXPECT_EQ(together[lane].sum_squares, alone.sum_squares);
    EXPECT_EQ(together[lane].gradient, alone.gradient);
    EXPECT_EQ(together[lane].jacobian_squared, alone.jacobian_squared);
  }
}

TEST(SmoothThrottle, CondensedRowsKeepTheNormalEquationsAndNullDirections) {
  Eigen::MatrixXd j(40, 3);
  Eigen::VectorXd r(40);
  for (Eigen::Index i = 0; i < 40; ++i) {
    const auto k = static_cast<std::uint64_t>(i);
    j.row(i) << random::normal(5, 0, k), 1e4 * random::normal(5, 1, k), 0.0;
    r[i] = random::normal(5, 2, k);
  }
  Eigen::VectorXd rows;
  Eigen::MatrixXd condensed;
  condense(j.transpose() * j, j.transpose() * r, r.squaredNorm(), rows, condensed);
  ASSERT_EQ(rows.size(), 4);
  EXPECT_NEAR(rows.squaredNorm(), r.squaredNorm(), 1e-12 * r.squaredNorm());
  EXPECT_LT((condensed.transpose() * condensed - j.transpose() * j).norm(), 1e-12 * (j.transpose() * j).norm());
  EXPECT_LT((condensed.transpose() * rows - j.transpose() * r).norm(), 1e-11 * (j.transpose() * r).norm());
  EXPECT_EQ(condensed.col(2).norm(), 0.0);
}

TEST(SmoothThrottle, FarStartsReachTheNoiseFloorAndLanesChangeNothing) {
  const Log log = make_log(20'000, 0.0, 0.35, 15.0, 0.14);
  std::vector<Set> starts;
  for (std::uint64_t s = 0; s < 20; ++s)
    starts.push_back(near_truth(100 + s, 0.5));
  auto options = smooth_throttle_options(smooth_plant_example);
  const auto fit = fit_smooth_throttle({}, log.record(), starts, options);
  EXPECT_GE(fit.n_reached, 19U);
  const optimize::FitReport& best = fit.reports[fit.best];
  EXPECT_LT(best.rmse, 1.005 * log.noise_deg);
  EXPECT_EQ(best.n_residuals, 20'000);
  for (Eigen::Index i = 0; i < 10; ++i) {
    EXPECT_LT(std::abs(best.values[i] - smooth_plant_example[static_cast<std::size_t>(i)]),
              4.5 * best.standard_error[i])
        << best.names[static_cast<std::size_t>(i)];
  }
  // Viscous friction and back-EMF of a motor with little inductance cannot be told apart.
  EXPECT_NE(std::ranges::find(best.unidentifiable, "viscous_nms_per_rad"), best.unidentifiable.end());
  EXPECT_EQ(std::ranges::find(best.unidentifiable, "preload_width_rad"), best.unidentifiable.end());

  options.lanes = false;
  const auto alone = fit_smooth_throttle({}, log.record(), {starts[2]}, options);
  EXPECT_EQ(alone.reports[0].cost, fit.reports[2].cost);
}

TEST(SmoothThrottle, NamesWrongInputBeforeAnyWork) {
  const Log log = make_log(100, 0.0, 0.3, 15.0, 0.14);
  const auto options = smooth_throttle_options(smooth_plant_example);
  Set outside = smooth_plant_example;
  outside[2] = 100.0;
  EXPECT_THROW((void)fit_smooth_throttle({}, log.record(), {outside}, options), ParameterError);
  EXPECT_THROW((void)fit_smooth_throttle({}, log.record(), {}, options), ShapeError);
  SmoothThrottleRecord short_record = log.record();
  short_record.duty = short_record.duty.first(50);
  EXPECT_THROW((void)fit_smooth_throttle({}, short_record, {smooth_plant_example}, options), ShapeError);
  EXPECT_THROW((void)fit_smooth_throttle({.inertia_kgm2 = 0.0}, log.record(), {smooth_plant_example}, options),
               ParameterError);
  EXPECT_NO_THROW((void)fit_smooth_throttle({}, log.record(), {smooth_plant_example}, options));
}

}  // namespace
}  // namespace mgdd::identify
