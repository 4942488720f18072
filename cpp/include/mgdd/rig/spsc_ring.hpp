// A queue between exactly one producing and one consuming thread, without locks (Lamport 1983). What does not fit is
// dropped and counted, never waited for. `push` and `pop` are wait-free and allocation-free; making a ring is not.
#pragma once

#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/shared_count.hpp"

namespace mgdd::rig {

inline constexpr std::size_t largest_ring = std::size_t{1} << 24;

template <class T>
  requires std::is_trivially_copyable_v<T>
class SpscRing {
 public:
  /// ParameterError unless `capacity` is a power of two in [2, 2^24].
  explicit SpscRing(std::size_t capacity) : places_((require(capacity), capacity)), mask_(capacity - 1) {}

  /// Producer: false where the ring is full; `value` is dropped then, and counted.
  bool push(const T& value) noexcept {
    const std::uint64_t at = pushed_.load(std::memory_order_relaxed);
    if (at - popped_seen_ > mask_) {
      popped_seen_ = popped_.load(std::memory_order_acquire);
      if (at - popped_seen_ > mask_) {
        dropped_.add();
        return false;
      }
    }
    places_[at & mask_] = value;
    pushed_.store(at + 1, std::memory_order_release);
    return true;
  }

  /// Consumer: the oldest value; false where there is none.
  bool pop(T& value) noexcept {
    const std::uint64_t at = popped_.load(std::memory_order_relaxed);
    if (at == pushed_seen_) {
      pushed_seen_ = pushed_.load(std::memory_order_acquire);
      if (at == pushed_seen_) return false;
    }
    value = places_[at & mask_];
    popped_.store(at + 1, std::memory_order_release);
    return true;
  }

  /// Any thread; exact for one that no other thread pushes to or pops from meanwhile.
  [[nodiscard]] std::size_t size() const noexcept {
    const std::uint64_t popped = popped_.load(std::memory_order_acquire);
    return static_cast<std::size_t>(pushed_.load(std::memory_order_acquire) - popped);
  }
  [[nodiscard]] std::size_t capacity() const noexcept { return mask_ + 1; }
  [[nodiscard]] std::uint64_t pushed() const noexcept { return pushed_.load(std::memory_order_acquire); }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.get(); }

 private:
  static void require(std::size_t capacity) {
    if (!std::has_single_bit(capacity) || capacity < 2 || capacity > largest_ring) {
      throw ParameterError("capacity", capacity, "must be a power of two in [2, 16777216]");
    }
  }

  // Counts of all values ever, 64 bits: they do not wrap. Each side keeps a line of the cache to itself.
  static constexpr std::size_t line = 64;
  std::vector<T> places_;
  std::size_t mask_;
  alignas(line) std::atomic<std::uint64_t> pushed_{0};
  std::uint64_t popped_seen_ = 0;
  SharedCount dropped_;
  alignas(line) std::atomic<std::uint64_t> popped_{0};
  std::uint64_t pushed_seen_ = 0;
};

}  // namespace mgdd::rig
