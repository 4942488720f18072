// Bytes of a record file: a header, then records of u32 length, u32 CRC-32 of the body, body; all little-endian.
// docs/rig_record.md says it byte by byte. Encoding a frame and all decoding are noexcept and allocation-free.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/rig/frame.hpp"

namespace mgdd::rig {

using ByteSpan = std::span<const std::uint8_t>;

/// Not text: a transfer that mends line ends or cuts the eighth bit destroys it.
inline constexpr std::array<std::uint8_t, 8> record_magic{0x89, 'M', 'R', 'E', 'C', '\r', '\n', 0x1A};
inline constexpr std::uint32_t record_version = 1;
inline constexpr std::size_t header_head = 48;          ///< bytes of a header before its JSON
inline constexpr std::size_t record_head = 8;           ///< length and CRC
inline constexpr std::size_t body_head = 16;            ///< kind, four small numbers, stamp
inline constexpr std::size_t largest_body = 1u << 20u;  ///< so that a damaged length costs no memory
inline constexpr std::size_t largest_frame_record = record_head + body_head + 8 + max_payload;

/// CRC-32 of zlib: polynomial 0x04C11DB7 reflected, start and final xor 0xFFFFFFFF; of "123456789": 0xCBF43926.
std::uint32_t crc32(ByteSpan bytes) noexcept;

struct RecordHeader {
  std::array<std::uint8_t, 16> run_id{};
  std::int64_t wall_ns = 0;       ///< since 1970, UTC, when the record began
  std::int64_t monotonic_ns = 0;  ///< of the same moment
  std::string json = "{}";        ///< whatever the caller says of the run

  bool operator==(const RecordHeader&) const = default;
};

enum class BodyKind : std::uint8_t { frame = 1, columns = 2, sample = 3, event = 4, damage = 5 };

/// Names of the numbers of a table, before its first sample.
struct ColumnsBody {
  std::uint16_t table = 0;
  std::int64_t monotonic_ns = 0;
  std::string_view name{};
  std::vector<std::string_view> columns{};
};

struct SampleBody {
  std::uint16_t table = 0;
  std::int64_t monotonic_ns = 0;
  ByteSpan bytes;  ///< eight per number

  [[nodiscard]] std::size_t size() const noexcept { return bytes.size() / 8; }
  [[nodiscard]] double operator[](std::size_t i) const noexcept;
};

struct EventBody {
  std::int64_t monotonic_ns = 0;
  std::string_view category;
  std::string_view text;
};

// --- to bytes ----------------------------------------------------------------------------------------------
std::vector<std::uint8_t> encoded(const RecordHeader& header);
/// The whole record of a frame; returns its length.
std::size_t encode(const Frame& frame, std::array<std::uint8_t, largest_frame_record>& to) noexcept;
/// The whole record of a sample, into room of `sample_record_size`.
void encode_sample(std::uint16_t table, std::int64_t monotonic_ns, std::span<const double> values,
                   std::span<std::uint8_t> to) noexcept;
constexpr std::size_t sample_record_size(std::size_t n) noexcept {
  return record_head + body_head + 8 * n;
}
std::vector<std::uint8_t> encoded_columns(std::uint16_t table, std::int64_t monotonic_ns, std::string_view name,
                                          std::span<const std::string> columns);
std::vector<std::uint8_t> encoded_event(std::int64_t monotonic_ns, std::string_view category, std::string_view text);
std::vector<std::uint8_t> encoded_damage(ByteSpan bytes);

// --- from bytes --------------------------------------------------------------------------------------------
struct FoundHeader {
  RecordHeader header;
  std::size_t size = 0;  ///< bytes of it in the file
};
enum class HeaderFault { none, not_a_record, other_version, damaged };
/// The header at the start of the bytes, or what is wrong with it.
HeaderFault read_header(ByteSpan bytes, FoundHeader& to);

enum class Found { record, end, incomplete, damaged };
struct FoundRecord {
  Found found = Found::end;
  std::size_t size = 0;  ///< bytes of the record in the file
  ByteSpan body{};
};
/// The record at the start of the bytes. A body of unknown kind is a record; one of known kind with a length that does
/// not belong to it is damaged. With `known_only`, as a search for the next record needs it, so is an unknown kind.
FoundRecord first_record(ByteSpan bytes, bool known_only = false) noexcept;

/// The first byte of a body that `first_record` found; may be none of the enumerators.
inline BodyKind kind_of(ByteSpan body) noexcept {
  return static_cast<BodyKind>(body[0]);
}

// Each for a body of its kind that `first_record` found; views into the body.
Frame frame_in(ByteSpan body) noexcept;
ColumnsBody columns_in(ByteSpan body);
SampleBody sample_in(ByteSpan body) noexcept;
EventBody event_in(ByteSpan body) noexcept;
/// Bytes that a repair could not read.
inline ByteSpan damage_in(ByteSpan body) noexcept {
  return body.subspan(body_head);
}

}  // namespace mgdd::rig
