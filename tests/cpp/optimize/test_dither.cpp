// The dither and its echo: orthogonality, the phase that sensors add, its compensation, and harmonics that mix.
#include "support/lagged_sensor.hpp"
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

using test_support::LaggedSensor;

DitherSettings window(int period, std::vector<int> harmonics) {
  return {.amplitude = Inputs::Constant(static_cast<Eigen::Index>(harmonics.size()), 1.0),
          .period = period,
          .harmonics = std::move(harmonics)};
}

TEST(Dither, SensorResponseIsThatOfTheDiscreteLag) {
  const auto degrees = [](double delay, double lag, int period) {
    return std::fmod(sensor_response({delay, lag}, 1, period).phase_rad * 180.0 / pi, 360.0);
  };
  EXPECT_NEAR(degrees(42.0, 25.0, 10), 140.5, 0.1);
  EXPECT_NEAR(degrees(34.0, 25.0, 10), 212.5, 0.1);
  EXPECT_EQ(sensor_response({0.0, 0.0}, 1, 10).gain, 1.0);
  EXPECT_EQ(sensor_response({0.0, 0.0}, 3, 10).phase_rad, 0.0);
  EXPECT_NEAR(degrees(38.0, 25.0, 400), 180.0 / pi * (2.0 * pi / 400.0 * 38.0 + std::atan(2.0 * pi / 400.0 * 25.0)),
              0.6);
}

// --- the echo in J, with the estimate held ------------------------------------------------------------------

struct Analyser {
  int delay;
  double lag;
  int period;
  bool compensated;
};

// Mean slope that demodulation reads off a late J while the estimate stays at `at`.
double slope_read(const Analyser& a, double at) {
  ExtremumSeekingSettings s = plain_seeking(at);
  s.dither.period = a.period;
  s.hold_cycles = 1'000'000;
  if (a.compensated) s.components = {{static_cast<double>(a.delay), a.lag}};
  ExtremumSeeking seeker(s);
  LaggedSensor sensor(a.delay, a.lag, quadratic(at));
  const auto late = [&](const Inputs& x) { return sensor.show(quadratic(x[0])); };
  for (int k = 0; k < 20 * a.period + 600; ++k)
    cycle_of(seeker, late);
  while (seeker.protocol().cycle % a.period != 0)
    cycle_of(seeker, late);
  double mean = 0.0;
  for (int k = 0; k < a.period; ++k) {
    cycle_of(seeker, late);
    mean += seeker.gradient()[0] / a.period;
  }
  return mean;
}

TEST(Dither, SignOfTheStepIsThatOfTheCosineOfThePhase) {
  const double at = -8.0, truth = bend * at;
  const std::vector<std::pair<Analyser, bool>> cases{{{0, 0.0, 10, false}, true},    {{42, 25.0, 10, false}, false},
                                                     {{34, 25.0, 10, false}, false}, {{38, 25.0, 120, false}, false},
                                                     {{38, 25.0, 400, false}, true}, {{38, 25.0, 120, true}, true},
                                                     {{38, 25.0, 60, true}, true}};
  for (const auto& [a, rises] : cases) {
    SCOPED_TRACE("D " + std::to_string(a.delay) + ", P " + std::to_string(a.period));
    const SensorResponse r = sensor_response({static_cast<double>(a.delay), a.lag}, 1, a.period);
    const double read = slope_read(a, at);
    EXPECT_EQ(read > 0.0, rises);
    EXPECT_NEAR(read, a.compensated ? truth : truth * r.gain * std::cos(r.phase_rad), 1e-6);
    EXPECT_TRUE(a.compensated || rises == (std::cos(r.phase_rad) > 0.0));
  }
}

TEST(Dither, EachComponentIsTurnedBackByItsOwnPhase) {
  const Inputs at = inputs({3.0, -2.0, 5.0});
  InputMatrix h(3, 3);
  h << -0.06, 0.02, 0.0, 0.02, -0.05, -0.01, 0.0, -0.01, -0.08;
  const Inputs late_slope = inputs({0.2, -0.1, 0.3});
  const auto at_once = [&](const Inputs& x) { return 0.5 * x.dot(h * x); };
  const auto late = [&](const Inputs& x) { return late_slope.dot(x) - 0.01 * x.squaredNorm(); };
  const Inputs truth = h * at + late_slope - 0.02 * at;
  for (const MeanRemoval form : {MeanRemoval::batch, MeanRemoval::moving_average}) {
    ExtremumSeekingSettings s;
    s.space = space_at(at);
    s.dither = window(40, {4, 5, 7});
    s.form = form;
    s.gain = Inputs::Constant(3, 0.2);
    s.hold_cycles = 100'000;
    s.components = {{0.0, 0.0}, {17.0, 6.0}};
    ExtremumSeeking seeker(s);
    LaggedSensor sensor(17, 6.0, late(at));
    Inputs mean = Inputs::Zero(3);
    for (int k = 0; k < 840; ++k) {
      const Inputs x = seeker.ask();
      const double j[] = {at_once(x), sensor.show(late(x))};
      seeker.tell({j, {}, false});
      if (k >= 800) mean += seeker.gradient() / 40.0;
    }
    EXPECT_LT((mean - truth).norm(), form == MeanRemoval::batch ? 1e-3 : 1e-9) << name_of(form);
    EXPECT_LT((seeker.gradient() - truth).norm(), form == MeanRemoval::batch ? 1e-9 : 10.0);
  }
}

}  // namespace
}  // namespace mgdd::optimize
