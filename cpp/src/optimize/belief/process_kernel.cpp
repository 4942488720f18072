#include "mgdd/optimize/belief/process_kernel.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

namespace mgdd::optimize {
namespace {

// Priors, in bends: J = level - bend/2 |z - 1/2|^2 + slopes (sd 0.4) + bends (0.6) + couplings (0.5) + the rest.
constexpr double level_sd = 3.0, slope_sd = 0.4, bend_sd = 0.6, coupling_sd = 0.5;
// What a model misses depends less on the operating point than on the input: of both, as shares. Readings at one point
// alone would else leave all others in doubt.
constexpr double context_share = 0.4;
constexpr double one_node = 1.0 + 1e-9;  // a coarser grid smooths as much as a secant does
constexpr double parabola_sd = 0.0745;   // of |z - 1/2|^2 over evenly spread z, one input: 1/sqrt(180)

// Slopes, bends and the couplings of every pair once, from the sum of the products of two points and of their squares.
template <class T>
T quadratic(const T& products, const T& squares) {
  return slope_sd * slope_sd * products + 0.25 * bend_sd * bend_sd * squares +
         0.5 * coupling_sd * coupling_sd * (products * products - squares);
}

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
  // A kink that lies somewhere else is foreseen on both sides of where the guide has it.
  for (Eigen::Index i = context_; i < inputs_; ++i) {
    const auto nodes = static_cast<double>(guide_.surface.axes()[static_cast<std::size_t>(i)].size());
    if (!(guide_.secant * (nodes - 1.0) > one_node)) continue;
    const auto at = [&](double place) {
      Inputs moved = z;
      moved[i] = place;
      return guide_.surface(guide_.lower + moved.cwiseProduct(range));
    };
    const double low = std::max(z[i] - guide_.secant, 0.0), high = std::min(z[i] + guide_.secant, 1.0);
    slopes[i] = (at(high) - at(low)) / ((high - low) * range[i]);
  }
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
  double slopes = 0.0, squares = 0.0, guide = 0.0;
  for (Eigen::Index i = 0; i < inputs_; ++i) {
    const double both = (a[i] - 0.5) * (b[i] - 0.5) * (i < context_ ? of_context_ : 1.0);
    slopes += both;
    squares += both * both;
  }
  if (guided()) {
    double places = 0.0;
    for (Eigen::Index i = inputs_ + 1; i < width(); ++i)
      places += a[i] * b[i];
    guide = guide_.factor_sd * guide_.factor_sd * a[inputs_] * b[inputs_] + guide_.place_sd * guide_.place_sd * places;
  }
  return {quadratic(slopes, squares), guide};
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

// Blocks that registers hold.
void ProcessKernel::covariances(const double* point, const Columns& others, Eigen::Index count, const Scales& s,
                                double* out) const noexcept {
  const double level = level_sd * whole_bend(s);
  const auto of_block = [&]<int size>(std::integral_constant<int, size>, Eigen::Index from) {
    using Block = Eigen::Array<double, 1, size>;
    Block slopes = Block::Zero(), both_squared = slopes, squares = slopes, guide = slopes;
    for (Eigen::Index i = 0; i < inputs_; ++i) {
      const Block own = others.row(i).segment<size>(from);
      const Block both = ((i < context_ ? of_context_ : 1.0) * (point[i] - 0.5)) * (own - 0.5);
      slopes += both;
      both_squared += both.square();
      squares += ((own - point[i]) * s.inverse_length[i]).square();
    }
    squares = (5.0 * squares).sqrt();
    squares = (1.0 + squares + squares.square() * (1.0 / 3.0)) * (-squares).exp();
    if (guided()) {
      for (Eigen::Index i = inputs_ + 1; i < width(); ++i)
        guide += point[i] * others.row(i).segment<size>(from).array();
      guide = guide_.factor_sd * guide_.factor_sd * point[inputs_] * others.row(inputs_).segment<size>(from).array() +
              guide_.place_sd * guide_.place_sd * guide;
    }
    Eigen::Map<Block>(out + from) = level * level +
                                    s.bend * s.bend * (quadratic(slopes, both_squared) + s.rest * squares) +
                                    s.guide * s.guide * guide;
  };
  Eigen::Index from = 0;
  for (; from + 8 <= count; from += 8)
    of_block(std::integral_constant<int, 8>{}, from);
  for (; from < count; ++from)
    of_block(std::integral_constant<int, 1>{}, from);
}

}  // namespace mgdd::optimize
