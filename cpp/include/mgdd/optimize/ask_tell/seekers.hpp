// Every seeker under one name, for loops that take any of them.
#pragma once

#include <concepts>
#include <variant>

#include "mgdd/optimize/laws/extremum_seeking.hpp"
#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "mgdd/optimize/laws/golden_section.hpp"
#include "mgdd/optimize/laws/gradient_descent.hpp"
#include "mgdd/optimize/laws/spsa.hpp"

namespace mgdd::optimize {

/// What a loop needs of a seeker.
template <class S>
concept AnySeeker = requires(S seeker, const S constant, const Reading& reading, const Inputs& by) {
  { seeker.ask() } noexcept -> std::same_as<const Inputs&>;
  { seeker.tell(reading) } noexcept -> std::same_as<TellStatus>;
  { seeker.restart() } noexcept;
  { seeker.shift_estimate(by) } noexcept;
  { constant.applied() } noexcept -> std::same_as<const Inputs&>;
  { constant.estimate() } noexcept -> std::same_as<const Inputs&>;
  { constant.protocol() } noexcept -> std::same_as<const Protocol&>;
  { limit_state_of(constant, std::size_t{}) } noexcept -> std::same_as<LimitState>;
  { constant.component_count() } noexcept -> std::same_as<std::size_t>;
  { constant.limit_count() } noexcept -> std::same_as<std::size_t>;
};

using Seeker = std::variant<ExtremumSeeking, Spsa, GradientDescent, GoldenSection, GaussianProcessSeeking>;

static_assert(AnySeeker<ExtremumSeeking> && AnySeeker<Spsa> && AnySeeker<GradientDescent> && AnySeeker<GoldenSection> &&
              AnySeeker<GaussianProcessSeeking>);

}  // namespace mgdd::optimize
