// Reads the rows of a batch into the inputs of a cycle.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mgdd/common/field.hpp"
#include "mgdd/engine/batch/batch.hpp"
#include "mgdd/engine/sensitivity.hpp"

namespace mgdd::engine {

/// One varied input: what it is, and the way to its place.
struct BatchColumn {
  enum class Changes {
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

  /// The inputs of a row, into inputs that began as `start()`.
  void read(std::size_t row, CycleInputs<double>& inputs) const {
    const double* value = cases_.values.data() + row * columns_.size();
    for (const BatchColumn& column : columns_)
      column.set(inputs, *value++, column);
  }
  CycleInputs<double> start() const { return {cases_.cylinder, cases_.point, cases_.soc_cad}; }
  bool varies_cylinder() const noexcept;
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
