// What the library was compiled for and what this processor offers, for reports of a machine.
// Both are compiled into the library: a caller with other flags gets the library's answer, not its own.
#pragma once

#include <string>
#include <vector>

namespace mgdd {

/// Instruction set that the compiler was allowed to use everywhere.
std::string compiled_simd_level();

/// Vector instruction sets of the processor, as far as the compiler can ask.
std::vector<std::string> processor_simd_levels();

}  // namespace mgdd
