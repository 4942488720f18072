// What single samples of a trace say about amplifier and sensor: spikes, and stretches that stand still.
#pragma once

#include "mgdd/engine/pressure/trace_analysis.hpp"

namespace mgdd::engine {

/// Adds a warning "spike" for a sample off its neighbours: by a tenth of the peak, or, outside -30 to 60 °CA, by a
/// hundredth of it and twelve times the usual.
void doubt_spikes(TraceAnalysis& analysis);

/// Adds a warning "clipped" or "stuck" for a run of four or more equal samples that the resolution does not explain:
/// the trace falls off steeply on both sides of it, or the volume changes outside -30 to 60 °CA.
void doubt_runs(TraceAnalysis& analysis);

}  // namespace mgdd::engine
