#include "mgdd/optimize/belief/process_kernel.hpp"

#include <cmath>
#include <utility>

namespace mgdd::optimize {
namespace {

// Priors, in bends: J = level - bend/2 |z - 1/2|^2 + slopes (sd 0.4) + bends (0.6) + couplings (0.5) + the rest.
constexpr double level_sd = 3.0, slope_sd = 0.4, bend_sd = 0.6, coupling_sd = 0.5;
// What a model misses depends less on the operating point than on the input: of both, as shares. Readings at one point
// alone would else leave all others in doubt.
constexpr double context_share = 0.4;
constexpr double parabola_sd = 0.0745;  // of |z - 1/2|^2 over evenly spread z, one input: 1/sqrt(180)

}  // namespace

ProcessKernel::ProcessKernel(Eigen::Index inputs, Eigen::Index context, bool bends_down, ProcessGuide guide)
    : inputs_(inputs), context_(context), bends_down_(bends_down), guide_(std::move(guide)) {
  if (!guided()) return;
  of_context_ = context_share;
  const Eigen::Map<const Eigen::ArrayXd> values(guide_.surface.values().data(),
                                                static_cast<Eigen::Index>(guide_.surface.values().size()));
  guide_middle_ = values.mean();
  const double sd = std::sqrt((values - guide_middle_).square().mean());
  guide_bend_ = 2.0 * sd / (parabola_sd * std::sqrt(static_cast<double>(inputs)));
}

void ProcessKernel::describe(const Inputs& z, double* point) const noexcept {
  Eigen::Map<Eigen::VectorXd>(point, inputs_) = z;
  if (!guided()) return;
  const Inputs range = guide_.upper - guide_.lower;
  Inputs slopes(inputs_);
  const double value = guide_.surface.read(guide_.lower + z.cwiseProduct(range), slopes);
  point[inputs_] = guide_.sign * (value - guide_middle_);
  Eigen::Map<Eigen::VectorXd>(point + inputs_ + 1, inputs_) = guide_.sign * slopes.cwiseProduct(range);
}

double ProcessKernel::mean(const double* point, const Scales& s) const noexcept {
  const double guided = s.guide * guide_at(point);
  if (!bends_down_) return guided;
  double sum = 0.0;
  for (Eigen::Index i = context_; i < inputs_; ++i)
    sum += (point[i] - 0.5) * (point[i] - 0.5);
  return guided - 0.5 * s.bend * s.bend / whole_bend(s) * sum;  // a guide that counts holds the bend already
}

ProcessKernel::Fixed ProcessKernel::fixed(const double* a, const double* b) const noexcept {
  double slopes = 0.0, bends = 0.0, couplings = 0.0, guide = 0.0;
  for (Eigen::Index i = 0; i < inputs_; ++i) {
    const double both = (a[i] - 0.5) * (b[i] - 0.5) * (i < context_ ? of_context_ : 1.0);
    couplings += slopes * both;  // of every pair once
    slopes += both;
    bends += 0.25 * both * both;
  }
  if (guided()) {
    double places = 0.0;
    for (Eigen::Index i = inputs_ + 1; i < width(); ++i)
      places += a[i] * b[i];
    guide = guide_.factor_sd * guide_.factor_sd * a[inputs_] * b[inputs_] + guide_.place_sd * guide_.place_sd * places;
  }
  return {slope_sd * slope_sd * slopes + bend_sd * bend_sd * bends + coupling_sd * coupling_sd * couplings, guide};
}

double ProcessKernel::matern(const double* a, const double* b, const Inputs& inverse_length) const noexcept {
  double squares = 0.0;
  for (Eigen::Index i = 0; i < inputs_; ++i) {
    const double off = (a[i] - b[i]) * inverse_length[i];
    squares += off * off;
  }
  const double r = std::sqrt(5.0 * squares);
  return (1.0 + r + r * r / 3.0) * std::exp(-r);
}

double ProcessKernel::join(const Fixed& f, double matern, const Scales& s) const noexcept {
  const double level = level_sd * whole_bend(s);
  return level * level + s.bend * s.bend * (f.quadratic + s.rest * matern) + s.guide * s.guide * f.guide;
}

void ProcessKernel::covariances(const double* point, const Columns& others, Eigen::Index count, const Scales& s,
                                double* out) const noexcept {
  using Row = Eigen::Array<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, most_kept>;
  Row slopes = Row::Zero(count), rest = slopes, squares = slopes, both(count);
  for (Eigen::Index i = 0; i < inputs_; ++i) {
    const auto own = others.row(i).head(count).array();
    both = (i < context_ ? of_context_ : 1.0) * (point[i] - 0.5) * (own - 0.5);
    rest += both * (coupling_sd * coupling_sd * slopes + 0.25 * bend_sd * bend_sd * both);
    slopes += both;
    squares += ((own - point[i]) * s.inverse_length[i]).square();
  }
  rest += slope_sd * slope_sd * slopes;
  squares = (5.0 * squares).sqrt();
  rest += s.rest * (1.0 + squares + squares.square() / 3.0) * (-squares).exp();
  const double level = level_sd * whole_bend(s);
  rest = level * level + s.bend * s.bend * rest;
  if (guided()) {
    both = guide_.factor_sd * guide_.factor_sd * point[inputs_] * others.row(inputs_).head(count).array();
    for (Eigen::Index i = inputs_ + 1; i < width(); ++i)
      both += guide_.place_sd * guide_.place_sd * point[i] * others.row(i).head(count).array();
    rest += s.guide * s.guide * both;
  }
  Eigen::Map<Row>(out, count) = rest;
}

}  // namespace mgdd::optimize
