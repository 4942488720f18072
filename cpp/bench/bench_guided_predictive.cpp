// One sample of the guided predictive controller, 20 prediction steps and three moves with limits of duty and rate, on
// the virtual throttle: median, p99 and p99.9 of the step beside the forms that it replaces. Double and float.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "mgdd/control/guided_predictive.hpp"
#include "mgdd/loop/virtual_throttle.hpp"

namespace {

using namespace mgdd;
using control::BasicGuidedPredictive;
using control::GuidedPredictiveSettings;

double wanted_deg(int k) {
  if (k % 1000 < 600) return k / 100 % 2 == 0 ? 40.0 : 42.0 + 20.0 * (k / 300 % 2);
  return 40.0 + 15.0 * std::sin(6.28e-3 * k);
}

GuidedPredictiveSettings form(const std::string& name) {
  GuidedPredictiveSettings s;
  s.duty_rate_per_s = 200.0;
  if (name == "learning") return s;
  s.friction_learning = false;
  if (name == "linear") s.prediction = control::Prediction::linear;
  if (name == "converged") s.gauss_newton_steps = 10;
  return s;
}

template <class T>
void step(benchmark::State& state, const std::string& name) {
  loop::VirtualThrottleSettings plant;
  plant.start_deg = 40.0;
  std::vector<double> times;
  for (auto _ : state) {
    loop::VirtualThrottle throttle(plant);
    BasicGuidedPredictive<T> controller(form(name));
    T measured = T(40.0);
    double duty = 0.0;
    for (int k = 0; k < 6000; ++k) {
      const T reference = static_cast<T>(wanted_deg(k));
      const auto start = std::chrono::steady_clock::now();
      const T computed = controller.step(reference, measured);
      times.push_back(std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
      measured = static_cast<T>(throttle.step({duty, plant.throttle.supply_v, 0.0}).sensed.angle_deg);
      duty = static_cast<double>(computed);
    }
  }
  std::ranges::sort(times);
  const auto quantile = [&](double share) { return times[static_cast<std::size_t>(share * double(times.size() - 1))]; };
  state.counters["p50_us"] = quantile(0.5);
  state.counters["p99_us"] = quantile(0.99);
  state.counters["p999_us"] = quantile(0.999);
  state.counters["max_us"] = times.back();
}

const bool registered = [] {
  for (const char* name : {"learning", "plain", "linear", "converged"}) {
    benchmark::RegisterBenchmark((std::string("guided_step/double/") + name).c_str(), step<double>, name);
    benchmark::RegisterBenchmark((std::string("guided_step/float/") + name).c_str(), step<float>, name);
  }
  return true;
}();

}  // namespace
