// One sweep of the smooth throttle's normal equations over 20 000 samples: one parameter set, eight in lanes, and the
// same by duals with stored rows. Before timing, the three must agree to 1e-10.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/identify/output_error.hpp"
#include "mgdd/identify/throttle/smooth_kernel.hpp"
#include "mgdd/math/dispatch.hpp"

namespace {

using namespace mgdd;
using namespace mgdd::identify;
using throttle::smooth_plant_example;
using throttle::SmoothPlant;
using Set = std::array<double, 10>;

constexpr std::size_t n_samples = 20'000;

struct Log {
  std::vector<double> duty, angle_deg;
  SmoothThrottleRecord record() const { return {1e-3, {0.14, 0.0, 0.0}, duty, angle_deg}; }
};

const Log& log() {
  static const Log made = [] {
    Log l;
    const auto model = dynamics::Rk4<SmoothPlant>{}.prepare(smooth_plant_example, 1e-3);
    Values<double, 3> x{0.14, 0.0, 0.0};
    for (std::size_t k = 0; k < n_samples; ++k) {
      l.duty.push_back(0.7 * random::uniform(1, 0, k / 80) - 0.35 - 0.1 * (x[0] - 0.26));
      l.angle_deg.push_back(model.output(x) + 0.05 * random::normal(1, 1, k));
      model.step(x, Values<double, 1>{l.duty.back()});
    }
    return l;
  }();
  return made;
}

Set shifted(double factor) {
  Set set = smooth_plant_example;
  for (double& value : set)
    value *= factor;
  return set;
}

OutputError<dynamics::Rk4<SmoothPlant>> dual_residual() {
  SimulationRecord record;
  record.dt_s = 1e-3;
  record.input = log().duty;
  record.output = log().angle_deg;
  record.start = {0.14, 0.0, 0.0};
  return {
      dynamics::Rk4<SmoothPlant>{}, shifted(1.02), std::vector<std::size_t>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}, {record}};
}

bool agree() {
  auto residual = dual_residual();
  Eigen::VectorXd r(residual.n_residuals());
  Eigen::MatrixXd j(residual.n_residuals(), 10);
  NormalSums sums;
  accumulate(SmoothPlant{}, log().record(), n_samples, shifted(1.02), sums);
  if (!residual(residual.start(), r, &j)) return false;
  return std::abs(sums.sum_squares / r.squaredNorm() - 1.0) < 1e-10 &&
         std::abs(sums.jacobian_squared[3][5] / j.col(3).dot(j.col(5)) - 1.0) < 1e-8;
}

void one_set(benchmark::State& state) {
  if (!agree()) state.SkipWithError("kernel and duals differ");
  NormalSums sums;
  for (auto _ : state) {
    accumulate(SmoothPlant{}, log().record(), n_samples, shifted(1.02), sums);
    benchmark::DoNotOptimize(sums);
  }
  state.SetLabel(std::string(name_of(instruction_set())));
}
BENCHMARK(one_set)->Unit(benchmark::kMillisecond);

void eight_sets(benchmark::State& state) {
  std::array<Set, smooth_throttle_lanes> sets;
  for (std::size_t lane = 0; lane < sets.size(); ++lane)
    sets[lane] = shifted(1.0 + 0.01 * static_cast<double>(lane));
  std::array<NormalSums, smooth_throttle_lanes> sums;
  for (auto _ : state) {
    accumulate(SmoothPlant{}, log().record(), n_samples, std::span<const Set, smooth_throttle_lanes>(sets),
               std::span<NormalSums, smooth_throttle_lanes>(sums));
    benchmark::DoNotOptimize(sums);
  }
}
BENCHMARK(eight_sets)->Unit(benchmark::kMillisecond);

void duals_with_rows(benchmark::State& state) {
  auto residual = dual_residual();
  const Eigen::VectorXd x = residual.start();
  Eigen::VectorXd r(residual.n_residuals());
  Eigen::MatrixXd j(residual.n_residuals(), 10);
  for (auto _ : state) {
    residual(x, r, &j);
    benchmark::DoNotOptimize(j.data());
  }
}
BENCHMARK(duals_with_rows)->Unit(benchmark::kMillisecond);

}  // namespace
