// Receding-horizon control of the smooth throttle over 6000 samples of 1 ms: closed-loop error beside the time of every
// step, in double and float, with bounds and with a limit of the change as well; how the Riccati sweep compares with
// dense condensing over the length of the horizon. Times are of the whole call, after 500 samples unmeasured: the run
// is the same every time, so that quantiles are over the smallest time of each sample, which leaves out what the
// operating system does, and p50 and p99 beside them over all times. Options: `--json`, one record per line;
// `--loop SAMPLES [float]`, a loop alone with N = 20 for an instruction counter.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <string_view>
#include <vector>

#include "condensed_horizon.hpp"
#include "mgdd/control/receding_horizon.hpp"
#include "mgdd/dynamics/rk4.hpp"
#include "mgdd/throttle/models/smooth.hpp"

namespace {

using namespace mgdd;
using Clock = std::chrono::steady_clock;

constexpr double rad_per_deg = std::numbers::pi / 180.0;
constexpr double limp_home = throttle::smooth_plant_example[7];
constexpr int samples = 6000, unmeasured = 500;

/// [rad]: squares between 0.3 and 1.0, a sine of 5 Hz about limp-home, small squares across it. Held over the horizon.
double reference_of(int k) {
  const double t = 1e-3 * k;
  if (k < 3000) return (k / 300) % 2 == 0 ? 0.3 : 1.0;
  if (k < 4500) return limp_home + 0.5 * std::sin(2.0 * std::numbers::pi * 5.0 * (t - 3.0));
  return limp_home + ((k / 150) % 2 == 0 ? -0.05 : 0.05);
}

template <class S>
auto smooth_model(double sample_s, int substeps) {
  std::array<S, 10> p{};
  for (std::size_t i = 0; i < p.size(); ++i)
    p[i] = static_cast<S>(throttle::smooth_plant_example[i]);
  return dynamics::Rk4<throttle::SmoothPlant>{{}, substeps}.prepare(p, sample_s);
}
template <class S>
using Model = decltype(smooth_model<S>(1e-3, 1));

control::HorizonSettings settings(double largest_change = unbounded) {
  control::HorizonSettings s;
  s.output_weight = 1e3 * rad_per_deg * rad_per_deg;  // the output is in deg
  s.terminal_weight = 5.0 * s.output_weight;
  s.input_weight = 1e-2;
  s.change_weight = 0.0;
  s.largest_change = largest_change;
  return s;
}

/// x+ = A x + B u from limp-home [rad, rad/s, A]: the plate without friction and preload, sampled at 1 ms.
template <class T, class C = T>
struct LinearModel {
  using Scalar = T;
  using State = std::array<T, 3>;
  using Input = T;
  static constexpr int n_observed = 3;

  std::array<std::array<C, 3>, 3> a{};
  std::array<C, 3> b{};

