// Normal equations of the smooth throttle over a record, in one pass and without storing a row: simulation (RK4, one
// step per sample), exact derivatives of that step with respect to the ten parameters, and the sums J'J, J'r, r'r.
// One parameter set (columns in SIMD lanes) or several at once (sets in lanes). SI, rad; residual in deg.
// noexcept, no heap. The instruction set is chosen at run time; without fused multiply-add every choice gives the same
// bits.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "mgdd/throttle/models/smooth.hpp"

namespace mgdd::identify {

/// Input and measured angle on one time grid, converted once.
struct SmoothThrottleRecord {
  double dt_s = 1e-3;
  std::array<double, 3> start{};  ///< known state at the first sample: rad, rad/s, A
  std::span<const double> duty;
  std::span<const double> angle_deg;
};

/// Sums over the samples: symmetric J'J, J'r with J = d r / d parameter and r = model - measured in deg.
struct NormalSums {
  std::array<std::array<double, 10>, 10> jacobian_squared{};
  std::array<double, 10> gradient{};
  double sum_squares = 0.0;
};

inline constexpr std::size_t smooth_throttle_lanes = 8;

/// First `n_samples` of the record. Numbers that are not finite say that the set cannot be simulated.
void accumulate(const throttle::SmoothPlant& plant, const SmoothThrottleRecord& record, std::size_t n_samples,
                const std::array<double, 10>& parameters, NormalSums& sums) noexcept;

/// Eight sets at once: `parameters[lane]`, `sums[lane]`.
void accumulate(const throttle::SmoothPlant& plant, const SmoothThrottleRecord& record, std::size_t n_samples,
                std::span<const std::array<double, 10>, smooth_throttle_lanes> parameters,
                std::span<NormalSums, smooth_throttle_lanes> sums) noexcept;

/// Instruction set in use: "avx512f", "avx2" or "baseline".
std::string_view smooth_throttle_instruction_set() noexcept;

}  // namespace mgdd::identify
