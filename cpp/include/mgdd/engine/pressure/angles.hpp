// The angles of a trace as a grid: its usual step, whether it is even, which samples lie between two angles. Rising
// angles, °CA aTDC.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace mgdd::engine {

/// Samples [first, last).
using SampleRange = std::pair<std::size_t, std::size_t>;

SampleRange samples_within(const std::vector<double>& angle_cad, double from_cad, double to_cad);

double median_step(const std::vector<double>& angle_cad);

/// Whether no step differs from the median by more than this share of it.
bool is_even(const std::vector<double>& angle_cad, double tolerance);

}  // namespace mgdd::engine
