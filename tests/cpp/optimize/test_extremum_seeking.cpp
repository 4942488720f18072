// Extremum seeking by its laws, and the dither behind a sensor that is late.
#include "support/seeker_case.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

/// Shows its input after a whole number of cycles and through a first-order lag.
class LaggedSensor {
 public:
  /// `delay` cycles, time constant `lag` cycles (0: none), settled on `at`.
  LaggedSensor(int delay, double lag, double at)
      : line_(static_cast<std::size_t>(delay), at), share_(lag > 0.0 ? 1.0 - std::exp(-1.0 / lag) : 1.0), shown_(at) {}

  double show(double value) {
    if (!line_.empty()) {
      std::swap(value, line_[next_]);
      next_ = (next_ + 1) % line_.size();
    }
    return shown_ += share_ * (value - shown_);
  }

 private:
  std::vector<double> line_;
  double share_, shown_;
  std::size_t next_ = 0;
};

// --- laws ---------------------------------------------------------------------------------------------------

// Slope of log|distance| per cycle between equal phases of the dither, distance from the orbit that it settles on.
double log_slope(ExtremumSeekingSettings s) {
  const auto period = static_cast<std::size_t>(s.dither.period);
  ExtremumSeeking seeker(std::move(s));
  const std::vector<double> path = search(seeker, quadratic, 400 * static_cast<int>(period));
  const std::size_t begin = 10 * period, end = 30 * period;  // behind the transient of the start
  return std::log(std::abs((path[end] - path.back()) / (path[begin] - path.back()))) / static_cast<double>(end - begin);
}

TEST(ExtremumSeeking, ApproachIsExponentialWithTheRateOfAveraging) {
  for (const double tau : {40.0, 80.0})
    EXPECT_NEAR(log_slope(plain_seeking(12.0, tau)) * tau, -1.0, 0.06) << "tau " << tau;
}

// In-phase part of (z - 1)/(z - h) at the dither; 1/(1 + ((1 - h)/omega)^2) is its form for slow dithers and h near 1.
TEST(ExtremumSeeking, WashoutSlowsTheApproachByItsGainAtTheDither) {
  const double omega = 2.0 * pi / 10.0;
  for (const double h : {0.9, 0.7}) {
    ExtremumSeekingSettings s = plain_seeking(12.0, 80.0);
    s.form = MeanRemoval::washout;
    s.washout_pole = h;
    const double found = -80.0 * log_slope(s);
    EXPECT_NEAR(found * (1.0 + h * h - 2.0 * h * std::cos(omega)) / ((1.0 + h) * (1.0 - std::cos(omega))), 1.0, 0.02);
    const double slow = found * (1.0 + std::pow((1.0 - h) / omega, 2));
    EXPECT_TRUE(h < 0.9 || std::abs(slow - 1.0) < 0.06) << slow;
  }
}

TEST(ExtremumSeeking, BatchMovesByTheMeanRateOncePerPeriod) {
  ExtremumSeekingSettings s = plain_seeking(3.0);
  s.form = MeanRemoval::batch;
  ExtremumSeeking seeker(s);
  const std::vector<double> path = search(seeker, quadratic, 40);
  for (std::size_t k = 0; k < 10; ++k)
    EXPECT_EQ(path[k], 3.0);
  EXPECT_NEAR(path[10], 3.0 * (1.0 - 10.0 / 40.0), 1e-12);
  EXPECT_EQ(path[19], path[10]);
  EXPECT_NEAR(path[20], path[10] * 0.75, 1e-12);
}

// Averaging of a cubic: the estimate settles at -A^2 J'''/(8 J'') from the optimum, whatever the gain.
TEST(ExtremumSeeking, BiasOfAThirdOrderMapDependsOnTheAmplitudeOnly) {
  const double third = 0.006;
  const auto j = [&](double x) { return quadratic(x) + third * x * x * x / 6.0; };
  for (const MeanRemoval form : {MeanRemoval::batch, MeanRemoval::moving_average}) {
    for (const double tau : {40.0, 80.0, 160.0}) {
      for (const double amplitude : {1.0, 2.0}) {
        ExtremumSeekingSettings s = plain_seeking(1.0);
        s.form = form;
        s.dither.amplitude = scalar_input(amplitude);
        s.gain = scalar_input(gain_for(tau, amplitude));
        ExtremumSeeking seeker(s);
        const std::vector<double> path = search(seeker, j, 3000);
        EXPECT_NEAR(mean_of(path, 2000, 3000), -amplitude * amplitude * third / (8.0 * bend), 0.005);
      }
    }
  }
}

// --- rates ----------------------------------------------------------------------------------------------------

