// What module.cpp binds: one function per noun. Only module.cpp includes this, so that a new noun rebuilds only itself.
#pragma once

#include <pybind11/pybind11.h>

namespace mgdd::bindings {

void bind_tables(pybind11::module_& m);
void bind_number_rows(pybind11::module_& m);
void bind_least_squares(pybind11::module_& m);
void bind_limits(pybind11::module_& m);
void bind_seekers(pybind11::module_& m);
void bind_map_seeking(pybind11::module_& m);
void bind_learning(pybind11::module_& m);
void bind_controllers(pybind11::module_& m);
void bind_guided_predictive(pybind11::module_& m);
void bind_single_precision(pybind11::module_& m);
void bind_supervisor(pybind11::module_& m);
void bind_cylinder(pybind11::module_& m);
void bind_emissions(pybind11::module_& m);
void bind_batch(pybind11::module_& m);
void bind_cycle(pybind11::module_& m);
void bind_performance(pybind11::module_& m);
void bind_pressure(pybind11::module_& m);
void bind_encoder(pybind11::module_& m);
void bind_throttle(pybind11::module_& m);
void bind_sensors(pybind11::module_& m);
void bind_stepper(pybind11::module_& m);
void bind_pseudo_wiener(pybind11::module_& m);
void bind_demand(pybind11::module_& m);
void bind_cylinder_fit(pybind11::module_& m);
void bind_throttle_fit(pybind11::module_& m);
void bind_online(pybind11::module_& m);
void bind_feed_forward(pybind11::module_& m);
void bind_model_optimum(pybind11::module_& m);
void bind_online_calibration(pybind11::module_& m);
void bind_curve(pybind11::module_& m);
void bind_guided_engine(pybind11::module_& m);
void bind_virtual_engine(pybind11::module_& m);
void bind_function_plant(pybind11::module_& m);
void bind_loop(pybind11::module_& m);
void bind_virtual_throttle(pybind11::module_& m);
void bind_throttle_loop(pybind11::module_& m);
void bind_mgdd1(pybind11::module_& m);

}  // namespace mgdd::bindings
