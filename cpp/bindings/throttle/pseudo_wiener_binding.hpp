// A pseudo-Wiener model as a dict, for the bindings of the model and of its fits.
#pragma once

#include "binding.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::bindings {

py::dict parameters_of(const throttle::PseudoWiener& model);

/// What `mgdd._core.throttle.PseudoWienerModel` holds.
struct BoundModel {
  throttle::PseudoWiener parameters;
  bool operator==(const BoundModel&) const = default;
};

}  // namespace mgdd::bindings
