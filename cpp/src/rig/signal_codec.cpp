#include "mgdd/rig/signal_codec.hpp"

#include <algorithm>
#include <bit>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <limits>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/rig/frame.hpp"

namespace mgdd::rig {
namespace {

/// Files state the largest double itself as the bound of a float64 signal.
constexpr Domain any_finite = closed(std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max());

using Bytes = std::span<const std::uint8_t>;

constexpr std::uint64_t lowest(int bits) noexcept {
  return bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
}

constexpr bool is_float(RawType type) noexcept {
  return type == RawType::float32 || type == RawType::float64;
}

/// Place of the first bit in the order in which the signal is walked: big-endian bytes are walked from their top bit.
constexpr int first_bit(const SignalLayout& s) noexcept {
  return s.byte_order == ByteOrder::little_endian ? s.start : s.start / 8 * 8 + 7 - s.start % 8;
}

constexpr int float_bits(RawType type) noexcept {
  return type == RawType::float32 ? 32 : 64;
}

bool fits(const SignalLayout& s, std::size_t bytes) noexcept {
  if (s.start < 0 || s.length < 1 || s.length > 64 || bytes > max_payload) return false;
  if (is_float(s.type) && s.length != float_bits(s.type)) return false;
  return s.start < 8 * static_cast<int>(bytes) && first_bit(s) + s.length <= 8 * static_cast<int>(bytes);
}

/// Bits of a signal that stand in one byte: `size` of them, `shift` above the byte's lowest; `weight` is the place of
/// the lowest in the number.
struct Piece {
  std::size_t byte;
  int shift, size, weight;
};

template <class Visit>
void each_piece(const SignalLayout& s, Visit visit) noexcept {
  const bool little = s.byte_order == ByteOrder::little_endian;
  int at = first_bit(s);
  for (int done = 0; done < s.length;) {
    const int inside = at % 8, size = std::min(8 - inside, s.length - done);
    visit(Piece{.byte = static_cast<std::size_t>(at / 8),
                .shift = little ? inside : 8 - inside - size,
                .size = size,
                .weight = little ? done : s.length - done - size});
    at += size;
    done += size;
  }
}

std::uint64_t read_bits(const SignalLayout& s, Bytes payload) noexcept {
  std::uint64_t raw = 0;
  each_piece(s, [&](const Piece& p) {
    raw |= (static_cast<std::uint64_t>(payload[p.byte]) >> p.shift & lowest(p.size)) << p.weight;
  });
  return raw;
}

void write_bits(const SignalLayout& s, std::uint64_t raw, std::span<std::uint8_t> payload) noexcept {
  each_piece(s, [&](const Piece& p) {
    const std::uint64_t mask = lowest(p.size) << p.shift, bits = (raw >> p.weight & lowest(p.size)) << p.shift;
    payload[p.byte] = static_cast<std::uint8_t>((payload[p.byte] & ~mask) | bits);
  });
}

struct Packed {
  std::uint64_t raw;
  PackStatus status;
};

/// Of a finite real number; the bits of a double hold no 64-bit integer, so the bounds are powers of two beyond it.
Packed to_integer(const SignalLayout& s, double real) noexcept {
  const bool with_sign = s.type == RawType::signed_integer;
  const int bits = with_sign ? s.length - 1 : s.length;
  const double rounded = std::nearbyint(real), beyond = std::ldexp(1.0, bits), least = with_sign ? -beyond : 0.0;
  if (rounded >= beyond) return {lowest(bits), PackStatus::clamped};
  if (rounded < least) return {with_sign ? ~lowest(bits) : 0, PackStatus::clamped};
  const auto raw =
      with_sign ? static_cast<std::uint64_t>(static_cast<std::int64_t>(rounded)) : static_cast<std::uint64_t>(rounded);
  return {raw, PackStatus::ok};
}

Packed to_float(const SignalLayout& s, double real) noexcept {
  if (s.type == RawType::float64) {
    constexpr double most = std::numeric_limits<double>::max();
    const double held = std::clamp(real, -most, most);
    return {std::bit_cast<std::uint64_t>(held), held == real ? PackStatus::ok : PackStatus::clamped};
  }
  // Beyond this a double rounds to an infinite float.
  constexpr double most = std::numeric_limits<float>::max(), last = most * (1.0 + 0x1p-25);
  const bool inside = std::abs(real) < last;
  const auto held = static_cast<float>(inside ? real : std::copysign(most, real));
  return {std::bit_cast<std::uint32_t>(held), inside ? PackStatus::ok : PackStatus::clamped};
}

/// Whether one frame can hold both.
bool together(const Signal& a, const Signal& b) noexcept {
  if (a.branches.empty() || b.branches.empty()) return true;
  return std::any_of(a.branches.begin(), a.branches.end(), [&b](int value) {
    return std::find(b.branches.begin(), b.branches.end(), value) != b.branches.end();
  });
}

[[noreturn]] void refuse(const Signal& signal, const std::string& why) {
  throw about(signal.name, ParameterError("signal " + signal.name + ": " + why));
}

}  // namespace

void validate(const SignalLayout& s) {
  require_within("start", s.start, 0, 8 * max_payload - 1, "bits");
  require_within("length", s.length, 1, 64, "bits");
  if (is_float(s.type) && s.length != float_bits(s.type)) {
    throw ParameterError("length", s.length,
                         "must be " + std::to_string(float_bits(s.type)) + " of a " + std::string(name_of(s.type)));
  }
  require_in(any_finite, "scale", s.scale);
  if (s.scale == 0.0) throw ParameterError("scale", s.scale, "must not be 0");
  require_in(any_finite, "offset", s.offset);
  if (s.minimum) require_in(any_finite, "minimum", *s.minimum);
  if (s.maximum) require_within("maximum", *s.maximum, s.minimum.value_or(any_finite.lower), any_finite.upper);
}

PackStatus pack(const SignalLayout& s, double value, OutOfRange beyond, std::span<std::uint8_t> payload) noexcept {
  if (!fits(s, payload.size())) return PackStatus::does_not_fit;
  if (!std::isfinite(value)) return PackStatus::not_finite;
  const double bounded = s.minimum && value < *s.minimum   ? *s.minimum
                         : s.maximum && *s.maximum < value ? *s.maximum
                                                           : value;
  const double real = (bounded - s.offset) / s.scale;
  if (std::isnan(real)) return PackStatus::not_finite;
  Packed packed = is_float(s.type) ? to_float(s, real) : to_integer(s, real);
  if (bounded != value) packed.status = PackStatus::clamped;
  if (packed.status == PackStatus::clamped && beyond == OutOfRange::refuse) return PackStatus::out_of_range;
  write_bits(s, packed.raw, payload);
  return packed.status;
}

std::optional<double> unpack(const SignalLayout& s, Bytes payload) noexcept {
  const std::optional<std::uint64_t> raw = unpack_raw(s, payload);
  if (!raw) return std::nullopt;
  double number = 0.0;
  switch (s.type) {
    case RawType::unsigned_integer:
      number = static_cast<double>(*raw);
      break;
    case RawType::signed_integer:
      number = static_cast<double>(static_cast<std::int64_t>(*raw));
      break;
    case RawType::float32:
      number = std::bit_cast<float>(static_cast<std::uint32_t>(*raw));
      break;
    case RawType::float64:
      number = std::bit_cast<double>(*raw);
      break;
  }
  return number * s.scale + s.offset;
}

PackStatus pack_raw(const SignalLayout& s, std::uint64_t raw, OutOfRange beyond,
                    std::span<std::uint8_t> payload) noexcept {
  if (!fits(s, payload.size())) return PackStatus::does_not_fit;
  std::uint64_t held = raw;
  if (s.type == RawType::signed_integer) {
    const auto most = static_cast<std::int64_t>(lowest(s.length - 1));
    held = static_cast<std::uint64_t>(std::clamp(static_cast<std::int64_t>(raw), -most - 1, most));
  } else {
    held = std::min(raw, lowest(s.length));
  }
  if (held != raw && beyond == OutOfRange::refuse) return PackStatus::out_of_range;
  write_bits(s, held, payload);
  return held == raw ? PackStatus::ok : PackStatus::clamped;
}

std::optional<std::uint64_t> unpack_raw(const SignalLayout& s, Bytes payload) noexcept {
  if (!fits(s, payload.size())) return std::nullopt;
  const std::uint64_t raw = read_bits(s, payload);
  const bool negative = s.type == RawType::signed_integer && (raw >> (s.length - 1) & 1u) != 0;
  return negative ? raw | ~lowest(s.length) : raw;
}

void validate(std::span<const Signal> signals, int size) {
  require_within("size", size, 1, max_payload, "bytes");
  std::vector<std::bitset<8 * max_payload>> taken;
  for (const Signal& signal : signals) {
    try {
      validate(signal.layout);
    } catch (const ParameterError& error) {
      throw within(signal.name, error);
    }
    if (!fits(signal.layout, static_cast<std::size_t>(size))) {
      refuse(signal, "its " + std::to_string(signal.layout.length) + " bits from bit " +
                         std::to_string(signal.layout.start) + " reach beyond the " + std::to_string(size) +
                         " bytes of the message");
    }
    std::bitset<8 * max_payload> own;
    each_piece(signal.layout, [&own](const Piece& p) {
      for (int bit = 0; bit < p.size; ++bit)
        own.set(8 * p.byte + static_cast<std::size_t>(p.shift + bit));
    });
    for (std::size_t i = 0; i < taken.size(); ++i) {
      const Signal& other = signals[i];
      if (other.name == signal.name) refuse(signal, "the name stands twice in the message");
      if (together(signal, other) && (taken[i] & own).any()) refuse(signal, "shares bits with signal " + other.name);
    }
    taken.push_back(own);
  }
}

}  // namespace mgdd::rig
