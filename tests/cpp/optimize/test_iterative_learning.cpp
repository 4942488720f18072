#include "mgdd/optimize/learning/iterative_learning.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"
#include "support/reference_algebra.hpp"

namespace mgdd::optimize {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using test_support::largest_singular_value, test_support::product, test_support::spectral_radius;

using Column = std::vector<double>;

const double nan = std::nan("");
constexpr double infinity = std::numeric_limits<double>::infinity();

VectorXd as_vector(std::span<const double> column) {
  return Eigen::Map<const VectorXd>(column.data(), static_cast<Index>(column.size()));
}

Column as_column(const VectorXd& vector) {
  return {vector.begin(), vector.end()};
}

// A plant of the tests: y = h * u, all N samples, so that a relative degree shows as leading zeros of y.
struct Plant {
  Column h;
  VectorXd wanted;  // r - d

  Column error(std::span<const double> u) const {
    VectorXd e = wanted;
    for (std::size_t t = 0; t < u.size(); ++t) {
      for (std::size_t k = 0; k <= t && k < h.size(); ++k) {
        e[static_cast<Index>(t)] -= h[k] * u[t - k];
      }
    }
    return as_column(e);
  }
};

VectorXd wave(Index n) {
  VectorXd out(n);
  for (Index i = 0; i < n; ++i) {
    out[i] = 1.0 + std::sin(0.7 * static_cast<double>(i)) + (i % 3 == 0 ? 0.4 : 0.0);
  }
  return out;
}

// One trial; returns the error it had.
VectorXd run(IterativeLearning& learner, const Plant& plant) {
  const Column error = plant.error(learner.ask());
  learner.tell(error);
  return as_vector(error);
}

LearningSettings p_type(std::size_t n, double k_p) {
  return {.initial = Column(n, 0.0), .impulse_response = {1.0, 0.5}, .k_p = k_p, .guard = false};
}

// --- fact 28 of the specification: h = [1, 0.5] ------------------------------------------------------------
TEST(IterativeLearning, PTypeConvergesIffTheFirstMarkovParameterSaysSo) {
  for (const std::size_t n : {5u, 10u, 100u}) {
    for (const double k_p : {0.1, 0.5, 1.0, 1.9, 1.999, 2.0, 2.1, 3.0, -0.1, 0.0}) {
      const ConvergenceReport report = IterativeLearning(p_type(n, k_p)).convergence();
      EXPECT_NEAR(report.spectral_radius, std::abs(1.0 - k_p), 1e-10);
      EXPECT_TRUE(report.radius_is_exact);
      EXPECT_EQ(report.asymptotic, std::abs(1.0 - k_p) < 1.0) << k_p;
    }
  }
}

TEST(IterativeLearning, AGainOf19ConvergesAfterALargeTransient) {
  const Plant plant{{1.0, 0.5}, VectorXd::Ones(5)};
  IterativeLearning learner(p_type(5, 1.9));
  double peak = 0.0;
  int worst = 0;
  double last = 0.0;
  for (int j = 0; j < 600; ++j) {
    last = run(learner, plant).norm() / std::sqrt(5.0);
    if (last > peak) peak = last, worst = j;
  }
  EXPECT_NEAR(peak, 840.1355881, 1e-4);
  EXPECT_EQ(worst, 38);
  EXPECT_LT(last, 1e-10);
  EXPECT_FALSE(learner.convergence().monotone);
}

TEST(IterativeLearning, AGainOf21Diverges) {
  const Plant plant{{1.0, 0.5}, VectorXd::Ones(5)};
  IterativeLearning learner(p_type(5, 2.1));
  for (int j = 0; j < 300; ++j) {
    run(learner, plant);
  }
  EXPECT_GT(run(learner, plant).norm(), 1e12);
  EXPECT_EQ(learner.convergence().sentence.substr(0, 8), "diverges");
}

// The bound 4/3 is that of the unit circle, |1 - 1.5 k_p| < 1. A trial of N samples is monotone a little beyond it: up
// to 1.36023 for N = 5, 1.34027 for N = 10, and 4/3 as N grows.
TEST(IterativeLearning, PTypeIsMonotoneUpToFourThirds) {
  for (const std::size_t n : {2u, 5u, 20u, 200u}) {
    const ConvergenceReport below = IterativeLearning(p_type(n, 4.0 / 3.0 - 1e-9)).convergence();
    const ConvergenceReport above = IterativeLearning(p_type(n, 4.0 / 3.0 + 1e-9)).convergence();
    EXPECT_TRUE(below.monotone);
    EXPECT_LT(below.frequency_gain, 1.0);
    EXPECT_GT(above.frequency_gain, 1.0);
    EXPECT_EQ(above.worst_frequency, 0.0);
  }
  EXPECT_TRUE(IterativeLearning(p_type(5, 1.36022)).convergence().monotone);
  EXPECT_FALSE(IterativeLearning(p_type(5, 1.36024)).convergence().monotone);
  EXPECT_FALSE(IterativeLearning(p_type(10, 1.34028)).convergence().monotone);
  EXPECT_FALSE(IterativeLearning(p_type(200, 1.33336)).convergence().monotone);
}

TEST(IterativeLearning, NormOptimalShrinksEachSingularDirectionByItsFactor) {
  LearningSettings settings{
      .initial = Column(6, 0.0), .law = LearningLaw::norm_optimal, .impulse_response = {1.0, 0.5}};
  const auto svd = test_support::singular_values(toeplitz(VectorXd::Unit(6, 0) + 0.5 * VectorXd::Unit(6, 1)));
  const double change = 0.1 * svd.values[0] * svd.values[0];
  for (const double error_weight : {1.0, 3.0}) {
    settings.error_weight = error_weight;
    for (Index i = 0; i < 6; ++i) {
      IterativeLearning learner(settings);
      const Plant plant{{1.0, 0.5}, svd.left.col(i)};
      run(learner, plant);
      const double s = svd.values[i];
      const double factor = change / (s * s * error_weight + change);
      EXPECT_LT((run(learner, plant) - factor * svd.left.col(i)).norm(), 1e-12) << i;
      if (i == 5) {
        const ConvergenceReport report = learner.convergence();
        EXPECT_NEAR(report.spectral_radius, factor, 1e-10);
        EXPECT_NEAR(report.sigma_max, factor, 1e-10);
        EXPECT_TRUE(report.monotone);
      }
    }
  }
}

// The printed form of Q and L, and the generic tests on it, against the closed forms.
TEST(IterativeLearning, NormOptimalIsThePrintedLaw) {
  const LearningSettings settings{.initial = as_column(wave(8)),
                                  .law = LearningLaw::norm_optimal,
                                  .impulse_response = {0.0, 0.8, 0.5, -0.2},
                                  .error_weight = 2.0,
                                  .input_weight = 0.3,
                                  .change_weight = 0.7};
  VectorXd h = VectorXd::Zero(7);
  h.head(3) << 0.8, 0.5, -0.2;
  const MatrixXd g = toeplitz(h);
  const MatrixXd id = MatrixXd::Identity(7, 7);
  const MatrixXd core = 2.0 * test_support::gram(g) + 0.7 * id;
  const MatrixXd q = test_support::solved(core + 0.3 * id, core);
  const MatrixXd l = test_support::solved(core, 2.0 * g.transpose());
  IterativeLearning learner(settings);
  const VectorXd e = wave(8).array().square();
  learner.ask();
  learner.tell(as_column(e));
  EXPECT_LT((as_vector(learner.ask()).head(7) - product(q, wave(8).head(7) + product(l, e.tail(7)))).norm(), 1e-12);
  EXPECT_EQ(learner.ask()[7], learner.ask()[6]);

  const ConvergenceReport report = learner.convergence();
  const MatrixXd input_map = product(q, id - product(l, g));
  const MatrixXd map = product(product(g, input_map), test_support::inverse(g));
  EXPECT_NEAR(report.sigma_max, largest_singular_value(map), 1e-12);
  EXPECT_NEAR(report.spectral_radius, spectral_radius(map), 1e-10);
  const MatrixXd limit = id - product(g, test_support::solved(id - input_map, product(q, l)));
  EXPECT_LT((report.limit_error_map - limit).norm(), 1e-12);
  EXPECT_NEAR(report.limit_error_gain, largest_singular_value(limit), 1e-12);
}

// --- every law against its own lifted matrices -------------------------------------------------------------
// L and Q are read off the learner itself, so this ties what it does to what it reports.
struct Lifted {
  MatrixXd g, q, l;

