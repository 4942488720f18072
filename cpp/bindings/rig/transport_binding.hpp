// Counts of a transport as Python reads them.
#pragma once

#include "binding.hpp"
#include "mgdd/rig/transport.hpp"

namespace mgdd::bindings {

py::dict counts_of(const rig::TransportCounts& counts, const rig::BusMonitor& monitor);

}  // namespace mgdd::bindings
