#include "mgdd/math/zero_phase.hpp"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

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

}  // namespace
}  // namespace mgdd
