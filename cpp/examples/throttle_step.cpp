// The shape of a 1 kHz control task on a microcontroller: static storage, float, no heap, no exceptions. A timer would
// call `control_task` every millisecond; here a plate of springs, preload and dry friction stands in for sensor and
// bridge, and the program checks what a target must: the plate follows, and the loop never allocates.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <type_traits>
#include <utility>

#include "mgdd/control/guided_predictive.hpp"

namespace {

bool in_loop = false;
int allocations = 0;

}  // namespace

void* operator new(std::size_t size) {
  allocations += in_loop ? 1 : 0;
  if (void* p = std::malloc(size)) return p;
  std::abort();
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

/// The throttle P1 from its data sheet, in 0.1 ms: torque of the motor against spring, preload, braking and friction.
struct Plate {
  double angle_deg = 8.0, speed_deg_per_s = 0.0;

  void pass_a_millisecond(double duty) noexcept {
    constexpr double deg = 57.29577951308232, inertia_kgm2 = 2.1e-3, stall_nm = 3.064, braking_nms = 0.1066;
    constexpr double spring_nm_per_deg = 0.087 / deg, preload_nm = 0.396, friction_nm = 0.284, step_s = 1e-4;
    for (int i = 0; i < 10; ++i) {
      const double x = angle_deg - 8.0;
      const double held = spring_nm_per_deg * x + preload_nm * std::clamp(x / 0.5, -1.0, 1.0);
      const double drive = stall_nm * duty - held - braking_nms * speed_deg_per_s / deg;
      const double free = speed_deg_per_s + step_s * deg * drive / inertia_kgm2;
      const double stops = step_s * deg * friction_nm / inertia_kgm2;  // what dry friction can take off
      speed_deg_per_s = std::copysign(std::fmax(std::fabs(free) - stops, 0.0), free);
      angle_deg = std::clamp(angle_deg + step_s * speed_deg_per_s, 0.0, 90.0);
    }
  }
};

}  // namespace

int main() {
  static Task task;
  Plate plate;
  double worst_deg = 0.0;
  in_loop = true;
  for (int k = 0; k < 3000; ++k) {
    task.wanted_deg = k < 500 ? 20.0F : k < 1500 ? 60.0F : 35.0F + 10.0F * std::sin(0.006283F * static_cast<float>(k));
    const double noise_deg = 0.03 * std::sin(2.4 * k * k);
    plate.pass_a_millisecond(static_cast<double>(control_task(task, static_cast<float>(plate.angle_deg + noise_deg))));
    if (k > 1700) worst_deg = std::fmax(worst_deg, std::fabs(plate.angle_deg - static_cast<double>(task.wanted_deg)));
  }
  in_loop = false;
  std::printf("3 s at 1 kHz in float: worst error along the sine %.2f deg, %d allocations, %zu bytes of state\n",
              worst_deg, allocations, sizeof(Task));
  return worst_deg < 1.0 && allocations == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
