// The plate that a predictive controller believes: the contract of a model, an exact lag, friction bands of both
// directions, slopes, and the box-constrained step over it.
#include "mgdd/control/plate_model.hpp"

#include <span>

#include "mgdd/control/move_qp.hpp"
#include "mgdd/dynamics/predict.hpp"
#include "support/test.hpp"

namespace mgdd::control {
namespace {

static_assert(dynamics::DiscreteModel<PlateModel<double>> && dynamics::DiscreteModel<PlateModel<float>> &&
              dynamics::DiscreteModel<PlateModel<Dual<3>, double>> && dynamics::StartsAtRest<PlateModel<double>>);

Plate asymmetric() {
  Plate s;
  s.gain_deg_per_s2 = 60000.0;
  s.time_constant_s = 0.025;
  s.electrical_s = 1.3e-3;
  s.spring = {.limp_home_deg = 11.0, .ramp_deg = 0.5, .above = {0.12, 7e-4}, .below = {0.16, 1.1e-3}};
  s.friction = 0.08;
  return s;
}
constexpr PlateBelief<double> uneven{{0.02, 0.07}, {-0.03, 0.05}, 1.2, 0.8};

TEST(Plate, TheLagIsExactForAHeldDuty) {
  const PlateModel<double> model(asymmetric(), 2e-3, PlateFriction::set_valued);
  auto s = model.at_rest(40.0, 0.05);
  double mean = 0.0;
  for (int i = 0; i < 3; ++i) {
    mean += model.mean_torque(s, 0.15) / 3.0;
    model.step(s, 0.15);
  }
  const double decay = std::exp(-6e-3 / 1.3e-3);
  EXPECT_NEAR(s.torque, 0.15 - 0.10 * decay, 1e-15);
  EXPECT_NEAR(mean, 0.15 - 0.10 * (1.0 - decay) * 1.3 / 6.0, 1e-15);
  EXPECT_EQ(s.angle_deg, 40.0);  // 0.15 lies inside the band about the springs' 0.14
}

TEST(Plate, LeavesRestAtTheLevelOfItsSideAndDirection) {
  PlateModel<double> model(asymmetric(), 1e-3, PlateFriction::set_valued);
  model.believe(uneven);
  for (const double angle : {40.0, 4.0}) {
    const bool above = angle > 11.0;
    const double spring = above ? 0.12 + 7e-4 * 29.0 : -0.16 - 1.1e-3 * 7.0;
    const auto duty = model.breakaway(model.at_rest(angle));
    EXPECT_NEAR(duty.up, spring + (above ? 0.09 : 0.02), 1e-12);
    EXPECT_NEAR(duty.down, spring + (above ? -0.05 : -0.08), 1e-12);
    for (const auto& [level, sign] : {std::pair{duty.up, 1.0}, std::pair{duty.down, -1.0}}) {
      auto stuck = model.at_rest(angle, level - sign * 1e-6), free = model.at_rest(angle, level + sign * 1e-6);
      model.step(stuck, level - sign * 1e-6);
      model.step(free, level + sign * 1e-6);
      EXPECT_EQ(stuck.angle_deg, angle);
      EXPECT_GT(sign * (free.angle_deg - angle), 0.0);
    }
  }
}

TEST(Plate, SlidesAtTheSpeedThatItsGainAndTimeConstantGive) {
  Plate s = asymmetric();
  s.spring.above = s.spring.below = {0.0, 0.0};
  s.open_deg = 1e6;
  PlateModel<double> model(s, 1e-3, PlateFriction::set_valued);
  model.believe({{0.02, 0.07}, {}, 1.2, 1.5});  // the gain's factor is the damping's too
  auto state = model.at_rest(40.0, 0.0);
  for (int i = 0; i < 400; ++i)
    model.step(state, 0.4);
  EXPECT_NEAR(state.speed_deg_per_s, 60000.0 * 0.025 / 1.5 * (0.4 - 0.09), 1e-3);
}

TEST(Plate, SlopesAreThoseOfDifferences) {
  for (const PlateFriction form : {PlateFriction::set_valued, PlateFriction::creeping, PlateFriction::none}) {
    PlateModel<double> model(asymmetric(), 2e-3, form);
    model.believe(uneven);
    PlateState<double> start = model.at_rest(14.0, -0.1);
    start.speed_deg_per_s = -150.0;
    const std::array<int, 3> lengths{3, 5, 12};
    const std::array<double, 3> moves{-0.05, 0.1, 0.35};
    std::array<double, 20> output{}, more{}, less{};
    std::array<std::array<double, 3>, 20> slope{}, unused{};
    dynamics::predict<3>(model, start, moves, lengths, std::span<double>(output), std::span(slope));
    for (std::size_t m = 0; m < 3; ++m) {
      auto up = moves, down = moves;
      up[m] += 1e-7;
      down[m] -= 1e-7;
      dynamics::predict<3>(model, start, up, lengths, std::span<double>(more), std::span(unused));
      dynamics::predict<3>(model, start, down, lengths, std::span<double>(less), std::span(unused));
      // The implicit divisors of ramp and creep are held, so their slopes are near, not exact, on the ramp.
      for (std::size_t k = 0; k < 20; ++k) {
        const double difference = (more[k] - less[k]) / 2e-7;
        EXPECT_NEAR(slope[k][m], difference, 1e-4 * std::abs(difference) + 1e-5) << k << ' ' << m;
      }
    }
  }
}

TEST(Plate, AFrozenSideHasNoLimpHome) {
  PlateModel<double> model(asymmetric(), 1e-3, PlateFriction::none);
  model.freeze_side(true);
  const auto slope_at = [&](double angle) {
    auto s = model.at_rest(angle, 0.0);
    model.step(s, 0.0);
    return s.speed_deg_per_s;
  };
  // Linear: the pull grows evenly from 30 deg above to 30 deg below limp-home.
  EXPECT_NEAR(slope_at(-19.0) - slope_at(11.0), slope_at(11.0) - slope_at(41.0), 1e-9);
  EXPECT_LT(slope_at(11.0), 0.0);  // with the whole preload of its side
}

using Qp = MoveQp<double, 3>;

TEST(MoveQp, FindsTheMinimumInTheBox) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  int at_bounds = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    Qp qp;
    for (int row = 0; row < 5; ++row) {
      qp.add(0.5 + std::abs(normal(random)), 3.0 * normal(random),
             {normal(random), 2.0 * normal(random), 0.3 * normal(random)});
    }
    const std::array<double, 3> moves{normal(random), normal(random), normal(random)};
    qp.add_changes(0.7, moves, 0.4);
    Qp::Column low{}, high{};
    for (std::size_t i = 0; i < 3; ++i) {
      low[i] = -std::abs(normal(random)) + 0.3 * normal(random);
      high[i] = low[i] + 1.5 * std::abs(normal(random));
    }
    Qp asked = qp;
    const auto d = asked.solve(low, high, 1.0, 0.0);
    for (std::size_t i = 0; i < 3; ++i) {
      double pull = qp.gradient[i];
      for (std::size_t j = 0; j < 3; ++j)
        pull += (j <= i ? qp.hessian[i][j] : qp.hessian[j][i]) * d[j];
      ASSERT_GE(d[i], low[i]);
      ASSERT_LE(d[i], high[i]);
      // Karush, Kuhn, Tucker: no pull inside, outward at a bound.
      if (d[i] > low[i]) {
        EXPECT_LE(pull, 1e-9) << trial;
      }
      if (d[i] < high[i]) {
        EXPECT_GE(pull, -1e-9) << trial;
      }
      at_bounds += d[i] == low[i] || d[i] == high[i];
    }
  }
  EXPECT_GT(at_bounds, 2000);
}

TEST(MoveQp, ChangesCountFromTheDutyBefore) {
  Qp qp;
  qp.add_changes(2.0, {0.1, 0.4, 0.2}, -0.3);
  // Without any other term the moves go back to the duty before them.
  const auto d = qp.solve({-9.0, -9.0, -9.0}, {9.0, 9.0, 9.0}, 1.0, 0.0);
  EXPECT_NEAR(d[0], -0.4, 1e-12);
  EXPECT_NEAR(d[1], -0.7, 1e-12);
  EXPECT_NEAR(d[2], -0.5, 1e-12);
}

}  // namespace
}  // namespace mgdd::control
