// What every seeker shares: its inputs and their bounds, what a cycle tells it, and the ask/tell protocol.
// A seeker proposes an input (`ask`), accepts the measurement of it (`tell`) and never holds a plant.
// `ask` and `tell` are noexcept and allocation-free; `require` turns a status into an exception.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/inputs.hpp"
#include "mgdd/optimize/ask_tell/reading.hpp"
#include "mgdd/optimize/watch/failure_watch.hpp"
#include "mgdd/optimize/watch/tell_watch.hpp"

namespace mgdd::optimize {

/// What an input is called, its unit, what may be applied of it, and what counts as a step of it.
struct Input {
  std::string name;
  double lower = -unlimited;
  double upper = unlimited;
  std::string unit{};       ///< empty: what the name says
  double scale = 0.0;       ///< > 0: what steps are counted in, unit of the input; 0 = a fortieth of the bounds, or 1
  double rate = unlimited;  ///< largest change of the estimate per step, > 0, unit of the input
  double step = 0.0;        ///< > 0: set in whole steps above the lower bound, or above 0; 0 = any value

  bool operator==(const Input&) const = default;
};
constexpr auto fields_of(const Input&) {
  using I = Input;
  return std::tuple{field<&I::name>("name", "what is set", DefaultForm::required),
                    field<&I::lower>("lower", "least applied value"),
                    field<&I::upper>("upper", "largest applied value"),
                    field<&I::unit>("unit", "of the input"),
                    field<&I::scale>("scale", "what steps are counted in; 0: a fortieth of the bounds, or 1"),
                    field<&I::rate>("rate", "largest change of the estimate per step"),
                    field<&I::step>("step", "whole steps in which it is set; 0: any value")};
}
/// ParameterError or ShapeError naming the entry.
void validate(const std::vector<Input>& inputs);

/// Where to start and what may be applied, per input; infinite: not bounded on that side.
struct SearchSpace {
  Inputs start = scalar_input(0.0);
  Inputs lower = scalar_input(-unlimited);
  Inputs upper = scalar_input(unlimited);
  std::vector<Input> inputs{};  ///< none, or one for each, whose bounds count then

  Eigen::Index size() const noexcept { return start.size(); }
};
/// The same with the bounds of its inputs; ParameterError or ShapeError where they contradict what else was given.
SearchSpace resolved(SearchSpace space);
/// What steps are counted in, per input: as its input says, or a fortieth of the bounds, or 1 where there are none.
Inputs scale_of(const SearchSpace& space) noexcept;
/// One number for all inputs as one for each; anything else as it is.
Inputs for_each_input(Inputs values, Eigen::Index inputs);
/// The same, or `factor` scales where nothing is given.
Inputs or_scaled(Inputs values, double factor, const SearchSpace& space);
/// Squares of lengths as a metric of steps, the largest as one.
inline InputMatrix metric_of(const Inputs& lengths) {
  return (lengths / lengths.maxCoeff()).cwiseAbs2().asDiagonal();
}
/// What can be set of each input.
Steps steps_of(const std::vector<Input>& inputs);
/// The smaller of each entry and the rate that its input says.
Inputs within_rates(Inputs values, const SearchSpace& space) noexcept;

/// Start and bounds, first in the table of every seeker: what comes per input is counted by them.
template <auto place>
constexpr auto space_fields() {
  using S = SearchSpace;
  return std::tuple{field<place, &S::start>("start", "first estimate, per input", DefaultForm::required),
                    field<place, &S::lower>("lower", "least applied input, per input"),
                    field<place, &S::upper>("upper", "largest applied input, per input"),
                    field<place, &S::inputs>("inputs", "names, units, bounds and scales", DefaultForm::none)};
}

/// ParameterError or ShapeError naming the entry; `reach` is how far a seeker goes to either side of its estimate,
/// which must fit between the bounds, around the start too.
void validate(const SearchSpace& space, const Inputs& reach);

/// ShapeError unless `values` has one entry per input, ParameterError unless each is inside (lower, upper].
void validate_entries(std::string_view name, const Inputs& values, Eigen::Index inputs, double lower,
                      double upper = unlimited);

/// ParameterError for a curvature that is given and not finite.
void validate_curvature(std::optional<double> curvature);

/// What one cycle returned. Components of J add up to it; a misfired cycle's numbers are not read, all others must
/// satisfy `is_reading`.
struct Reading {
  std::span<const double> components;
  std::span<const double> limits;  ///< measured values of the limited quantities, in the order of the settings
  bool misfire = false;
  std::span<const double> applied{};  ///< what the plant really applied, in the order of the inputs; empty: as asked
};

/// The input that the plant applied, kept in `told`, or `asked` itself where the reading
/// does not say; both outlive the answer.
inline const Inputs& applied_input(const Reading& reading, const Inputs& asked, Inputs& told) noexcept {
  if (reading.applied.empty()) return asked;  // NOLINT(bugprone-return-const-ref-from-parameter)
  told = Eigen::Map<const Inputs>(reading.applied.data(), asked.size());
  return told;
}

enum class TellStatus {
  accepted,
  misfire,
  not_asked,
  wrong_component_count,
  wrong_limit_count,
  not_a_reading,
  wrong_applied  ///< not one number per input, or one that is not a reading; of a misfired cycle too
};

/// The bookkeeping of ask and tell, and the one place through which every input passes on its way to the plant.
struct Protocol {
  /// `channels`: how many components of J and limits a reading has.
  Protocol(const SearchSpace& space, std::size_t channels, bool failing_edges = true)
      : failures(space.size(), failing_edges), heard(space.size(), channels), steps(steps_of(space.inputs)) {
    failures.roam(space.start, space.lower, space.upper);
  }

