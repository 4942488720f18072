// What a loop relies on: nothing is allocated, whatever the options.
#include <string>

#include <gtest/gtest.h>

#include "mgdd/loop/virtual_engine.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::loop {
namespace {

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
