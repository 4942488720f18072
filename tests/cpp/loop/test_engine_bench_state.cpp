// What a loop relies on: the same seed gives the same run however it is cut, nothing is allocated, errors say what to
// do.
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/loop/engine_bench.hpp"
#include "support/bench_case.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::loop {
namespace {

using test_support::bits_of;
using test_support::wandering_soc_cad;
using History = std::vector<std::vector<std::uint64_t>>;

static_assert(noexcept(std::declval<EngineBench&>().step(0.0)));
static_assert(noexcept(std::declval<EngineBench&>().reset(0)));

BenchSettings eventful(std::uint64_t seed = 7) {
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
  s.seed = seed;
  return s;
}

History run(EngineBench& bench, int cycles) {
  History out;
  for (int k = 0; k < cycles; ++k)
    out.push_back(bits_of(bench.step(wandering_soc_cad(bench.cycle()))));
  return out;
}

TEST(EngineBenchState, TheSameSeedGivesTheSameRunAfterResetAndInThreads) {
  EngineBench bench(eventful());
  const History whole = run(bench, 200);
  bench.reset();
  EXPECT_EQ(run(bench, 200), whole);
  std::vector<History> parallel(3);
  std::vector<std::thread> threads;
  threads.reserve(parallel.size());
  for (History& mine : parallel) {
    threads.emplace_back([&mine] {
      EngineBench own(eventful());
      mine = run(own, 200);
    });
  }
  for (std::thread& t : threads)
    t.join();
  for (const History& each : parallel)
    EXPECT_EQ(each, whole);
  bench.reset(8);
  EXPECT_NE(run(bench, 200), whole);
  bench.reset(7);
  EXPECT_EQ(run(bench, 200), whole);
}

TEST(EngineBenchState, ARestoredRunContinuesBitForBit) {
  for (const bool delayed : {false, true}) {
    BenchSettings s = eventful();
    s.delay_whole_objective = delayed;
    for (const int cut : {0, 1, 60, 130}) {
      EngineBench bench(s);
      run(bench, cut);
      const auto state = save_state(bench);
      const History rest = run(bench, 120);
      s.seed = 99;  // the seed belongs to the state
      EngineBench other(s);
      run(other, 33);
      restore_state(other, state);
      EXPECT_EQ(save_state(other), state);
      EXPECT_EQ(run(other, 120), rest) << cut;
      s.seed = 7;
    }
  }
}

TEST(EngineBenchState, ARefusedStateChangesNothing) {
  EngineBench bench(eventful());
  run(bench, 40);
  const auto good = save_state(bench);
  const auto refused = [&](const std::function<void(std::map<std::string, std::vector<double>>&)>& spoil) {
    auto bad = good;
    spoil(bad);
    std::string message = "accepted";
    try {
      restore_state(bench, bad);
    } catch (const ParameterError& error) {
      message = error.what();
    }
    EXPECT_EQ(save_state(bench), good);
    return message;
  };
  EXPECT_NE(refused([](auto& s) { s.erase("fast_line"); }).find("'fast_line' is missing"), std::string::npos);
  EXPECT_NE(refused([](auto& s) { s["last_components"].pop_back(); }).find("'last_components' has"), std::string::npos);
  EXPECT_NE(refused([](auto& s) { s["cycle"][0] = -1.0; }).find("'cycle' = -1"), std::string::npos);
  EXPECT_EQ(refused([](auto& s) { s["seed"][1] = 0.5; }), "state column 'seed' holds 0.5: must be a whole number >= 0");
  EXPECT_NE(refused([](auto& s) { s["component0_line"] = {}; }).find("another kind of object"), std::string::npos);
  EXPECT_NE(refused([](auto& s) { s["analyser_at"] = {1e6}; }).find("'analyser_at' = 1000000"), std::string::npos);
  EXPECT_NE(refused([](auto& s) { s["fast_at"] = {0.5}; }).find("'fast_at' holds 0.5"), std::string::npos);
  restore_state(bench, good);
}

TEST(EngineBenchState, EveryNumberThatIsNotFiniteIsRefusedByName) {
  BenchSettings s = eventful();
  s.delay_whole_objective = true;
  EngineBench bench(s);
  run(bench, 40);
  const StateColumns good = save_state(bench);
  for (const auto& [name, values] : good) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      for (const double spoiled : {std::nan(""), HUGE_VAL}) {
        StateColumns bad = good;
        bad[name][i] = spoiled;
        std::string field = "accepted";
        try {
          restore_state(bench, bad);
        } catch (const ParameterError& error) {
          field = error.field;
        }
        EXPECT_EQ(field, name) << i;
      }
    }
  }
  EXPECT_EQ(save_state(bench), good);
}

