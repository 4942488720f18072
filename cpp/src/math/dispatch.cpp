#include "mgdd/math/dispatch.hpp"

#include <array>
#include <cstdlib>
#include <string>
#include <utility>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/platform.hpp"

namespace mgdd {
namespace {

constexpr const char* environment_variable = "MGDD_INSTRUCTION_SET";
constexpr std::array<std::pair<InstructionSet, std::string_view>, 3> set_names{{
    {InstructionSet::baseline, "baseline"},
    {InstructionSet::avx2, "avx2"},
    {InstructionSet::avx512f, "avx512f"},
}};

InstructionSet widest() {
  InstructionSet known = InstructionSet::baseline;
#if MGDD_X86_CLONES
  for (const std::string& level : processor_simd_levels()) {
    for (const InstructionSet set : {InstructionSet::avx2, InstructionSet::avx512f}) {
      if (level == to_string(set)) known = set;
    }
  }
#endif
  return known;
}

}  // namespace

std::string_view to_string(InstructionSet set) noexcept {
  return name_of<InstructionSet>(set_names, set);
}

InstructionSet wanted_instruction_set() {
  const char* wanted = std::getenv(environment_variable);  // NOLINT(concurrency-mt-unsafe): read only
  if (wanted == nullptr || *wanted == '\0') return widest();
  const InstructionSet set = parse_name<InstructionSet>(set_names, environment_variable, wanted);
  if (set > widest()) {
    throw ParameterError(environment_variable, wanted,
                         "this processor has " + std::string(to_string(widest())) + " at most");
  }
  return set;
}

InstructionSet instruction_set() noexcept {
  static const InstructionSet chosen = [] {
    try {
      return wanted_instruction_set();
    } catch (const ParameterError&) {  // the Python module refuses it at import
      return widest();
    }
  }();
  return chosen;
}

}  // namespace mgdd
