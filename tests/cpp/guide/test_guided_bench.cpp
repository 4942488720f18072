// A guided seeker in the loops of the virtual bench: a load step with scatter, noise and misfires, every seeker.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "mgdd/guide/feed_forward.hpp"
#include "mgdd/guide/model_optimum.hpp"
#include "mgdd/loop/engine_loop.hpp"
#include "mgdd/optimize/ask_tell/variant_seeker.hpp"
#include "support/seeker_case.hpp"

namespace mgdd::guide {
namespace {

using namespace optimize;

constexpr std::int64_t step_at = 400;

engine::OperatingPoint point_of(double fuel_mg, double duration_cad) {
  engine::OperatingPoint point;
  point.fuel_mg = fuel_mg;
  point.burn_duration_cad = duration_cad;
  return point;
}

loop::EngineBench bench_with_step(std::uint64_t seed) {
  loop::BenchSettings s;
  s.schedule = {{0, point_of(12.0, 24.0)}, {step_at, point_of(30.0, 44.0)}};
  s.misfire_probability = 0.01;
  s.seed = seed;
  return loop::EngineBench(s);
}

/// Mean distance of the applied timing to the optimum in the 60 cycles after the step.
template <class S>
double mean_distance(S& seeker, ModelOptimum* guide, std::uint64_t seed, double optimum) {
  loop::EngineBench bench = bench_with_step(seed);
  double sum = 0.0;
  for (std::int64_t k = 0; k < step_at + 60; ++k) {
    if (guide && (k == 0 || bench.point_changes_at(k))) {
      seeker.offer(guide_value(guide->find(bench.point())), GuideCause::new_point);
    }
    const loop::LoopCycle cycle = loop::loop_step(bench, seeker);
    if (k >= step_at) sum += std::abs(cycle.bench.soc_requested_cad - optimum) / 60.0;
  }
  return sum;
}

TEST(GuidedBench, EverySeekerIsNearTheOptimumSoonerAfterALoadStep) {
  ModelOptimumSettings settings;
  const double optimum = ModelOptimum(settings).find(point_of(30.0, 44.0)).soc_cad;
  settings.cylinder.wall_heat.wall_heat_scale *= 1.3;
  ModelOptimum rough(settings);
  const SearchSpace space{scalar_input(-20.0), scalar_input(-40.0), scalar_input(15.0)};
  for (const auto& [name, any] : every_seeker(space, 0.27, 3)) {
    SCOPED_TRACE(name);
    double guided = 0.0, plain = 0.0;
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
      FeedForward<VariantSeeker> with{VariantSeeker(any)}, without{VariantSeeker(any)};
      guided += mean_distance(with, &rough, seed, optimum) / 8.0;
      plain += mean_distance(without, nullptr, seed, optimum) / 8.0;
      EXPECT_NE(with.path().trust().verdict(), Verdict::wrong);
    }
    if (name == "golden_section") continue;  // it searches its whole bracket anew, with a guide or without
    const double share = name == "gradient_descent" ? 1.0 : 0.75;  // whose steps by the noise are as large as the move
    EXPECT_LT(guided, share * plain) << guided << " against " << plain;
  }
}

}  // namespace
}  // namespace mgdd::guide
