#include "mgdd/control/mgdd1.hpp"

#include <array>

namespace mgdd::control {
namespace {

using Mg = Mgdd1Settings;
constexpr Domain mgdd1_weight = closed(0.0, 1e9);

constexpr auto mgdd1_table = joined(
    std::array{
        field<&Mg::adaptation_gain>({"adaptation_gain", "-", above(0.0, 1.0), "share of the Gauss-Newton step"}),
        field<&Mg::difference>({"difference", "-", above(0.0, 0.5), "duty by which the model is asked for its slope"}),
        field<&Mg::error_weight>({"error_weight", "1/degree²", mgdd1_weight, "of the squared error at each sample"}),
        field<&Mg::duty_change_weight>(
            {"duty_change_weight", "-", above(0.0, 1e9), "of the squared change of the duty"}),
        field<&Mg::trim_rate_per_deg_s>({"trim_rate_per_deg_s", "1/(degree*second)", mgdd1_weight,
                                         "rate of the trim, which the model does not see"}),
    },
    reference_fields<&Mg::reference>(), duty_fields<&Mg::duty>());

}  // namespace

std::span<const Field<Mg>> mgdd1_fields() noexcept {
  return mgdd1_table;
}

void validate(const Mg& s) {
  require_fields(mgdd1_table, s);
  validate(s.duty);
  require_within("horizon_samples", s.horizon_samples, 1, 1000);
  require_within("delay_samples", s.delay_samples, 0, longest_control_delay);
}

}  // namespace mgdd::control
