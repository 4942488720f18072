// The bench as Python holds it, and its cycles as columns, for every binding that returns them.
#pragma once

#include <vector>

#include "binding.hpp"
#include "guarded.hpp"
#include "mgdd/loop/virtual_engine.hpp"

namespace mgdd::bindings {

using BoundBench = Guarded<loop::VirtualEngine>;

/// One array per measured quantity, by name; `components` and `limits` are tables.
py::dict bench_columns(const std::vector<loop::BenchCycle>& rows, const loop::BenchSettings& settings);

}  // namespace mgdd::bindings
