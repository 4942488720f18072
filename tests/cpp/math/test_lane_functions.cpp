// Functions of numbers and lanes against the library: powers, exponential, logarithm and hyperbolic tangent.
#include "mgdd/math/fast_power.hpp"
#include "mgdd/math/fast_tanh.hpp"
#include "mgdd/math/lane_functions.hpp"
#include "support/test.hpp"

namespace mgdd {
namespace {

TEST(LaneFunctions, FourFifthsOverAHundredOctaves) {
  for (int i = -5000; i <= 5000; ++i) {
    const double x = std::exp2(0.01 * i + 0.0037);
    // (x^(4/5) / x)^5 x = 1, whatever the rounding of 0.8.
    const double root = lane_four_fifths(x) / x;
    EXPECT_NEAR(root * root * root * root * root * x, 1.0, 1e-14) << x;
    EXPECT_NEAR(inverse_fifth_root_guess(x) * std::pow(x, 0.2), 1.0, 0.04) << x;
    EXPECT_NEAR(inverse_fifth_root_first(x, inverse_fifth_root_guess(x)) * std::pow(x, 0.2), 1.0, 3e-7) << x;
  }
  EXPECT_EQ(lane_four_fifths(0.0), 0.0);
  EXPECT_NEAR(lane_four_fifths(32.0), 16.0, 1e-14);
  EXPECT_TRUE(std::isnan(lane_four_fifths(std::numeric_limits<double>::quiet_NaN())));
}

TEST(LaneFunctions, ExponentialAndLogarithm) {
  for (int i = -6990; i <= 6990; ++i) {
    const double x = 0.1 * i + 0.013;
    EXPECT_NEAR(lane_exp(x) / std::exp(x), 1.0, 5e-16) << x;
    const double y = std::exp(x);
    EXPECT_NEAR(lane_log(y), std::log(y), 4e-16 * std::fmax(1.0, std::abs(x))) << y;
  }
  EXPECT_EQ(lane_exp(0.0), 1.0);
  EXPECT_EQ(lane_log(1.0), 0.0);
  EXPECT_EQ(lane_exp(-1e9), lane_exp(-700.0));
  EXPECT_EQ(lane_exp(1e9), lane_exp(700.0));
  EXPECT_TRUE(std::isnan(lane_exp(std::numeric_limits<double>::quiet_NaN())));
}

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double tolerance = 1e-15;

static_assert(noexcept(fast_power<4, 5>(1.0)));

template <int P, int Q>
double relative_error(double x) {
  const long double exact = std::pow(static_cast<long double>(x), static_cast<long double>(P) / Q);
  return static_cast<double>(std::abs((fast_power<P, Q>(x) - exact) / exact));
}

template <int P, int Q>
double error_around(double x) {
  double worst = relative_error<P, Q>(x);
  for (const double toward : {0.0, infinity})
    worst = std::max(worst, relative_error<P, Q>(std::nextafter(x, toward)));
  return worst;
}

template <class Exponent>
class FastPower : public testing::Test {};

template <int P, int Q>
struct Ratio {
  static constexpr int p = P, q = Q;
};
using Exponents = testing::Types<Ratio<4, 5>, Ratio<2, 5>, Ratio<1, 4>>;

class ExponentNames {
 public:
  template <class T>
  static std::string GetName(int) {
    return std::to_string(T::p) + "_over_" + std::to_string(T::q);
  }
};
TYPED_TEST_SUITE(FastPower, Exponents, ExponentNames);

TYPED_TEST(FastPower, AgreesWithPowOverNineteenDecades) {
  std::mt19937_64 random(19);
  std::uniform_real_distribution<double> decade(-9.6, 9.6);
  for (int i = 0; i < 200000; ++i) {
    const double x = std::pow(10.0, decade(random));
    ASSERT_LT((relative_error<TypeParam::p, TypeParam::q>(x)), tolerance) << x;
  }
}

TYPED_TEST(FastPower, AgreesAtEveryBoundaryOfTheReduction) {
  for (int e = -32; e < 32; ++e) {
    for (int i = 0; i < 256; ++i) {
      const double x = std::ldexp(1.0 + i / 256.0, e);  // centres and edges of every interval
      // Just below 2^-32 std::pow answers, whose exponent is the rounded one: 1e-15 more.
      ASSERT_LT((error_around<TypeParam::p, TypeParam::q>(x)), 2 * tolerance) << x;
    }
  }
}

TYPED_TEST(FastPower, IsPowItselfOutsideTheRange) {
  constexpr double exponent = static_cast<double>(TypeParam::p) / TypeParam::q;
  for (const double x : {0x1p32, 1e12, 1e100, std::numeric_limits<double>::max(), 0x1.fffffffffffffp-33, 1e-12, 1e-300,
                         std::numeric_limits<double>::min(), std::numeric_limits<double>::denorm_min()}) {
    EXPECT_DOUBLE_EQ((fast_power<TypeParam::p, TypeParam::q>(x)), std::pow(x, exponent)) << x;
  }
}

TYPED_TEST(FastPower, TreatsSpecialValuesAsPowDoes) {
  constexpr auto power = [](double x) { return fast_power<TypeParam::p, TypeParam::q>(x); };
  EXPECT_EQ(power(0.0), 0.0);
  EXPECT_EQ(power(-0.0), 0.0);
  EXPECT_EQ(power(infinity), infinity);
  EXPECT_TRUE(std::isnan(power(std::numeric_limits<double>::quiet_NaN())));
  for (const double negative : {-1e-300, -1.0, -2.5e7, std::numeric_limits<double>::lowest()}) {
    EXPECT_TRUE(std::isnan(power(negative))) << negative;
  }
  EXPECT_NEAR(power(1.0), 1.0, tolerance);
}

// A step back at the seam of two intervals would be a false extremum for a seeker: none beyond rounding.
TYPED_TEST(FastPower, RisesAcrossEverySeam) {
  constexpr auto power = [](double x) { return fast_power<TypeParam::p, TypeParam::q>(x); };
  for (int e = -32; e < 32; ++e) {
    for (int i = 0; i < 128; ++i) {
      const double seam = std::ldexp(1.0 + i / 128.0, e);
      double before = power(seam * (1.0 - 4e-15));
      for (int step = -3; step <= 4; ++step) {
        const double here = power(seam * (1.0 + step * 1e-15));
        ASSERT_GT(here, before * (1.0 - tolerance)) << seam;
        before = here;
      }
      ASSERT_GT(power(seam * (1.0 + 1e-14)), power(seam * (1.0 - 1e-14))) << seam;
    }
  }
}

TEST(FastTanh, AgreesWithTheLibraryFromTinyToSaturated) {
  double worst = 0.0;
  for (int i = 0; i <= 200'000; ++i) {
    const double x = std::exp(-40.0 + 45.0 * i / 200'000.0);
    const double expected = static_cast<double>(std::tanh(static_cast<long double>(x)));
    worst = std::max(worst, std::abs(fast_tanh(x) - expected) / expected);
    ASSERT_EQ(fast_tanh(-x), -fast_tanh(x));
  }
  EXPECT_LT(worst, 2e-15);
}

TEST(FastTanh, LimitsAndNaN) {
  EXPECT_EQ(fast_tanh(0.0), 0.0);
  EXPECT_EQ(fast_tanh(infinity), 1.0);
  EXPECT_EQ(fast_tanh(-infinity), -1.0);
  EXPECT_TRUE(std::isnan(fast_tanh(std::numeric_limits<double>::quiet_NaN())));
}

}  // namespace
}  // namespace mgdd