  MatrixXd input_map() const { return q - product(l, g); }
  MatrixXd error_map() const { return product(product(g, input_map()), test_support::inverse(g)); }
  Lifted(const LearningSettings& settings, const Column& h) {
    const auto n = static_cast<Index>(settings.initial.size());
    g = q = l = MatrixXd::Zero(n, n);
    for (Index k = 0; k < n; ++k) {
      g.col(k) = -as_vector(Plant{h, VectorXd::Zero(n)}.error(as_column(VectorXd::Unit(n, k))));
      LearningSettings unit = settings;
      unit.initial = as_column(VectorXd::Unit(n, k));
      q.col(k) = next(unit, VectorXd::Zero(n));
      unit.initial = Column(settings.initial.size(), 0.0);
      l.col(k) = next(unit, VectorXd::Unit(n, k));  // Q L
    }
  }

  static VectorXd next(const LearningSettings& settings, const VectorXd& error) {
    IterativeLearning learner(settings);
    learner.ask();
    learner.tell(as_column(error));
    return as_vector(learner.ask());
  }
};

std::vector<LearningSettings> every_law() {
  const LearningSettings base{.initial = Column(12, 0.0), .impulse_response = {0.9, 0.4, -0.1}, .guard = false};
  std::vector<LearningSettings> laws(8, base);
  laws[0].k_p = 0.6;
  laws[1].law = LearningLaw::d;
  laws[2].law = LearningLaw::pd, laws[2].k_d = 0.2;
  laws[3].law = LearningLaw::q_filter;
  laws[4].law = LearningLaw::q_filter, laws[4].learning_function = {0.1, 0.5, 0.2}, laws[4].lead = 1;
  laws[5].law = LearningLaw::pd, laws[5].k_d = -0.1, laws[5].cutoff = 0.6;
  laws[6].law = LearningLaw::norm_optimal;
  laws[7].law = LearningLaw::norm_optimal, laws[7].input_weight = 0.2;
  return laws;
}

TEST(IterativeLearning, ReportAgreesWithTheMatricesOfTheLaw) {
  for (const LearningSettings& settings : every_law()) {
    const Lifted m(settings, settings.impulse_response);
    const Index n = m.g.rows();
    const ConvergenceReport report = IterativeLearning(settings).convergence();
    EXPECT_NEAR(report.sigma_max, largest_singular_value(m.error_map()), 1e-10) << report.sentence;
    if (!report.radius_is_exact || settings.law == LearningLaw::norm_optimal) {
      EXPECT_NEAR(report.spectral_radius, spectral_radius(m.input_map()), 1e-10) << report.sentence;
    }
    ASSERT_TRUE(report.asymptotic);
    const MatrixXd id = MatrixXd::Identity(n, n);
    const MatrixXd limit = id - product(m.g, test_support::solved(id - m.input_map(), m.l));
    EXPECT_LT((report.limit_error_map - limit).norm(), 1e-10) << report.sentence;
  }
}

TEST(IterativeLearning, ErrorsFollowTheErrorMapToTheLimit) {
  for (LearningSettings settings : every_law()) {
    settings.initial = as_column(0.3 * wave(12));
    const Plant plant{settings.impulse_response, wave(12)};
    const Lifted m(settings, plant.h);
    const MatrixXd error_map = m.error_map();
    IterativeLearning learner(settings);
    const ConvergenceReport report = learner.convergence();
    const VectorXd limit = product(report.limit_error_map, plant.wanted);
    VectorXd before = run(learner, plant);
    for (int j = 0; j < 400; ++j) {
      const VectorXd after = run(learner, plant);
      EXPECT_LT((after - limit - product(error_map, before - limit)).norm(), 1e-11) << report.sentence;
      if (report.monotone) {
        EXPECT_LE((after - limit).norm(), report.sigma_max * (before - limit).norm() + 1e-12);
      }
      before = after;
    }
    EXPECT_LT((before - limit).norm(), 1e-9) << report.sentence;
    const bool perfect = !learner.law().cutoff() && !settings.input_weight;
    EXPECT_EQ(report.limit_error_gain == 0.0, perfect);
    EXPECT_EQ(limit.norm() < 1e-12, perfect);
  }
}

// The limit is where learning rests: told the limit error, the learner gives the same input again. 300 samples are
// enough for the blocked decompositions of Eigen; `make asan` runs them too.
TEST(IterativeLearning, RestsAtThePredictedLimitInLongTrialsToo) {
  for (const Index n : {12, 300}) {
    LearningSettings settings{.law = LearningLaw::q_filter, .k_p = 0.15, .cutoff = 0.3};
    settings.initial = Column(static_cast<std::size_t>(n), 0.0);
    for (Index k = 0; k < n; ++k)
      settings.impulse_response.push_back(std::pow(0.9, static_cast<double>(k)));
    const ConvergenceReport report = IterativeLearning(settings).convergence();
    ASSERT_TRUE(report.asymptotic) << report.sentence;
    const VectorXd limit = product(report.limit_error_map, wave(n));
    EXPECT_GT(limit.norm(), 1e-3);
    VectorXd input = wave(n) - limit;  // u = G^-1 (w - e) of y(t) = 0.9 y(t-1) + u(t)
    for (Index t = n - 1; t > 0; --t)
      input[t] -= 0.9 * input[t - 1];
    settings.initial = as_column(input);
    IterativeLearning learner(settings);
    learner.ask();
    learner.tell(as_column(limit));
    EXPECT_LT((as_vector(learner.ask()) - input).norm(), 1e-10 * input.norm());
  }
}

// Closed forms of one update with relative degree 1; errors before the window are zero, behind it the last one.
TEST(IterativeLearning, LawsReadTheErrorAsPrinted) {
  const VectorXd e{{7.0, 1.0, -2.0, 4.0, 3.0}};
  const LearningSettings base{.initial = {0.1, 0.2, 0.3, 0.4, 0.5}, .relative_degree = 1};
  const auto expect = [&](const LearningSettings& settings, const Column& change) {
    const VectorXd u = Lifted::next(settings, e);
    for (std::size_t t = 0; t < 4; ++t) {
      EXPECT_NEAR(u[static_cast<Index>(t)], base.initial[t] + change[t], 1e-15) << name_of(settings.law) << t;
    }
    EXPECT_EQ(u[4], u[3]);
  };
  LearningSettings settings = base;
  settings.k_p = 0.5;
  expect(settings, {0.5, -1.0, 2.0, 1.5});
  settings = base;
  settings.law = LearningLaw::d;
  settings.k_d = 0.5;
  expect(settings, {0.5, -1.5, 3.0, -0.5});
  settings.law = LearningLaw::pd;
  settings.k_p = 2.0;
  expect(settings, {2.0 - 1.5, -4.0 + 3.0, 8.0 - 0.5, 6.0});
}

TEST(IterativeLearning, RelativeDegreeComesFromTheImpulseResponse) {
  LearningSettings settings{.initial = Column(20, 0.0), .impulse_response = {0.0, 1e-15, 2.0, 1.0}};
  IterativeLearning learner(settings);
  EXPECT_EQ(learner.law().relative_degree(), 2u);
  EXPECT_NEAR(learner.convergence().spectral_radius, 0.5, 1e-15);
  const Plant plant{{0.0, 0.0, 2.0, 1.0}, wave(20)};
  for (int j = 0; j < 100; ++j) {
    run(learner, plant);
  }
  const VectorXd e = run(learner, plant);
  EXPECT_LT(e.tail(18).norm(), 1e-9);
  EXPECT_EQ(e.head(2), plant.wanted.head(2));
  settings.relative_degree = 1;
  EXPECT_THROW(IterativeLearning{settings}, ParameterError);
}

// --- limits and guard --------------------------------------------------------------------------------------
TEST(IterativeLearning, InputsStayInBoundsAndWithinTheRate) {
  LearningSettings settings{.initial = Column(15, 0.0), .impulse_response = {0.0, 1.0, 0.5}};
  settings.lower = -0.5;
  settings.upper = 0.8;
  settings.rate = 0.25;
  const Plant plant{settings.impulse_response, 5.0 * wave(15) - VectorXd::Constant(15, 4.0)};
  IterativeLearning learner(settings);
  double highest = 0.0;
  double steepest = 0.0;
  for (int j = 0; j < 50; ++j) {
    const auto u = learner.ask();
    for (std::size_t t = 0; t < u.size(); ++t) {
      EXPECT_TRUE(u[t] >= -0.5 && u[t] <= 0.8);
      highest = std::max(highest, u[t]);
      if (t > 0) steepest = std::max(steepest, std::abs(u[t] - u[t - 1]));
    }
    run(learner, plant);
  }
  EXPECT_EQ(highest, 0.8);
  EXPECT_NEAR(steepest, 0.25, 1e-15);
}

TEST(IterativeLearning, GuardFreezesAfterTwoRisesAndReturnsToTheBestTrial) {
  LearningSettings settings{.initial = Column(3, 1.0), .k_p = 0.1};
  for (const bool guard : {true, false}) {
    settings.guard = guard;
    IterativeLearning learner(settings);
    std::vector<Column> inputs;
    LearningStatus status = LearningStatus::learned;
    for (const double size : {3.0, 2.0, 2.5, 1.5, 1.5, 1.6, 1.7}) {
      EXPECT_FALSE(learner.frozen());
      inputs.push_back(as_column(as_vector(learner.ask())));
      status = learner.tell(Column(3, size));
    }
    EXPECT_EQ(status, guard ? LearningStatus::frozen : LearningStatus::learned);
    EXPECT_EQ(learner.frozen(), guard);
    EXPECT_EQ(learner.best_trial(), 3);
    EXPECT_EQ(learner.best_input(), inputs[3]);
    EXPECT_DOUBLE_EQ(learner.best_norm(), 1.5 * std::sqrt(3.0));
    if (guard) {
      EXPECT_EQ(as_column(as_vector(learner.ask())), inputs[3]);
      EXPECT_EQ(learner.tell(Column(3, 0.1)), LearningStatus::frozen);
      EXPECT_EQ(as_column(as_vector(learner.ask())), inputs[3]);
      EXPECT_EQ(learner.trial(), 8);
    }
  }
}

// --- refusals: wrong, then right ---------------------------------------------------------------------------
TEST(IterativeLearning, ARefusedErrorChangesNothing) {
  LearningSettings settings = p_type(4, 0.7);
  settings.lower = -5.0;
  IterativeLearning learner(settings);
  IterativeLearning twin(settings);
  const Column good{1.0, 2.0, 3.0, 4.0};
  const auto before = save_state(learner);
  EXPECT_EQ(learner.try_tell(good), LearningStatus::not_asked);
  EXPECT_THROW(learner.tell(good), ParameterError);
  EXPECT_EQ(save_state(learner), before);
  learner.ask();
  const auto asked = save_state(learner);
  EXPECT_EQ(learner.try_tell(Column(3, 0.0)), LearningStatus::wrong_length);
  EXPECT_THROW(learner.tell(Column(5, 0.0)), ShapeError);
  EXPECT_EQ(learner.try_tell(Column{1.0, nan, 0.0, 0.0}), LearningStatus::not_a_reading);
  for (const double beyond : {1.001e30, -1e31, 1.7e308})
    EXPECT_EQ(learner.try_tell(Column{1.0, beyond, 0.0, 0.0}), LearningStatus::not_a_reading);
  EXPECT_THROW(learner.tell(Column(4, 1.7e308)), DataError);
  IterativeLearning steep(p_type(4, 1e300));
  steep.ask();
  const auto flat = save_state(steep);
  EXPECT_EQ(steep.try_tell(Column(4, 1e20)), LearningStatus::overflow);
  EXPECT_EQ(save_state(steep), flat);
  try {
    learner.tell(Column{1.0, 2.0, -infinity, 0.0});
    FAIL();
  } catch (const DataError& error) {
    EXPECT_NE(std::string(error.what()).find("trial 0, sample 2 = -inf"), std::string::npos) << error.what();
  }
  EXPECT_EQ(save_state(learner), asked);
  twin.ask();
  learner.tell(good);
  twin.tell(good);
  EXPECT_EQ(save_state(learner), save_state(twin));
  EXPECT_THROW(learner.tell(good), ParameterError);
}

TEST(IterativeLearning, RefusesSettingsThatMakeNoSense) {
  const LearningSettings base = p_type(5, 0.5);
  const auto refused = [&](auto change) {
    LearningSettings settings = base;
    change(settings);
    EXPECT_THROW(IterativeLearning{settings}, ParameterError);
  };
  refused([](auto& s) { s.k_p = nan; });
  refused([](auto& s) { s.k_p.reset(), s.impulse_response.clear(); });
  refused([](auto& s) { s.k_d = 0.1; });
  refused([](auto& s) { s.lead = 1; });
  refused([](auto& s) { s.learning_function = {1.0}; });
  refused([](auto& s) { s.error_weight = 1.0; });
  refused([](auto& s) { s.cutoff = 1.0; });
  refused([](auto& s) { s.impulse_response = {0.0, 0.0}; });
  refused([](auto& s) { s.impulse_response = {0.0, 0.0, 0.0, 0.0, 0.0, 1.0}; });
  refused([](auto& s) { s.impulse_response = {infinity}; });
  refused([](auto& s) { s.relative_degree = 5; });
  refused([](auto& s) { s.relative_degree = -1; });
  refused([](auto& s) { s.initial[2] = infinity; });
  refused([](auto& s) { s.lower = 0.1; });
  refused([](auto& s) { s.lower = s.upper = 0.0; });
  refused([](auto& s) { s.rate = 0.0; });
  refused([](auto& s) { s.initial = {0.0, 1.0}, s.rate = 0.5; });
  refused([](auto& s) { s.law = LearningLaw::pd; });
  refused([](auto& s) { s.law = LearningLaw::norm_optimal; });
  refused([](auto& s) { s.law = LearningLaw::d; });
  refused([](auto& s) { s.k_p.reset(), s.law = LearningLaw::norm_optimal, s.change_weight = -1.0; });
  refused([](auto& s) { s.k_p.reset(), s.law = LearningLaw::norm_optimal, s.error_weight = 0.0; });
  refused([](auto& s) { s.k_p.reset(), s.law = LearningLaw::norm_optimal, s.input_weight = nan; });
  refused([](auto& s) { s.k_p.reset(), s.law = LearningLaw::norm_optimal, s.cutoff = 0.2; });
  refused([](auto& s) { s.initial = Column(lifted_ceiling + 1, 0.0); });
  LearningSettings empty = base;
  empty.initial.clear();
  EXPECT_THROW(IterativeLearning{empty}, ShapeError);
  EXPECT_THROW(static_cast<void>(parse_name<LearningLaw>("law", "i")), ParameterError);
  LearningSettings blind = base;
  blind.impulse_response.clear();
  EXPECT_THROW(static_cast<void>(IterativeLearning(blind).convergence()), ParameterError);
}

// --- saved and resumed -------------------------------------------------------------------------------------
TEST(IterativeLearning, ResumesBitForBit) {
  for (LearningSettings settings : every_law()) {
    settings.guard = true;
    const Plant plant{settings.impulse_response, wave(12)};
    IterativeLearning whole(settings);
    for (int j = 0; j < 7; ++j) {
      run(whole, plant);
    }
    const Column error = plant.error(whole.ask());
    IterativeLearning resumed(settings);
    resumed.restore(save_state(whole));
    EXPECT_EQ(resumed.try_tell(error), whole.try_tell(error));
    for (int j = 0; j < 60; ++j) {
      EXPECT_EQ(run(resumed, plant), run(whole, plant));
    }
    EXPECT_EQ(save_state(resumed), save_state(whole));
  }
}

TEST(IterativeLearning, RestoreChecksBeforeItTouches) {
  LearningSettings settings = p_type(4, 0.7);
  settings.upper = 9.0;
  IterativeLearning source(settings);
  for (int j = 0; j < 3; ++j) {
    run(source, {{1.0, 0.5}, VectorXd::Ones(4)});
  }
  const StateColumns good = save_state(source);
  IterativeLearning learner(settings);
  const StateColumns fresh = save_state(learner);
  const auto refused = [&](auto change) {
    StateColumns state = good;
    change(state);
    EXPECT_ANY_THROW(learner.restore(state));
    EXPECT_EQ(save_state(learner), fresh);
  };
  refused([](auto& s) { s.erase("trial"); });
  refused([](auto& s) { s["mood"] = {1.0}; });
  refused([](auto& s) { s["input"].pop_back(); });
  refused([](auto& s) { s["best_input"].push_back(0.0); });
  refused([](auto& s) { s["input"][1] = nan; });
  refused([](auto& s) { s["input"][1] = 9.5; });
  refused([](auto& s) { s["trial"] = {3.5}; });
  refused([](auto& s) { s["trial"] = {-1.0}; });
  refused([](auto& s) { s["trial"] = {2.0}; });
  refused([](auto& s) { s["trial"] = {}; });
  refused([](auto& s) { s["asked"] = {2.0}; });
  refused([](auto& s) { s["best_trial"] = {3.0}; });
  refused([](auto& s) { s["best_norm"] = {}; });
  refused([](auto& s) { s["error_norms"][0] = -1.0; });
  learner.restore(good);
  EXPECT_EQ(save_state(learner), good);
}

// --- what a real-time loop relies on -----------------------------------------------------------------------
static_assert(noexcept(std::declval<IterativeLearning&>().ask()));
static_assert(noexcept(std::declval<IterativeLearning&>().try_tell(std::declval<std::span<const double>>())));

TEST(IterativeLearning, AskAndTellAllocateNothing) {
  for (LearningSettings settings : every_law()) {
    settings.initial.assign(300, 0.0);
    settings.upper = 0.9;
    const Plant plant{settings.impulse_response, wave(300)};
    IterativeLearning learner(settings);
    const Column error = plant.error(learner.ask());
    const test_support::AllocationCounter counter;
    for (int j = 0; j < 3; ++j) {
      learner.ask();
      EXPECT_EQ(learner.try_tell(error), LearningStatus::learned);
    }
    EXPECT_EQ(counter.count(), 0u) << name_of(settings.law);
  }
}

TEST(IterativeLearning, KeepsTheLatestNormsWithoutAllocating) {
  IterativeLearning learner({.initial = {0.0}, .k_p = 0.0, .guard = false});
  Column error(1);
  const test_support::AllocationCounter counter;
  for (int j = 0; j < 1500; ++j) {
    error[0] = j;
    learner.ask();
    learner.try_tell(error);
  }
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_EQ(learner.error_norms().size(), IterativeLearning::history_length);
  EXPECT_EQ(learner.error_norms().front(), 500.0);
  EXPECT_EQ(learner.error_norms().back(), 1499.0);
  IterativeLearning resumed({.initial = {0.0}, .k_p = 0.0, .guard = false});
  resumed.restore(save_state(learner));
  EXPECT_EQ(save_state(resumed), save_state(learner));
}

}  // namespace
}  // namespace mgdd::optimize
