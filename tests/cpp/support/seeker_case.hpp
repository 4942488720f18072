// What tests of seekers share: the quadratic of the default engine, one cycle of ask and tell, a whole search, and one
// of each seeker and form.
#pragma once

#include <initializer_list>
#include <optional>
#include <type_traits>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/seekers.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {

inline constexpr double bend = -0.051;  // J'' in % per CAD^2
inline constexpr double pi = std::numbers::pi;

inline double quadratic(double x) {
  return 0.5 * bend * x * x;
}

inline Inputs inputs(std::initializer_list<double> values) {
  Inputs out(static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), out.begin());
  return out;
}

/// Bounds at the same distance below and above zero.
inline SearchSpace space_at(Inputs start, double bound = unlimited) {
  const auto n = start.size();
  return {std::move(start), Inputs::Constant(n, -bound), Inputs::Constant(n, bound)};
}

/// One cycle on J(input), with limits if the seeker has any.
template <class S, class F>
TellStatus cycle_of(S& seeker, F&& j, std::vector<double> limits = {}) {
  const double value[] = {j(seeker.ask())};
  return seeker.tell({value, limits, false});
}

/// `cycles` cycles on a function of one input with normal noise; estimate before each cycle, and after the last.
template <class S, class F>
std::vector<double> search(S& seeker, F&& j, int cycles, double noise_sd = 0.0, std::uint64_t seed = 0) {
  std::vector<double> path{seeker.estimate()[0]};
  for (int k = 0; k < cycles; ++k) {
    const double noise = noise_sd > 0.0 ? noise_sd * random::normal(seed, 7, static_cast<std::uint64_t>(k)) : 0.0;
    cycle_of(seeker, [&](const Inputs& x) { return j(x[0]) + noise; });
    path.push_back(seeker.estimate()[0]);
  }
  return path;
}

/// First index at which |path - target| <= distance; -1 if none.
inline int first_within(const std::vector<double>& path, double distance, double target = 0.0) {
  for (std::size_t k = 0; k < path.size(); ++k) {
    if (std::abs(path[k] - target) <= distance) return static_cast<int>(k);
  }
  return -1;
}

inline double rms_of(const std::vector<double>& path, std::size_t begin, std::size_t end) {
  double sum = 0.0;
  for (std::size_t k = begin; k < end; ++k)
    sum += path[k] * path[k];
  return std::sqrt(sum / static_cast<double>(end - begin));
}

inline double mean_of(const std::vector<double>& path, std::size_t begin, std::size_t end) {
  double sum = 0.0;
  for (std::size_t k = begin; k < end; ++k)
    sum += path[k];
  return sum / static_cast<double>(end - begin);
}

/// A gain with the time constant `tau_cycles` on a quadratic of curvature `j2`.
inline double gain_for(double tau_cycles, double amplitude = 1.0, double j2 = bend) {
  return 2.0 / (amplitude * std::abs(j2) * tau_cycles);
}

/// Extremum seeking of definition 2.3 of the facts: moving average, no clip, P 10, A 1.
inline ExtremumSeekingSettings plain_seeking(double start, double tau_cycles = 40.0) {
  ExtremumSeekingSettings s;
  s.space = space_at(scalar_input(start));
  s.form = MeanRemoval::moving_average;
  s.gain = scalar_input(gain_for(tau_cycles));
  s.rate = scalar_input(unlimited);
  return s;
}

/// A seeker as its settings make it, with what a user of `bend` knows; of golden section bounds are finite.
template <class S, class More>
void add_seeker(std::vector<std::pair<std::string, Seeker>>& out, std::string name, const SearchSpace& space,
                const std::vector<Limit>& limits, std::optional<double> curvature, More more) {
  std::remove_cvref_t<decltype(std::declval<S>().settings())> s;
  s.space = space;
  s.limits = limits;
  if constexpr (requires { s.curvature; }) s.curvature = curvature;
  if constexpr (requires { s.dither; }) {
    if (space.size() > 1) {
      s.dither.period = 40;
      const std::vector<int> three{4, 5, 7};
      s.dither.harmonics.assign(three.begin(), three.begin() + space.size());
    }
  }
  more(s);
  if constexpr (requires { s.form; }) name += "_" + std::string(name_of(s.form));
  out.emplace_back(std::move(name), S(std::move(s)));
}

/// Every seeker and form but the process, whose searches take long.
inline std::vector<std::pair<std::string, Seeker>> every_seeker(const SearchSpace& space, double noise_sd,
                                                                std::uint64_t seed = 0,
                                                                const std::vector<Limit>& limits = {},
                                                                std::optional<double> curvature = bend) {
  std::vector<std::pair<std::string, Seeker>> out;
  for (const auto& one : names<MeanRemoval>())
    add_seeker<ExtremumSeeking>(out, "extremum_seeking", space, limits, curvature,
                                [&](auto& s) { s.form = one.first; });
  for (const auto& one : names<SpsaForm>()) {
    add_seeker<Spsa>(out, "spsa", space, limits, curvature, [&](auto& s) {
      s.form = one.first;
      s.seed = seed;
    });
  }
  add_seeker<GradientDescent>(out, "gradient_descent", space, limits, curvature, [](auto&) {});
  if (space.size() > 1) return out;
  add_seeker<GoldenSection>(out, "golden_section", space, limits, curvature, [&](auto& s) {
    if (std::isinf(space.lower[0])) s.space.lower[0] = -45.0;
    if (std::isinf(space.upper[0])) s.space.upper[0] = 52.0;
    s.noise_sd = noise_sd;
  });
  return out;
}

}  // namespace mgdd::optimize
