// One CAN or CAN FD frame, as it came from a bus or goes to one. Stamps in ns. Trivially copyable and without a heap:
// rings, records and loops hold it by value; everything here is real-time safe.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

namespace mgdd::rig {

inline constexpr std::size_t max_payload = 64;  ///< bytes of a CAN FD frame; a classic one has 8

struct Frame {
  std::uint32_t id = 0;   ///< 11 bits, or 29 of an extended frame; of an error frame its class bits
  bool extended = false;  ///< 29-bit identifier
  bool error = false;     ///< the controller's news of a bus error: no data of a sender
  bool received = false;  ///< from the bus; otherwise sent by us
  std::uint8_t size = 0;  ///< bytes of `data` in use
  std::array<std::uint8_t, max_payload> data{};
  std::int64_t monotonic_ns = 0;  ///< CLOCK_MONOTONIC when it was received or handed to the bus
  std::int64_t bus_ns = 0;        ///< stamp of the driver or adapter in its own epoch; 0: it gave none
  bool fd = false;                ///< sent as CAN FD, whatever its size
  bool bit_rate_switch = false;   ///< data of a CAN FD frame at the higher rate
  bool remote = false;            ///< asks for the frame of this identifier; carries no data
  std::uint8_t channel = 0;       ///< which bus, where one record holds several

  bool operator==(const Frame&) const = default;

  /// The bytes in use; never beyond `data`, whatever `size` says.
  [[nodiscard]] std::span<const std::uint8_t> payload() const noexcept {
    return {data.data(), std::min<std::size_t>(size, max_payload)};
  }
};

static_assert(std::is_trivially_copyable_v<Frame>);

}  // namespace mgdd::rig
