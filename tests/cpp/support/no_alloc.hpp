// Counts heap allocations of the calling thread, to prove that a loop makes none.
// Sees operator new and, on glibc and under AddressSanitizer, malloc itself: Eigen calls malloc directly.
#pragma once

#include <cstddef>

namespace mgdd::test_support {

/// Allocations of this thread since construction.
class AllocationCounter {
 public:
  AllocationCounter() noexcept;

  [[nodiscard]] std::size_t count() const noexcept;

 private:
  std::size_t start_;
};

}  // namespace mgdd::test_support
