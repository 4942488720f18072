// The autocorrelation time against its closed form for first-order sequences, (1 + rho)/(1 - rho).
#include "mgdd/math/autocorrelation.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/random.hpp"

namespace mgdd {
namespace {

double mean_time(double rho, std::size_t n) {
  double sum = 0.0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    std::vector<double> r(n);
    for (std::size_t i = 0; i < n; ++i) {
      const double own = random::normal(seed, 3, i);
      r[i] = i == 0 ? own : rho * r[i - 1] + std::sqrt(1.0 - rho * rho) * own;
    }
    sum += autocorrelation_time(r) / 100.0;
  }
  return sum;
}

TEST(Autocorrelation, TimeOfFirstOrderSequences) {
  EXPECT_NEAR(mean_time(0.0, 2000), 1.0, 0.1);
  EXPECT_NEAR(mean_time(0.5, 2000), 3.0, 0.3);
  EXPECT_NEAR(mean_time(0.9, 4000), 19.0, 2.0);
  EXPECT_NEAR(mean_time(-0.6, 500), 1.0, 1e-9);  // never better than independent
}

TEST(Autocorrelation, EdgesAreFinite) {
  EXPECT_EQ(autocorrelation_time({}), 1.0);
  EXPECT_EQ(autocorrelation_time(std::vector<double>(50, 0.0)), 1.0);
  EXPECT_EQ(autocorrelation_time(std::vector<double>{2.0}), 1.0);
  EXPECT_GT(autocorrelation_time(std::vector<double>(50, 1.0)), 20.0);  // an offset is one sample
}

}  // namespace
}  // namespace mgdd