  std::int64_t cycle = 0;  ///< cycles told so far, misfires included
  std::int64_t misfires = 0;
  bool asked = false;
  FailureWatch failures;
  TellWatch heard;
  Steps steps;

  /// What is asked of the plant where the seeker wants `wanted`; the same until it is told. `excess` says by how much
  /// an input is expected over a limit, at most 0 where all are kept.
  template <class Excess>
  const Inputs& ask(const Inputs& wanted, const Excess& excess) noexcept {
    if (asked) return sent(wanted);
    asked = true;
    const Inputs& admitted = failures.admit(wanted);
    return steps.any() ? failures.settle(steps.nearest(admitted, excess), wanted) : admitted;
  }
  const Inputs& ask(const Inputs& wanted) noexcept {
    return ask(wanted, [](const Inputs&) { return 0.0; });
  }
  /// The same for an input that goes to the plant as it is, since what it comes from has looked already.
  const Inputs& pass(const Inputs& input) noexcept {
    asked = true;
    return failures.pass(input);
  }
  /// What `ask` gave last.
  const Inputs& sent(const Inputs& wanted) const noexcept {
    return failures.instead() != nullptr ? *failures.instead()
                                         : wanted;  // NOLINT(bugprone-return-const-ref-from-parameter)
  }
  /// What a seeker that wanted `wanted` learns from: the input that the plant applied, kept in `told`, or what was
  /// asked where the reading does not say; all outlive the answer.
  const Inputs& applied(const Reading& reading, const Inputs& wanted, Inputs& told) const noexcept {
    return applied_input(reading, sent(wanted), told);
  }

  /// What would become of this reading; changes nothing.
  TellStatus check(const Reading& reading, std::size_t components, std::size_t limits,
                   Eigen::Index inputs) const noexcept;

  /// Counts an accepted or misfired reading; a refused one changes nothing.
  void count(TellStatus status, const Reading& reading) noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("cycle", self.cycle, counts_end);
    v("misfires", self.misfires, counts_end);
    v("asked", self.asked);
    FailureWatch::visit(self.failures, v);
    TellWatch::visit(self.heard, v);
  }
};

/// Throws what a refused reading deserves, naming the cycle; returns for accepted and misfired ones.
void require(TellStatus status, const Protocol& protocol, const Reading& reading, std::size_t components,
             std::size_t limits, Eigen::Index inputs);

/// ParameterError unless every entry of a restored column lies within the bounds of these settings.
void require_within_space(std::string_view column, const Inputs& values, const SearchSpace& space);

/// Sum of the components of J, negated where the user minimises.
inline double objective_of(const Reading& reading, bool maximize) noexcept {
  double sum = 0.0;
  for (const double c : reading.components)
    sum += c;
  return maximize ? sum : -sum;
}

/// Moves `estimate` by `step`, keeping `reach` on either side inside the bounds.
inline void move_within(Inputs& estimate, const Inputs& step, const SearchSpace& space, const Inputs& reach) noexcept {
  estimate = (estimate + step).cwiseMax(space.lower + reach).cwiseMin(space.upper - reach);
}

/// Each entry clipped to +-limit.
inline void clip_each(Inputs& values, const Inputs& limit) noexcept {
  values = values.cwiseMax(-limit).cwiseMin(limit);
}

}  // namespace mgdd::optimize
