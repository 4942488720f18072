#include "mgdd/rig/record_format.hpp"

#include <algorithm>
#include <cstring>

namespace mgdd::rig {
namespace {

constexpr std::array<std::array<std::uint32_t, 256>, 8> make_crc_tables() noexcept {
  std::array<std::array<std::uint32_t, 256>, 8> tables{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t sum = byte;
    for (int bit = 0; bit < 8; ++bit)
      sum = (sum & 1u) != 0 ? sum >> 1 ^ 0xEDB88320u : sum >> 1;
    tables[0][byte] = sum;
  }
  for (std::size_t depth = 1; depth < tables.size(); ++depth) {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      const std::uint32_t before = tables[depth - 1][byte];
      tables[depth][byte] = before >> 8 ^ tables[0][before & 0xFFu];
    }
  }
  return tables;
}
constexpr auto crc_tables = make_crc_tables();

template <class Int>
void put(std::uint8_t* to, Int value) noexcept {
  for (std::size_t i = 0; i < sizeof(Int); ++i)
    to[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> 8 * i);
}

template <class Int>
Int get(const std::uint8_t* from) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(Int); ++i)
    value |= static_cast<std::uint64_t>(from[i]) << 8 * i;
  return static_cast<Int>(value);
}

/// The 16 bytes that every body begins with.
struct BodyHead {
  BodyKind kind = BodyKind::frame;
  std::uint8_t flags = 0;
  std::uint16_t small = 0;
  std::uint32_t word = 0;
  std::int64_t monotonic_ns = 0;
};

void put_head(std::uint8_t* body, const BodyHead& head) noexcept {
  body[0] = static_cast<std::uint8_t>(head.kind);
  body[1] = head.flags;
  put(body + 2, head.small);
  put(body + 4, head.word);
  put(body + 8, head.monotonic_ns);
}

BodyHead head_in(ByteSpan body) noexcept {
  return {.kind = kind_of(body),
          .flags = body[1],
          .small = get<std::uint16_t>(body.data() + 2),
          .word = get<std::uint32_t>(body.data() + 4),
          .monotonic_ns = get<std::int64_t>(body.data() + 8)};
}

/// Length and CRC before a body that stands complete behind them.
void seal(std::span<std::uint8_t> record) noexcept {
  const auto body = record.subspan(record_head);
  put(record.data(), static_cast<std::uint32_t>(body.size()));
  put(record.data() + 4, crc32(body));
}

std::vector<std::uint8_t> sealed(const BodyHead& head, std::span<const std::string_view> parts) {
  std::vector<std::uint8_t> record(record_head + body_head);
  put_head(record.data() + record_head, head);
  for (const std::string_view part : parts)
    record.insert(record.end(), part.begin(), part.end());
  seal(record);
  return record;
}

std::string_view as_text(ByteSpan bytes) noexcept {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Bits of the flags of a frame.
enum : std::uint8_t { extended = 1, error = 2, received = 4, fd = 8, bit_rate_switch = 16, remote = 32 };

std::uint8_t flags_of(const Frame& f) noexcept {
  return static_cast<std::uint8_t>((f.extended ? extended : 0) | (f.error ? error : 0) | (f.received ? received : 0) |
                                   (f.fd ? fd : 0) | (f.bit_rate_switch ? bit_rate_switch : 0) |
                                   (f.remote ? remote : 0));
}

constexpr std::size_t frame_head = body_head + 8;

/// Data bytes in the body: a remote frame has a size and no data.
std::size_t data_bytes(std::uint8_t flags, std::size_t size) noexcept {
  return (flags & remote) != 0 ? 0 : size;
}

bool names_fit(ByteSpan body, std::size_t count) noexcept {
  std::size_t at = body_head;
  for (std::size_t i = 0; i <= count; ++i) {  // the name of the table, then those of the columns
    if (body.size() - at < 2) return false;
    const std::size_t length = get<std::uint16_t>(body.data() + at);
    at += 2;
    if (body.size() - at < length) return false;
    at += length;
  }
  return at == body.size();
}

enum class Form { right, wrong, unknown };

Form form_of(ByteSpan body) noexcept {
  const BodyHead head = head_in(body);
  const std::size_t rest = body.size() - body_head;
  bool right = false;
  switch (head.kind) {
    case BodyKind::frame: {
      const std::size_t size = head.small >> 8;
      right = size <= max_payload && body.size() == frame_head + data_bytes(head.flags, size);
      break;
    }
    case BodyKind::columns:
      right = names_fit(body, head.word);
      break;
    case BodyKind::sample:
      right = rest == 8 * static_cast<std::size_t>(head.word);
      break;
    case BodyKind::event:
      right = rest == static_cast<std::size_t>(head.small) + head.word;
      break;
    case BodyKind::damage:
      right = rest == head.word;
      break;
    default:
      return Form::unknown;
  }
  return right ? Form::right : Form::wrong;
}

}  // namespace

