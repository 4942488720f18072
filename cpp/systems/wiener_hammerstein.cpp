#include "systems/wiener_hammerstein.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::systems {
namespace {

constexpr int order_ceiling = WienerHammersteinModel<double>::order_ceiling;

struct Filter {
  Eigen::VectorXd b, a;
};

// Parameters of one filter from `first` on: a1..an, b0..b(n-1); the last b makes the gain at rest 1.
void unpack(const Eigen::VectorXd& x, Eigen::Index first, int order, Filter& filter) {
  const Eigen::Index n = order;
  filter.a.resize(n + 1);
  filter.b.resize(n + 1);
  filter.a[0] = 1.0;
  filter.a.tail(n) = x.segment(first, n);
  filter.b.head(n) = x.segment(first + n, n);
  filter.b[n] = filter.a.sum() - x.segment(first + n, n).sum();
}

void run_filter(const Eigen::VectorXd& b, const Eigen::VectorXd& a, const Eigen::VectorXd& u,
                Eigen::VectorXd& y) noexcept {
  std::array<double, 2 * order_ceiling + 2> s{};
  const auto order = static_cast<std::size_t>(std::max(b.size(), a.size()) - 1);
  std::array<double, 2 * order_ceiling + 2> bb{};
  std::array<double, 2 * order_ceiling + 2> aa{};
  for (Eigen::Index i = 0; i < b.size(); ++i)
    bb[static_cast<std::size_t>(i)] = b[i];
  for (Eigen::Index i = 0; i < a.size(); ++i)
    aa[static_cast<std::size_t>(i)] = a[i];
  for (Eigen::Index k = 0; k < u.size(); ++k) {
    const double in = u[k];
    const double out = bb[0] * in + s[0];
    for (std::size_t i = 1; i <= order; ++i)
      s[i - 1] = bb[i] * in - aa[i] * out + s[i];
    y[k] = out;
  }
}

// The four cubic B-splines that act at x, with their slopes; linear beyond the grid.
struct Basis {
  Eigen::Index cell;
  std::array<double, 4> value;
  std::array<double, 4> slope;
};

Basis basis_at(const WienerHammerstein& model, double x) noexcept {
  const double step = (model.upper - model.lower) / (model.n_curve - 3);
  const double s = (x - model.lower) / step;
  const double inside = std::clamp(s, 0.0, static_cast<double>(model.n_curve - 3));
  const double cell = std::min(std::floor(inside), static_cast<double>(model.n_curve - 4));
  const double t = inside - cell;
  const double r = 1.0 - t;
  Basis basis{static_cast<Eigen::Index>(cell),
              {r * r * r / 6.0, (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
               (-3.0 * t * t * t + 3.0 * t * t + 3.0 * t + 1.0) / 6.0, t * t * t / 6.0},
              {-r * r / 2.0, (9.0 * t * t - 12.0 * t) / 6.0, (-9.0 * t * t + 6.0 * t + 3.0) / 6.0, t * t / 2.0}};
  for (std::size_t j = 0; j < 4; ++j) {
    basis.value[j] += basis.slope[j] * (s - inside);
    basis.slope[j] /= step;
  }
  return basis;
}

void check_length(const WienerHammerstein& model, const Eigen::VectorXd& parameters) {
  if (parameters.size() != model.n_parameters()) {
    throw about("parameters", ShapeError("parameters has " + std::to_string(parameters.size()) + " values: must have " +
                                         std::to_string(model.n_parameters())));
  }
}

}  // namespace

Eigen::VectorXd filter_series(const Eigen::VectorXd& b, const Eigen::VectorXd& a, const Eigen::VectorXd& u) {
  constexpr Eigen::Index limit = 2 * order_ceiling + 1;
  if (a.size() < 1 || b.size() < 1 || a.size() > limit || b.size() > limit) {
    throw ShapeError("a, b: must have 1 to " + std::to_string(limit) + " values");
  }
  if (a[0] != 1.0) throw ParameterError("a[0]", a[0], "must be 1");
  Eigen::VectorXd y(u.size());
  run_filter(b, a, u, y);
  return y;
}

bool is_stable(const Eigen::VectorXd& a) noexcept {
  std::array<double, 2 * order_ceiling + 2> c{};
  std::array<double, 2 * order_ceiling + 2> d{};
  for (Eigen::Index i = 0; i < a.size(); ++i)
    c[static_cast<std::size_t>(i)] = a[i];
  for (auto n = static_cast<std::size_t>(a.size() - 1); n > 0; --n) {
    const double k = c[n];
    if (!(std::abs(k) < 1.0)) return false;
    for (std::size_t i = 0; i <= n; ++i)
      d[i] = (c[i] - k * c[n - i]) / (1.0 - k * k);
    c = d;
  }
  return true;
}

void WienerHammerstein::validate() const {
  require_within("first_order", first_order, 1, order_ceiling);
  require_within("last_order", last_order, 1, order_ceiling);
  require_within("n_curve", n_curve, 4, 1000);
  require_positive("upper - lower", upper - lower);
}

std::vector<std::string> WienerHammerstein::names() const {
  std::vector<std::string> names;
  for (const auto& [filter, order] : {std::pair("first_", first_order), std::pair("last_", last_order)}) {
    for (int i = 1; i <= order; ++i)
      names.push_back(std::string(filter) + "a" + std::to_string(i));
    for (int i = 0; i < order; ++i)
      names.push_back(std::string(filter) + "b" + std::to_string(i));
  }
  for (int i = 0; i < n_curve; ++i)
    names.push_back("curve" + std::to_string(i));
  return names;
}

Eigen::VectorXd WienerHammerstein::curve(const Eigen::VectorXd& parameters, const Eigen::VectorXd& x) const {
  check_length(*this, parameters);
  const Eigen::Index first = 2 * static_cast<Eigen::Index>(first_order + last_order);
  Eigen::VectorXd y(x.size());
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const Basis basis = basis_at(*this, x[k]);
    y[k] = 0.0;
    for (std::size_t j = 0; j < 4; ++j)
      y[k] += basis.value[j] * parameters[first + basis.cell + static_cast<Eigen::Index>(j)];
  }
  return y;
}

