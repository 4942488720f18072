// Pseudo-Wiener models to and from plain numbers, for the bindings of the model and of its fits.
#pragma once

#include <map>
#include <string>

#include "binding.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::bindings {

/// ParameterError for a name or value that the kind does not have.
throttle::PseudoWiener make_pseudo_wiener(const std::string& kind, const std::map<std::string, double>& given,
                                          const std::string& switching, const std::string& friction);
py::dict parameters_of(const throttle::PseudoWiener& model);

}  // namespace mgdd::bindings
