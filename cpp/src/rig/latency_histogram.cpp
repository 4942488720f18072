#include "mgdd/rig/latency_histogram.hpp"

#include <algorithm>
#include <limits>

namespace mgdd::rig {
namespace {

constexpr std::size_t n_edges = LatencyHistogram::n_bins - 1;
constexpr std::size_t bins_per_decade = 8;
constexpr double first_edge_ns = 100.0;

// 10^(i/8) for i = 0..7: std::pow is not constexpr.
constexpr std::array<double, bins_per_decade> within_decade{1.0,
                                                            1.333521432163324,
                                                            1.7782794100389228,
                                                            2.371373705661655,
                                                            3.1622776601683795,
                                                            4.216965034285822,
                                                            5.623413251903491,
                                                            7.498942093324558};

constexpr std::array<std::int64_t, n_edges> edges_ns = [] {
  std::array<std::int64_t, n_edges> edges{};
  double decade = first_edge_ns;
  for (std::size_t i = 0; i < n_edges; ++i) {
    // std::lround is not constexpr. NOLINTNEXTLINE(bugprone-incorrect-roundings)
    edges[i] = static_cast<std::int64_t>(decade * within_decade[i % bins_per_decade] + 0.5);
    if (i % bins_per_decade == bins_per_decade - 1) decade *= 10.0;
  }
  return edges;
}();

}  // namespace

void LatencyHistogram::add(std::int64_t time_ns) noexcept {
  time_ns = std::max<std::int64_t>(time_ns, 0);
  const auto bin = std::upper_bound(edges_ns.begin(), edges_ns.end(), time_ns) - edges_ns.begin();
  bins_[static_cast<std::size_t>(bin)].add();
  sum_.add(static_cast<std::uint64_t>(time_ns));
  max_.set(std::max(max_.get(), static_cast<std::uint64_t>(time_ns)));
}

std::array<std::uint64_t, LatencyHistogram::n_bins> LatencyHistogram::counts() const noexcept {
  std::array<std::uint64_t, n_bins> out{};
  std::transform(bins_.begin(), bins_.end(), out.begin(), [](const SharedCount& bin) { return bin.get(); });
  return out;
}

std::uint64_t LatencyHistogram::count() const noexcept {
  std::uint64_t n = 0;
  for (const SharedCount& bin : bins_)
    n += bin.get();
  return n;
}

double LatencyHistogram::mean_ns() const noexcept {
  const std::uint64_t n = count();
  return n == 0 ? 0.0 : static_cast<double>(sum_.get()) / static_cast<double>(n);
}

std::int64_t LatencyHistogram::quantile_ns(double q) const noexcept {
  const auto now = counts();
  std::uint64_t n = 0;
  for (const std::uint64_t bin : now)
    n += bin;
  if (n == 0) return 0;
  const double wanted = std::clamp(q, 0.0, 1.0) * static_cast<double>(n);
  std::uint64_t below = 0;
  std::size_t bin = 0;
  for (; bin + 1 < n_bins; ++bin) {
    below += now[bin];
    if (below > 0 && static_cast<double>(below) >= wanted) break;
  }
  return std::min(upper_edge_ns(bin), max_ns());
}

std::int64_t LatencyHistogram::upper_edge_ns(std::size_t bin) noexcept {
  return bin < n_edges ? edges_ns[bin] : std::numeric_limits<std::int64_t>::max();
}

}  // namespace mgdd::rig