std::uint32_t crc32(ByteSpan bytes) noexcept {
  std::uint32_t sum = ~0u;
  const auto& t = crc_tables;
  for (; bytes.size() >= 8; bytes = bytes.subspan(8)) {
    const std::uint32_t low = get<std::uint32_t>(bytes.data()) ^ sum, high = get<std::uint32_t>(bytes.data() + 4);
    sum = t[7][low & 0xFFu] ^ t[6][low >> 8 & 0xFFu] ^ t[5][low >> 16 & 0xFFu] ^ t[4][low >> 24] ^ t[3][high & 0xFFu] ^
          t[2][high >> 8 & 0xFFu] ^ t[1][high >> 16 & 0xFFu] ^ t[0][high >> 24];
  }
  for (const std::uint8_t byte : bytes)
    sum = sum >> 8 ^ t[0][(sum ^ byte) & 0xFFu];
  return ~sum;
}

double SampleBody::operator[](std::size_t i) const noexcept {
  return std::bit_cast<double>(get<std::uint64_t>(bytes.data() + 8 * i));
}

std::vector<std::uint8_t> encoded(const RecordHeader& header) {
  std::vector<std::uint8_t> out(header_head + header.json.size() + 4);
  std::copy(record_magic.begin(), record_magic.end(), out.begin());
  put(out.data() + 8, record_version);
  put(out.data() + 12, static_cast<std::uint32_t>(header.json.size()));
  std::copy(header.run_id.begin(), header.run_id.end(), out.begin() + 16);
  put(out.data() + 32, header.wall_ns);
  put(out.data() + 40, header.monotonic_ns);
  std::copy(header.json.begin(), header.json.end(), out.begin() + header_head);
  put(out.data() + out.size() - 4, crc32(ByteSpan(out).first(out.size() - 4)));
  return out;
}

std::size_t encode(const Frame& f, std::array<std::uint8_t, largest_frame_record>& to) noexcept {
  const ByteSpan payload = f.payload();
  const std::uint8_t flags = flags_of(f);
  const std::size_t data = data_bytes(flags, payload.size());
  std::uint8_t* body = to.data() + record_head;
  put_head(body, {.kind = BodyKind::frame,
                  .flags = flags,
                  .small = static_cast<std::uint16_t>(f.channel | payload.size() << 8),
                  .word = f.id,
                  .monotonic_ns = f.monotonic_ns});
  put(body + body_head, f.bus_ns);
  if (data > 0) std::memcpy(body + frame_head, payload.data(), data);
  const std::size_t size = record_head + frame_head + data;
  seal(std::span(to).first(size));
  return size;
}

void encode_sample(std::uint16_t table, std::int64_t monotonic_ns, std::span<const double> values,
                   std::span<std::uint8_t> to) noexcept {
  std::uint8_t* body = to.data() + record_head;
  put_head(body, {.kind = BodyKind::sample,
                  .small = table,
                  .word = static_cast<std::uint32_t>(values.size()),
                  .monotonic_ns = monotonic_ns});
  for (std::size_t i = 0; i < values.size(); ++i)
    put(body + body_head + 8 * i, std::bit_cast<std::uint64_t>(values[i]));
  seal(to.first(sample_record_size(values.size())));
}

std::vector<std::uint8_t> encoded_columns(std::uint16_t table, std::int64_t monotonic_ns, std::string_view name,
                                          std::span<const std::string> columns) {
  std::string names;
  const auto append = [&names](std::string_view text) {
    names.push_back(static_cast<char>(text.size() & 0xFFu));
    names.push_back(static_cast<char>(text.size() >> 8 & 0xFFu));
    names.append(text);
  };
  append(name);
  for (const std::string& column : columns)
    append(column);
  return sealed({.kind = BodyKind::columns,
                 .small = table,
                 .word = static_cast<std::uint32_t>(columns.size()),
                 .monotonic_ns = monotonic_ns},
                std::array<std::string_view, 1>{names});
}