  void step(State& x, const T& u) const noexcept {
    const State now = x;
    for (std::size_t i = 0; i < 3; ++i)
      x[i] = now[0] * a[i][0] + now[1] * a[i][1] + now[2] * a[i][2] + u * b[i];
  }
  T output(const State& x) const noexcept { return x[0]; }
  double sample_s() const noexcept { return 1e-3; }
  template <class U>
  LinearModel<U, C> over() const noexcept {
    return {a, b};
  }
  template <class S>
  static auto numbers(S& x) noexcept {
    return std::array{&x[0], &x[1], &x[2]};
  }
};
template <class S>
LinearModel<S> linear_model() {
  auto p = throttle::smooth_plant_example;
  p[2] = p[5] = p[7] = 0.0;
  const auto exact = dynamics::Rk4<throttle::SmoothPlant>{{}, 64}.prepare(p, 1e-3);
  LinearModel<S> model;
  for (std::size_t j = 0; j < 4; ++j) {
    std::array<double, 3> x{};
    if (j < 3) x[j] = 1.0;
    exact.step(x, std::array{j < 3 ? 0.0 : 1.0});
    for (std::size_t i = 0; i < 3; ++i)
      (j < 3 ? model.a[i][j] : model.b[i]) = static_cast<S>(x[i]);
  }
  return model;
}

struct Course {
  double rms_rad = 0.0, activity = 0.0, sweeps = 0.0;
  int most_sweeps = 0, unsolved = 0;
  std::vector<double> whole_us, feedback_us;
};

/// A loop from rest at limp-home; `unit` is that of the output in rad.
template <int N, class M, class P>
Course drive(const M& model, const P& plant, const control::HorizonSettings& s, double home, double unit, int n) {
  using S = typename M::Scalar;
  control::RecedingHorizon<M, N> controller(model, s);
  std::array<double, 3> x{home, 0.0, 0.0};
  const auto seen = [&] { return std::array<S, 3>{static_cast<S>(x[0]), static_cast<S>(x[1]), static_cast<S>(x[2])}; };
  controller.start(seen(), S(0));
  Course out;
  out.whole_us.reserve(static_cast<std::size_t>(n));
  out.feedback_us.reserve(static_cast<std::size_t>(n));
  double before = 0.0;
  for (int k = 0; k < n; ++k) {
    const double r = reference_of(k) - limp_home + home;
    const auto state = seen();
    const auto begin = Clock::now();
    controller.prepare();
    const auto middle = Clock::now();
    const double u = static_cast<double>(controller.feedback(state, static_cast<S>(r / unit)));
    const auto end = Clock::now();
    if (k >= unmeasured) {
      out.whole_us.push_back(std::chrono::duration<double, std::micro>(end - begin).count());
      out.feedback_us.push_back(std::chrono::duration<double, std::micro>(end - middle).count());
    }
    out.sweeps += controller.sweeps();
    out.most_sweeps = std::max(out.most_sweeps, controller.sweeps());
    out.unsolved += controller.status() != control::HorizonStatus::converged;
    out.activity += std::abs(u - before);
    before = u;
    plant.step(x, dynamics::input_of(plant, u));
    out.rms_rad += (x[0] - r) * (x[0] - r);
  }
  out.rms_rad = std::sqrt(out.rms_rad / n);
  out.sweeps /= n;
  return out;
}
template <class S, int N>
Course drive(const control::HorizonSettings& s, bool linear, int n = samples) {
  if (!linear) return drive<N>(smooth_model<S>(1e-3, 1), smooth_model<double>(1e-3, 4), s, limp_home, rad_per_deg, n);
  auto in_rad = s;
  in_rad.output_weight /= rad_per_deg * rad_per_deg;
  in_rad.terminal_weight /= rad_per_deg * rad_per_deg;
  return drive<N>(linear_model<S>(), linear_model<double>(), in_rad, 0.0, 1.0, n);
}

double quantile(std::vector<double> values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

bool as_json = false;

template <class S, int N>
void report(const char* scalar, const control::HorizonSettings& s, bool linear = false) {
  constexpr int repeats = 7;
  std::vector<double> own, own_feedback, p50, p99;
  Course course;
  for (int i = 0; i < repeats; ++i) {
    course = drive<S, N>(s, linear);
    p50.push_back(quantile(course.whole_us, 0.5));
    p99.push_back(quantile(course.whole_us, 0.99));
    if (i == 0) own = course.whole_us, own_feedback = course.feedback_us;
    for (std::size_t k = 0; k < own.size(); ++k) {
      own[k] = std::min(own[k], course.whole_us[k]);
      own_feedback[k] = std::min(own_feedback[k], course.feedback_us[k]);
    }
  }
  const char* format =
      as_json
          ? "{\"model\": \"%s\", \"n\": %d, \"scalar\": \"%s\", \"change\": %g, \"iterations\": %d, \"max_sweeps\": "
            "%d, \"rms_rad\": "
            "%.5f, \"p50\": %.2f, \"p99\": %.2f, \"p999\": %.2f, \"max\": %.2f, \"feedback_p50\": %.2f, "
            "\"feedback_p999\": %.2f, \"all_p50\": %.2f, \"all_p99\": %.2f, \"sweeps\": %.2f, \"most_sweeps\": %d, "
            "\"unsolved\": %d, \"activity\": %.1f}\n"
          : "%-6s %4d %-6s %6.2g %4d %6d %9.5f | %7.2f %7.2f %7.2f %7.2f | %7.2f %7.2f | %7.2f %7.2f | %6.2f %4d %5d "
            "%7.1f\n";
  std::printf(format, linear ? "linear" : "smooth", N, scalar, s.largest_change < 1e3 ? s.largest_change : 0.0,
              s.max_iterations, s.max_sweeps, course.rms_rad, quantile(own, 0.5), quantile(own, 0.99),
              quantile(own, 0.999), quantile(own, 1.0), quantile(own_feedback, 0.5), quantile(own_feedback, 0.999),
              quantile(p50, 0.5), quantile(p99, 0.5), course.sweeps, course.most_sweeps, course.unsolved,
              course.activity);
  std::fflush(stdout);
}

/// Microseconds of one unlimited solve along the model, by sweep and by condensing.
template <int N>
void crossover() {
  static control::HorizonQp<double, N, 3> qp;
  static bench::Condensed<N, 3> dense;
  const auto model = smooth_model<double>(1e-3, 1);
  using D = Dual<4>;
  const auto dual = model.over<D>();
  auto s = dynamics::lifted<std::remove_const_t<decltype(dual)>>(std::array<double, 3>{0.4, 3.0, 1.0});
  for (std::size_t k = 0; k < static_cast<std::size_t>(N); ++k) {
    qp.nominal[k] = 0.2;
    for (std::size_t i = 0; i < 3; ++i)
      s[i] = D::seeded(s[i].value, static_cast<int>(i));
    dual.step(s, dynamics::input_of(dual, D::seeded(0.2, 3)));
    auto& stage = qp.stages[k];
    for (Eigen::Index i = 0; i < 3; ++i) {
      for (Eigen::Index j = 0; j < 3; ++j)
        stage.a(i, j) = s[static_cast<std::size_t>(i)].grad[static_cast<std::size_t>(j)];
      stage.b(i) = s[static_cast<std::size_t>(i)].grad[3];
    }
    stage.c = {1.0, 0.0, 0.0};
    stage.error = s[0].value - 0.42;
    stage.weight = 1e3;
  }
  qp.input_weight = 1e-2;
  qp.set.limit(-1e30, 1e30, 1e30);
  const Eigen::Vector3d deviation(0.01, 0.2, 0.0);
  qp.invalidate();
  (void)qp.solve(deviation, 0.2, 1);
  dense.solve(qp, deviation);
  double apart = 0.0;
  for (int k = 0; k < N; ++k)
    apart = std::max(apart, std::abs(dense.input(k) + 0.2 - qp.input()[static_cast<std::size_t>(k)]));
  if (!(apart < 1e-8)) {
    std::printf("sweep and condensing differ by %g at %d: not timed\n", apart, N);
    std::exit(1);
  }
  const auto best_us = [](auto&& call) {
    double best = 1e9;
    for (int i = 0; i < 30; ++i) {
      const auto begin = Clock::now();
      for (int j = 0; j < 100; ++j)
        call();
      best = std::min(best, std::chrono::duration<double, std::micro>(Clock::now() - begin).count() / 100.0);
    }
    return best;
  };
  const double sweep_us = best_us([&] {
    qp.invalidate();
    (void)qp.solve(deviation, 0.2, 1);
  });
  const double dense_us = best_us([&] { dense.solve(qp, deviation); });
  std::printf(as_json ? "{\"crossover\": %d, \"sweep_us\": %.3f, \"dense_us\": %.3f, \"ratio\": %.2f}\n"
                      : "%4d %10.3f %10.3f %8.2f\n",
              N, sweep_us, dense_us, dense_us / sweep_us);
}

/// The plant under a known duty, so that a peer can show that its equations are the same.
void trace() {
  const auto plant = smooth_model<double>(1e-3, 4);
  std::array<double, 3> x{limp_home, 0.0, 0.0};
  for (int k = 0; k < 400; ++k)
    plant.step(x, std::array{0.6 * std::sin(0.05 * k)});
  std::printf("{\"trace\": [%.15g, %.15g, %.15g]}\n", x[0], x[1], x[2]);
  const auto linear = linear_model<double>();
  std::printf("{\"linear\": [");
  for (std::size_t i = 0; i < 3; ++i)
    std::printf("%.17g, %.17g, %.17g, %.17g%s", linear.a[i][0], linear.a[i][1], linear.a[i][2], linear.b[i],
                i < 2 ? ", " : "]}\n");
}

}  // namespace

int main(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    if (argv[i] == std::string_view("--json")) as_json = true;
    if (argv[i] == std::string_view("--loop") && i + 1 < argc) {
      const int n = std::atoi(argv[i + 1]);
      const bool narrow = i + 2 < argc && argv[i + 2] == std::string_view("float");
      std::printf("%.5f\n",
                  (narrow ? drive<float, 20>(settings(), false, n) : drive<double, 20>(settings(), false, n)).rms_rad);
      return 0;
    }
  }
  if (!as_json) {
    std::printf(
        "                                        | us, smallest of each sample     | feedback alone  | all times"
        "       |\nmodel     N scalar change iter sweeps   rms_rad |     p50     p99   p99.9     max |     p50   p99.9 "
        "|"
        "     p50     p99 | sweeps most open activity\n");
  }
  for (const double change : {unbounded, 0.1}) {
    auto s = settings(change);
    report<double, 10>("double", s);
    report<double, 20>("double", s);
    report<double, 50>("double", s);
    report<double, 100>("double", s);
    report<float, 10>("float", s);
    report<float, 20>("float", s);
    report<float, 50>("float", s);
    s.max_sweeps = 25;
    report<double, 20>("double", s);
    s.max_sweeps = 10;
    report<double, 20>("double", s);
    report<double, 50>("double", s);
    s.max_sweeps = 60;
    s.max_iterations = 10;
    report<double, 20>("double", s);
  }
  report<double, 20>("double", settings(), true);
  report<float, 20>("float", settings(), true);
  if (as_json) trace();
  if (!as_json) std::printf("\n   N   sweep_us   dense_us    ratio\n");
  crossover<3>();
  crossover<5>();
  crossover<8>();
  crossover<10>();
  crossover<15>();
  crossover<20>();
  crossover<30>();
  crossover<50>();
  return 0;
}
