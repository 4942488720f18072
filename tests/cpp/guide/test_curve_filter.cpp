// Where a known curve stands: Bayes' rule against a slow direct integral, invariances, memory and lag.
#include "mgdd/guide/curve_filter.hpp"

#include "mgdd/common/random.hpp"
#include "support/test.hpp"

namespace mgdd::guide {
namespace {

/// Steeper above its best input than below.
double skewed(double x) {
  return -0.03 * (std::exp(0.08 * x) - 1.0 - 0.08 * x) / 0.0064;
}

Curve skewed_curve(double best, double factor = 1.0) {
  std::vector<double> inputs, values;
  for (double x = best - 50.0; x <= best + 50.0; x += 0.5) {
    inputs.push_back(x);
    values.push_back(factor * skewed(x - best));
  }
  return {inputs, values};
}

CurveFilterSettings settings_on(double lower, double upper) {
  return {.lower = lower, .upper = upper, .prior_sd = 10.0};
}

TEST(CurveFilter, FindsPlaceAndScaleOfAMovedCurve) {
  for (const double place : {-14.0, -3.2, 6.0}) {
    CurveFilter filter(settings_on(-30.0, 10.0), skewed_curve(-2.0));
    for (int k = 0; k < 40; ++k) {
      // Three inputs alone would fit a curve that is steep on one side as well.
      const double x = place + std::array{5.0, -3.0, 0.5, -6.0, 2.0}[static_cast<std::size_t>(k % 5)];
      filter.learn(x, 17.0 + 1.25 * skewed(x - place));
    }
    EXPECT_NEAR(filter.mean(), place, 0.26) << "half the distance of two places";
    EXPECT_NEAR(filter.scale(), 1.25, 0.1) << "between what is read and one";
    EXPECT_LT(filter.spread(), 0.5);
    EXPECT_LT(filter.noise_sd(), 0.1);
    EXPECT_NEAR(filter.predict(place + 2.0).mean, 17.0 + 1.25 * skewed(2.0), 0.05);
  }
}

// o, S and the noise's variance are integrated on grids here, readings do not fade.
TEST(CurveFilter, IsWhatADirectIntegralGives) {
  CurveFilterSettings settings = settings_on(-20.0, 20.0);
  settings.memory_cycles = 1e9;
  settings.discrepancy = 0.0;
  const Curve curve = skewed_curve(0.0);
  CurveFilter filter(settings, curve);
  std::vector<double> inputs, readings;
  for (std::size_t i = 0; i < 12; ++i) {
    inputs.push_back((i % 3 == 0 ? 6.0 : i % 3 == 1 ? -4.0 : 3.0) + 0.1 * static_cast<double>(i));
    readings.push_back(0.3 + 1.2 * skewed(inputs.back() + 3.0) + 0.3 * random::normal(1, 1, i));
    filter.learn(inputs.back(), readings.back());
  }

  const double guess = std::pow(0.5 * curve.curvature(3.0) * 9.0, 2);
  double sum = 0.0, first = 0.0, second = 0.0;
  const double widths[3][3] = {{1.0, 1.0, 0.0}, {0.35, 1.0, -3.0}, {1.0, 0.35, -3.0}};
  for (double place = -20.0; place <= 20.001; place += 1.0) {
    for (const auto& [below, above, log_prior] : widths) {
      double evidence = 0.0;
      for (double scale = -0.5; scale <= 2.6; scale += 0.04) {
        const double a = (scale - 1.0) / settings.scale_sd;
        for (double offset = -6.0; offset <= 8.0; offset += 0.05) {
          double squares = 0.0;
          for (std::size_t i = 0; i < inputs.size(); ++i) {
            const double away = inputs[i] - place;
            const double off =
                readings[i] - offset - scale * (curve(away / (away < 0.0 ? below : above)) - curve.top());
            squares += off * off;
          }
          // Inverse gamma over the variance, worth four readings of the guess, integrated by hand: Student's t.
          evidence += std::exp(-0.5 * a * a) * std::pow(4.0 * guess + squares, -0.5 * (4.0 + 12.0));
        }
      }
      const double weight = evidence * std::exp(-0.5 * place * place / 100.0 + log_prior);
      sum += weight;
      first += weight * place;
      second += weight * place * place;
    }
  }
  const double mean = first / sum, sd = std::sqrt(second / sum - mean * mean);
  // The filter puts one variance for all under the prior of S and hardly believes S < 0.1: near, not equal.
  EXPECT_NEAR(filter.mean(), mean, 0.15 * sd);
  EXPECT_NEAR(filter.spread(), sd, 0.15 * sd);
}

TEST(CurveFilter, MirroredReadingsGiveTheMirroredPlace) {
  const Curve parabola = Curve::parabola(-0.05, 0.0, 50.0);
  CurveFilter left(settings_on(-20.0, 20.0), parabola), right(left);
  for (int k = 0; k < 12; ++k) {
    const double x = k % 3 == 0 ? 5.0 : k % 3 == 1 ? -1.0 : 8.0;
    const double j = -0.025 * (x - 7.0) * (x - 7.0) + 0.1 * (k % 2);
    right.learn(x, j);
    left.learn(-x, j);
  }
  EXPECT_NEAR(left.mean(), -right.mean(), 1e-9);
  EXPECT_NEAR(left.spread(), right.spread(), 1e-9);
  EXPECT_GT(right.mean(), 5.0);
}

TEST(CurveFilter, ALagIsPartOfTheHypotheses) {
  CurveFilterSettings settings = settings_on(-30.0, 10.0);
  settings.lag_cycles = 7.0;
  CurveFilter filter(settings, skewed_curve(-2.0));
  const double share = -std::expm1(-1.0 / 7.0);
  double level = skewed(-18.0 + 9.0);  // settled at the first input
  for (int k = 0; k < 60; ++k) {
    const double x = k < 5 ? -18.0 : (k / 10 % 2 == 0 ? -5.0 : -12.0);
    level += share * (skewed(x + 9.0) - level);
    if (k % 7 == 3) {
      filter.pass(x);  // a misfire
    } else {
      filter.learn(x, 2.0 + level);
    }
  }
  EXPECT_NEAR(filter.mean(), -9.0, 0.3);
}

// A level is not known, so that readings of one input alone say nothing of the place, however far below the top they
// lie.
TEST(CurveFilter, OneInputAloneSaysNothingOfThePlace) {
  CurveFilter filter(settings_on(-40.0, 36.0), skewed_curve(-2.0));
  for (int k = 0; k < 80; ++k)
    filter.learn(-16.0, 3.0 + 0.3 * random::normal(5, 1, static_cast<std::uint64_t>(k)));
  EXPECT_NEAR(filter.mean(), -2.0, 0.05);
  EXPECT_NEAR(filter.spread(), 10.0, 0.2);
  EXPECT_NEAR(filter.noise_sd(), 0.3, 0.06) << "what is read far from the top is noise as well";
}

TEST(CurveFilter, APriorThatIsWrongFades) {
  const double place = -14.0, expected = -9.0;
  const int seeds = 40;
  double early = 0.0, late = 0.0;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    CurveFilter filter(settings_on(-30.0, 10.0), skewed_curve(-2.0));
    filter.restart(skewed_curve(-2.0), expected, 1.5);
    for (std::uint64_t k = 0; k < 700; ++k) {
      const double x = place + (k % 2 == 0 ? 1.0 : -1.0);
      filter.learn(x, skewed(x - place) + 0.25 * random::normal(seed, 6, k));
      if (k == 19) early += (filter.mean() - place) / seeds;
    }
    late += (filter.mean() - place) / seeds;
  }
  EXPECT_GT(early, 3.0) << "the prior is believed at first";
  EXPECT_NEAR(late, 0.0, 0.85) << "a prior that stays holds the end 2.9 away";
}

TEST(CurveFilter, OldReadingsFade) {
  CurveFilterSettings settings = settings_on(-30.0, 10.0);
  settings.memory_cycles = 20.0;
  CurveFilter filter(settings, skewed_curve(-2.0));
  for (int k = 0; k < 400; ++k) {
    const double x = k % 2 == 0 ? -12.0 : -4.0;
    filter.learn(x, skewed(x + 8.0) + 0.1 * random::normal(5, 1, static_cast<std::uint64_t>(k)));
  }
  EXPECT_NEAR(filter.readings(), 1.0 / -std::expm1(-1.0 / 20.0), 1e-6);
}

TEST(CurveFilter, ADoubtThrowsNothingAwayButSeesAMove) {
  for (const double moved : {0.0, 6.0}) {
    CurveFilter filter(settings_on(-30.0, 10.0), skewed_curve(-2.0));
    const auto told = [&](int from, int to, double place) {
      for (int k = from; k < to; ++k) {
        const double x = std::array{-12.0, -4.0, 2.0}[static_cast<std::size_t>(k % 3)];
        filter.learn(x, skewed(x - place) + 0.1 * random::normal(5, 1, static_cast<std::uint64_t>(k)));
      }
    };
    told(0, 60, -8.0);
    const double narrow = filter.spread();
    filter.doubt(0.01);
    EXPECT_GT(filter.spread(), 1.5 * narrow);
    EXPECT_NEAR(filter.readings(), 49.0, 1.0) << "fading with 143 alone";
    told(60, 72, -8.0 + moved);
    EXPECT_NEAR(filter.mean(), -8.0 + moved, 1.0);
    told(72, 172, -8.0 + moved);
    EXPECT_LT(filter.spread(), 0.2) << "the readings of before are given up, those of after count for long";
  }
}

TEST(CurveFilter, StatesAnErrorThatHolds) {
  int inside = 0;
  const int runs = 300;
  for (std::uint64_t seed = 0; seed < runs; ++seed) {
    CurveFilterSettings settings = settings_on(-30.0, 10.0);
    settings.memory_cycles = 1e9;
    const double place = -2.0 + 8.0 * random::normal(seed, 1, 0);
    if (place < -28.0 || place > 8.0) continue;
    CurveFilter filter(settings, skewed_curve(-2.0));
    for (int k = 0; k < 12; ++k) {
      const double x = place + (k % 2 == 0 ? 4.0 : -4.0) + 2.0;
      filter.learn(x, skewed(x - place) + 0.25 * random::normal(seed, 2, static_cast<std::uint64_t>(k)));
    }
    inside += std::abs(filter.mean() - place) <= 1.96 * filter.spread();
  }
  EXPECT_GE(inside, 0.88 * runs);
}

}  // namespace
}  // namespace mgdd::guide
