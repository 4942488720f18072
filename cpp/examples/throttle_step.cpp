// The shape of a 1 kHz control task on a microcontroller: static storage, float, no heap and no exception in the loop.
// A timer would call `control_task` every millisecond; here the virtual throttle stands in for sensor and bridge, and
// the program checks what a target must: the plate follows, and the loop never allocates.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <type_traits>
#include <utility>

#include "mgdd/control/guided_predictive.hpp"
#include "mgdd/loop/virtual_throttle.hpp"

namespace {

bool in_loop = false;
int allocations = 0;

}  // namespace

void* operator new(std::size_t size) {
  allocations += in_loop ? 1 : 0;
  if (void* p = std::malloc(size)) return p;
  throw std::bad_alloc();
}
void operator delete(void* p) noexcept {
  std::free(p);
}
void operator delete(void* p, std::size_t) noexcept {
  std::free(p);
}

namespace {

using Controller = mgdd::control::BasicGuidedPredictive<float>;

/// What the interrupt handler owns.
struct Task {
  Controller controller{mgdd::control::GuidedPredictiveSettings{}};  // throttle P1, 1 ms, one sample of delay
  float duty = 0.0F;
  float wanted_deg = 8.0F;
};

/// One tick: what was computed in the last one goes out, then the next one is computed. noexcept.
float control_task(Task& task, float measured_deg) noexcept {
  const float sent = task.duty;
  task.duty = task.controller.feedback(task.wanted_deg, measured_deg);
  task.controller.prepare();  // the time until the next sample is spent on what needs no measurement
  return sent;
}
static_assert(noexcept(control_task(std::declval<Task&>(), 0.0F)));
static_assert(std::is_trivially_copyable_v<mgdd::control::PlateModel<float>>);

}  // namespace

int main() {
  static Task task;
  mgdd::loop::VirtualThrottleSettings settings;  // P1 with noise on both sensors
  settings.start_deg = 8.0;
  mgdd::loop::VirtualThrottle plate(settings);
  float measured_deg = 8.0F;
  double angle_deg = 8.0, worst_deg = 0.0;
  in_loop = true;
  for (int k = 0; k < 3000; ++k) {
    task.wanted_deg = k < 500 ? 20.0F : k < 1500 ? 60.0F : 35.0F + 10.0F * std::sin(0.006283F * static_cast<float>(k));
    const float duty = control_task(task, measured_deg);
    const auto now = plate.step({duty, settings.throttle.supply_v, 0.0});
    measured_deg = static_cast<float>(now.sensed.angle_deg);
    angle_deg = now.angle_deg;
    if (k > 1700) worst_deg = std::fmax(worst_deg, std::fabs(angle_deg - static_cast<double>(task.wanted_deg)));
  }
  in_loop = false;
  std::printf("3 s at 1 kHz in float: worst error along the sine %.2f deg, %d allocations, %zu bytes of state\n",
              worst_deg, allocations, sizeof(Task));
  return worst_deg < 1.0 && allocations == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
