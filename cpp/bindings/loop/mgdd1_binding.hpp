// Mgdd1 as Python holds it: guided by a pseudo-Wiener model, or by a Python object.
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

}  // namespace mgdd::bindings
