// Decompositions that tests compare with, compiled once: as templates they are the dearest lines of a test file.
#pragma once

#include <Eigen/Core>

namespace mgdd::test_support {

/// a^-1 b, by the LU decomposition with partial pivoting.
Eigen::MatrixXd solved(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
Eigen::MatrixXd inverse(const Eigen::MatrixXd& a);
/// a b, added up in the order of the columns of a.
Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
/// a^T a
Eigen::MatrixXd gram(const Eigen::MatrixXd& a);

struct SingularValues {
  Eigen::VectorXd values;  // the largest first
  Eigen::MatrixXd left;
};
SingularValues singular_values(const Eigen::MatrixXd& a);
double largest_singular_value(const Eigen::MatrixXd& a);
/// The largest absolute eigenvalue.
double spectral_radius(const Eigen::MatrixXd& a);

}  // namespace mgdd::test_support
