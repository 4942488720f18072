// The process against plain Bayesian algebra written anew, and the knowledge gradient against a sum over many draws.
#include <Eigen/Dense>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/belief/process_model.hpp"
#include "mgdd/optimize/laws/most_worth.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

Inputs at(double a, double b) {
  Inputs z(2);
  z << a, b;
  return z;
}

// A plane, bends and a coupling, none of them symmetric.
double surface(const Inputs& z) {
  return 7.0 + 3.0 * z[0] - 2.0 * z[1] - 20.0 * z[0] * z[0] - 11.0 * z[1] * z[1] + 6.0 * z[0] * z[1];
}

ProcessModel told(int readings, double noise_sd, ProcessModel::Settings settings) {
  settings.inputs = 2;
  ProcessModel model(settings);
  const Inputs about = at(0.4, 0.6);
  for (int k = 0; k < readings; ++k) {
    const auto index = static_cast<std::uint64_t>(k);
    const Inputs z = at(random::uniform(1, 1, index), random::uniform(1, 2, index));
    model.record(z, surface(z) + noise_sd * random::normal(1, 3, index), about);
    if (model.count() > 2) model.fit(about);
  }
  return model;
}

TEST(ProcessModel, ReadsASurfaceOfSecondOrderOffItsReadings) {
  for (const bool bends_down : {true, false}) {
    ProcessModel model = told(30, 0.05, {.bends_down = bends_down});
    InputTable points(3, 2);
    points << 0.2, 0.7, 0.9, 0.1, 0.5, 0.5;
    model.predict(points, 3);
    for (int p = 0; p < 3; ++p) {
      const Inputs z = points.row(p).transpose();
      EXPECT_NEAR(model.mean(p), surface(z), 0.25) << p;
      EXPECT_LT(std::sqrt(model.covariance(p, p)), 0.25) << p;
    }
    EXPECT_NEAR(model.noise_sd(), 0.05, 0.04);
  }
}

TEST(ProcessModel, CovariancesAreThoseOfOneNormalDistribution) {
  ProcessModel model = told(12, 0.1, {});
  InputTable points(5, 2);
  points << 0.1, 0.1, 0.9, 0.3, 0.5, 0.8, 0.4, 0.6, 0.0, 1.0;
  model.predict(points, 5);
  Eigen::MatrixXd c(5, 5);
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < 5; ++j)
      c(i, j) = model.covariance(i, j);
  }
  EXPECT_LT((c - c.transpose()).cwiseAbs().maxCoeff(), 1e-9 * c.cwiseAbs().maxCoeff());
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(c).eigenvalues().minCoeff(), -1e-8 * c.maxCoeff());
}

// One more reading with known noise changes mean and variance as the rule of Bayes says for two normal numbers.
TEST(ProcessModel, AReadingChangesItsOwnPointAsBayesSays) {
  const ProcessModel::Settings settings{.memory = 1e12, .noise_sd = 0.3};
  ProcessModel model = told(80, 0.3, settings);  // so many that the numbers of the process hardly move any more
  InputTable point(1, 2);
  point << 0.95, 0.95;
  model.predict(point, 1);
  const double mean = model.mean(0), variance = model.covariance(0, 0);
  model.record(at(0.95, 0.95), mean + 1.0, at(0.4, 0.6));
  model.fit(at(0.4, 0.6));
  model.predict(point, 1);
  const double share = variance / (variance + 0.09);
  EXPECT_NEAR(model.mean(0) - mean, share, 0.15 * share + 0.01);
  EXPECT_NEAR(model.covariance(0, 0), variance * (1.0 - share), 0.15 * variance);
}

TEST(ProcessModel, FullItForgetsOldReadingsNearTheEstimateAndKeepsFarOnes) {
  const ProcessModel::Settings settings{.inputs = 1, .kept = 10};
  ProcessModel model(settings);
  const Inputs about = scalar_input(0.5);
  model.record(scalar_input(0.0), -5.0, about);
  model.record(scalar_input(1.0), -6.0, about);
  for (int k = 0; k < 40; ++k) {
    model.record(scalar_input(0.5 + 1e-3 * k), 0.0, about);
    model.fit(about);
  }
  EXPECT_EQ(model.count(), 10);
  InputTable ends(2, 1);
  ends << 0.0, 1.0;
  model.predict(ends, 2);
  EXPECT_NEAR(model.mean(0), -5.0, 0.5);
  EXPECT_NEAR(model.mean(1), -6.0, 0.5);
}

TEST(ProcessModel, RowsOfCovariancesAreThoseOfEachPair) {
  ProcessModel model = told(25, 0.2, {.most_points = 700});
  InputTable points(700, 2);
  for (int p = 0; p < 700; ++p) {
    points.row(p) << random::uniform(5, 1, static_cast<std::uint64_t>(p)),
        random::uniform(5, 2, static_cast<std::uint64_t>(p));
  }
  model.predict(points, 700);
  const std::array<int, 10> of{3, 699, 4, 5, 500, 6, 7, 8, 9, 0};
  std::vector<int> with(698);  // all but two, the last ones first
  for (int p = 0; p < 698; ++p)
    with[static_cast<std::size_t>(p)] = 699 - p;
  InputTable rows(10, 698);
  model.covariances(of, with, rows);
  for (Eigen::Index k = 0; k < 10; ++k) {
    const int own = of[static_cast<std::size_t>(k)];
    for (const int p : {2, 3, 499, 500, 699})
      EXPECT_NEAR(rows(k, 699 - p), model.covariance(own, p), 1e-9 * model.covariance(own, own)) << own << ' ' << p;
  }
}

