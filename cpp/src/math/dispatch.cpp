#include "mgdd/math/dispatch.hpp"

#include "mgdd/common/platform.hpp"

namespace mgdd {

std::string_view to_string(InstructionSet set) noexcept {
  switch (set) {
    case InstructionSet::avx512f:
      return "avx512f";
    case InstructionSet::avx2:
      return "avx2";
    case InstructionSet::baseline:
      break;
  }
  return "baseline";
}

InstructionSet instruction_set() noexcept {
  static const InstructionSet widest = [] {
    InstructionSet known = InstructionSet::baseline;
#if MGDD_X86_CLONES
    for (const std::string& level : processor_simd_levels()) {
      for (const InstructionSet set : {InstructionSet::avx2, InstructionSet::avx512f}) {
        if (level == to_string(set)) known = set;
      }
    }
#endif
    return known;
  }();
  return widest;
}

}  // namespace mgdd
