// Numbers in the bits of a CAN payload, as a DBC lays them out: physical = raw * scale + offset.
// Bits count as in a DBC: bit b of byte n is 8 n + b, bit 0 the least significant. `start` is the least significant bit
// of a little-endian (Intel) signal and the most significant one of a big-endian (Motorola) signal.
// pack and unpack are noexcept and allocation-free: a number never wraps, NaN is never sent.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"

namespace mgdd::rig {

enum class ByteOrder { little_endian, big_endian };

enum class RawType { unsigned_integer, signed_integer, float32, float64 };
constexpr std::string_view other_name(RawType type) noexcept {
  return type == RawType::unsigned_integer ? "unsigned" : type == RawType::signed_integer ? "signed" : "";
}

struct SignalLayout {
  int start = 0;   ///< as a DBC counts
  int length = 1;  ///< bits, 1 to 64
  ByteOrder byte_order = ByteOrder::little_endian;
  RawType type = RawType::unsigned_integer;
  double scale = 1.0;
  double offset = 0.0;
  std::optional<double> minimum{};  ///< of the physical value, before it is rounded to a raw one
  std::optional<double> maximum{};

  bool operator==(const SignalLayout&) const = default;
};

constexpr auto fields_of(const SignalLayout&) {
  using S = SignalLayout;
  return std::tuple{
      field<&S::start>({"start", "-", {}, "first bit, as a DBC counts", DefaultForm::required}),
      field<&S::length>({"length", "-", {}, "bits", DefaultForm::required}),
      field<&S::byte_order>("byte_order", "order of the bytes"),
      field<&S::type>("raw_type", "meaning of the bits"),
      field<&S::scale>({"scale", "-", {}, "physical value of one step"}),
      field<&S::offset>({"offset", "-", {}, "physical value of the raw 0"}),
      field<&S::minimum>({"minimum", "-", {}, "lowest physical value"}),
      field<&S::maximum>({"maximum", "-", {}, "highest physical value"}),
  };
}

/// ParameterError naming field, value and bound.
void validate(const SignalLayout& layout);

enum class OutOfRange { clamp, refuse };

enum class PackStatus {
  ok,
  clamped,       ///< the nearest value within the bounds of the layout and of its bits was written
  out_of_range,  ///< nothing was written
  not_finite,    ///< NaN or infinite: nothing was written
  does_not_fit,  ///< the signal reaches beyond the payload, or its layout is invalid: nothing was written
};

/// Writes a physical value and leaves the other bits alone; rounds to the nearest raw value, halves to even.
[[nodiscard]] PackStatus pack(const SignalLayout& layout, double value, OutOfRange beyond,
                              std::span<std::uint8_t> payload) noexcept;

/// The physical value; none where the signal reaches beyond the payload.
[[nodiscard]] std::optional<double> unpack(const SignalLayout& layout, std::span<const std::uint8_t> payload) noexcept;

/// Writes an integer: of a signed layout in two's complement of 64 bits, of a float its bits. Ignores scale, offset,
/// minimum and maximum.
[[nodiscard]] PackStatus pack_raw(const SignalLayout& layout, std::uint64_t raw, OutOfRange beyond,
                                  std::span<std::uint8_t> payload) noexcept;

/// The integer, of a signed layout extended to 64 bits; none where the signal reaches beyond the payload.
[[nodiscard]] std::optional<std::uint64_t> unpack_raw(const SignalLayout& layout,
                                                      std::span<const std::uint8_t> payload) noexcept;

/// A signal of a message.
struct Signal {
  std::string name;
  SignalLayout layout;
  std::vector<int> branches{};  ///< values of the multiplexer that select it; empty: always there
};

/// ParameterError naming the signals of a message of `size` bytes that reach beyond it or share bits, or a bad layout.
/// Signals of two branches of a multiplexer may share bits.
void validate(std::span<const Signal> signals, int size);

}  // namespace mgdd::rig
