// Reads the rows of a batch into the inputs of a cycle.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "mgdd/common/record.hpp"
#include "mgdd/engine/batch/batch.hpp"
#include "mgdd/engine/sensitivity.hpp"

namespace mgdd::engine {

/// One varied input: what it is, and the way to its place.
struct BatchColumn {
  enum class Changes {
    nothing,
    timing,    ///< start of combustion
    burn,      ///< fuel and how it burns: the motored cycle stays
    point,     ///< the motored cycle
    cylinder,  ///< the same by a field of the cylinder that does not stand in a table over the crank angle
    tables,    ///< geometry or gamma
    grid       ///< IVC or EVO
  };
  FieldInfo info;
  Changes changes = Changes::timing;
  void (*set)(CycleInputs<double>& inputs, double value, const BatchColumn& column) = nullptr;
  double& (*in_point)(OperatingPoint&) noexcept = nullptr;
  double& (*in_cylinder)(Cylinder&) noexcept = nullptr;
};

/// Every input that may vary.
std::vector<BatchColumn> batch_columns();

class CaseReader {
 public:
  /// ParameterError for an unknown or repeated name, ShapeError for a table that is not whole.
  explicit CaseReader(const BatchCases& cases);

  /// The inputs of a row, into inputs that hold row `before`; says what has changed. `no_row`: inputs are `start()`.
  BatchColumn::Changes read(std::size_t row, std::size_t before, CycleInputs<double>& inputs) const {
    const std::size_t m = columns_.size();
    const double* now = cases_.values.data() + row * m;
    const double* old = before == no_row ? nullptr : cases_.values.data() + before * m;
    auto changes = old == nullptr ? BatchColumn::Changes::grid : BatchColumn::Changes::nothing;
    for (std::size_t i = 0; i < m; ++i) {
      if (old != nullptr && now[i] == old[i]) continue;
      columns_[i].set(inputs, now[i], columns_[i]);
      changes = std::max(changes, columns_[i].changes);
    }
    return changes;
  }
  static constexpr std::size_t no_row = std::numeric_limits<std::size_t>::max();
  CycleInputs<double> start() const { return {cases_.cylinder, cases_.point, cases_.soc_cad}; }
  std::size_t size() const noexcept { return cases_.size(); }
  /// Mean length of the rows in a row with one motored cycle.
  double cases_per_point() const noexcept;
  /// All rows; ParameterError naming the field and the row.
  void require_valid() const;

 private:
  bool within_domains(std::size_t row) const noexcept;

  const BatchCases& cases_;
  std::vector<BatchColumn> columns_;
};

}  // namespace mgdd::engine
