// Safeguards of the online calibration, and what a loop relies on: bounded work without allocation, a state that goes
// on bit for bit, refusals that change nothing.
#include "mgdd/common/state.hpp"
#include "mgdd/guide/online_calibration.hpp"
#include "support/calibration_case.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::guide {
namespace {

using test_support::cycle_of;
using test_support::run;
using test_support::steady_bench;
using test_support::sure_of_the_rest;
using test_support::wall;
using test_support::wrong_guide;

static_assert(noexcept(std::declval<OnlineCalibration&>().update()));
static_assert(noexcept(std::declval<OnlineCalibration&>().offer({}, engine::OperatingPoint{}, 0.0)));

constexpr CalibrationMethod every_method[] = {CalibrationMethod::extremum_seeking, CalibrationMethod::gauss_newton,
                                              CalibrationMethod::recursive};

std::vector<double> trace_of(loop::VirtualEngine& bench, double soc_cad = -6.0) {
  bench.step(soc_cad);
  const auto shown = bench.pressure().pressure_bar;
  return {shown.begin(), shown.end()};
}

TEST(OnlineCalibrationLoop, BadCyclesNeverReachIt) {
  using enum CalibrationStatus;
  loop::VirtualEngine bench(steady_bench(0.05));
  OnlineCalibration calibration(wrong_guide(CalibrationMethod::gauss_newton));
  run(bench, calibration, 40);
  const std::vector<double> good = trace_of(bench);
  const auto offered = [&](const std::function<void(std::vector<double>&)>& spoil, bool misfire = false,
                           double soc = -6.0) {
    std::vector<double> bad = good;
    spoil(bad);
    StateColumns before = save_state(calibration);
    const CalibrationStatus status = calibration.offer(bad, {}, soc, misfire);
    EXPECT_EQ(calibration.update(), status);
    StateColumns after = save_state(calibration);
    for (StateColumns* each : {&before, &after}) {
      each->erase("last_offer");
      each->erase("last_status");
    }
    EXPECT_EQ(after, before) << name_of(status);
    return status;
  };
  EXPECT_EQ(offered([](auto& p) { p.pop_back(); }), wrong_size);
  EXPECT_EQ(offered([](auto& p) { p[100] = std::nan(""); }), unusable);
  EXPECT_EQ(offered([](auto& p) { p[0] = HUGE_VAL; }), unusable);
  EXPECT_EQ(offered([](auto&) {}, false, std::nan("")), unusable);
  EXPECT_EQ(offered([](auto& p) {
              for (double& each : p)
                each = std::min(each, 100.0);
            }),
            saturated);
  EXPECT_EQ(offered([](auto&) {}, true), misfire);
  loop::BenchSettings motored = steady_bench();
  motored.misfire_probability = 1.0;
  loop::VirtualEngine unlit(motored);
  const std::vector<double> unburned = trace_of(unlit);
  EXPECT_EQ(offered([&](auto& p) { p = unburned; }), misfire);  // seen, not said
  EXPECT_EQ(calibration.offer(good, {}, -6.0), accepted);
  EXPECT_EQ(calibration.update(), updated);
}

TEST(OnlineCalibrationLoop, WaitsAfterAChangeOfOperatingPoint) {
  using enum CalibrationStatus;
  loop::BenchSettings s = steady_bench();
  engine::OperatingPoint load;
  load.fuel_mg = 26.0;
  s.schedule = {{0, {}}, {30, load}, {100, {}}};
  for (const CalibrationMethod method : every_method) {
    loop::VirtualEngine bench(s);
    OnlineCalibration calibration(sure_of_the_rest(wrong_guide(method)));
    for (int k = 0; k < 140; ++k) {
      const CalibrationVector before = calibration.parameters();
      const CalibrationStatus status = cycle_of(bench, calibration);
      const bool waits = (k >= 30 && k < 50) || (k >= 100 && k < 120);
      EXPECT_EQ(status == unsteady, waits) << k << " " << name_of(status);
      if (k < 9 || (k >= 50 && k < 59)) {
        EXPECT_EQ(status, collecting) << k;
      }
      if (status != updated) {
        EXPECT_EQ(calibration.parameters()[wall], before[wall]) << k;
      }
    }
    EXPECT_NEAR(calibration.parameters()[wall], 0.5, 0.02) << name_of(method);
  }
}

TEST(OnlineCalibrationLoop, FreezesWhereCyclesScatter) {
  loop::BenchSettings s = steady_bench();
  s.soc_scatter_cad = 4.0;
  loop::VirtualEngine bench(s);
  OnlineCalibration calibration(wrong_guide(CalibrationMethod::gauss_newton));
  int frozen = 0;
  for (int k = 0; k < 60; ++k) {
    const CalibrationStatus status = cycle_of(bench, calibration, 8.0);
    frozen += status == CalibrationStatus::cov ? 1 : 0;
    if (status == CalibrationStatus::updated) {
      EXPECT_LT(calibration.cov_percent(), 3.0);
    }
  }
  EXPECT_GT(frozen, 30);
}

TEST(OnlineCalibrationLoop, AJumpIsNotAveragedButLearntAnew) {
  for (const CalibrationMethod method : every_method) {
    loop::VirtualEngine bench(steady_bench(0.05));
    OnlineCalibration calibration(sure_of_the_rest(wrong_guide(method, 0.6)));
    run(bench, calibration, 80);
    EXPECT_NEAR(calibration.parameters()[wall], 0.5, 0.02);
    EXPECT_EQ(calibration.jumps(), 0);
    loop::BenchSettings changed = steady_bench(0.05);
    changed.cylinder.wall_heat.wall_heat_scale = 1.2;
    loop::VirtualEngine other(changed);
    EXPECT_EQ(name_of(cycle_of(other, calibration)), "jump") << name_of(method);
    EXPECT_NEAR(calibration.parameters()[wall], 0.5, 0.02);  // one cycle is not believed
    run(other, calibration, 60);
    EXPECT_EQ(calibration.jumps(), 1) << name_of(method);
    EXPECT_NEAR(calibration.parameters()[wall], 1.2, 0.04) << name_of(method);
    loop::VirtualEngine again(steady_bench(0.05, 8));
    cycle_of(again, calibration);  // a single odd cycle
    run(other, calibration, 30);
    EXPECT_EQ(calibration.jumps(), 1);
    EXPECT_NEAR(calibration.parameters()[wall], 1.2, 0.03);
  }
}

TEST(OnlineCalibrationLoop, StaysInsideItsBounds) {
  for (const CalibrationMethod method : every_method) {
    for (const double truth : {0.0, 4.0}) {
      loop::BenchSettings s = steady_bench(0.02);
      s.cylinder.wall_heat.wall_heat_scale = truth;
      loop::VirtualEngine bench(s);
      OnlineCalibration calibration(sure_of_the_rest(wrong_guide(method)));
      for (int k = 0; k < 100; ++k) {
        cycle_of(bench, calibration);
        EXPECT_GE(calibration.parameters()[wall], 0.2);
        EXPECT_LE(calibration.parameters()[wall], 2.5);
      }
      EXPECT_FALSE(calibration.determined()) << name_of(method) << " " << calibration.explain(wall);
    }
  }
}

TEST(OnlineCalibrationLoop, NothingIsAllocatedAndTheStateGoesOnBitForBit) {
  loop::BenchSettings s = steady_bench(0.2, 4);
  s.soc_scatter_cad = 0.3;
  s.misfire_probability = 0.03;
  engine::OperatingPoint load;
  load.fuel_mg = 26.0;
  s.schedule = {{0, {}}, {70, load}};
  for (const CalibrationMethod method : every_method) {
    for (const int cut : {0, 3, 25, 75, 101}) {
      loop::VirtualEngine bench(s);
      OnlineCalibration whole(wrong_guide(method)), later(wrong_guide(method));
      run(bench, later, 13, -4.0);
      bench.reset();
      for (int k = 0; k < 140; ++k) {
        if (k == cut) {
          const StateColumns state = save_state(whole);
          restore_state(later, state);
          EXPECT_EQ(save_state(later), state);
        }
        const engine::OperatingPoint point = bench.point();
        const loop::BenchCycle c = bench.step(test_support::wandering_soc_cad(k));
        const auto shown = bench.pressure().pressure_bar;
        const test_support::AllocationCounter counter;
        const CalibrationStatus offered = whole.offer(shown, point, c.soc_requested_cad, c.misfire);
        const CalibrationStatus updated = whole.update();
        EXPECT_EQ(counter.count(), 0u);
        if (k >= cut) {
          EXPECT_EQ(later.offer(shown, point, c.soc_requested_cad, c.misfire), offered);
          EXPECT_EQ(later.update(), updated) << k;
          EXPECT_EQ(later.parameters(), whole.parameters()) << name_of(method) << cut << " " << k;
          EXPECT_EQ(later.standard_errors(), whole.standard_errors());
        }
      }
      EXPECT_GT(whole.updates(), 30);
      EXPECT_EQ(save_state(later), save_state(whole));
    }
  }
}

TEST(OnlineCalibrationLoop, ARefusedStateChangesNothing) {
  loop::VirtualEngine bench(steady_bench(0.1));
  OnlineCalibration calibration(wrong_guide(CalibrationMethod::recursive));
  run(bench, calibration, 35);
  const StateColumns good = save_state(calibration);
  StateColumns bad = good;
  bad["parameters"][0] = 9.0;
  EXPECT_THROW(restore_state(calibration, bad), ParameterError);
  bad = good;
  bad["covariance"][n_calibrated + 1] = -1.0;  // a diagonal place
  EXPECT_THROW(restore_state(calibration, bad), ParameterError);
  EXPECT_EQ(save_state(calibration), good);
}

}  // namespace
}  // namespace mgdd::guide
