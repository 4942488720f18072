// The step of an exported throttle controller on its test vectors: build it for the host first, then for the target.
// In a control task the same `step` runs once per sample: it is noexcept, allocates nothing and reads no clock.
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "controller_settings.hpp"
#include "test_vectors.hpp"

namespace {

using throttle_controller::Controller;
using throttle_controller::Number;

/// One sample: reference and measured angle in deg, the duty -1..1 in return.
Number control_task(Controller& controller, Number reference_deg, Number measured_deg) noexcept {
  return controller.step(reference_deg, measured_deg);
}
static_assert(noexcept(std::declval<Controller&>().step(Number(), Number())));

}  // namespace

int main() {
  static Controller controller{throttle_controller::settings};  // checks the settings: before the loop begins
  unsigned long samples = 0, equal = 0, wrong = 0;              // %zu is more than every library of a target prints
  double largest = 0.0;
  for (const auto& sample : throttle_controller::samples) {
    const Number duty = control_task(controller, sample.reference_deg, sample.measured_deg);
    const double difference = static_cast<double>(duty) - static_cast<double>(sample.duty);
    const double size = difference < 0.0 ? -difference : difference;
    ++samples;
    if (duty == sample.duty) ++equal;
    if (!(size <= throttle_controller::allowed_difference)) ++wrong;  // NaN is wrong
    if (size > largest) largest = size;
  }
  std::printf("%s: %lu samples, %lu equal, %lu wrong, largest difference %.3g, allowed %.3g, %lu bytes of state\n",
              wrong == 0 ? "passed" : "FAILED", samples, equal, wrong, largest, throttle_controller::allowed_difference,
              static_cast<unsigned long>(sizeof(Controller)));
  return wrong == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
