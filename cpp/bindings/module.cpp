#include "binding.hpp"
#include "mgdd/common/platform.hpp"

PYBIND11_MODULE(_core, m) {
  using namespace mgdd::bindings;
  m.doc() =
      "The C++ core of mgdd. Use it through mgdd.engine, mgdd.throttle, mgdd.identify, mgdd.optimize and mgdd.loop.";
  m.attr("__version__") = MGDD_VERSION;
  m.def("compiled_simd_level", &mgdd::compiled_simd_level, "Instruction set of this build.");
  m.def("processor_simd_levels", &mgdd::processor_simd_levels, "Vector instruction sets of this processor.");
  m.def("compiler", [] { return std::string(MGDD_COMPILER); }, "Compiler of this build.");
  bind_errors(m);
  bind_optimize(m);
  bind_limits(m);
  bind_seekers(m);
  bind_direct_seekers(m);
  bind_learning(m);
  bind_cylinder(m);
  bind_emissions(m);
  bind_engine(m);
  bind_performance(m);
  bind_trace(m);
  bind_throttle(m);
  bind_sensors(m);
  bind_throttle_step(m);
  bind_pseudo_wiener(m);
  bind_identify(m);
  bind_recursive(m);
  bind_identify_throttle(m);
  bind_benchmark_models(m);
  bind_bench(m);
  bind_loop(m);
  bind_virtual_throttle(m);
  make_refusals_readable(m);
}
