// What does an earlier burn bring, and what does it cost? Simulates one cylinder over its start of combustion and
// prints a table; `engine_timing 25` does so for 25 mg of fuel per cycle.
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "mgdd/engine/cycle.hpp"

int main(int argc, char** argv) {
  using namespace mgdd::engine;
  try {
    const Cylinder cylinder;  // a light-duty diesel
    OperatingPoint point;
    if (argc > 1) point.fuel_mg = std::strtod(argv[1], nullptr);

    // Tables and memory once; the loop below allocates nothing.
    const CycleModel<double> model(cylinder, crank_grid(cylinder));
    CycleWorkspace<double> work = model.make_workspace();

    std::printf("soc_cad  efficiency  p_max_bar  imep_gross_bar  ca50_cad\n");
    for (double soc_cad = -20.0; soc_cad <= 5.0; soc_cad += 2.5) {
      validate_cycle(cylinder, point, soc_cad);
      const Charge<double> charge = model.charge(point);
      model.run(charge, soc_cad, work);
      model.require_physical(work);
      const Indicators<double> cycle = model.indicators(charge, soc_cad, work);
      std::printf("%7.1f  %10.4f  %9.1f  %14.2f  %8.1f\n", soc_cad, cycle.efficiency_gross, cycle.p_max_bar,
                  cycle.imep_gross_bar, cycle.ca50_cad);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
