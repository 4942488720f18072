// What single samples of a trace say about amplifier and sensor: spikes.
#pragma once

#include "mgdd/engine/pressure/trace_analysis.hpp"

namespace mgdd::engine {

/// Adds a warning "spike" for a sample off its neighbours: by a tenth of the peak, or, outside -30 to 60 °CA, by a
/// hundredth of it and twelve times the usual.
void doubt_spikes(TraceAnalysis& analysis);

}  // namespace mgdd::engine
