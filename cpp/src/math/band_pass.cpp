#include "mgdd/math/band_pass.hpp"

#include <cmath>
#include <numbers>

#include "mgdd/common/error.hpp"
#include "mgdd/math/dispatch.hpp"
#include "mgdd/math/sliding_sums.hpp"

namespace mgdd {
namespace {

constexpr double attenuation_db = 80.0;
constexpr double shape = 0.1102 * (attenuation_db - 8.7);  // Kaiser 1974, for more than 50 dB

// Modified Bessel function of the first kind, order 0, by its series.
double bessel_i0(double x) {
  double sum = 1.0, term = 1.0;
  for (int k = 1; term > 1e-17 * sum; ++k) {
    term *= 0.25 * x * x / (static_cast<double>(k) * k);
    sum += term;
  }
  return sum;
}

}  // namespace

BandPass::BandPass(double low, double high, double transition) {
  if (!(low > 0.0 && low < 1.0)) throw ParameterError("low", low, "must be in (0, 1) of Nyquist");
  if (!(high > low)) throw ParameterError("high", high, "must be above low");
  if (!(transition > 0.0 && transition < 2.0 * low)) {
    throw ParameterError("transition", transition, "must be in (0, 2 low)");
  }
  const double from = low * std::numbers::pi, width = transition * std::numbers::pi;
  const double to = high + 0.5 * transition < 1.0 ? high * std::numbers::pi : std::numbers::pi;
  const auto reach = static_cast<std::size_t>(std::ceil(0.5 * (attenuation_db - 7.95) / (2.285 * width)));
  taps_.assign(2 * reach + 1, (to - from) / std::numbers::pi);
  for (std::size_t j = 1; j <= reach; ++j) {
    const auto at = static_cast<double>(j);
    const double share = at / static_cast<double>(reach + 1);
    const double window = bessel_i0(shape * std::sqrt(1.0 - share * share)) / bessel_i0(shape);
    taps_[reach - j] = taps_[reach + j] = (std::sin(to * at) - std::sin(from * at)) / (std::numbers::pi * at) * window;
  }
}

double BandPass::gain(double frequency) const noexcept {
  double sum = taps_[reach()];
  for (std::size_t j = 1; j <= reach(); ++j)
    sum += 2.0 * taps_[reach() + j] * std::cos(std::numbers::pi * frequency * static_cast<double>(j));
  return sum;
}

void BandPass::apply(std::span<const double> column, std::span<double> out) const noexcept {
  dispatch([&]() MGDD_INLINE_LAMBDA { sliding_sums(taps_, column.data(), out); });
}

}  // namespace mgdd
