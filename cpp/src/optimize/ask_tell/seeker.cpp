#include "mgdd/optimize/ask_tell/seeker.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double scales_in_bounds = 40.0;  // degrees of crank angle between usual bounds of a timing

std::string entry(std::string_view name, Eigen::Index i, Eigen::Index size) {
  return size == 1 ? std::string(name) : std::string(name) + "[" + std::to_string(i) + "]";
}

[[noreturn]] void refuse_reading(const std::string& at, std::string_view name, double value) {
  const DataError refusal(
      name, value,
      "must be finite and at most " + text(largest_reading) + " in magnitude; tell misfire=True if the cycle misfired");
  throw in_context(at, refusal);
}

}  // namespace

void validate_entries(std::string_view name, const Inputs& values, Eigen::Index inputs, double lower, double upper) {
  if (values.size() != inputs) {
    throw about(name, ShapeError(std::string(name) + " has " + std::to_string(values.size()) + " entries: must have " +
                                 std::to_string(inputs) + ", one per entry of start"));
  }
  for (Eigen::Index i = 0; i < inputs; ++i) {
    if (!(values[i] > lower && values[i] <= upper)) {
      throw ParameterError(entry(name, i, inputs), values[i],
                           "must be > " + text(lower) + (upper < unlimited ? " and <= " + text(upper) : std::string()));
    }
  }
}

void validate(const std::vector<Input>& inputs) {
  if (inputs.size() > max_inputs) {
    throw about("inputs", ShapeError("inputs has " + std::to_string(inputs.size()) + " entries: at most " +
                                     std::to_string(max_inputs) + " inputs are possible"));
  }
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const Input& one = inputs[i];
    const auto refuse = [&](const char* field, double value, const std::string& why) {
      throw ParameterError("inputs: " + one.name + " " + field, value, why);
    };
    if (one.name.empty()) throw about("inputs", ParameterError("inputs: a name is empty: say what is set"));
    for (std::size_t k = 0; k < i; ++k) {
      if (inputs[k].name == one.name) throw about("inputs", ParameterError("inputs: " + one.name + ": each name once"));
    }
    if (!(one.lower < one.upper)) refuse("lower", one.lower, "must be < upper = " + text(one.upper));
    if (std::isfinite(one.lower) && std::isfinite(one.upper) && !is_reading(one.upper - one.lower)) {
      refuse("upper", one.upper, "must be within " + text(largest_reading) + " of lower = " + text(one.lower));
    }
    if (!(one.scale >= 0.0 && is_reading(one.scale))) {
      refuse("scale", one.scale, "must be > 0 and finite, or 0 for a fortieth of the bounds");
    }
    if (!(one.rate > 0.0)) refuse("rate", one.rate, "must be > 0");
    if (!(one.step >= 0.0 && is_reading(one.step))) {
      refuse("step", one.step, "must be > 0 and finite, or 0 where any value can be set");
    }
    if (!(one.step <= one.rate)) refuse("step", one.step, "must be at most the rate = " + text(one.rate));
    if (one.step > one.upper - one.lower) {
      refuse("step", one.step, "must be at most upper - lower = " + text(one.upper - one.lower));
    }
  }
}

SearchSpace resolved(SearchSpace space) {
  if (space.inputs.empty()) return space;
  validate(space.inputs);
  const Eigen::Index n = space.size();
  if (static_cast<Eigen::Index>(space.inputs.size()) != n) {
    throw about("inputs", ShapeError("inputs has " + std::to_string(space.inputs.size()) + " entries: must have " +
                                     std::to_string(n) + ", one per entry of start"));
  }
  for (const auto& [name, given, own] :
       {std::tuple{"lower", &space.lower, &Input::lower}, std::tuple{"upper", &space.upper, &Input::upper}}) {
    if (given->size() != n) *given = Inputs::Constant(n, given->size() == 1 ? (*given)[0] : 0.0);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Input& one = space.inputs[static_cast<std::size_t>(i)];
      double& bound = (*given)[i];
      if (std::isfinite(bound) && bound != one.*own) {
        throw ParameterError(entry(name, i, n), bound,
                             "must be left out, or " + text(one.*own) + " as inputs say of " + one.name);
      }
      bound = one.*own;
    }
  }
  return space;
}

Inputs scale_of(const SearchSpace& space) noexcept {
  Inputs scale(space.size());
  for (Eigen::Index i = 0; i < scale.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double said = at < space.inputs.size() ? space.inputs[at].scale : 0.0;
    const bool bounded = i < space.lower.size() && i < space.upper.size();
    const double width = bounded ? space.upper[i] - space.lower[i] : unlimited;
    scale[i] = said > 0.0 ? said : width > 0.0 && is_reading(width) ? width / scales_in_bounds : 1.0;
  }
  return scale;
}

