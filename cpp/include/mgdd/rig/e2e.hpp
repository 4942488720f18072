// End-to-end protection of a CAN payload: an alive counter and a CRC-8 over a data identifier and the payload.
// Like AUTOSAR profiles 1 and 2 and open to other habits (start, final xor, polynomial, places, modulus); not a
// conformant implementation of either. `protect` and `E2eCheck` are noexcept and allocation-free.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <tuple>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/rig/frame.hpp"

namespace mgdd::rig {

/// A CRC-8, most significant bit first.
struct Crc8 {
  std::uint8_t polynomial = 0x1D;
  std::uint8_t start = 0xFF;
  std::uint8_t final_xor = 0xFF;

  bool operator==(const Crc8&) const = default;

  /// The register after one more byte.
  [[nodiscard]] constexpr std::uint8_t next(std::uint8_t sum, std::uint8_t byte) const noexcept {
    sum ^= byte;
    for (int bit = 0; bit < 8; ++bit)
      sum = static_cast<std::uint8_t>((sum & 0x80u) != 0 ? (sum << 1) ^ polynomial : sum << 1);
    return sum;
  }
  [[nodiscard]] constexpr std::uint8_t of(std::span<const std::uint8_t> bytes) const noexcept {
    std::uint8_t sum = start;
    for (const std::uint8_t byte : bytes)
      sum = next(sum, byte);
    return static_cast<std::uint8_t>(sum ^ final_xor);
  }
};

inline constexpr Crc8 crc8_sae_j1850{};              ///< of "123456789": 0x4B
inline constexpr Crc8 crc8_h2f{.polynomial = 0x2F};  ///< CRC-8H2F of AUTOSAR; of "123456789": 0xDF

/// "sae_j1850", "h2f"; ParameterError lists the names.
Crc8 named_crc8(std::string_view name);
/// Its name, where it has one.
std::optional<std::string_view> crc_name(const Crc8& crc) noexcept;

/// Which bytes of the data identifier the CRC covers beside the payload.
enum class DataIdMode {
  none,
  low,          ///< the low byte, before the payload
  both,         ///< low byte, then high byte, before the payload
  alternating,  ///< low byte where the counter is even, otherwise the high one, before the payload
  list,         ///< the byte that the counter chooses from a list of 16, after the payload
};

enum class CounterPlace { low_nibble, high_nibble, byte };

struct E2eSettings {
  Crc8 crc{};
  int data_id = 0;  ///< 0 to 65535
  DataIdMode data_id_mode = DataIdMode::both;
  std::optional<std::array<std::uint8_t, 16>> data_id_list{};  ///< of the mode `list` only
  int size = 8;                                                ///< bytes of the payload
  int crc_byte = 0;
  int counter_byte = 1;
  CounterPlace counter_place = CounterPlace::low_nibble;
  int counter_modulus = 16;   ///< the counter runs from 0 to this minus 1
  int max_step = 3;           ///< largest step of the counter between two frames that counts as good
  int bad_until_invalid = 3;  ///< bad frames in a row
  int good_until_valid = 2;   ///< good frames in a row

  bool operator==(const E2eSettings&) const = default;
};

constexpr auto fields_of(const E2eSettings&) {
  using S = E2eSettings;
  constexpr Domain in_a_row = closed(1.0, 1e6);
  return std::tuple{
      field<&S::crc>("crc", "name, or (polynomial, start, final xor)"),
      field<&S::data_id>({"data_id", "-", closed(0.0, 0xFFFF), "identifier under the CRC"}),
      field<&S::data_id_mode>("data_id_mode", "bytes of it under the CRC"),
      field<&S::data_id_list>("data_id_list", "sixteen bytes of the mode 'list'"),
      field<&S::size>({"size", "bytes", closed(2.0, max_payload), "of the payload"}),
      field<&S::crc_byte>("crc_byte", "place of the CRC"),
      field<&S::counter_byte>("counter_byte", "place of the counter"),
      field<&S::counter_place>("counter_place", "its bits in the byte"),
      field<&S::counter_modulus>("counter_modulus", "values of the counter"),
      field<&S::max_step>("max_step", "largest good step"),
      field<&S::bad_until_invalid>({"bad_until_invalid", "frames", in_a_row, "bad frames in a row"}),
      field<&S::good_until_valid>({"good_until_valid", "frames", in_a_row, "good frames in a row"}),
  };
}

/// ParameterError naming field, value and bound.
void validate(const E2eSettings& settings);

/// Writes counter and CRC into a payload; false, and nothing written, where its length is not `settings.size` or the
/// counter is not below the modulus.
[[nodiscard]] bool protect(const E2eSettings& settings, int counter, std::span<std::uint8_t> payload) noexcept;

/// The counter that follows.
[[nodiscard]] constexpr int next_counter(const E2eSettings& settings, int counter) noexcept {
  return counter + 1 < settings.counter_modulus ? counter + 1 : 0;
}

enum class E2eStatus {
  ok,             ///< a step of 1 to `max_step`
  initial,        ///< first frame with a correct CRC: its step is not known yet; neither good nor bad
  repeated,       ///< the counter stood still
  lost,           ///< a step beyond `max_step`
  wrong_crc,      ///< the payload is not to be used, nor is its counter
  wrong_length,   ///< the same
  wrong_counter,  ///< a correct CRC with a counter outside of the modulus; the same
};
inline constexpr std::size_t e2e_status_count = names<E2eStatus>().size();

struct E2eCounts {
  std::array<std::uint64_t, e2e_status_count> by_status{};  ///< frames, by the number of the enumerator
  std::uint64_t missing = 0;  ///< frames that the steps of the counter skipped, as far as a modulus shows

  [[nodiscard]] std::uint64_t of(E2eStatus status) const noexcept {
    return by_status[static_cast<std::size_t>(status)];
  }
};

/// Receiver's side. Valid after `good_until_valid` good frames in a row, invalid after `bad_until_invalid` bad ones in
/// a row. It sees frames, not time: who waits for a frame that never comes needs a time limit beside it.
class E2eCheck {
 public:
  /// ParameterError for settings that `validate` refuses.
  explicit E2eCheck(const E2eSettings& settings);

  E2eStatus push(std::span<const std::uint8_t> payload) noexcept;

  [[nodiscard]] bool valid() const noexcept { return valid_; }
  [[nodiscard]] const E2eCounts& counts() const noexcept { return counts_; }
  [[nodiscard]] const E2eSettings& settings() const noexcept { return settings_; }
  /// As new: not valid, no frame seen. The counts stay.
  void reset() noexcept;

 private:
  E2eStatus judged(std::span<const std::uint8_t> payload) noexcept;

  E2eSettings settings_;
  E2eCounts counts_;
  int last_ = -1;  ///< counter of the last frame with a correct CRC; -1: none yet
  int good_ = 0, bad_ = 0;
  bool valid_ = false;
};

}  // namespace mgdd::rig
