#include "mgdd/optimize/least_squares/parameter.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double off_open_bound = 1e-6;  // of the bound or 1

}  // namespace

Parameter parameter_of(const FieldInfo& field, std::string name) {
  const auto off = [](bool open, double bound) { return open ? off_open_bound * std::max(1.0, std::abs(bound)) : 0.0; };
  const Domain& d = field.domain;
  return {std::move(name), d.lower + off(d.lower_open, d.lower), d.upper - off(d.upper_open, d.upper), d.log_scaled};
}

void LeastSquaresOptions::validate() const {
  require_fields(fields_of(*this), *this);
}

void validate(const std::vector<Parameter>& parameters) {
  if (parameters.empty()) {
    throw about("parameters", ParameterError("parameters is empty: name at least one"));
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Parameter& p = parameters[i];
    if (p.name.empty()) {
      throw ParameterError("parameter " + std::to_string(i) + " has no name");
    }
    for (std::size_t k = 0; k < i; ++k) {
      if (parameters[k].name == p.name) {
        throw ParameterError("parameter name '" + p.name + "' appears twice: names must be unique");
      }
    }
    if (!(p.lower < p.upper)) {
      throw about(p.name,
                  ParameterError(p.name + ": lower = " + text(p.lower) + " must be < upper = " + text(p.upper)));
    }
    if (p.log_scaled && !(p.lower > 0.0)) {
      throw about(p.name,
                  ParameterError(p.name + ": lower = " + text(p.lower) + " must be > 0 for a log-scaled parameter"));
    }
  }
}

void validate_start(const std::vector<Parameter>& parameters, const Eigen::VectorXd& start) {
  if (start.size() != static_cast<Eigen::Index>(parameters.size())) {
    throw about("start", ShapeError("start has " + std::to_string(start.size()) + " values for " +
                                    std::to_string(parameters.size()) + " parameters"));
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Parameter& p = parameters[i];
    const double value = start[static_cast<Eigen::Index>(i)];
    if (!std::isfinite(value) || value < p.lower || value > p.upper) {
      throw about(p.name, ParameterError("start of " + p.name + " = " + text(value) + ": must be finite and in [" +
                                         text(p.lower) + ", " + text(p.upper) + "]"));
    }
  }
}

}  // namespace mgdd::optimize
