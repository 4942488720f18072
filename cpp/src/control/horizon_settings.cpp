#include "mgdd/control/horizon_settings.hpp"

#include <array>
#include <utility>

#include "mgdd/common/error.hpp"

namespace mgdd::control {
namespace {

using S = HorizonSettings;

constexpr Domain weight = closed(0.0, 1e12);
constexpr Domain bound = closed(-1e12, 1e12);
constexpr Domain anywhere = closed(-unbounded, unbounded);

constexpr std::array<Field<S>, n_horizon_fields> table{{
    field<&S::output_weight>({"output_weight", "-", weight, "weight of each squared output error but the last"}),
    field<&S::terminal_weight>({"terminal_weight", "-", weight, "weight of the last squared output error"}),
    field<&S::input_weight>({"input_weight", "-", weight, "weight of the squared input"}),
    field<&S::change_weight>({"change_weight", "-", weight, "weight of its squared change from sample to sample"}),
    field<&S::lower>({"lower", "-", bound, "least input"}),
    field<&S::upper>({"upper", "-", bound, "largest input"}),
    field<&S::largest_change>({"largest_change", "-", above(0.0), "largest change of the input from sample to sample"}),
    field<&S::least_output>({"least_output", "-", anywhere, "soft bound of the output"}),
    field<&S::largest_output>({"largest_output", "-", anywhere, "soft bound of the output"}),
    field<&S::output_limit_weight>({"output_limit_weight", "-", weight, "price of the squared excess over them"}),
    field<&S::tolerance>({"tolerance", "-", above(0.0, 1e12), "converged where no input changes by more"}),
}};

constexpr std::array<std::pair<HorizonStatus, std::string_view>, 3> names{{
    {HorizonStatus::converged, "converged"},
    {HorizonStatus::iteration_limit, "iteration_limit"},
    {HorizonStatus::not_finite, "not_finite"},
}};

}  // namespace

std::span<const Field<HorizonSettings>, n_horizon_fields> horizon_fields() noexcept {
  return table;
}

Names<HorizonStatus> horizon_status_names() noexcept {
  return names;
}

void validate(const HorizonSettings& s) {
  require_fields(table, s);
  if (!(s.lower < s.upper)) throw ParameterError("upper", s.upper, "must be > lower = " + text(s.lower));
  if (!(s.least_output < s.largest_output)) {
    throw ParameterError("largest_output", s.largest_output, "must be > least_output = " + text(s.least_output));
  }
  if (!(s.input_weight + s.change_weight > 0.0)) {
    throw ParameterError("change_weight", s.change_weight,
                         "must be > 0 where input_weight is 0: else no input is best");
  }
  require_within("max_iterations", s.max_iterations, 1.0, 1000.0);
  require_within("max_sweeps", s.max_sweeps, 1.0, 1e6);
}

}  // namespace mgdd::control
