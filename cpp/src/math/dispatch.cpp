#include "mgdd/math/dispatch.hpp"

#include <cstdlib>
#include <string>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/platform.hpp"

namespace mgdd {
namespace {

constexpr const char* environment_variable = "MGDD_INSTRUCTION_SET";

InstructionSet widest() {
  InstructionSet known = InstructionSet::baseline;
#if MGDD_X86_CLONES
  for (const std::string& level : processor_simd_levels()) {
    for (const InstructionSet set : {InstructionSet::avx2, InstructionSet::avx512f}) {
      if (level == name_of(set)) known = set;
    }
  }
#endif
  return known;
}

}  // namespace

InstructionSet wanted_instruction_set() {
  const char* wanted = std::getenv(environment_variable);  // NOLINT(concurrency-mt-unsafe): read only
  if (wanted == nullptr || *wanted == '\0') return widest();
  const InstructionSet set = parse_name<InstructionSet>(environment_variable, wanted);
  if (set > widest()) {
    throw ParameterError(environment_variable, wanted,
                         "this processor has " + std::string(name_of(widest())) + " at most");
  }
  return set;
}

InstructionSet instruction_set() noexcept {  // NOLINT(bugprone-exception-escape): out of memory at the start
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
