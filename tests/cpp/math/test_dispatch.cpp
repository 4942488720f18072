// Every instruction set gives the same bits, and the choice is one that the processor has.
#include "mgdd/math/dispatch.hpp"

// Vectors are handed over inside one inlined function: no calling convention is involved.
#pragma GCC diagnostic ignored "-Wpsabi"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/platform.hpp"
#include "mgdd/math/fast_tanh.hpp"
#include "mgdd/math/lanes.hpp"

namespace mgdd {
namespace {

MGDD_INLINE void sweep(const std::array<double, 8>& from, std::array<double, 8>& to) noexcept {
  Lanes<8> x = Lanes<8>::load(from.data());
  for (int k = 0; k < 100; ++k) {
    const Lanes<8> t(fast_tanh(x.v));
    x = select(t > Lanes<8>(0.3), x - 0.37 * t * t, x * 1.1 + 0.01);
  }
  x.store(to.data());
}

TEST(Dispatch, EveryInstructionSetGivesTheSameBits) {
  const std::array<double, 8> from{-2.0, -0.3, -1e-3, 0.0, 1e-9, 0.2, 0.7, 5.0};
  std::array<double, 8> expected{};
  dispatch(InstructionSet::baseline, [&]() MGDD_INLINE_LAMBDA { sweep(from, expected); });
  for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512f}) {
    if (set > instruction_set()) continue;
    std::array<double, 8> to{};
    dispatch(set, [&]() MGDD_INLINE_LAMBDA { sweep(from, to); });
    EXPECT_EQ(to, expected) << name_of(set);
  }
}

TEST(Dispatch, TakesWhatTheProcessorHas) {
  const auto levels = processor_simd_levels();
  if (instruction_set() == InstructionSet::baseline) return;
  EXPECT_NE(std::find(levels.begin(), levels.end(), name_of(instruction_set())), levels.end());
}

}  // namespace
}  // namespace mgdd
