#include "binding.hpp"

PYBIND11_MODULE(_core, m) {
  using namespace mgdd::bindings;
  m.doc() = "The C++ core of mgdd. Use it through mgdd.engine, mgdd.identify and mgdd.optimize.";
  m.attr("__version__") = MGDD_VERSION;
  bind_errors(m);
  bind_optimize(m);
  bind_cylinder(m);
  bind_engine(m);
  bind_identify(m);
}
