// How long things took, in 64 bins that are even on a logarithmic scale: eight per decade from 100 ns to 5.6 s, one
// below and one above. `add` is real-time safe; one thread adds, any thread may copy and read meanwhile.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "mgdd/rig/shared_count.hpp"

namespace mgdd::rig {

class LatencyHistogram {
 public:
  static constexpr std::size_t n_bins = 64;

  /// A negative time counts as none.
  void add(std::int64_t time_ns) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept;
  /// Exact; 0 of none.
  [[nodiscard]] std::int64_t max_ns() const noexcept { return static_cast<std::int64_t>(max_.get()); }
  [[nodiscard]] double mean_ns() const noexcept;
  /// The time that at least the share `q` of all times do not exceed: the upper edge of its bin or the largest time,
  /// so never too small, and at most a third too large where it exceeds 100 ns. 0 of none.
  [[nodiscard]] std::int64_t quantile_ns(double q) const noexcept;

  [[nodiscard]] std::array<std::uint64_t, n_bins> counts() const noexcept;
  /// First time that lies above the bin; the last bin has none and gives the largest number.
  static std::int64_t upper_edge_ns(std::size_t bin) noexcept;

 private:
  std::array<SharedCount, n_bins> bins_{};
  SharedCount sum_, max_;
};

}  // namespace mgdd::rig
