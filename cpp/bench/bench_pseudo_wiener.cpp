// Speed of the pseudo-Wiener models: one sample, one sample of four lanes, and a horizon with sensitivities.
#include <benchmark/benchmark.h>

#include <array>
#include <vector>

#include "mgdd/dynamics/predict.hpp"
#include "mgdd/math/dispatch.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace {

using namespace mgdd;
using namespace mgdd::throttle;

template <class P>
P example() {
  P p;
  if constexpr (std::is_same_v<P, PwW>) p.rise_deg.fill(12.0);
  if constexpr (std::is_same_v<P, PwP>) {
    p.radius_duty[0] = 0.05;
    p.gain_deg_per_duty[0] = 150.0;
  }
  p.frame.substeps = 1;
  return p;
}

template <class P, class T>
void sample(benchmark::State& state) {
  const auto model = model_of(lift<T>(example<P>()));
  auto s = model.at_rest(T(20.0), T(0.0));
  double duty = 0.1;
  for (auto _ : state) {
    model.step(s, T(duty));
    duty = 0.5 - duty;
    benchmark::DoNotOptimize(s);
  }
}
BENCHMARK(sample<PwR, double>);
BENCHMARK(sample<PwW, double>);
BENCHMARK(sample<PwP, double>);
BENCHMARK(sample<PwR, Dual<5>>);

// Lanes pay off only in a function that is compiled per instruction set.
MGDD_INLINE void run_lanes(const BasicPwRModel<Lanes<8>>& model, BasicPwRState<Lanes<8>>& state, int samples) noexcept {
  for (int k = 0; k < samples; ++k)
    model.step(state, Lanes<8>(k % 200 < 100 ? 0.35 : 0.1));
}
void eight_lanes(benchmark::State& state) {
  const auto model = model_of(lift<Lanes<8>>(example<PwR>()));
  auto s = model.at_rest(Lanes<8>(20.0), Lanes<8>(0.0));
  for (auto _ : state) {
    dispatch([&]() MGDD_INLINE_LAMBDA { run_lanes(model, s, 1000); });
    benchmark::DoNotOptimize(s);
  }
  state.counters["ns_per_sample_and_lane"] =
      benchmark::Counter(8000.0 * static_cast<double>(state.iterations()) * 1e-9,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(eight_lanes);

// 20 samples of 2 ms in three moves, as a predictive controller asks once per period.
template <class P>
void horizon(benchmark::State& state) {
  P p = example<P>();
  p.frame.sample_s = 2e-3;
  const auto model = model_of(p);
  const auto start = model.at_rest(20.0, 0.0);
  const std::array<double, 3> moves{0.4, 0.2, 0.25};
  const std::array<int, 3> lengths{4, 6, 10};
  std::array<double, 20> angle{};
  std::array<std::array<double, 3>, 20> slope{};
  for (auto _ : state) {
    dynamics::predict<3>(model, start, moves, lengths, angle, slope);
    benchmark::DoNotOptimize(slope);
  }
  state.counters["ns_per_step"] = benchmark::Counter(20.0 * static_cast<double>(state.iterations()) * 1e-9,
                                                     benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(horizon<PwR>);
BENCHMARK(horizon<PwW>);
BENCHMARK(horizon<PwP>);

}  // namespace
