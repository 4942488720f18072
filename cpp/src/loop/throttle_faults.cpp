#include "mgdd/loop/throttle_faults.hpp"

#include <cmath>

#include "mgdd/common/bounds.hpp"

namespace mgdd::loop {
namespace {

using Kind = ThrottleFaultKind;

// The sample that begins at a time or next after it; a time that is a whole number of samples but for rounding is one.
std::int64_t sample_at(double time_s, double sample_s) noexcept {
  return static_cast<std::int64_t>(std::ceil(time_s / sample_s - 1e-6));
}

}  // namespace

void validate(const ThrottleFault& fault) {
  require_within("from_s", fault.from_s, 0.0, 1e9, "s");
  if (fault.until_s && !(*fault.until_s > fault.from_s && *fault.until_s <= 1e9)) {
    throw ParameterError("until_s", *fault.until_s, "must be > from_s = " + text(fault.from_s) + " and <= 1e9", "s");
  }
  switch (fault.kind) {
    case Kind::jammed_at:
      require_within("size", fault.size, -360.0, 360.0, "deg");
      break;
    case Kind::spring_above:
    case Kind::spring_below:
      require_in(above(0.0, 1.0), "size", fault.size);
      break;
    case Kind::supply_sag:
      require_within("size", fault.size, 0.0, 100.0, "V");
      break;
    default:
      require_within("size", fault.size, 0.0, 0.0);
  }
}

FaultSamples samples_of(const ThrottleFault& fault, double sample_s) noexcept {
  return {sample_at(fault.from_s, sample_s),
          fault.until_s ? sample_at(*fault.until_s, sample_s) : std::numeric_limits<std::int64_t>::max()};
}

void apply(const ThrottleFault& fault, throttle::Throttle& t) noexcept {
  const double left = 1.0 - fault.size;
  switch (fault.kind) {
    case Kind::jammed:
    case Kind::jammed_at:
      t.friction = throttle::Friction::coulomb;  // models with a bristle or tanh would yield
      t.coulomb_nm = t.stiction_nm = jam_nm;
      t.plate_friction_share = 0.5;
      break;
    case Kind::spring_above:
      t.spring_above_nm_per_rad *= left;
      t.preload_above_nm *= left;
      break;
    case Kind::spring_below:
      t.spring_below_nm_per_rad *= left;
      t.preload_below_nm *= left;
      break;
    default:
      break;
  }
}

}  // namespace mgdd::loop
