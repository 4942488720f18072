// A count that one thread raises and any thread may read: of frames, of drops, of nanoseconds. Real-time safe.
// A reader sees each count whole, and counts that belong together possibly one event apart.
#pragma once

#include <atomic>
#include <cstdint>

namespace mgdd::rig {

class SharedCount {
 public:
  SharedCount() noexcept = default;
  SharedCount(const SharedCount& other) noexcept : value_(other.get()) {}
  SharedCount& operator=(const SharedCount& other) noexcept {
    set(other.get());
    return *this;
  }
  ~SharedCount() = default;

  /// By the one thread that owns the count: a load and a store, no locked instruction.
  void add(std::uint64_t n = 1) noexcept { set(get() + n); }
  void set(std::uint64_t n) noexcept { value_.store(n, std::memory_order_relaxed); }

  [[nodiscard]] std::uint64_t get() const noexcept { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> value_{0};
};

static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

}  // namespace mgdd::rig
