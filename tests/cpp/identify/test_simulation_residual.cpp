#include "mgdd/identify/output_error.hpp"

#include "mgdd/common/random.hpp"
#include "mgdd/dynamics/rk4.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::identify {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A user's own functor: a driven pendulum, x'' = gain u - damping x' - stiffness sin(x), read with an offset.
struct Pendulum {
  static constexpr int n_states = 2;
  static constexpr int n_inputs = 1;
  static constexpr int n_parameters = 4;

  template <class T>
  Values<T, 2> derivative(const Values<T, 4>& p, const Values<T, 2>& x, const Values<double, 1>& u) const noexcept {
    using std::sin;
    return {x[1], p[0] * u[0] - p[1] * x[1] - p[2] * sin(x[0])};
  }
  template <class T>
  T output(const Values<T, 4>& p, const Values<T, 2>& x) const noexcept {
    return x[0] + p[3];
  }
};
using dynamics::Rk4;
static_assert(dynamics::Ode<Pendulum> && dynamics::ModelFamily<Rk4<Pendulum>>);

// First-order lag with its exact discrete step; starts where the parameter says.
struct Lag {
  static constexpr int n_start = 1;
  static constexpr int n_parameters = 3;  // gain, time constant [s], start

  template <class T>
  struct Model {
    using Scalar = T;
    using State = Values<T, 1>;
    using Input = T;
    static constexpr int n_observed = 1;
    T gain, keep, begin;
    double dt_s;

    void step(State& x, const T& u) const noexcept { x[0] = keep * x[0] + (1.0 - keep) * (gain * u); }
    T output(const State& x) const noexcept { return x[0]; }
    double sample_s() const noexcept { return dt_s; }
    template <class S>
    static auto numbers(S& x) noexcept {
      return std::array{&x[0]};
    }
  };
  template <class T>
  Model<T> prepare(const Values<T, 3>& p, double dt_s) const noexcept {
    using std::exp;
    return {p[0], exp(-dt_s / p[1]), p[2], dt_s};
  }
  template <class T>
  Values<T, 1> start(const Model<T>& model, const Values<T, 1>&) const noexcept {
    return {model.begin};
  }
};
static_assert(dynamics::ModelFamily<Lag>);

constexpr Values<double, 4> pendulum_truth{3.0, 0.4, 2.0, 0.1};

SimulationRecord pendulum_record(std::uint64_t seed, std::size_t n, double noise = 0.0) {
  SimulationRecord record{
      .dt_s = 0.02, .input = {}, .output = {}, .start = {0.2, -0.1}, .free_start = {}, .weight = {}};
  const auto model = Rk4<Pendulum>{}.prepare<double>(pendulum_truth, record.dt_s);
  Values<double, 2> x{0.2, -0.1};
  for (std::size_t k = 0; k < n; ++k) {
    const Values<double, 1> u{2.0 * random::uniform(seed, 0, k / 20) - 1.0};
    record.input.push_back(u[0]);
    record.output.push_back(model.output(x) + noise * random::normal(seed, 1, k));
    model.step(x, u);
  }
  return record;
}

template <class Residual>
double largest_difference_error(Residual& residual, const VectorXd& x) {
  VectorXd r(residual.n_residuals()), up = r, down = r;
  MatrixXd j(residual.n_residuals(), residual.n_unknowns());
  EXPECT_TRUE(residual(x, r, &j));
  double worst = 0.0;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double h = 1e-5 * std::max(1.0, std::abs(x[i]));
    VectorXd moved = x;
    moved[i] = x[i] + h;
    EXPECT_TRUE(residual(moved, up, nullptr));
    moved[i] = x[i] - h;
    EXPECT_TRUE(residual(moved, down, nullptr));
    worst = std::max(worst, ((up - down) / (2.0 * h) - j.col(i)).norm() / j.col(i).norm());
  }
  return worst;
}

TEST(OutputError, SensitivitiesAgreeWithCentralDifferences) {
  std::vector<SimulationRecord> records{pendulum_record(1, 300), pendulum_record(2, 200)};
  records[0].free_start = {0, 1};
  records[1].free_start = {1};
  records[1].skip = 30;
  records[1].sigma = 0.05;
  records[1].weight.assign(200, 0.5);
  OutputError residual(Rk4<Pendulum>{{}, 2}, {2.5, 0.5, 1.5, 0.0}, std::vector<std::size_t>{0, 1, 2, 3}, records);
  EXPECT_EQ(residual.n_unknowns(), 7);
  EXPECT_EQ(residual.n_residuals(), 300 + 170);
  EXPECT_LT(largest_difference_error(residual, residual.start()), 1e-8);
}

