// A value that one thread sets and one other thread reads: the latest one, whole, and nobody ever waits or tries again
// (three places, of which each side owns one and the third is exchanged). `write` and `read` are real-time safe.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <type_traits>

namespace mgdd::rig {

template <class T>
  requires std::is_trivially_copyable_v<T>
class LatestValue {
 public:
  explicit LatestValue(const T& initial = {}) noexcept { places_.fill(initial); }

  /// The one writer. Values that nobody has read until the next one are gone.
  void write(const T& value) noexcept {
    places_[written_] = value;
    written_ = between_.exchange(written_ | fresh, std::memory_order_acq_rel) & place;
  }

  /// The one reader.
  const T& read() noexcept {
    if ((between_.load(std::memory_order_relaxed) & fresh) != 0) {
      read_ = between_.exchange(read_, std::memory_order_acq_rel) & place;
    }
    return places_[read_];
  }

 private:
  static constexpr unsigned place = 3, fresh = 4;
  static constexpr std::size_t line = 64;

  std::array<T, 3> places_;
  alignas(line) unsigned written_ = 0;
  alignas(line) unsigned read_ = 1;
  alignas(line) std::atomic<unsigned> between_{2};
};

}  // namespace mgdd::rig
