#include <vector>

#include "binding.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/platform.hpp"
#include "mgdd/math/dispatch.hpp"
#include "nouns.hpp"
#include "rig/rig_binding.hpp"

namespace {

/// A submodule and its nouns; a later room may use the classes of an earlier one.
struct Room {
  const char* name;
  const char* doc;
  std::vector<void (*)(pybind11::module_&)> nouns;
};

}  // namespace

PYBIND11_MODULE(_core, m) {
  using namespace mgdd::bindings;
  m.doc() = "The C++ core of mgdd, a submodule per room. Use it through mgdd.engine, mgdd.throttle and so on.";
  m.attr("__version__") = MGDD_VERSION;
  m.def("compiled_simd_level", &mgdd::compiled_simd_level, "Instruction set of this build.");
  m.def("processor_simd_levels", &mgdd::processor_simd_levels, "Vector instruction sets of this processor.");
  m.def(
      "instruction_set", [] { return as_str(mgdd::name_of(mgdd::instruction_set())); },
      "Instruction set that the kernels run in: the widest of this processor, or MGDD_INSTRUCTION_SET.");
  m.def("compiler", [] { return std::string(MGDD_COMPILER); }, "Compiler of this build.");
  bind_errors(m);
  static_cast<void>(mgdd::wanted_instruction_set());  // refuses a wrong MGDD_INSTRUCTION_SET here, by name
  const std::vector<Room> rooms{
      {"math", "Places in look-up tables, and rows of numbers in a text.", {&bind_tables, &bind_number_rows}},
      {"optimize",
       "Fits, seekers and learners.",
       {&bind_least_squares, &bind_limits, &bind_seekers, &bind_map_seeking, &bind_learning}},
      {"control",
       "Controllers of a throttle plate.",
       {&bind_controllers, &bind_guided_predictive, &bind_supervisor, &bind_single_precision}},
      {"engine",
       "Cycle model of one cylinder, emissions, performance, measured pressure.",
       {&bind_cylinder, &bind_emissions, &bind_cycle, &bind_batch, &bind_performance, &bind_pressure, &bind_encoder}},
      {"throttle",
       "Throttle body, its sensors, pseudo-Wiener models, demand chain.",
       {&bind_throttle, &bind_sensors, &bind_stepper, &bind_pseudo_wiener, &bind_demand}},
      {"identify",
       "Fits of the cylinder and the throttle, update while running.",
       {&bind_cylinder_fit, &bind_throttle_fit, &bind_online}},
      {"guide",
       "Models that guide a seeker: feed-forward, curves, trust.",
       {&bind_curve, &bind_feed_forward, &bind_model_optimum, &bind_online_calibration, &bind_guided_engine}},
      {"loop",
       "Virtual benches and the loops over them.",
       {&bind_virtual_engine, &bind_function_plant, &bind_loop, &bind_virtual_throttle, &bind_throttle_loop,
        &bind_mgdd1}},
      {"rig",
       "Between a controller and a real actuator: frames of a bus, their protection and signals, records, the safety "
       "gate, buses, the loop.",
       {&bind_e2e, &bind_signal_codec, &bind_frame, &bind_record, &bind_safety, &bind_transports, &bind_realtime_loop}},
  };
  for (const Room& room : rooms) {
    auto submodule = m.def_submodule(room.name, room.doc);
    for (const auto bind : room.nouns)
      bind(submodule);
  }
  make_refusals_readable(m);
}
