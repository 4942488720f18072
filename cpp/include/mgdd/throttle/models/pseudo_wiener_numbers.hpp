// A pseudo-Wiener model as plain numbers by name, as a file or a user states it, and back. Offline code.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::throttle {

struct NamedNumber {
  std::string_view name;
  std::string_view unit;  ///< "-" for none
  double value;
};

/// Fields and settings of a model, without the plays beyond its number of plays.
std::vector<NamedNumber> named_numbers(const PseudoWiener& model);
/// The default model of a kind with every field and setting that the kind can have.
std::vector<NamedNumber> named_numbers(PseudoWienerKind kind);

/// The default model of a kind with other numbers, checked; `switching` and `friction` matter for PW-R.
/// ParameterError for a name or a value that the kind does not have.
PseudoWiener pseudo_wiener_from(std::string_view kind, const std::map<std::string, double>& given,
                                std::string_view switching = "predicted", std::string_view friction = "set_valued");

}  // namespace mgdd::throttle
