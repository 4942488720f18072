// A seeker on a process of your own: it proposes an input, takes what was measured of it, and never sees the process.
// Here the process is a function with noise whose optimum, at -6, lies beyond a measured limit that is reached at -3.
#include <cstdint>
#include <cstdio>
#include <exception>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/extremum_seeking.hpp"

int main() {
  using namespace mgdd::optimize;
  try {
    ExtremumSeekingSettings settings;
    settings.space = {scalar_input(5.0), scalar_input(-20.0), scalar_input(10.0)};  // start, lower, upper [°CA aTDC]
    settings.dither.amplitude = scalar_input(1.0);
    settings.gain = scalar_input(1.0);
    Limit pressure;
    pressure.name = "p_max_bar";
    pressure.upper = 100.0;
    settings.limits = {pressure};
    ExtremumSeeking seeker(settings);

    std::printf("cycle  estimate_cad  p_max_bar\n");
    for (int cycle = 0; cycle < 600; ++cycle) {
      const double soc_cad = seeker.ask()[0];
      const double noise = 0.1 * mgdd::random::normal(1, 0, static_cast<std::uint64_t>(cycle));
      const double efficiency_percent[] = {40.0 - 0.025 * (soc_cad + 6.0) * (soc_cad + 6.0) + noise};
      const double p_max_bar[] = {100.0 - 4.0 * (soc_cad + 3.0)};
      const Reading reading{efficiency_percent, p_max_bar};
      require(seeker.tell(reading), seeker.protocol(), reading, 1, 1, 1);  // throws for a reading that is refused
      if (cycle % 50 == 49) std::printf("%5d  %12.2f  %9.1f\n", cycle + 1, seeker.estimate()[0], p_max_bar[0]);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
