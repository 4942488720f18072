// The plate of an electronic throttle after a step of the duty: the plant that sticks exactly, and beside it the model
// PW-R made of the same parameters, as a controller would carry it. Prints CSV; `throttle_plate 0.35` sets the duty.
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "mgdd/common/units.hpp"
#include "mgdd/throttle/models/pw_r.hpp"
#include "mgdd/throttle/plant.hpp"

int main(int argc, char** argv) {
  using namespace mgdd::throttle;
  try {
    const Throttle throttle;  // the preset P1
    const double duty = argc > 1 ? std::strtod(argv[1], nullptr) : 0.3;

    const ThrottlePlant plant(throttle);  // 0.1 ms steps, checks the parameters
    ThrottleState state = at_rest(throttle.limp_home_deg);
    ThrottleInput input;
    input.supply_v = throttle.supply_v;

    const PwR parameters = pw_r_of(throttle);
    parameters.validate();
    const PwRModel model(parameters);  // samples of 1 ms
    auto predicted = model.at_rest(throttle.limp_home_deg, 0.0);

    std::printf("time_ms,duty,angle_deg,pw_r_angle_deg\n");
    for (int sample = 0; sample <= 300; ++sample) {
      input.duty = sample < 200 ? duty : 0.0;  // 200 ms on, then back to limp-home
      if (sample % 10 == 0) {
        std::printf("%d,%.3f,%.3f,%.3f\n", sample, input.duty, state.plate_angle_rad / mgdd::units::rad_per_deg,
                    model.output(predicted));
      }
      for (int step = 0; step < 10; ++step)
        plant.step(state, input);
      model.step(predicted, input.duty);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
