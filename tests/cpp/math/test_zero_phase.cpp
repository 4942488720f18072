// Filters without a shift of phase: low passes of second order, and bands.
#include <Eigen/Core>

#include "mgdd/common/error.hpp"
#include "mgdd/math/band_pass.hpp"
#include "mgdd/math/zero_phase.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd {
namespace {

Eigen::MatrixXd matrix_of(std::size_t n, double cutoff) {
  ZeroPhaseLowPass filter(n, cutoff);
  const auto size = static_cast<Eigen::Index>(n);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(size, size);
  for (Eigen::Index k = 0; k < size; ++k) {
    filter.apply({matrix.col(k).data(), n});
  }
  return matrix;
}

// Forward times backward is |H|^2, and reflection makes the cosines of the DCT-II its eigenvectors.
TEST(ZeroPhaseLowPass, CosinesAreScaledByTheSquaredButterworthGain) {
  for (const double cutoff : {0.01, 0.2, 0.5, 0.99}) {
    for (const std::size_t n : {1u, 2u, 7u, 50u}) {
      ZeroPhaseLowPass filter(n, cutoff);
      for (std::size_t k = 0; k < n; ++k) {
        const double frequency = static_cast<double>(k) / static_cast<double>(n);
        std::vector<double> wave(n);
        std::vector<double> expected(n);
        for (std::size_t t = 0; t < n; ++t) {
          wave[t] = std::cos(std::numbers::pi * frequency * (static_cast<double>(t) + 0.5));
          expected[t] = ZeroPhaseLowPass::gain(cutoff, frequency) * wave[t];
        }
        filter.apply(wave);
        for (std::size_t t = 0; t < n; ++t) {
          EXPECT_NEAR(wave[t], expected[t], 2e-12) << "cutoff " << cutoff << " n " << n << " k " << k;
        }
      }
    }
  }
}

TEST(ZeroPhaseLowPass, GainIsOneHalfAtTheCutoff) {
  for (const double cutoff : {0.05, 0.2, 0.7}) {
    EXPECT_NEAR(ZeroPhaseLowPass::gain(cutoff, cutoff), 0.5, 1e-15);
    EXPECT_EQ(ZeroPhaseLowPass::gain(cutoff, 0.0), 1.0);
    EXPECT_LT(ZeroPhaseLowPass::gain(cutoff, 1.0), 1e-30);
  }
}

TEST(ZeroPhaseLowPass, MatrixIsSymmetricAndKeepsAConstant) {
  const Eigen::MatrixXd q = matrix_of(40, 0.2);
  EXPECT_LT((q - q.transpose()).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT((q.rowwise().sum().array() - 1.0).abs().maxCoeff(), 1e-13);
  EXPECT_GT((q - Eigen::MatrixXd::Identity(40, 40)).norm(), 1.0);
}

TEST(ZeroPhaseLowPass, AllocatesNothingAndRefusesBadCutoffs) {
  std::vector<double> column(300, 1.0);
  ZeroPhaseLowPass filter(column.size(), 0.1);
  const test_support::AllocationCounter counter;
  filter.apply(column);
  EXPECT_EQ(counter.count(), 0u);
  static_assert(noexcept(filter.apply(column)));
  for (const double cutoff : {0.0, 0.009, 0.991, 1.0, -0.2, std::nan("")}) {
    EXPECT_THROW(ZeroPhaseLowPass(10, cutoff), ParameterError) << cutoff;
  }
  EXPECT_THROW(ZeroPhaseLowPass(0, 0.2), ParameterError);
}

double tone(double frequency, double sample) {
  return std::sin(std::numbers::pi * frequency * sample + 0.3);
}

// Largest difference of the filtered tone from `factor` times the tone at the same place.
double largest_error(const BandPass& band, double frequency, double factor) {
  std::vector<double> column(300 + 2 * band.reach()), out(300);
  for (std::size_t k = 0; k < column.size(); ++k)
    column[k] = tone(frequency, static_cast<double>(k));
  band.apply(column, out);
  double most = 0.0;
  for (std::size_t k = 0; k < out.size(); ++k)
    most = std::max(most, std::abs(out[k] - factor * column[k + band.reach()]));
  return most;
}

TEST(MathBandPass, KeepsItsBandAndNothingElse) {
  const BandPass band(0.2, 0.7, 0.08);
  for (const double inside : {0.24, 0.3, 0.45, 0.66})
    EXPECT_LT(largest_error(band, inside, 1.0), 1.1e-4) << inside;
  for (const double outside : {0.01, 0.1, 0.16, 0.74, 0.95})
    EXPECT_LT(largest_error(band, outside, 0.0), 1.1e-4) << outside;
  for (const double edge : {0.2, 0.7})
    EXPECT_LT(largest_error(band, edge, 0.5), 2e-4) << edge;
}

TEST(MathBandPass, GainIsWhatATonePassesWith) {
  const BandPass band(0.13, 0.51, 0.1);
  for (double f = 0.02; f < 1.0; f += 0.035)
    EXPECT_LT(largest_error(band, f, band.gain(f)), 1e-12) << f;
}

TEST(MathBandPass, AnUpperEdgeBeyondNyquistMakesAHighPass) {
  for (const double high : {0.97, 1.0, 7.0}) {
    const BandPass band(0.3, high, 0.1);
    EXPECT_NEAR(band.gain(0.99), 1.0, 1.1e-4);
    EXPECT_NEAR(band.gain(0.36), 1.0, 1.1e-4);
    EXPECT_LT(std::abs(band.gain(0.24)), 1.1e-4);
  }
}

TEST(MathBandPass, ASharperTransitionReachesFarther) {
  EXPECT_GT(BandPass(0.2, 0.7, 0.04).reach(), 1.9 * static_cast<double>(BandPass(0.2, 0.7, 0.08).reach()));
}

TEST(MathBandPass, RefusesABandThatCannotBe) {
  EXPECT_THROW(BandPass(0.0, 0.5, 0.1), ParameterError);
  EXPECT_THROW(BandPass(1.0, 2.0, 0.1), ParameterError);
  EXPECT_THROW(BandPass(0.4, 0.4, 0.1), ParameterError);
  EXPECT_THROW(BandPass(0.2, 0.5, 0.4), ParameterError);
  EXPECT_THROW(BandPass(0.2, 0.5, std::nan("")), ParameterError);
}

TEST(MathBandPass, AllocatesNothing) {
  const BandPass band(0.2, 0.7, 0.08);
  static_assert(noexcept(band.apply({}, {})));
  std::vector<double> column(100 + 2 * band.reach(), 1.0), out(100);
  band.apply(column, out);
  const test_support::AllocationCounter counter;
  band.apply(column, out);
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace mgdd
