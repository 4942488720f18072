// What tests of the guided engine share: a model with twice the wall heat of the plant, seekers, and cycles on the
// bench.
#pragma once

#include <optional>

#include "mgdd/guide/guided_engine.hpp"
#include "mgdd/loop/virtual_engine.hpp"
#include "support/seeker_case.hpp"
#include "support/test.hpp"

namespace mgdd::guide {

using engine::OperatingPoint;
using optimize::scalar_input;
using optimize::TellStatus;

inline constexpr double plant_best_cad = -5.63;  // of the default cylinder, wall heat 0.5

inline engine::Cylinder rough_cylinder() {
  engine::Cylinder c;
  c.wall_heat.wall_heat_scale = 1.0;
  return c;
}

inline ModelOptimum rough_model() {
  ModelOptimumSettings s;
  s.cylinder = rough_cylinder();
  return ModelOptimum(s);
}

inline CurveSeekingSettings curve_settings(ModelOptimum model, const OperatingPoint& point) {
  CurveSeekingSettings s;
  EXPECT_TRUE(model.tabulate(point, s.curve));
  s.space = {scalar_input(s.curve.best()), scalar_input(-30.0), scalar_input(10.0)};
  return s;
}

inline CurveSeeking curve_seeking(ModelOptimum model, const OperatingPoint& point) {
  return CurveSeeking(curve_settings(std::move(model), point));
}

inline FeedForward<optimize::VariantSeeker> trimmed(double start_cad = -15.0) {
  optimize::ExtremumSeekingSettings s;
  s.space = {scalar_input(start_cad), scalar_input(-30.0), scalar_input(10.0)};
  return FeedForward(optimize::VariantSeeker(optimize::ExtremumSeeking(s)));
}

inline std::optional<OnlineCalibration> calibration() {
  OnlineCalibrationSettings s;
  s.cylinder = rough_cylinder();
  s.window.steady_cycles = 0;
  s.window.window_cycles = 10;
  return std::optional<OnlineCalibration>(std::in_place, s);
}

inline loop::VirtualEngine bench_at(std::vector<loop::ScheduledPoint> schedule, std::uint64_t seed) {
  loop::BenchSettings s;
  s.schedule = std::move(schedule);
  s.pressure.noise_bar = 0.05;
  s.seed = seed;
  return loop::VirtualEngine(s);
}

/// One cycle as 7.2 of the loop has it.
inline double cycle(loop::VirtualEngine& bench, GuidedEngine& guided) {
  guided.at(bench.point());
  const loop::BenchCycle c = bench.step(guided.ask()[0]);
  const double j[] = {c.j};
  const auto trace = bench.pressure();
  EXPECT_EQ(guided.tell({j, {}, c.misfire}, trace.pressure_bar),
            c.misfire ? TellStatus::misfire : TellStatus::accepted);
  return guided.estimate()[0];
}

inline std::vector<double> path_of(loop::VirtualEngine& bench, GuidedEngine& guided, int cycles) {
  std::vector<double> path;
  for (int k = 0; k < cycles; ++k)
    path.push_back(cycle(bench, guided));
  return path;
}

}  // namespace mgdd::guide