TEST(OutputError, ALinearLagMatchesItsClosedFormAndStartsWhereItsParameterSays) {
  const SimulationRecord record{.dt_s = 0.01,
                                .input = std::vector<double>(200, 1.0),
                                .output = std::vector<double>(200, 0.0),
                                .start = {0.0},
                                .free_start = {},
                                .weight = {}};
  OutputError residual(Lag{}, {2.0, 0.3, 0.5}, std::vector<std::size_t>{0, 1, 2}, std::vector{record});
  VectorXd y(200);
  MatrixXd j(200, 3);
  ASSERT_TRUE(residual(residual.start(), y, &j));
  for (Eigen::Index k = 0; k < 200; ++k) {
    const double t = 0.01 * static_cast<double>(k);
    const double e = std::exp(-t / 0.3);
    EXPECT_NEAR(y[k], 2.0 + (0.5 - 2.0) * e, 1e-13);
    EXPECT_NEAR(j(k, 0), 1.0 - e, 1e-13);
    EXPECT_NEAR(j(k, 1), (0.5 - 2.0) * e * t / 0.09, 1e-12);
    EXPECT_NEAR(j(k, 2), e, 1e-13);
  }
}

TEST(OutputError, ARecordWithoutUnknownsLeavesNoStaleRows) {
  std::vector<SimulationRecord> records{pendulum_record(6, 60), pendulum_record(7, 40)};
  records[1].free_start = {0};
  OutputError residual(Rk4<Pendulum>{{}, 2}, pendulum_truth, std::vector<std::size_t>{}, records);
  VectorXd r(100);
  MatrixXd j = MatrixXd::Constant(100, 1, 7.0);  // what an earlier call or the allocator left there
  ASSERT_TRUE(residual(residual.start(), r, &j));
  EXPECT_EQ(j.topRows(60), MatrixXd::Zero(60, 1));
  EXPECT_EQ(j(60, 0), 1.0);
}

TEST(OutputError, EvaluatesWithoutTheHeapAndRefusesAnEscape) {
  auto record = pendulum_record(5, 200);
  record.free_start = {0, 1};
  OutputError residual(Rk4<Pendulum>{}, pendulum_truth, std::vector<std::size_t>{0, 1, 2, 3}, std::vector{record});
  static_assert(noexcept(residual(std::declval<const VectorXd&>(), std::declval<VectorXd&>(), nullptr)));
  VectorXd x = residual.start(), r(200);
  MatrixXd j(200, 6);
  const test_support::AllocationCounter counter;
  EXPECT_TRUE(residual(x, r, &j));
  EXPECT_TRUE(residual(x, r, nullptr));
  EXPECT_EQ(counter.count(), 0U);
  x[1] = -1e6;  // explodes under a fixed step
  EXPECT_FALSE(residual(x, r, &j));
  EXPECT_FALSE(residual(x, r, nullptr));
}

TEST(OutputError, NamesWhatDoesNotBelongTogether) {
  const auto build = [](auto change, const std::vector<std::size_t>& free = {0}) {
    auto record = pendulum_record(6, 50);
    change(record);
    return OutputError(Rk4<Pendulum>{}, pendulum_truth, free, std::vector{record});
  };
  EXPECT_THROW(build([](SimulationRecord& r) { r.input.pop_back(); }), ShapeError);
  EXPECT_THROW(build([](SimulationRecord& r) { r.start.pop_back(); }), ShapeError);
  EXPECT_THROW(build([](SimulationRecord& r) { r.skip = 50; }), ShapeError);
  EXPECT_THROW(build([](SimulationRecord& r) { r.dt_s = 0.0; }), ParameterError);
  EXPECT_THROW(build([](SimulationRecord& r) { r.sigma = -1.0; }), ParameterError);
  EXPECT_THROW(build([](SimulationRecord& r) { r.free_start = {2}; }), ParameterError);
  EXPECT_THROW(build([](SimulationRecord& r) { r.output[7] = std::numeric_limits<double>::infinity(); }),
               ParameterError);
  EXPECT_THROW(build([](SimulationRecord&) {}, {1, 1}), ParameterError);
  EXPECT_EQ(build([](SimulationRecord&) {}).n_unknowns(), 1);
}

}  // namespace
}  // namespace mgdd::identify
