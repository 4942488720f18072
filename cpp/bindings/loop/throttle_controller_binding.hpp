// Any controller of mgdd.control as the core runs it in a loop, and back into the caller's object.
#pragma once

#include <variant>

#include "binding.hpp"
#include "mgdd/loop/throttle_controllers.hpp"

namespace mgdd::bindings {

using AnyMgdd1 = std::variant<loop::Mgdd1On<throttle::PwRModel>, loop::Mgdd1On<throttle::PwWModel>,
                              loop::Mgdd1On<throttle::PwPModel>>;

struct BoundMgdd1 {
  AnyMgdd1 controller;
};

/// A copy; ParameterError for what is no controller of mgdd.control.
loop::ThrottleController controller_of(const py::handle& object);

/// Puts what a run left behind back into the caller's object.
void give_back(const py::handle& object, const loop::ThrottleController& controller);

}  // namespace mgdd::bindings