Steps steps_of(const std::vector<Input>& inputs) {
  const auto n = static_cast<Eigen::Index>(inputs.size());
  Steps out{Inputs(n), Inputs(n), Inputs(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Input& one = inputs[static_cast<std::size_t>(i)];
    out.size[i] = one.step;
    out.from[i] = std::isfinite(one.lower) ? one.lower : 0.0;
    out.to[i] = one.upper;
  }
  return out;
}

Inputs for_each_input(Inputs values, Eigen::Index inputs) {
  if (values.size() != 1) return values;
  return Inputs::Constant(inputs, values[0]);
}

Inputs or_scaled(Inputs values, double factor, const SearchSpace& space) {
  if (values.size() > 0) return for_each_input(std::move(values), space.size());
  return factor * scale_of(space);
}

Inputs within_rates(Inputs values, const SearchSpace& space) noexcept {
  for (std::size_t i = 0; i < space.inputs.size(); ++i) {
    double& value = values[static_cast<Eigen::Index>(i)];
    value = std::min(value, space.inputs[i].rate);
  }
  return values;
}

void validate(const SearchSpace& space, const Inputs& reach) {
  const Eigen::Index n = space.size();
  if (n < 1) throw about("start", ShapeError("start is empty: give one number per input"));
  for (const auto& [name, values] : {std::pair{"lower", &space.lower}, std::pair{"upper", &space.upper}}) {
    if (values->size() != n) {
      throw about(name, ShapeError(std::string(name) + " has " + std::to_string(values->size()) +
                                   " entries: must have " + std::to_string(n) + ", one per entry of start"));
    }
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    if (!std::isfinite(space.start[i])) {
      throw ParameterError(entry("start", i, n), space.start[i], "must be finite");
    }
    if (!(space.lower[i] < space.upper[i])) {
      throw ParameterError(entry("lower", i, n), space.lower[i], "must be < upper = " + text(space.upper[i]));
    }
    const double low = space.lower[i] + reach[i];
    const double high = space.upper[i] - reach[i];
    if (!(low <= high)) {
      throw ParameterError(entry("upper", i, n), space.upper[i],
                           "must be at least " + text(2.0 * reach[i]) + " above lower = " + text(space.lower[i]) +
                               ", room for the perturbation on both sides");
    }
    if (!(space.start[i] >= low && space.start[i] <= high)) {
      throw ParameterError(entry("start", i, n), space.start[i],
                           "must lie in [" + text(low) + ", " + text(high) +
                               "], the bounds less the perturbation; move start or widen the bounds");
    }
  }
}

void require_within_space(std::string_view column, const Inputs& values, const SearchSpace& space) {
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (values[i] >= space.lower[i] && values[i] <= space.upper[i]) continue;
    throw about(column, ParameterError("state column '" + std::string(column) + "' holds " + text(values[i]) +
                                       ": must lie in [" + text(space.lower[i]) + ", " + text(space.upper[i]) +
                                       "], the bounds of these settings"));
  }
}

void validate_curvature(std::optional<double> curvature) {
  if (curvature && !std::isfinite(*curvature)) {
    throw ParameterError("curvature", *curvature, "must be finite; leave it out where it is not known");
  }
}

TellStatus Protocol::check(const Reading& reading, std::size_t components, std::size_t limits,
                           Eigen::Index inputs) const noexcept {
  if (!asked) return TellStatus::not_asked;
  if (!reading.applied.empty() && (reading.applied.size() != static_cast<std::size_t>(inputs) ||
                                   !std::all_of(reading.applied.begin(), reading.applied.end(), is_reading))) {
    return TellStatus::wrong_applied;
  }
  if (reading.misfire) return TellStatus::misfire;
  if (reading.components.size() != components) return TellStatus::wrong_component_count;
  if (reading.limits.size() != limits) return TellStatus::wrong_limit_count;
  const bool measured = std::all_of(reading.components.begin(), reading.components.end(), is_reading) &&
                        std::all_of(reading.limits.begin(), reading.limits.end(), is_reading);
  return measured ? TellStatus::accepted : TellStatus::not_a_reading;
}

void Protocol::count(TellStatus status, const Reading& reading) noexcept {
  if (status != TellStatus::accepted && status != TellStatus::misfire) return;
  asked = false;
  ++cycle;
  Inputs said;
  const Inputs& applied = applied_input(reading, failures.sent(), said);
  if (&applied == &said) heard.follow(failures.sent(), applied);
  if (status == TellStatus::accepted) heard.read(reading.components, reading.limits, applied);
  if (status == TellStatus::misfire) {
    ++misfires;
    failures.failed();
  } else {
    failures.worked();
  }
}

void require(TellStatus status, const Protocol& protocol, const Reading& reading, std::size_t components,
             std::size_t limits, Eigen::Index inputs) {
  const std::string at = "cycle " + std::to_string(protocol.cycle) + ": ";
  switch (status) {
    case TellStatus::accepted:
    case TellStatus::misfire:
      return;
    case TellStatus::not_asked:
      throw ParameterError(at + "tell without ask: call ask(), apply its input, then tell what was measured, once");
    case TellStatus::wrong_component_count:
      throw in_context(
          at, about("J", ShapeError("J has " + std::to_string(reading.components.size()) + " components: must have " +
                                    std::to_string(components) + ", as the settings say")));
    case TellStatus::wrong_limit_count:
      throw in_context(
          at, about("limits", ShapeError("limits has " + std::to_string(reading.limits.size()) + " values: must have " +
                                         std::to_string(limits) + ", one per limit of the settings")));
    case TellStatus::wrong_applied:
      if (reading.applied.size() != static_cast<std::size_t>(inputs)) {
        throw in_context(
            at, about("applied", ShapeError("applied has " + std::to_string(reading.applied.size()) +
                                            " entries: must have " + std::to_string(inputs) +
                                            ", one per input, or be left out where everything was applied as asked")));
      }
      for (std::size_t i = 0; i < reading.applied.size(); ++i) {
        if (is_reading(reading.applied[i])) continue;
        throw in_context(at, DataError(entry("applied", static_cast<Eigen::Index>(i), inputs), reading.applied[i],
                                       "must be finite and at most " + text(largest_reading) +
                                           " in magnitude; leave it out if what was applied is not known"));
      }
      return;
    case TellStatus::not_a_reading:
      for (const double value : reading.components) {
        if (!is_reading(value)) refuse_reading(at, "J", value);
      }
      for (std::size_t i = 0; i < reading.limits.size(); ++i) {
        if (!is_reading(reading.limits[i])) {
          refuse_reading(at, "limits[" + std::to_string(i) + "]", reading.limits[i]);
        }
      }
  }
}

}  // namespace mgdd::optimize