/// Steps of the estimate while J pulls up, with a limit at x <= 2.
struct Steps {
  double up = 0.0;  ///< largest
  double down = 0.0;
  double least_down = unlimited;  ///< smallest one above x = 8, where the way back is long
};
Steps steps_of(ExtremumSeekingSettings s, double start) {
  s.space = space_at(scalar_input(start), 50.0);
  s.limits = {{"p_max_bar", 104.0}};
  ExtremumSeeking seeker(s);
  Steps out;
  for (int k = 0; k < 60; ++k) {
    const double before = seeker.estimate()[0];
    const double x = seeker.ask()[0];
    const double j[] = {0.3 * x}, limited[] = {100.0 + 2.0 * x};
    seeker.tell({j, limited, false});
    const double step = seeker.estimate()[0] - before;
    out.up = std::max(out.up, step);
    out.down = std::max(out.down, -step);
    if (step < 0.0 && seeker.estimate()[0] > 8.0) out.least_down = std::min(out.least_down, -step);
  }
  return out;
}

TEST(ExtremumSeeking, TheWayBackBelowALimitHasItsOwnRate) {
  for (const MeanRemoval form : {MeanRemoval::batch, MeanRemoval::moving_average, MeanRemoval::washout}) {
    const bool batch = form == MeanRemoval::batch;
    const auto expect_back = [&](const ExtremumSeekingSettings& s, double rate) {
      const Steps steps = steps_of(s, 22.0);
      EXPECT_NEAR(steps.down, rate, 1e-12) << name_of(form);
      EXPECT_NEAR(steps.least_down, rate, 1e-12) << name_of(form);
    };
    ExtremumSeekingSettings s;
    s.form = form;
    s.rate = scalar_input(0.02);
    for (const double recovery : {0.11, 0.7, 2.3}) {
      s.recovery_rate = scalar_input(recovery);
      expect_back(s, recovery);
      EXPECT_NEAR(steps_of(s, -20.0).up, batch ? 0.2 : 0.02, 1e-12) << name_of(form) << ": a batch moves once in ten";
    }
    s.recovery_rate = Inputs{};
    expect_back(s, 0.02);
    s.rate = Inputs{};
    s.dither.amplitude = scalar_input(1.7);
    expect_back(s, 1.7);
    EXPECT_NEAR(steps_of(s, -30.0).up, batch ? 1.7 : 0.51, 1e-12) << name_of(form);
  }
  ExtremumSeekingSettings slow;  // a batch comes back as slowly as it is told
  slow.rate = scalar_input(0.5);
  slow.recovery_rate = scalar_input(0.11);
  EXPECT_NEAR(steps_of(slow, 22.0).down, 0.11, 1e-12);
}

// --- dither that vanishes, several inputs -------------------------------------------------------------------

TEST(ExtremumSeeking, DitherShrinksWhereJIsFlatAndComesBackAtANewOperatingPoint) {
  ExtremumSeekingSettings s = plain_seeking(10.0);
  s.form = MeanRemoval::batch;
  s.amplitude_floor = 0.2;
  s.full_gradient = 0.2;
  s.rate = Inputs{};
  ExtremumSeeking seeker(s);
  search(seeker, quadratic, 60);
  EXPECT_GT(seeker.amplitude_share(), 0.95);
  search(seeker, quadratic, 900);
  EXPECT_NEAR(seeker.amplitude_share(), 0.2, 0.01);
  EXPECT_NEAR(seeker.estimate()[0], 0.0, 0.5);
  seeker.restart();
  EXPECT_EQ(seeker.amplitude_share(), 1.0);
  search(seeker, [](double x) { return quadratic(x - 12.0); }, 60);
  EXPECT_GT(seeker.amplitude_share(), 0.95);
  search(seeker, [](double x) { return quadratic(x - 12.0); }, 900);
  EXPECT_NEAR(seeker.estimate()[0], 12.0, 0.5);
}

// A hold of two windows and a half, at the start and again after a restart in the middle of a window: a batch then
// moves at the end of the third window, the moving average as soon as the hold is over.
TEST(ExtremumSeeking, ARestartHoldsTheEstimateAsTheStartDoes) {
  for (const auto& [form, first_move] : {std::pair{MeanRemoval::batch, 30U}, {MeanRemoval::moving_average, 25U}}) {
    ExtremumSeekingSettings s = plain_seeking(6.0);
    s.form = form;
    s.hold_cycles = 25;
    ExtremumSeeking seeker(s);
    for (const bool again : {false, true}) {
      const std::vector<double> path = search(seeker, quadratic, 37);
      EXPECT_EQ(std::ranges::count(path, path.front()), first_move) << name_of(form) << again;
      EXPECT_LT(path.back(), path[first_move - 1]);
      seeker.restart();
    }
  }
}

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
