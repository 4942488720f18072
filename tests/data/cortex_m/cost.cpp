// Instructions that a step of an exported controller takes, where QEMU lets each of them last a nanosecond
// (-icount shift=0) and the system timer count 40 of them.
#include <cstdint>
#include <cstdio>

#include "controller_settings.hpp"
#include "test_vectors.hpp"

int main() {
  volatile auto* const timer = reinterpret_cast<volatile std::uint32_t*>(0xE000E010);  // control, reload, value
  timer[1] = 0xFFFFFF;
  timer[2] = 0;
  timer[0] = 5;
  static throttle_controller::Controller controller{throttle_controller::settings};
  std::uint64_t ticks = 0;
  std::uint32_t most = 0, samples = 0;
  for (const auto& sample : throttle_controller::samples) {
    const std::uint32_t before = timer[2];
    static_cast<void>(controller.step(sample.reference_deg, sample.measured_deg));
    const std::uint32_t taken = (before - timer[2]) & 0xFFFFFF;  // it counts down
    ticks += taken;
    most = taken > most ? taken : most;
    ++samples;
  }
  std::printf("%lu %lu\n", static_cast<unsigned long>(40 * ticks / samples), static_cast<unsigned long>(40 * most));
}
