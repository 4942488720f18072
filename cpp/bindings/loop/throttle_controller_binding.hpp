// Any controller of mgdd.control as the core runs it in a loop, and back into the caller's object.
#pragma once

#include "binding.hpp"
#include "loop/mgdd1_binding.hpp"
#include "mgdd/loop/throttle_controllers.hpp"

namespace mgdd::bindings {

/// A copy; ParameterError for anything but a controller of mgdd.control.
loop::ThrottleController controller_of(const py::handle& object);

/// Puts what a run left behind back into the caller's object.
void give_back(const py::handle& object, const loop::ThrottleController& controller);

}  // namespace mgdd::bindings
