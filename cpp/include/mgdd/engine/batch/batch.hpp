// Many cycles at once, for any mix of inputs: indicators in columns, cycles in SIMD lanes where gamma is constant and
// one by one otherwise, on several threads. Conventional units, angles in °CA aTDC. Offline code: it allocates and
// throws. The numbers of a form do not depend on the number of threads, on the instruction set or on which cases run
// together.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/common/record.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/indicators.hpp"
#include "mgdd/math/dispatch.hpp"

namespace mgdd::engine {

/// The cases of a batch: what they share, and a table of what varies.
struct BatchCases {
  Cylinder cylinder{};
  OperatingPoint point{};
  double soc_cad = -6.0;
  std::vector<std::string> names;    ///< varied inputs, of `batch_inputs()`
  std::span<const double> values{};  ///< row by row, one number for each name

  std::size_t size() const noexcept { return names.empty() ? 0 : values.size() / names.size(); }
};

/// How the cases run; which form a batch takes never depends on the threads.
enum class BatchForm {
  automatic,
  single,  ///< one by one; the only one where gamma depends on temperature
  lanes,   ///< any mix of cases; the numbers of `single` to rounding
  shared,  ///< cases of one operating point in a row share its motored part and the expansion after the burn, which is
           ///< interpolated over the pressure at its end: 1e-6 of `single`; a case outside of that range runs in lanes
};

/// ParameterError that lists the valid names.

struct BatchSettings {
  double step_cad = default_step_cad;
  Integrator integrator = Integrator::trapezoid;
  std::size_t threads = 0;  ///< 0 = one per core
  BatchForm form = BatchForm::automatic;
  InstructionSet set = instruction_set();
};

/// What may vary: `soc_cad`, the numbers of an operating point with its optional ones, the numbers of a cylinder.
std::vector<FieldInfo> batch_inputs();

/// ParameterError with the row for a value outside of its domain, ShapeError for values that do not fill the rows; the
/// checks of `validate_cycle` for every case.
void validate(const BatchCases& cases);

/// The form that these cases run in: `single` where gamma depends on temperature; for `automatic`, `shared` where many
/// cases in a row differ in fuel and burn only. Who cuts a batch into pieces asks before and passes it on.
BatchForm form_of(const BatchCases& cases, BatchForm wanted);

using IndicatorMember = double Indicators<double>::*;
/// ParameterError that lists the indicators.
IndicatorMember parse_indicator(std::string_view name);

/// Column i is written with output i of every case; NaN in a case whose pressure leaves the physical range. Validates
/// first. Returns the number of such cases.
std::size_t simulate_batch(const BatchCases& cases, const BatchSettings& settings,
                           std::span<const IndicatorMember> outputs, std::span<double* const> columns);

/// Exact derivatives of every output along every input of `differentiable_inputs()`, by forward mode: column
/// i * outputs + o holds that of output o along input i. In lanes, one direction at a time; cycle by cycle where the
/// input changes geometry or gamma. NaN as in `simulate_batch`, but a cycle on its own is a ConvergenceError.
void differentiate_batch(const BatchCases& cases, const BatchSettings& settings,
                         std::span<const IndicatorMember> outputs, const std::vector<std::string>& along,
                         std::span<double* const> columns);

}  // namespace mgdd::engine
