// Cycles of the bench as columns, for every binding that returns them.
#pragma once

#include <vector>

#include "binding.hpp"
#include "mgdd/loop/engine_bench.hpp"

namespace mgdd::bindings {

/// One array per measured quantity, by name; `components` and `limits` are tables.
py::dict bench_columns(const std::vector<loop::BenchCycle>& rows, const loop::BenchSettings& settings);

}  // namespace mgdd::bindings
