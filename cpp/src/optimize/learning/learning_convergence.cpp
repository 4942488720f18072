#include "mgdd/optimize/learning/learning_convergence.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Complex = std::complex<double>;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double stalled = 1e-6;  // a radius this close to 1 leaves some error for millions of trials

double largest_singular_value(const MatrixXd& matrix) {
  if (!matrix.allFinite()) return infinity;
  const double scale = matrix.cwiseAbs().maxCoeff();
  if (scale == 0.0) return 0.0;
  const MatrixXd scaled = matrix / scale;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(scaled.transpose() * scaled, Eigen::EigenvaluesOnly);
  return scale * std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

// First column of G^-1, itself lower-triangular Toeplitz: its norm gives the smallest singular value of G to all
// digits.
VectorXd inverse_response(const VectorXd& h) {
  VectorXd inverse(h.size());
  inverse[0] = 1.0 / h[0];
  for (Index k = 1; k < h.size(); ++k) {
    inverse[k] = -h.segment(1, k).dot(inverse.head(k).reverse()) / h[0];
  }
  return inverse;
}

MatrixXd learning_matrix(const LearningUpdate& law) {
  const auto n = static_cast<Index>(law.samples());
  MatrixXd matrix = MatrixXd::Zero(n, n);
  const auto lead = static_cast<Index>(law.lead());
  for (Index t = 0; t < n; ++t) {
    for (Index i = 0; i < static_cast<Index>(law.taps().size()) && i <= t + lead; ++i) {
      matrix(t, std::min(t + lead - i, n - 1)) += law.taps()[static_cast<std::size_t>(i)];
    }
  }
  return matrix;
}

void filter_columns(LearningUpdate& law, MatrixXd& matrix) {
  for (Index k = 0; k < matrix.cols(); ++k) {
    law.filter({matrix.col(k).data(), static_cast<std::size_t>(matrix.rows())});
  }
}

// Closed forms: with S = G^T We G + Wu + Wd, input and error map are Wd S^-1 and its mirror image in G G^T.
void judge_norm_optimal(const LearningUpdate& law, ConvergenceReport& report) {
  const double largest_inverse = largest_singular_value(toeplitz(inverse_response(law.response())));
  const double pull = law.error_weight() / (largest_inverse * largest_inverse) + law.input_weight();
  report.spectral_radius = law.change_weight() / (pull + law.change_weight());
  report.radius_is_exact = true;
  report.sigma_max = report.spectral_radius;
  // Strict for any weights, also where the quotient rounds to 1.
  report.asymptotic = report.monotone = pull > 0.0;
  if (!report.asymptotic) return;
  const MatrixXd g = toeplitz(law.response());
  const Index n = g.rows();
  if (law.input_weight() > 0.0) {
    MatrixXd normal = law.error_weight() * (g * g.transpose());
    normal.diagonal().array() += law.input_weight();
    report.limit_error_map = law.input_weight() * normal.llt().solve(MatrixXd::Identity(n, n));
    report.limit_error_gain = law.input_weight() / pull;
  } else {
    report.limit_error_map = MatrixXd::Zero(n, n);
    report.limit_error_gain = 0.0;
  }
}

// A causal plant makes the map far from normal, and its computed eigenvalues meaningless for long trials. The similar
// matrix m(i, k) a^(i-k) has the same ones; the a of least Frobenius norm brings it closest to normal.
void weight_by_time(MatrixXd& m) {
  const Index n = m.rows();
  VectorXd below(n);
  VectorXd above(n);
  for (Index k = 0; k < n; ++k) {
    below[k] = m.diagonal(-k).squaredNorm();
    above[k] = m.diagonal(k).squaredNorm();
  }
  double best = 1.0;
  double least = infinity;
  for (int step = 0; step <= 64; ++step) {
    const double a = std::exp2(-step / 64.0);
    double sum = 0.0;
    for (Index k = 0; k < n; ++k) {
      const double weight = std::pow(a * a, static_cast<double>(k));
      sum += below[k] * weight + (above[k] > 0.0 ? above[k] / weight : 0.0);
    }
    if (sum < least) least = sum, best = a;
  }
  for (Index k = -n + 1; k < n; ++k) {
    m.diagonal(-k) *= std::pow(best, static_cast<double>(k));
  }
}

double radius(const LearningUpdate& law, MatrixXd input_map, bool& exact) {
  const auto ahead = law.taps().begin() + static_cast<std::ptrdiff_t>(std::min(law.lead(), law.taps().size()));
  const bool causal = std::all_of(law.taps().begin(), ahead, [](double tap) { return tap == 0.0; });
  exact = causal && !law.cutoff();
  if (exact) {
    const double first = law.lead() < law.taps().size() ? law.taps()[law.lead()] : 0.0;
    return std::abs(1.0 - first * law.response()[0]);
  }
  if (!input_map.allFinite()) return infinity;
  weight_by_time(input_map);
  if (!input_map.allFinite()) return infinity;
  const Eigen::EigenSolver<MatrixXd> solver(input_map, false);
  if (solver.info() != Eigen::Success) {
    throw ConvergenceError("the eigenvalues of Q (I - L G) were not found: scale impulse_response and gains");
  }
  return solver.eigenvalues().cwiseAbs().maxCoeff();
}

void judge(LearningUpdate law, ConvergenceReport& report) {
  const MatrixXd g = toeplitz(law.response());
  const Index n = g.rows();
  const MatrixXd identity = MatrixXd::Identity(n, n);
  MatrixXd learned = learning_matrix(law);  // Q L once filtered
  MatrixXd input_map = identity - learned * g;
  if (!law.cutoff()) {
    report.sigma_max = largest_singular_value(identity - g * learned);
  } else {
    filter_columns(law, learned);
    filter_columns(law, input_map);
    const MatrixXd inverse = toeplitz(inverse_response(law.response()));
    report.sigma_max = largest_singular_value(g * input_map * inverse);
  }
  report.spectral_radius = radius(law, input_map, report.radius_is_exact);
  report.asymptotic = report.spectral_radius < 1.0;
  report.monotone = report.sigma_max < 1.0;
  if (!report.asymptotic) return;
  if (law.cutoff()) {
    // Not LU: behind its last block Eigen 3.4.1 binds a null reference, which the undefined-behaviour sanitizer
    // refuses.
    report.limit_error_map = identity - g * (identity - input_map).householderQr().solve(learned);
    report.limit_error_gain = largest_singular_value(report.limit_error_map);
  } else {
    report.limit_error_map = MatrixXd::Zero(n, n);
    report.limit_error_gain = 0.0;
  }
}

double frequency_response(const LearningUpdate& law, double frequency) {
  const Complex back = std::polar(1.0, -std::numbers::pi * frequency);  // z^-1
  Complex g = 0.0;
  for (Index k = law.response().size(); k-- > 0;) {
    g = g * back + law.response()[k];
  }
  if (law.is_norm_optimal()) {
    return law.change_weight() / (law.error_weight() * std::norm(g) + law.input_weight() + law.change_weight());
  }
  Complex l = 0.0;
  for (std::size_t i = law.taps().size(); i-- > 0;) {
    l = l * back + law.taps()[i];
  }
  l *= std::polar(1.0, std::numbers::pi * frequency * static_cast<double>(law.lead()));
  return std::abs(1.0 - l * g) * (law.cutoff() ? ZeroPhaseLowPass::gain(*law.cutoff(), frequency) : 1.0);
}

// A grid finer than the ripples of n samples, then golden section around its best point.
void scan_frequencies(const LearningUpdate& law, ConvergenceReport& report) {
  const int cells = std::max(1024, 8 * static_cast<int>(law.samples() + law.taps().size()));
  int best = 0;
  double highest = -1.0;
  for (int i = 0; i <= cells; ++i) {
    const double value = frequency_response(law, static_cast<double>(i) / cells);
    if (value > highest) highest = value, best = i;
  }
  double low = static_cast<double>(std::max(best - 1, 0)) / cells;
  double high = static_cast<double>(std::min(best + 1, cells)) / cells;
  report.worst_frequency = static_cast<double>(best) / cells;
  for (int i = 0; i < 60; ++i) {
    const double inner = (std::numbers::phi - 1.0) * (high - low);
    const bool right = frequency_response(law, low + inner) > frequency_response(law, high - inner);
    (right ? low : high) = right ? high - inner : low + inner;
  }
  const double refined = frequency_response(law, 0.5 * (low + high));
  report.frequency_gain = std::max(highest, refined);
  if (refined > highest) report.worst_frequency = 0.5 * (low + high);
}

std::string describe(const ConvergenceReport& r) {
  if (!r.asymptotic) {
    return "diverges: spectral radius " + text(r.spectral_radius) +
           " must be < 1; lower the gain, check its sign, or filter with a lower cutoff";
  }
  std::string sentence = "converges: spectral radius " + text(r.spectral_radius) + " < 1";
  if (r.spectral_radius > 1.0 - stalled) sentence += " (so close to 1 that part of the error will practically stay)";
  sentence += r.monotone
                  ? "; every trial is closer to the limit than the one before (sigma_max " + text(r.sigma_max) + " < 1)"
                  : "; the error may grow before it falls (sigma_max " + text(r.sigma_max) + " >= 1)";
  sentence += r.limit_error_gain == 0.0
                  ? "; no error remains"
                  : "; up to " + text(r.limit_error_gain) + " of the error of a zero input remains";
  return sentence;
}

}  // namespace

ConvergenceReport convergence(const LearningUpdate& law) {
  if (law.response().size() == 0) {
    throw about("impulse_response", ParameterError("impulse_response is missing: the convergence test needs a model"));
  }
  ConvergenceReport report;
  if (law.is_norm_optimal()) {
    judge_norm_optimal(law, report);
  } else {
    judge(law, report);
  }
  scan_frequencies(law, report);
  report.sentence = describe(report);
  return report;
}

}  // namespace mgdd::optimize
