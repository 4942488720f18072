// One function per noun of the rig. Apart from binding.hpp, so that a new one here does not recompile the other
// modules.
#pragma once

#include "binding.hpp"

namespace mgdd::bindings {

void bind_e2e(py::module_& m);
void bind_frame(py::module_& m);
void bind_record(py::module_& m);
void bind_safety(py::module_& m);
void bind_signal_codec(py::module_& m);
void bind_transports(py::module_& m);
void bind_realtime_loop(py::module_& m);

}  // namespace mgdd::bindings
