#include "support/reference_algebra.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace mgdd::test_support {

using Eigen::MatrixXd;

MatrixXd solved(const MatrixXd& a, const MatrixXd& b) {
  return a.partialPivLu().solve(b);
}

MatrixXd inverse(const MatrixXd& a) {
  return solved(a, MatrixXd::Identity(a.rows(), a.cols()));
}

MatrixXd product(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd out = MatrixXd::Zero(a.rows(), b.cols());
  for (Eigen::Index k = 0; k < a.cols(); ++k) {
    for (Eigen::Index j = 0; j < b.cols(); ++j)
      out.col(j) += b(k, j) * a.col(k);
  }
  return out;
}

MatrixXd gram(const MatrixXd& a) {
  return product(a.transpose(), a);
}

SingularValues singular_values(const MatrixXd& a) {
  const Eigen::JacobiSVD<MatrixXd> svd(a, Eigen::ComputeFullU);
  return {svd.singularValues(), svd.matrixU()};
}

double largest_singular_value(const MatrixXd& a) {
  return singular_values(a).values[0];
}

double spectral_radius(const MatrixXd& a) {
  return a.eigenvalues().cwiseAbs().maxCoeff();
}

}  // namespace mgdd::test_support
