#include "mgdd/control/horizon_settings.hpp"

#include <array>

#include "mgdd/common/error.hpp"

namespace mgdd::control {
namespace {

using Hz = HorizonSettings;

constexpr Domain horizon_weight = closed(0.0, 1e12);
constexpr Domain bound = closed(-1e12, 1e12);
constexpr Domain anywhere = closed(-unbounded, unbounded);

constexpr std::array horizon_table{
    field<&Hz::output_weight>(
        {"output_weight", "-", horizon_weight, "weight of each squared output error but the last"}),
    field<&Hz::terminal_weight>({"terminal_weight", "-", horizon_weight, "weight of the last squared output error"}),
    field<&Hz::input_weight>({"input_weight", "-", horizon_weight, "weight of the squared input"}),
    field<&Hz::change_weight>(
        {"change_weight", "-", horizon_weight, "weight of its squared change from sample to sample"}),
    field<&Hz::lower>({"lower", "-", bound, "least input"}),
    field<&Hz::upper>({"upper", "-", bound, "largest input"}),
    field<&Hz::largest_change>(
        {"largest_change", "-", above(0.0), "largest change of the input from sample to sample"}),
    field<&Hz::least_output>({"least_output", "-", anywhere, "soft bound of the output"}),
    field<&Hz::largest_output>({"largest_output", "-", anywhere, "soft bound of the output"}),
    field<&Hz::output_limit_weight>(
        {"output_limit_weight", "-", horizon_weight, "price of the squared excess over them"}),
    field<&Hz::tolerance>({"tolerance", "-", above(0.0, 1e12), "converged where no input changes by more"}),
};

}  // namespace

std::span<const Field<HorizonSettings>> horizon_fields() noexcept {
  return horizon_table;
}

void validate(const HorizonSettings& s) {
  require_fields(horizon_table, s);
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
