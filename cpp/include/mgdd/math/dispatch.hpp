// The one place that knows instruction sets: a loop is written once, compiled for each of them and run in the widest
// one that the processor has. Without fused multiply-add (-ffp-contract=off) every choice gives the same bits.
// noexcept, no heap after the first call.
#pragma once

#include <string_view>

/// For functions inside a dispatched loop: they must be part of it, to be compiled for its instruction set.
#define MGDD_INLINE [[gnu::always_inline]] inline
/// The same for a lambda, behind its parameters: `[&]() MGDD_INLINE_LAMBDA { ... }`.
#define MGDD_INLINE_LAMBDA __attribute__((always_inline))

// Not on Windows, where GCC spills vectors of 32 bytes to a stack aligned to 16.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(_WIN32)
#define MGDD_X86_CLONES 1
#else
#define MGDD_X86_CLONES 0
#endif

namespace mgdd {

enum class InstructionSet { baseline, avx2, avx512f };

/// The one that the environment variable MGDD_INSTRUCTION_SET names, or the widest that this processor has and the
/// compiler knows. ParameterError for a name that is unknown, or of a set that the processor lacks.
InstructionSet wanted_instruction_set();

/// The same, asked once; the widest where the variable names none that can run.
InstructionSet instruction_set() noexcept;

namespace detail {

// Clones that are not inlined into their caller, which knows no wide vectors.
template <class Body>
[[gnu::noinline]] void run_baseline(const Body& body) noexcept {
  body();
}
#if MGDD_X86_CLONES
template <class Body>
__attribute__((target("avx2,fma"), noinline)) void run_avx2(const Body& body) noexcept {
  body();
}
template <class Body>
__attribute__((target("avx512f"), noinline)) void run_avx512f(const Body& body) noexcept {
  body();
}
#endif

}  // namespace detail

/// Runs `body`, a lambda marked MGDD_INLINE_LAMBDA, in that instruction set, which the processor must have. Hot numbers
/// belong into locals of the body: what it captures stays in memory.
template <class Body>
void dispatch(InstructionSet set, const Body& body) noexcept {
#if MGDD_X86_CLONES
  if (set == InstructionSet::avx512f) return detail::run_avx512f(body);
  if (set == InstructionSet::avx2) return detail::run_avx2(body);
#endif
  static_cast<void>(set);
  detail::run_baseline(body);
}
template <class Body>
void dispatch(const Body& body) noexcept {
  dispatch(instruction_set(), body);
}

}  // namespace mgdd