TEST(EngineBenchState, NothingIsAllocatedWithAnyOption) {
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
            EngineBench bench(s);
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

TEST(EngineBenchSettings, EveryFieldIsCheckedByName) {
  const auto message = [](const std::function<void(BenchSettings&)>& spoil) -> std::string {
    BenchSettings s;
    spoil(s);
    try {
      const EngineBench bench(s);
    } catch (const ParameterError& error) {
      return error.what();
    }
    return "accepted";
  };
  const auto starts = [&](const std::string& text, const std::function<void(BenchSettings&)>& spoil) {
    EXPECT_EQ(message(spoil).substr(0, text.size()), text);
  };
  EXPECT_EQ(message([](auto&) {}), "accepted");
  starts("bore_mm = -1 mm: must be > 0", [](auto& s) { s.cylinder.geometry.bore_mm = -1.0; });
  starts("step_cad = 9 °CA: must be in", [](auto& s) { s.step_cad = 9.0; });
  starts("schedule is empty: must have", [](auto& s) { s.schedule.clear(); });
  starts("schedule[0].cycle = 4: must be 0", [](auto& s) { s.schedule[0].cycle = 4; });
  starts("schedule[2].cycle = 5: must be > 5", [](auto& s) { s.schedule = {{0, {}}, {5, {}}, {5, {}}}; });
  starts("schedule[0].fuel_mg = 0 mg: must be > 0", [](auto& s) { s.schedule[0].point.fuel_mg = 0.0; });
  starts("schedule[0].speed_rpm = -1 rpm: must be > 0", [](auto& s) { s.schedule[0].point.speed_rpm = -1.0; });
  starts("soc_scatter_cad = 6 °CA: must be in [0, 5]", [](auto& s) { s.soc_scatter_cad = 6.0; });
  starts("efficiency_noise_percent = -1 %: must be in [0, 20]", [](auto& s) { s.efficiency_noise_percent = -1.0; });
  starts("misfire_probability = 1.5: must be in [0, 1]", [](auto& s) { s.misfire_probability = 1.5; });
  starts("soc_drift_cad_per_kcycle = 200 °CA: must be", [](auto& s) { s.soc_drift_cad_per_kcycle = 200.0; });
  starts("wall_heat_drift_per_kcycle = 200: must be", [](auto& s) { s.wall_heat_drift_per_kcycle = 200.0; });
  starts("true_nox.reference_nox_ppm = 0 ppm: must be > 0", [](auto& s) { s.true_nox.proxy.reference_nox_ppm = 0.0; });
  starts("soft_sensor.correction_gain = 2: must be in", [](auto& s) { s.soft_sensor.correction_gain = 2.0; });
  starts("analyser.delay_s = 99 s: must be in", [](auto& s) { s.analyser.delay_s = 99.0; });
  starts("fast_sensor.lag_s = -1 s: must be in", [](auto& s) { s.fast_sensor.lag_s = -1.0; });
  starts("nox_sensor = 'none': the performance uses nox_ppm", [](auto& s) {
    s.performance = engine::efficiency_and_nox();
    s.nox_sensor = NoxSensor::none;
  });
  starts("limits: 'torque' is not measured: must be one of cov_imep_percent, imep_closed_bar",
         [](auto& s) { s.limits = {"torque"}; });
  starts("limits has 9 entries: must be at most 8", [](auto& s) { s.limits.assign(9, "p_max_bar"); });
  EXPECT_THROW(parse_name<NoxSensor>("nox_sensor", "nose"), ParameterError);
  BenchSettings cold;
  cold.cylinder.wall_heat.wall_heat_scale = 100.0;
  cold.schedule[0].point.speed_rpm = 10.0;
  EXPECT_THROW(EngineBench{cold}, ConvergenceError);
}

}  // namespace
}  // namespace mgdd::loop
