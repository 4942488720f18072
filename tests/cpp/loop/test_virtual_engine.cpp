// Laws of the virtual bench: its sensors are their closed forms, its chance has its statistics.
#include "mgdd/loop/virtual_engine.hpp"

#include "support/bench_case.hpp"
#include "support/engine_case.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::loop {
namespace {

using test_support::quiet_bench;

engine::Indicators<double> cycle_of(const engine::Cylinder& cylinder, const engine::OperatingPoint& point, double soc) {
  const engine::CycleModel<double> model(cylinder, engine::crank_grid(cylinder));
  engine::CycleWorkspace<double> work = model.make_workspace();
  const engine::Charge<double> charge = model.charge(point);
  model.run(charge, soc, work);
  return model.indicators(charge, soc, work);
}

TEST(VirtualEngine, SensorsStartSteadyAndAnswerAStepInClosedForm) {
  VirtualEngine bench(quiet_bench());
  const BenchCycle first = bench.step(-10.0);
  EXPECT_EQ(first.nox_analyser_ppm, first.nox_true_ppm);
  EXPECT_EQ(first.nox_fast_ppm, first.nox_true_ppm);
  const double before = first.nox_true_ppm;
  const double fast_tau = 0.05 * 1500.0 / 120.0;
  for (int k = 1; k < 200; ++k) {
    const BenchCycle c = bench.step(0.0);
    const double rise = c.nox_true_ppm - before;
    const double slow = k >= 39 ? before + rise * (1.0 - std::exp(-(k - 38.0) / 25.0)) : before;
    const double fast = k >= 2 ? before + rise * (1.0 - std::exp(-(k - 1.0) / fast_tau)) : before;
    ASSERT_NEAR(c.nox_analyser_ppm, slow, 1e-8) << k;
    ASSERT_NEAR(c.nox_fast_ppm, fast, 1e-8) << k;
  }
  EXPECT_EQ(bench.analyser_delay_cycles(), 38u);
  EXPECT_DOUBLE_EQ(bench.analyser_gain(), -std::expm1(-1.0 / 25.0));
}

TEST(VirtualEngine, TheCorrectionFindsTheAnalyserAtItsRate) {
  BenchSettings s = quiet_bench();
  s.soft_sensor.model = s.true_nox;
  s.soft_sensor.model.proxy.reference_nox_ppm *= 1.3;
  VirtualEngine bench(s);
  for (int k = 0; k < 400; ++k) {
    const BenchCycle c = bench.step(-6.0);
    ASSERT_NEAR(std::log(c.nox_soft_corrected_ppm / c.nox_soft_ppm), -std::log(1.3) * (1.0 - std::pow(0.99, k)), 1e-9);
    ASSERT_NEAR(c.nox_soft_ppm / c.nox_true_ppm, 1.3, 1e-12);
  }
}

TEST(VirtualEngine, ATrueProxyIsNotCorrectedEvenInTransients) {
  BenchSettings s = quiet_bench();
  s.soft_sensor.model = s.true_nox;
  VirtualEngine bench(s);
  for (int k = 0; k < 500; ++k) {
    const BenchCycle c = bench.step(test_support::wandering_soc_cad(k));
    ASSERT_NEAR(c.nox_soft_corrected_ppm, c.nox_true_ppm, 1e-9);
  }
}

TEST(VirtualEngine, EachSensorReachesThePerformance) {
  for (const NoxSensor sensor :
       {NoxSensor::analyser, NoxSensor::fast, NoxSensor::soft, NoxSensor::soft_corrected, NoxSensor::true_value}) {
    BenchSettings s = quiet_bench(1.0);
    s.nox_sensor = sensor;
    s.soft_sensor.correction_gain = 0.3;
    VirtualEngine bench(s);
    BenchCycle c;
    for (int k = 0; k < 60; ++k)
      c = bench.step(test_support::wandering_soc_cad(k));
    const double values[] = {c.nox_analyser_ppm, c.nox_fast_ppm, c.nox_soft_ppm, c.nox_soft_corrected_ppm,
                             c.nox_true_ppm};
    EXPECT_EQ(std::count(std::begin(values), std::end(values), -c.components[1]), 1) << name_of(sensor);
    EXPECT_EQ(-c.components[1], values[static_cast<int>(sensor) - 1]) << name_of(sensor);
    EXPECT_EQ(parse_name<NoxSensor>("nox_sensor", name_of(sensor)), sensor);
  }
}

TEST(VirtualEngine, TheWholeObjectiveCanPassTheAnalyser) {
  BenchSettings s = quiet_bench();
  const double before = VirtualEngine(s).step(-10.0).j, after = VirtualEngine(s).step(0.0).j;
  s.delay_whole_objective = true;
  s.analyser.delay_cycles = 7;
  s.analyser.lag_cycles = 3.0;
  VirtualEngine bench(s);
  EXPECT_EQ(bench.step(-10.0).j, before);
  for (int k = 1; k < 40; ++k) {
    const double expected = k >= 8 ? after + (before - after) * std::exp(-(k - 7.0) / 3.0) : before;
    ASSERT_NEAR(bench.step(0.0).j, expected, 1e-9) << k;
  }
}

TEST(VirtualEngine, ScatterAndNoiseHaveTheirStatistics) {
  constexpr int n = 4000;
  BenchSettings s;
  s.analyser.lag_s = s.analyser.delay_s = 0.0;
  VirtualEngine bench(s);
  double soc = 0.0, soc2 = 0.0, eta = 0.0, eta2 = 0.0, both = 0.0, reading2 = 0.0, fast2 = 0.0, cross = 0.0;
  const double swept_m3 = engine::Geometry<double>({}).swept_m3;
  double fast_level = bench.step(-6.0).nox_true_ppm;
  bench.reset(5);
  const double gain = s.fast_sensor.gain_at(1500.0);
  double last_true = 0.0;
  for (int k = 0; k < n; ++k) {
    const BenchCycle c = bench.step(-6.0);
    const double e = 100.0 * (c.indicators.efficiency_gross - cycle_of({}, {}, c.soc_cad).efficiency_gross);
    soc += (c.soc_cad + 6.0) / n;
    soc2 += std::pow(c.soc_cad + 6.0, 2) / n;
    eta += e / n;
    eta2 += e * e / n;
    both += e * (c.soc_cad + 6.0) / n;
    reading2 += std::pow(c.nox_analyser_ppm / c.nox_true_ppm - 1.0, 2) / n;
    if (k > 0) fast_level += gain * (last_true - fast_level);
    if (k > 20) fast2 += std::pow(c.nox_fast_ppm / fast_level - 1.0, 2) / (n - 21);
    cross += (c.nox_analyser_ppm / c.nox_true_ppm - 1.0) * (c.nox_fast_ppm / fast_level - 1.0) / n;
    last_true = c.nox_true_ppm;
    ASSERT_NEAR(c.indicators.imep_gross_bar * swept_m3 * 1e5, c.indicators.work_gross_j, 1e-9);
    ASSERT_NEAR(c.indicators.imep_closed_bar * swept_m3 * 1e5, c.indicators.work_closed_j, 1e-9);
    ASSERT_NEAR(c.indicators.efficiency_gross, c.indicators.work_gross_j / 856.0, 1e-12);
  }
  const double four = 4.0 / std::sqrt(static_cast<double>(n));
  EXPECT_NEAR(soc, 0.0, 0.3 * four);
  EXPECT_NEAR(eta, 0.0, 0.25 * four);
  EXPECT_NEAR(std::sqrt(soc2), 0.3, 0.3 * four);
  EXPECT_NEAR(std::sqrt(eta2), 0.25, 0.25 * four);
  EXPECT_NEAR(cross, 0.0, 0.01 * 0.03 * four);
  EXPECT_NEAR(both, 0.0, 0.3 * 0.25 * four);
  EXPECT_NEAR(std::sqrt(reading2), 0.01, 0.01 * four);
  EXPECT_NEAR(std::sqrt(fast2), 0.03, 0.03 * four);
}

TEST(VirtualEngine, AMisfireBurnsNothing) {
  constexpr int n = 4000;
  BenchSettings s = quiet_bench();
  s.misfire_probability = 0.1;
  VirtualEngine bench(s);
  engine::OperatingPoint motored;
  motored.fuel_mg = 0.0;
  const auto dead = cycle_of({}, motored, -6.0);
  const auto fired = cycle_of({}, {}, -6.0);
  int misfires = 0, pairs = 0;
  bool last = false;
  for (int k = 0; k < n; ++k) {
    const BenchCycle c = bench.step(-6.0);
    misfires += c.misfire;
    pairs += c.misfire && last;
    last = c.misfire;
    EXPECT_EQ(c.indicators.imep_gross_bar, (c.misfire ? dead : fired).imep_gross_bar);
    EXPECT_EQ(c.indicators.p_max_bar, (c.misfire ? dead : fired).p_max_bar);
    if (!c.misfire) continue;
    EXPECT_DOUBLE_EQ(c.indicators.efficiency_gross, dead.work_gross_j / 856.0);
    EXPECT_LT(c.nox_true_ppm, 1.0);
    EXPECT_TRUE(std::isfinite(c.j));
  }
  EXPECT_NEAR(misfires, 0.1 * n, 4.0 * std::sqrt(0.09 * n));
  EXPECT_NEAR(pairs, 0.01 * n, 4.0 * std::sqrt(0.0099 * n));
}

TEST(VirtualEngine, DriftMovesTimingAndWallHeat) {
  BenchSettings s = quiet_bench();
  s.soc_drift_cad_per_kcycle = 2.0;
  s.wall_heat_drift_per_kcycle = 0.4;
  VirtualEngine bench(s);
  BenchCycle c;
  for (int k = 0; k <= 500; ++k)
    c = bench.step(-6.0);
  EXPECT_DOUBLE_EQ(c.soc_cad, -5.0);
  engine::Cylinder worn;
  worn.wall_heat.wall_heat_scale = 0.7;
  EXPECT_DOUBLE_EQ(c.indicators.efficiency_gross, cycle_of(worn, {}, -5.0).efficiency_gross);
  bench.reset(0);
  EXPECT_EQ(bench.step(-6.0).indicators.efficiency_gross, cycle_of({}, {}, -6.0).efficiency_gross);
}

TEST(VirtualEngine, TheScheduleChangesThePointAndSaysSo) {
  BenchSettings s = quiet_bench();
  engine::OperatingPoint warm, fast, little;
  warm.intake_temperature_k = 330.0;
  fast.speed_rpm = 3000.0;
  little.speed_rpm = 3000.0;
  little.fuel_mg = 20.8;
  s.schedule = {{0, {}}, {3, warm}, {5, fast}, {8, little}};
  VirtualEngine bench(s);
  for (std::int64_t k = 0; k < 12; ++k) {
    const engine::OperatingPoint& expected = k < 3 ? engine::OperatingPoint{} : k < 5 ? warm : k < 8 ? fast : little;
    EXPECT_EQ(bench.point(), expected);
    EXPECT_EQ(bench.point_at(k), expected);
    EXPECT_EQ(bench.analyser_delay_cycles(), k < 5 ? 38u : 75u);
    const BenchCycle c = bench.step(-6.0);
    EXPECT_EQ(c.indicators.imep_gross_bar, cycle_of({}, expected, -6.0).imep_gross_bar);
    EXPECT_EQ(c.operating_point_changed, k == 5) << k;  // 4 % more fuel is not a change
  }
}

TEST(VirtualEngine, RequestsOutsideTheWindowAreClampedAndFlagged) {
  VirtualEngine bench(quiet_bench());
  EXPECT_EQ(bench.window_cad(), (std::array<double, 2>{-60.0, 20.0}));
  EXPECT_EQ(bench.step(-61.0).soc_cad, -60.0);
  EXPECT_FALSE(bench.step(-7.0).clamped);
  const BenchCycle lost = bench.step(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(lost.soc_cad, -7.0);
  EXPECT_TRUE(lost.clamped);
  const BenchCycle late = bench.step(std::numeric_limits<double>::infinity());
  EXPECT_EQ(late.soc_cad, 20.0);
  EXPECT_TRUE(late.clamped);
  engine::Cylinder narrow;
  narrow.geometry.ivc_cad = -40.0;
  narrow.geometry.evo_cad = 15.0;
  EXPECT_EQ(timing_window(narrow)[0], -40.0);
  EXPECT_LT(timing_window(narrow)[1], 15.0);
}

TEST(VirtualEngine, LimitsAreTheMeasuredValues) {
  BenchSettings s;
  s.limits = {"p_max_bar", std::string(cov_imep_name), "dp_max_bar_per_cad", "t_max_k"};
  VirtualEngine bench(s);
  std::vector<double> imep;
  for (int k = 0; k < 120; ++k) {
    const BenchCycle c = bench.step(-6.0);
    imep.push_back(c.indicators.imep_gross_bar);
    ASSERT_EQ(c.limits().size(), 4u);
    EXPECT_EQ(c.limits()[0], c.indicators.p_max_bar);
    EXPECT_EQ(c.limits()[2], c.indicators.dp_max_bar_per_cad);
    EXPECT_EQ(c.limits()[3], c.indicators.t_max_k);
    const std::vector<double> window(imep.end() - std::min<std::ptrdiff_t>(50, std::ssize(imep)), imep.end());
    double mean = 0.0, squares = 0.0;
    for (const double x : window)
      mean += x / static_cast<double>(window.size());
    for (const double x : window)
      squares += std::pow(x - mean, 2);
    const double cov = k == 0 ? 0.0 : 100.0 * std::sqrt(squares / static_cast<double>(window.size() - 1)) / mean;
    EXPECT_NEAR(c.limits()[1], cov, 1e-10) << k;
  }
}

TEST(VirtualEngine, AnImpossibleCycleIsFlaggedAndRepeatsTheLastValue) {
  BenchSettings s = quiet_bench();
  s.schedule.front().point.speed_rpm = 50.0;
  s.step_cad = 5.0;
  s.wall_heat_drift_per_kcycle = 100.0;
  VirtualEngine bench(s);
  BenchCycle last = bench.step(-6.0), c = last;
  while (!(c = bench.step(-6.0)).unphysical && c.cycle < 1000)
    last = c;
  ASSERT_TRUE(c.unphysical);
  EXPECT_EQ(c.j, last.j);
  EXPECT_EQ(c.nox_true_ppm, last.nox_true_ppm);
  EXPECT_TRUE(std::isnan(c.indicators.imep_gross_bar));
}

// --- real time ------------------------------------------------------------------------------------------------

static_assert(noexcept(std::declval<VirtualEngine&>().step(0.0)));
static_assert(noexcept(std::declval<VirtualEngine&>().reset(0)));

BenchSettings eventful() {
  BenchSettings s;
  s.performance = engine::efficiency_and_nox();
  s.nox_sensor = NoxSensor::soft_corrected;
  s.misfire_probability = 0.03;
  s.soc_drift_cad_per_kcycle = 1.0;
  s.wall_heat_drift_per_kcycle = 0.2;
  s.limits = {"p_max_bar", std::string(cov_imep_name)};
  engine::OperatingPoint fast;
  fast.speed_rpm = 2000.0;
  s.schedule = {{0, {}}, {90, fast}};
  s.seed = 7;
  return s;
}

TEST(VirtualEngine, AllocatesNothingWithAnyOption) {
  int combinations = 0;
  for (const NoxSensor sensor : {NoxSensor::none, NoxSensor::analyser, NoxSensor::fast, NoxSensor::soft,
                                 NoxSensor::soft_corrected, NoxSensor::true_value}) {
    for (const bool delayed : {false, true}) {
      for (const double chance : {0.0, 1.0}) {
        for (const double drift : {0.0, 1.0}) {
          for (const auto shape : {engine::BurnShape::triangle, engine::BurnShape::double_wiebe}) {
            BenchSettings s = eventful();
            if (sensor == NoxSensor::none) s.performance = engine::efficiency_only();
            s.nox_sensor = sensor;
            s.delay_whole_objective = delayed;
            s.soc_scatter_cad *= chance;
            s.efficiency_noise_percent *= chance;
            s.misfire_probability = 0.3 * chance;
            s.soc_drift_cad_per_kcycle = s.wall_heat_drift_per_kcycle = drift;
            s.cylinder.burn.burn_shape = shape;
            s.schedule.back().cycle = 2;
            VirtualEngine bench(s);
            const test_support::AllocationCounter counter;
            for (int k = 0; k < 6; ++k) {
              bench.step(-60.0 + 20.0 * k);
              if (k == 4) bench.reset(3);
            }
            EXPECT_EQ(counter.count(), 0u) << name_of(sensor);
            ++combinations;
          }
        }
      }
    }
  }
  EXPECT_EQ(combinations, 96);
}

}  // namespace
}  // namespace mgdd::loop
