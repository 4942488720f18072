#include "mgdd/engine/pressure/pegging.hpp"

#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>

#include <Eigen/Dense>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/pressure/angles.hpp"
#include "mgdd/math/line_fit.hpp"

namespace mgdd::engine {
namespace {

using Column = std::vector<double>;

// Adds `factor` times the mean pressure of the samples within `half` CAD of an angle to a sum over all samples.
void add_mean(WeightedSum& sum, double factor, const Column& angle, double centre, double half) {
  const auto [first, last] = samples_within(angle, centre - half, centre + half);
  if (first == last) {
    throw DataError("pegging needs samples at " + text(centre) + " +- " + text(half) +
                    " °CA aTDC, but the trace spans " + text(angle.front()) + " to " + text(angle.back()));
  }
  for (std::size_t k = first; k < last; ++k)
    sum.weights[k] += factor / static_cast<double>(last - first);
}

// Weights that turn values of y at the given x into the slope of their line.
Column slope_weights(const Column& x) {
  const double mean = std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
  double squares = 0.0;
  Column out;
  for (const double at : x)
    out.push_back(at - mean), squares += (at - mean) * (at - mean);
  for (double& weight : out)
    weight /= squares;
  return out;
}

}  // namespace

double polytropic_exponent(const Column& angle, const Column& pressure, const Column& volume, double from_cad,
                           double to_cad) {
  LineFit line;
  for (std::size_t k = 0; k < angle.size(); ++k) {
    if (angle[k] < from_cad - 1e-9 || angle[k] > to_cad + 1e-9 || !(pressure[k] > 0.0)) continue;
    line.add(std::log(volume[k]), std::log(pressure[k]));
  }
  return line.n < 3.0 ? undefined<double>() : -line.slope();
}

double polytropic_exponent(const Column& angle, const Column& pressure, const Cylinder& cylinder, double from_cad,
                           double to_cad) {
  const Geometry<double> geometry(cylinder.geometry);
  Column volume;
  for (const double a : angle)
    volume.push_back(geometry.volume_m3(a));
  return polytropic_exponent(angle, pressure, volume, from_cad, to_cad);
}

WeightedSum exponent_of_logarithms(const Column& angle, const Column& volume, double from_cad, double to_cad) {
  const auto [first, last] = samples_within(angle, from_cad, to_cad);
  if (last - first < 3) return {};
  Column x;
  for (std::size_t k = first; k < last; ++k)
    x.push_back(-std::log(volume[k]));
  return {first, slope_weights(x), 0.0};
}

WeightedSum pegging_of(const Column& angle, const Cylinder& cylinder, const TraceOptions& options) {
  validate(options);
  const Geometry<double> geometry(cylinder.geometry);
  const double n = options.pegging_exponent;
  WeightedSum offset{0, Column(angle.size(), 0.0), 0.0};
  switch (options.pegging) {
    case Pegging::none:
      return {};
    case Pegging::inlet:  // mean around intake bottom dead centre equals the intake pressure (Randolph 1990)
      offset.constant = options.inlet_pressure_kpa * units::pa_per_kpa / units::pa_per_bar;
      add_mean(offset, -1.0, angle, -180.0, 5.0);
      return offset;
    case Pegging::two_point: {  // p V^n = const through -100 and -65 CAD (Randolph 1990)
      const double ratio = std::pow(geometry.volume_m3(-100.0) / geometry.volume_m3(-65.0), n);
      add_mean(offset, -ratio / (ratio - 1.0), angle, -100.0, 1.0);
      add_mean(offset, 1.0 / (ratio - 1.0), angle, -65.0, 1.0);
      return offset;
    }
    case Pegging::least_squares:
      break;
  }
  // Intercept of the linear regression p = -offset + C V^-n over -100..-50 CAD (Brunt and Pond 1997).
  const auto [first, last] = samples_within(angle, -100.0, -50.0);
  if (last - first < 5) {
    throw DataError("pegging 'least_squares' needs at least 5 samples in -100..-50 °CA aTDC, found " +
                    std::to_string(last - first));
  }
  Column x;
  double mean = 0.0;
  for (std::size_t k = first; k < last; ++k) {
    x.push_back(std::pow(geometry.volume_m3(angle[k]) / geometry.volume_m3(-100.0), -n));
    mean += x.back() / static_cast<double>(last - first);
  }
  offset.first = first;
  offset.weights = slope_weights(x);
  for (double& weight : offset.weights)
    weight = weight * mean - 1.0 / static_cast<double>(last - first);
  return offset;
}

FreePolytrope free_polytrope(const Column& angle, const Column& pressure, const Column& volume, double from_cad,
                             double to_cad) {
  std::vector<std::size_t> in;
  for (std::size_t k = 0; k < angle.size(); ++k) {
    if (angle[k] >= from_cad - 1e-9 && angle[k] <= to_cad + 1e-9) in.push_back(k);
  }
  if (in.size() < 10 || angle[in.back()] - angle[in.front()] < 40.0 - 1e-9) return {};
  // p = C x^-n - offset with x = V/V(first), from C = p(first), n = 1.35, offset = 0.
  Eigen::Vector3d at{pressure[in.front()], 1.35, 0.0};
  double squares = 0.0;
  Eigen::Matrix3d normal;
  for (int round = 0; round < 30; ++round) {
    normal.setZero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    squares = 0.0;
    for (const std::size_t k : in) {
      const double log_x = std::log(volume[k] / volume[in.front()]);
      const double shape = std::exp(-at[1] * log_x);
      const double residual = pressure[k] - (at[0] * shape - at[2]);
      const Eigen::Vector3d slope{shape, -at[0] * shape * log_x, -1.0};
      normal += slope * slope.transpose();
      gradient += slope * residual;
      squares += residual * residual;
    }
    const Eigen::Vector3d step = normal.ldlt().solve(gradient);
    if (!step.allFinite()) return {};
    at += step;
    if (!(at[1] > 0.5 && at[1] < 3.0)) return {};
    if (std::abs(step[1]) < 1e-7) {
      const double variance = squares / (static_cast<double>(in.size()) - 3.0);
      return {at[1], at[2], std::sqrt(variance * normal.inverse()(2, 2))};
    }
  }
  return {};
}

}  // namespace mgdd::engine
