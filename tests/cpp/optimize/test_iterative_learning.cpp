#include "mgdd/optimize/learning/iterative_learning.hpp"

#include <Eigen/Core>

#include "mgdd/common/enum_names.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

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

VectorXd next(const LearningSettings& settings, const VectorXd& error) {
  IterativeLearning learner(settings);
  learner.ask();
  learner.tell(as_column(error));
  return as_vector(learner.ask());
}

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

// Closed forms of one update with relative degree 1; errors before the window are zero, behind it the last one.
TEST(IterativeLearning, LawsReadTheErrorAsPrinted) {
  const VectorXd e{{7.0, 1.0, -2.0, 4.0, 3.0}};
  const LearningSettings base{.initial = {0.1, 0.2, 0.3, 0.4, 0.5}, .relative_degree = 1};
  const auto expect = [&](const LearningSettings& settings, const Column& change) {
    const VectorXd u = next(settings, e);
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
