// A compiled function as a plant, as Python holds it.
#pragma once

#include "guarded.hpp"
#include "mgdd/loop/function_plant.hpp"

namespace mgdd::bindings {

using BoundFunctionPlant = Guarded<loop::FunctionPlant>;

}  // namespace mgdd::bindings