Eigen::VectorXd WienerHammerstein::simulate(const Eigen::VectorXd& parameters, const Eigen::VectorXd& input) const {
  validate();
  check_length(*this, parameters);
  Filter first;
  Filter last;
  unpack(parameters, 0, first_order, first);
  unpack(parameters, Eigen::Index{2} * first_order, last_order, last);
  return filter_series(last.b, last.a, curve(parameters, filter_series(first.b, first.a, input)));
}

CurveTable::Point CurveTable::at(double x) const noexcept {
  const Basis basis = basis_at(model, x);
  Point point{0.0, 0.0};
  for (std::size_t j = 0; j < 4; ++j) {
    const double c = coefficients[basis.cell + static_cast<Eigen::Index>(j)];
    point.value += basis.value[j] * c;
    point.slope += basis.slope[j] * c;
  }
  return point;
}

template <class T>
WienerHammersteinModel<T>::WienerHammersteinModel(const WienerHammerstein& model, const Eigen::VectorXd& parameters) {
  model.validate();
  check_length(model, parameters);
  if (!parameters.allFinite()) throw about("parameters", ParameterError("parameters: must be finite numbers"));
  const auto take = [&](Eigen::Index from, int order, Coefficients& b, Coefficients& a) {
    Filter filter;
    unpack(parameters, from, order, filter);
    std::copy(filter.b.begin(), filter.b.end(), b.begin());
    std::copy(filter.a.begin(), filter.a.end(), a.begin());
  };
  take(0, model.first_order, first_b_, first_a_);
  take(2 * static_cast<Eigen::Index>(model.first_order), model.last_order, last_b_, last_a_);
  curve_ = std::make_shared<const CurveTable>(CurveTable{model, parameters.tail(model.n_curve)});
}

template class WienerHammersteinModel<double>;
template class WienerHammersteinModel<float>;
template class WienerHammersteinModel<Dual<3>>;
template class WienerHammersteinModel<Lanes<8>>;
static_assert(dynamics::StartsAtRest<WienerHammersteinModel<double>> &&
              dynamics::StartsAtRest<WienerHammersteinModel<float>> &&
              dynamics::StartsAtRest<WienerHammersteinModel<Dual<3>>> &&
              dynamics::StartsAtRest<WienerHammersteinModel<Lanes<8>>> &&
              dynamics::Liftable<WienerHammersteinModel<double>, Dual<3>>);

WienerHammersteinResidual::WienerHammersteinResidual(const WienerHammerstein& model, Eigen::VectorXd input,
                                                     Eigen::VectorXd output, Eigen::Index skip)
    : model_(model), input_(std::move(input)), output_(std::move(output)), skip_(skip) {
  model_.validate();
  if (output_.size() != input_.size()) throw ShapeError("input and output differ in length");
  if (!input_.allFinite() || !output_.allFinite()) throw ParameterError("input, output: must be finite numbers");
  if (skip_ < 0 || input_.size() - skip_ <= model_.n_parameters()) {
    throw ShapeError("skip", skip_,
                     "must leave more samples than the " + std::to_string(model_.n_parameters()) + " parameters");
  }
  for (Eigen::VectorXd* v : {&between_, &curved_, &slope_, &all_pole_, &work_, &work_out_, &model_out_})
    v->resize(input_.size());
  weights_.resize(4, input_.size());
  cell_.resize(static_cast<std::size_t>(input_.size()));
}

