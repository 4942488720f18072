#include "support/fit_cases.hpp"

#include <array>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::optimize {
namespace {

// NIST Statistical Reference Datasets, Misra1a: y = b1 (1 - exp(-b2 x)); 11 certified digits.
TEST(LeastSquares, NistMisra1aFromBothStarts) {
  const std::array x{77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0};
  const std::array y{10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78};
  const auto model = [&](const VectorXd& b, VectorXd& r, MatrixXd* j) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double e = std::exp(-b[1] * x[i]);
      r[static_cast<Index>(i)] = b[0] * (1.0 - e) - y[i];
      if (j != nullptr) {
        j->row(static_cast<Index>(i)) << 1.0 - e, b[0] * x[i] * e;
      }
    }
    return true;
  };
  LeastSquares solver(named(2), 14);
  for (const VectorXd& start : {vector({500.0, 1e-4}), vector({250.0, 5e-4})}) {
    const FitReport fit = solver.solve(model, start);
    EXPECT_TRUE(fit.success()) << fit.brief();
    EXPECT_NEAR(fit.values[0], 2.3894212918E+02, 1e-7 * 239);
    EXPECT_NEAR(fit.values[1], 5.5015643181E-04, 1e-7 * 5.5e-4);
    EXPECT_NEAR(fit.standard_error[0], 2.7070075241E+00, 1e-7 * 2.7);
    EXPECT_NEAR(fit.standard_error[1], 7.2668688436E-06, 1e-7 * 7.3e-6);
    EXPECT_NEAR(2.0 * fit.cost, 1.2455138894E-01, 1e-10);
    EXPECT_EQ(fit.unidentifiable.size(), 2u) << "their correlation is -0.999";
  }
}

// NIST Statistical Reference Datasets, Thurber: cubic over cubic, 7 parameters, higher difficulty.
TEST(LeastSquares, NistThurberFromBothStarts) {
  const std::array x{-3.067, -2.981, -2.921, -2.912, -2.840, -2.797, -2.702, -2.699, -2.633, -2.481,
                     -2.363, -2.322, -1.501, -1.460, -1.274, -1.212, -1.100, -1.046, -0.915, -0.714,
                     -0.566, -0.545, -0.400, -0.309, -0.109, -0.103, 0.010,  0.119,  0.377,  0.790,
                     0.963,  1.006,  1.115,  1.572,  1.841,  2.047,  2.200};
  const std::array y{80.574,   84.248,   87.264,   87.195,   89.076,   89.608,   89.868,   90.101,   92.405,   95.854,
                     100.696,  101.060,  401.672,  390.724,  567.534,  635.316,  733.054,  759.087,  894.206,  990.785,
                     1090.109, 1080.914, 1122.643, 1178.351, 1260.531, 1273.514, 1288.339, 1327.543, 1353.863, 1414.509,
                     1425.208, 1421.384, 1442.962, 1464.350, 1468.705, 1447.894, 1457.628};
  const VectorXd certified = vector({1.2881396800E+03, 1.4910792535E+03, 5.8323836877E+02, 7.5416644291E+01,
                                     9.6629502864E-01, 3.9797285797E-01, 4.9727297349E-02});
  const VectorXd certified_error = vector({4.6647963344E+00, 3.9571156086E+01, 2.8698696102E+01, 5.5675370270E+00,
                                           3.1333340687E-02, 1.4984928198E-02, 6.5842344623E-03});
  const auto model = [&](const VectorXd& b, VectorXd& r, MatrixXd* j) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double t = x[i];
      const double top = b[0] + t * (b[1] + t * (b[2] + t * b[3]));
      const double bottom = 1.0 + t * (b[4] + t * (b[5] + t * b[6]));
      r[static_cast<Index>(i)] = top / bottom - y[i];
      if (j != nullptr) {
        const double f = -top / (bottom * bottom);
        j->row(static_cast<Index>(i)) << 1.0 / bottom, t / bottom, t * t / bottom, t * t * t / bottom, f * t, f * t * t,
            f * t * t * t;
      }
    }
    return true;
  };
  LeastSquares solver(named(7), 37);
  for (const VectorXd& start :
       {vector({1000, 1000, 400, 40, 0.7, 0.3, 0.03}), vector({1300, 1500, 500, 75, 1, 0.4, 0.05})}) {
    const FitReport fit = solver.solve(model, start);
    EXPECT_TRUE(fit.success()) << fit.brief();
    EXPECT_LT((fit.values - certified).cwiseQuotient(certified).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT((fit.standard_error - certified_error).cwiseQuotient(certified_error).cwiseAbs().maxCoeff(), 1e-5);
    EXPECT_NEAR(2.0 * fit.cost, 5.6427082397E+03, 1e-6);
  }
}

}  // namespace
}  // namespace mgdd::optimize
