// One ask and one tell of every seeker, with one input and three, without limits and with two. The plant is a
// noise-free parabola, two nanoseconds. Before timing, the seeker must find its vertex; the limits stay slack.
#include <benchmark/benchmark.h>

#include <array>
#include <string>
#include <type_traits>
#include <vector>

#include "mgdd/optimize/ask_tell/seekers.hpp"

namespace {

using namespace mgdd::optimize;

constexpr double bend = -0.0255;
constexpr double start = 4.0, near = 1.5;
constexpr int settling_cycles = 6000;

std::vector<Limit> limits(bool with) {
  if (!with) return {};
  Limit pressure, rise;
  pressure.name = "p_max_bar";
  pressure.upper = 200.0;
  rise.name = "dp_max_bar_per_cad";
  rise.upper = 20.0;
  return {pressure, rise};
}

template <class S>
S make(int inputs, bool with_limits) {
  std::remove_cvref_t<decltype(std::declval<S>().settings())> s;
  s.space.start = Inputs::Constant(inputs, start);
  s.space.lower = Inputs::Constant(inputs, -20.0);
  s.space.upper = Inputs::Constant(inputs, 20.0);
  s.limits = limits(with_limits);
  if constexpr (requires { s.dither; }) {
    if (inputs == 3) {
      s.dither.period = 40;
      s.dither.harmonics = {4, 5, 7};
    }
  }
  const auto for_every_input = [&](Inputs& own) {
    if (own.size() > 0) own = Inputs::Constant(inputs, own[0]);  // empty: the seeker makes its own
  };
  if constexpr (requires { s.gain.size(); }) for_every_input(s.gain);
  if constexpr (std::is_same_v<S, GoldenSection>) s.noise_sd = 0.25;  // goes on around the vertex of a parabola
  return S(s);
}

template <class S>
void cycle(S& seeker, bool with_limits) {
  const Inputs& x = seeker.ask();
  const double j = bend * x.squaredNorm();
  const std::array<double, 2> limited{100.0 + x[0], 8.0 - 0.1 * x[0]};
  const std::span<const double> values = with_limits ? std::span<const double>(limited) : std::span<const double>();
  benchmark::DoNotOptimize(seeker.tell({{&j, 1}, values}));
}

template <class S>
void ask_tell(benchmark::State& state, int inputs, bool with_limits) {
  S seeker = make<S>(inputs, with_limits);
  for (int k = 0; k < settling_cycles; ++k)
    cycle(seeker, with_limits);
  if (!(seeker.estimate().cwiseAbs().maxCoeff() < near)) return state.SkipWithError("the vertex is not found");
  for (auto _ : state)
    cycle(seeker, with_limits);
}

template <class S>
bool add(const std::string& name, int most_inputs = 3) {
  for (const int inputs : {1, 3}) {
    if (inputs > most_inputs) continue;
    for (const bool with_limits : {false, true}) {
      const std::string full =
          "seeker/" + name + "/inputs:" + std::to_string(inputs) + "/limits:" + (with_limits ? "2" : "0");
      benchmark::RegisterBenchmark(full.c_str(),
                                   [=](benchmark::State& state) { ask_tell<S>(state, inputs, with_limits); });
    }
  }
  return true;
}

[[maybe_unused]] const bool registered =
    add<ExtremumSeeking>("extremum_seeking") && add<Spsa>("spsa") && add<GradientDescent>("gradient_descent") &&
    add<GoldenSection>("golden_section", 1) && add<GaussianProcessSeeking>("gaussian_process");

}  // namespace
