// A compiled function of the user's as a plant: inputs in, J and limited quantities out, noise on J by seed and cycle.
// `step` is noexcept and allocates nothing of its own. Every number in its own unit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mgdd/loop/virtual_engine.hpp"

namespace mgdd::loop {

/// Reads n_inputs numbers and writes n_outputs; 0: measured, anything else: a failed cycle. Called from many threads at
/// once where loops run on many; an exception that leaves it ends the program.
using PlantFunction = int (*)(const double* inputs, std::size_t n_inputs, double* outputs, std::size_t n_outputs,
                              void* user_data);

struct FunctionPlantSettings {
  std::size_t inputs = 1;             ///< 1 to 8
  std::size_t values = 1;             ///< outputs before the limits, 1 to 64; of one it is J
  std::vector<std::string> limits{};  ///< names of the outputs after them, at most eight
  double noise_sd = 0.0;              ///< standard deviation of the noise on J, >= 0 [unit of J]
  std::uint64_t seed = 0;             ///< of that noise
};

/// Standard normal noise of a cycle.
double plant_noise(std::uint64_t seed, std::int64_t cycle) noexcept;

class FunctionPlant {
 public:
  /// ParameterError for a null function or a setting outside its domain. The data outlive the plant.
  FunctionPlant(PlantFunction function, void* user_data, FunctionPlantSettings settings);

  /// Runs one cycle. One that failed is a misfire with NaN: a status, or an output that is not a reading
  /// (`optimize::is_reading`), as one is that was not written.
  BenchCycle step(std::span<const double> inputs) noexcept;
  /// The same with the plain outputs, valid until the next call; empty where it failed.
  std::span<const double> measure(std::span<const double> inputs) noexcept;

  /// Back to cycle 0, with another seed.
  void reset(std::uint64_t seed) noexcept;
  std::int64_t cycle() const noexcept { return cycle_; }  ///< index of the next cycle
  const FunctionPlantSettings& settings() const noexcept { return settings_; }

 private:
  PlantFunction function_;
  void* user_data_;
  FunctionPlantSettings settings_;
  std::vector<double> outputs_;
  std::int64_t cycle_ = 0;
};

}  // namespace mgdd::loop