std::vector<std::uint8_t> encoded_event(std::int64_t monotonic_ns, std::string_view category, std::string_view text) {
  return sealed({.kind = BodyKind::event,
                 .small = static_cast<std::uint16_t>(category.size()),
                 .word = static_cast<std::uint32_t>(text.size()),
                 .monotonic_ns = monotonic_ns},
                std::array<std::string_view, 2>{category, text});
}

std::vector<std::uint8_t> encoded_damage(ByteSpan bytes) {
  return sealed({.kind = BodyKind::damage, .word = static_cast<std::uint32_t>(bytes.size())},
                std::array<std::string_view, 1>{as_text(bytes)});
}

HeaderFault read_header(ByteSpan bytes, FoundHeader& to) {
  if (bytes.size() < record_magic.size() || !std::equal(record_magic.begin(), record_magic.end(), bytes.begin())) {
    return HeaderFault::not_a_record;
  }
  if (bytes.size() < header_head + 4) return HeaderFault::damaged;
  if (get<std::uint32_t>(bytes.data() + 8) != record_version) return HeaderFault::other_version;
  const std::size_t length = get<std::uint32_t>(bytes.data() + 12), end = header_head + length;
  if (length > largest_body || bytes.size() < end + 4 ||
      crc32(bytes.first(end)) != get<std::uint32_t>(bytes.data() + end)) {
    return HeaderFault::damaged;
  }
  std::copy_n(bytes.begin() + 16, to.header.run_id.size(), to.header.run_id.begin());
  to.header.wall_ns = get<std::int64_t>(bytes.data() + 32);
  to.header.monotonic_ns = get<std::int64_t>(bytes.data() + 40);
  to.header.json = as_text(bytes.subspan(header_head, length));
  to.size = end + 4;
  return HeaderFault::none;
}

FoundRecord first_record(ByteSpan bytes, bool known_only) noexcept {
  if (bytes.empty()) return {.found = Found::end};
  if (bytes.size() < record_head) return {.found = Found::incomplete};
  const std::size_t length = get<std::uint32_t>(bytes.data());
  if (length < body_head || length > largest_body) return {.found = Found::damaged};
  if (bytes.size() - record_head < length) return {.found = Found::incomplete};
  const ByteSpan body = bytes.subspan(record_head, length);
  const Form form = form_of(body);
  if (form == Form::wrong || (known_only && form == Form::unknown)) return {.found = Found::damaged};
  if (crc32(body) != get<std::uint32_t>(bytes.data() + 4)) return {.found = Found::damaged};
  return {.found = Found::record, .size = record_head + length, .body = body};
}

Frame frame_in(ByteSpan body) noexcept {
  const BodyHead head = head_in(body);
  Frame f;
  f.id = head.word;
  f.extended = (head.flags & extended) != 0;
  f.error = (head.flags & error) != 0;
  f.received = (head.flags & received) != 0;
  f.fd = (head.flags & fd) != 0;
  f.bit_rate_switch = (head.flags & bit_rate_switch) != 0;
  f.remote = (head.flags & remote) != 0;
  f.channel = static_cast<std::uint8_t>(head.small & 0xFFu);
  f.size = static_cast<std::uint8_t>(head.small >> 8);
  f.monotonic_ns = head.monotonic_ns;
  f.bus_ns = get<std::int64_t>(body.data() + body_head);
  const ByteSpan data = body.subspan(frame_head);
  std::copy(data.begin(), data.end(), f.data.begin());
  return f;
}

ColumnsBody columns_in(ByteSpan body) {
  const BodyHead head = head_in(body);
  ColumnsBody out{.table = head.small, .monotonic_ns = head.monotonic_ns};
  std::size_t at = body_head;
  const auto next = [&] {
    const std::size_t length = get<std::uint16_t>(body.data() + at);
    const std::string_view text = as_text(body.subspan(at + 2, length));
    at += 2 + length;
    return text;
  };
  out.name = next();
  for (std::uint32_t i = 0; i < head.word; ++i)
    out.columns.push_back(next());
  return out;
}

SampleBody sample_in(ByteSpan body) noexcept {
  const BodyHead head = head_in(body);
  return {.table = head.small, .monotonic_ns = head.monotonic_ns, .bytes = body.subspan(body_head)};
}

EventBody event_in(ByteSpan body) noexcept {
  const BodyHead head = head_in(body);
  const std::string_view text = as_text(body.subspan(body_head));
  return {.monotonic_ns = head.monotonic_ns, .category = text.substr(0, head.small), .text = text.substr(head.small)};
}

}  // namespace mgdd::rig