bool WienerHammersteinResidual::operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual,
                                           Eigen::MatrixXd* jacobian) noexcept {
  const Eigen::Index n1 = model_.first_order;
  const Eigen::Index n2 = model_.last_order;
  const Eigen::Index n = input_.size();
  const Eigen::Index m = n_residuals();
  const Eigen::Index first_curve = 2 * (n1 + n2);
  Filter first;
  Filter last;
  unpack(x, 0, model_.first_order, first);
  unpack(x, 2 * n1, model_.last_order, last);
  if (!x.allFinite() || !is_stable(first.a) || !is_stable(last.a)) return false;
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(1);

  run_filter(first.b, first.a, input_, between_);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Basis basis = basis_at(model_, between_[k]);
    cell_[static_cast<std::size_t>(k)] = basis.cell;
    double value = 0.0;
    double slope = 0.0;
    for (Eigen::Index j = 0; j < 4; ++j) {
      const double c = x[first_curve + basis.cell + j];
      weights_(j, k) = basis.value[static_cast<std::size_t>(j)];
      value += weights_(j, k) * c;
      slope += basis.slope[static_cast<std::size_t>(j)] * c;
    }
    curved_[k] = value;
    slope_[k] = slope;
  }
  run_filter(last.b, last.a, curved_, model_out_);
  residual = (model_out_ - output_).tail(m);
  if (!residual.allFinite()) return false;
  if (jacobian == nullptr) return true;

  // d/d b_i is the input through 1/A, i samples late; d/d a_i minus the output through 1/A, i samples late. The last
  // numerator coefficient is bound to all others, hence the second term.
  const auto column = [&](Eigen::Index j, const Eigen::VectorXd& signal) { jacobian->col(j) = signal.tail(m); };
  const auto late = [n](const Eigen::VectorXd& v, Eigen::Index i, Eigen::Index k) {
    return k >= i && k < n ? v[k - i] : 0.0;
  };
  const auto through_last = [&](Eigen::Index j) {
    work_.array() *= slope_.array();
    run_filter(last.b, last.a, work_, work_out_);
    column(j, work_out_);
  };
  run_filter(one, first.a, input_, all_pole_);
  Eigen::VectorXd& output_pole = model_out_;  // free from here on
  run_filter(one, first.a, between_, output_pole);
  for (Eigen::Index i = 1; i <= n1; ++i) {
    for (Eigen::Index k = 0; k < n; ++k)
      work_[k] = late(all_pole_, n1, k) - late(output_pole, i, k);
    through_last(i - 1);
  }
  for (Eigen::Index i = 0; i < n1; ++i) {
    for (Eigen::Index k = 0; k < n; ++k)
      work_[k] = late(all_pole_, i, k) - late(all_pole_, n1, k);
    through_last(n1 + i);
  }
  run_filter(last.b, last.a, curved_, work_);
  run_filter(one, last.a, work_, output_pole);
  run_filter(one, last.a, curved_, all_pole_);
  for (Eigen::Index i = 1; i <= n2; ++i) {
    for (Eigen::Index k = 0; k < n; ++k)
      work_[k] = late(all_pole_, n2, k) - late(output_pole, i, k);
    column(2 * n1 + i - 1, work_);
  }
  for (Eigen::Index i = 0; i < n2; ++i) {
    for (Eigen::Index k = 0; k < n; ++k)
      work_[k] = late(all_pole_, i, k) - late(all_pole_, n2, k);
    column(2 * n1 + n2 + i, work_);
  }
  for (Eigen::Index c = 0; c < model_.n_curve; ++c) {
    for (Eigen::Index k = 0; k < n; ++k) {
      const Eigen::Index j = c - cell_[static_cast<std::size_t>(k)];
      work_[k] = j >= 0 && j < 4 ? weights_(j, k) : 0.0;
    }
    run_filter(last.b, last.a, work_, work_out_);
    column(first_curve + c, work_out_);
  }
  return jacobian->allFinite();
}

optimize::FitReport fit_wiener_hammerstein(const WienerHammerstein& model, const Eigen::VectorXd& start,
                                           const Eigen::VectorXd& input, const Eigen::VectorXd& output,
                                           Eigen::Index skip, const optimize::LeastSquaresOptions& options) {
  WienerHammersteinResidual residual(model, input, output, skip);
  check_length(model, start);
  std::vector<optimize::Parameter> parameters;
  for (std::string& name : model.names())
    parameters.push_back({.name = std::move(name)});
  optimize::LeastSquares search(std::move(parameters), residual.n_residuals(), options);
  return search.solve(residual, start);
}

}  // namespace mgdd::systems
