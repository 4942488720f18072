// What a predictive controller asks once per period: 20 samples of 2 ms under three moves with exact slopes, on PW-R
// and on the first-principle groups with electrical lag, in double and float.
// Before timing, the slopes must agree with differences to 1e-4.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>

#include "mgdd/dynamics/predict.hpp"
#include "mgdd/throttle/models/first_principle.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace {

using namespace mgdd;
using namespace mgdd::throttle;

constexpr std::size_t samples = 20;
constexpr std::array<int, 3> lengths{4, 6, 10};

template <class S>
auto pw_r() {
  PwR p;
  p.frame.sample_s = 2e-3;
  p.frame.substeps = 1;
  return BasicPwRModel<S>(lift<S>(p));
}

template <class S>
auto groups() {
  FirstPrinciple family;
  family.substeps = 1;
  const auto values = first_principle_of(Throttle{});
  FirstPrinciple::Groups<S> p{};
  for (std::size_t i = 0; i < p.size(); ++i)
    p[i] = static_cast<S>(values[i]);
  return family.prepare(p, 2e-3);
}

template <class M>
struct Horizon {
  using S = typename M::Scalar;
  std::array<S, samples> angle{};
  std::array<std::array<S, 3>, samples> slope{};

  void run(const M& model, const typename M::State& start, const std::array<S, 3>& moves) {
    dynamics::predict<3>(model, start, moves, lengths, angle, slope);
  }
};

template <class M>
bool agrees(const M& model, const typename M::State& start) {
  using S = typename M::Scalar;
  const std::array<S, 3> moves{S(0.4), S(0.2), S(0.25)};
  Horizon<M> at, up, down;
  at.run(model, start, moves);
  for (std::size_t m = 0; m < 3; ++m) {
    auto more = moves, less = moves;
    const S h = S(1e-3);
    more[m] += h;
    less[m] -= h;
    up.run(model, start, more);
    down.run(model, start, less);
    const S expected = (up.angle[samples - 1] - down.angle[samples - 1]) / (S(2) * h);
    if (!(std::abs(at.slope[samples - 1][m] - expected) < S(1e-2) * (S(1) + std::abs(expected)))) return false;
  }
  return true;
}

template <class M>
void horizon(benchmark::State& state, const M& model) {
  using S = typename M::Scalar;
  const auto start = model.at_rest(S(20));
  if (!agrees(model, start)) state.SkipWithError("slopes and differences differ");
  std::array<S, 3> moves{S(0.4), S(0.2), S(0.25)};
  Horizon<M> out;
  for (auto _ : state) {
    benchmark::DoNotOptimize(moves);
    out.run(model, start, moves);
    benchmark::DoNotOptimize(out);
  }
}
void pw_r_double(benchmark::State& state) {
  horizon(state, pw_r<double>());
}
void pw_r_float(benchmark::State& state) {
  horizon(state, pw_r<float>());
}
void groups_double(benchmark::State& state) {
  horizon(state, groups<double>());
}
void groups_float(benchmark::State& state) {
  horizon(state, groups<float>());
}
BENCHMARK(pw_r_double);
BENCHMARK(pw_r_float);
BENCHMARK(groups_double);
BENCHMARK(groups_float);

}  // namespace
