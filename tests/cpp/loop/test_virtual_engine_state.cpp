// What a loop relies on: a restored run goes on bit for bit, bad states are refused, nothing is allocated.
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/loop/virtual_engine.hpp"
#include "support/bench_case.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::loop {
namespace {

using test_support::bits_of;
using test_support::wandering_soc_cad;
using History = std::vector<std::vector<std::uint64_t>>;

static_assert(noexcept(std::declval<VirtualEngine&>().step(0.0)));
static_assert(noexcept(std::declval<VirtualEngine&>().reset(0)));

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

History run(VirtualEngine& bench, int cycles) {
  History out;
  for (int k = 0; k < cycles; ++k)
    out.push_back(bits_of(bench.step(wandering_soc_cad(bench.cycle()))));
  return out;
}

TEST(VirtualEngineState, ARestoredRunContinuesBitForBit) {
  for (const bool delayed : {false, true}) {
    BenchSettings s = eventful();
    s.delay_whole_objective = delayed;
    for (const int cut : {0, 1, 60, 130}) {
      VirtualEngine bench(s);
      run(bench, cut);
      const auto state = save_state(bench);
      const History rest = run(bench, 120);
      s.seed = 99;  // the seed belongs to the state
      VirtualEngine other(s);
      run(other, 33);
      restore_state(other, state);
      EXPECT_EQ(save_state(other), state);
      EXPECT_EQ(run(other, 120), rest) << cut;
      s.seed = 7;
    }
  }
}

TEST(VirtualEngineState, EveryNumberThatIsNotFiniteIsRefusedByName) {
  BenchSettings s = eventful();
  s.delay_whole_objective = true;
  VirtualEngine bench(s);
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

TEST(VirtualEngineState, NothingIsAllocatedWithAnyOption) {
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