// Four readings at one place are as good as their mean, said to be of four.
TEST(ProcessModel, AMeanOfReadingsCountsAsAllOfThem) {
  const ProcessModel::Settings apart{.inputs = 1, .memory = 1e9, .noise_sd = 0.5};
  ProcessModel each(apart), mean(apart);
  const Inputs about = scalar_input(0.5);
  for (int k = 0; k < 12; ++k) {
    const Inputs z = scalar_input(0.08 * k);
    std::array<double, 4> read{};
    for (std::size_t r = 0; r < read.size(); ++r)
      read[r] = std::sin(3.0 * z[0]) + 0.5 * random::normal(6, static_cast<std::uint64_t>(k), r);
    for (const double value : read)
      each.record(z, value, about);
    mean.record(z, (read[0] + read[1] + read[2] + read[3]) / 4.0, about, 4.0);
  }
  InputTable points(3, 1);
  points << 0.11, 0.47, 0.83;
  each.fit(about);
  mean.fit(about);
  each.predict(points, 3);
  mean.predict(points, 3);
  for (int p = 0; p < 3; ++p) {
    EXPECT_NEAR(mean.mean(p), each.mean(p), 0.15) << p;
    EXPECT_NEAR(mean.sd(p), each.sd(p), 0.3 * each.sd(p)) << p;
  }
}

TEST(KnowledgeGradient, IsTheMeanRiseOfTheLargest) {
  const std::vector<double> mean{1.0, 0.4, 0.9, -3.0, 1.0}, effect{0.2, -0.7, 1.1, 0.05, 0.2};
  std::vector<int> order(5);
  std::vector<double> breaks(5);
  const double found = knowledge_gradient(mean, effect, order, breaks);
  double sum = 0.0;
  constexpr int cells = 200'000;
  for (int k = 0; k < cells; ++k) {  // over even shares of probability
    const double z = random::normal_quantile((k + 0.5) / cells);
    double largest = -1e9;
    for (std::size_t i = 0; i < mean.size(); ++i)
      largest = std::max(largest, mean[i] + effect[i] * z);
    sum += largest / cells;
  }
  EXPECT_NEAR(found, sum - 1.0, 1e-4);
  const std::vector<double> same{0.3, 0.3, 0.3};
  EXPECT_EQ(knowledge_gradient(std::vector<double>{1.0, 2.0, 0.0}, same, {order.data(), 3}, {breaks.data(), 3}), 0.0);
}

// Two sure means at inputs that lie close together tell a slope that their mean does not.
TEST(ProcessModel, MeansAreKeptApartWhereWhatLiesBetweenThemIsMoreThanTheirNoise) {
  const Inputs about = at(0.4, 0.6), here = at(0.40, 0.58), beside = at(0.408, 0.58);
  for (const double readings : {1.0, 400.0}) {
    ProcessModel model = told(40, 0.3, {.alike = 0.01});
    model.record(here, surface(here), about, readings);
    const int count = model.count();
    model.record(beside, surface(beside), about, readings);
    EXPECT_EQ(model.count(), readings > 1.0 ? count + 1 : count) << readings;
    model.record(beside, surface(beside), about, readings);
    EXPECT_EQ(model.count(), readings > 1.0 ? count + 1 : count) << "the same input";
  }
}

TEST(ProcessModel, NoReadingIsSurerThanThoseOfAVisitWereAmongThemselves) {
  for (const double within : {0.0, 0.7}) {
    ProcessModel model({.inputs = 2, .memory = 1e9});
    for (std::uint64_t k = 0; k < 20; ++k) {
      const Inputs z = at(random::uniform(3, 1, k), random::uniform(3, 2, k));
      model.scattered(within, 25.0);
      model.record(z, surface(z) + 0.02 * random::normal(3, 3, k), at(0.5, 0.5), 25.0);
    }
    model.fit(at(0.5, 0.5));
    if (within > 0.0) {
      EXPECT_NEAR(model.noise_sd(), within, 1e-12);
    } else {
      EXPECT_LT(model.noise_sd(), 0.4);  // of 0.02 times 5
    }
  }
}

TEST(ProcessModel, AnOddReadingCountsOnceItIsReadAgain) {
  const Inputs here = at(0.31, 0.62), about = at(0.5, 0.5);
  InputTable asked(1, 2);
  asked.row(0) = here.transpose();
  const auto known = [&](ProcessModel& model) {
    model.fit(about);
    model.predict(asked, 1);
    return model.mean(0);
  };
  for (const double second : {0.0, 4.0}) {
    ProcessModel model = told(30, 0.1, {.alike = 0.01, .repeated = true});
    const double before = known(model);
    EXPECT_GT(model.record(here, before + 4.0, about), 100.0);
    EXPECT_NEAR(known(model), before, 0.2) << "it is not believed alone";
    const double odd = model.record(here, before + second, about);
    EXPECT_LT(odd, 9.0) << second;
    const double after = known(model);
    EXPECT_NEAR(after, before + second, 0.2 + 0.5 * second) << second;  // its neighbours still speak against it
  }
}

}  // namespace
}  // namespace mgdd::optimize
