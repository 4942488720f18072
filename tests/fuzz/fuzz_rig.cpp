// Mutated record files through reader and repair, random layouts and payloads through codec and check: no crash, no
// byte out of bounds, no byte lost. Usage: mgdd_fuzz RUNS [SEED]; equal seeds give equal runs.
#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/e2e.hpp"
#include "mgdd/rig/record_format.hpp"
#include "mgdd/rig/record_reader.hpp"
#include "mgdd/rig/signal_codec.hpp"

namespace {

using namespace mgdd::rig;
using Bytes = std::vector<std::uint8_t>;

struct Random {
  std::mt19937_64 engine;

  std::uint64_t word() { return engine(); }
  std::size_t below(std::size_t n) { return n == 0 ? 0 : static_cast<std::size_t>(engine() % n); }
  bool one_in(std::size_t n) { return below(n) == 0; }
};

void require(bool holds, const char* law) {
  if (holds) return;
  std::fprintf(stderr, "broken: %s\n", law);
  std::abort();
}

/// A small record with every kind of body, and where each record in it begins.
struct Seed {
  Bytes bytes;
  std::vector<std::size_t> starts;

  void add(std::span<const std::uint8_t> record) {
    starts.push_back(bytes.size());
    bytes.insert(bytes.end(), record.begin(), record.end());
  }
};

Seed make_seed() {
  Seed seed;
  seed.bytes = encoded({.run_id = {1, 2, 3}, .wall_ns = 5, .monotonic_ns = 7, .json = R"({"rig": "seed"})"});
  const std::vector<std::string> names{"angle_deg", "duty"};
  seed.add(encoded_columns(3, 11, "controller", names));
  for (int i = 0; i < 4; ++i) {
    Frame frame{.id = 0x120, .received = i % 2 == 0, .size = static_cast<std::uint8_t>(i == 3 ? 64 : 8)};
    frame.data.fill(static_cast<std::uint8_t>(17 * i));
    frame.fd = i == 3;
    frame.remote = i == 2;
    std::array<std::uint8_t, largest_frame_record> record{};
    seed.add(std::span(record).first(encode(frame, record)));
    std::array<std::uint8_t, sample_record_size(2)> sample{};
    encode_sample(3, 100 + i, std::array{12.5, -0.25}, sample);
    seed.add(sample);
  }
  seed.add(encoded_event(200, "state", "ARMED -> RUN"));
  seed.add(encoded_damage(std::array<std::uint8_t, 5>{1, 2, 3, 4, 5}));
  return seed;
}

void put_word(Bytes& bytes, std::size_t at, std::uint32_t word) {
  for (std::size_t i = 0; i < 4 && at + i < bytes.size(); ++i)
    bytes[at + i] = static_cast<std::uint8_t>(word >> 8 * i);
}

/// One change of a few bytes.
void mutate(Bytes& bytes, Random& random) {
  if (bytes.empty()) return;
  const std::size_t at = random.below(bytes.size());
  static constexpr std::array<std::uint32_t, 8> edges{0, 1, 15, 16, 17, 0x7FFFFFFF, 0xFFFFFFFF, 1u << 20};
  switch (random.below(6)) {
    case 0:
      bytes[at] ^= static_cast<std::uint8_t>(1u << random.below(8));
      return;
    case 1:
      bytes[at] = static_cast<std::uint8_t>(random.word());
      return;
    case 2:
      put_word(bytes, at, edges[random.below(edges.size())]);
      return;
    case 3:
      bytes.resize(at);
      return;
    case 4:
      bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                  bytes.begin() + static_cast<std::ptrdiff_t>(at + random.below(bytes.size() - at)));
      return;
    default: {
      const Bytes again(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                        bytes.begin() + static_cast<std::ptrdiff_t>(at + random.below(bytes.size() - at)));
      bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(random.below(bytes.size())), again.begin(), again.end());
    }
  }
}

/// A change inside of bodies whose CRC is made right again: what a faulty writer could leave.
Bytes forged(const Seed& seed, Random& random) {
  Bytes bytes = seed.bytes;
  for (std::size_t n = 1 + random.below(4); n > 0; --n) {
    const std::size_t start = seed.starts[random.below(seed.starts.size())],
                      size = first_record(std::span<const std::uint8_t>(seed.bytes).subspan(start)).size - record_head;
    const std::size_t at = start + record_head + random.below(random.one_in(2) ? body_head : size);
    bytes[at] = static_cast<std::uint8_t>(random.word());
    put_word(bytes, start + 4, crc32(std::span<const std::uint8_t>(bytes).subspan(start + record_head, size)));
  }
  return bytes;
}

/// The bytes in pieces of random size, as a slow disk gives them.
ByteSource in_pieces(const Bytes& bytes, std::uint64_t seed) {
  return [&bytes, at = std::size_t{0},
          random = Random{std::mt19937_64(seed)}](std::span<std::uint8_t> room) mutable -> std::size_t {
    const std::size_t left = std::min(bytes.size() - at, room.size());
    const std::size_t n = left == 0 ? 0 : 1 + random.below(left);
    if (n > 0) std::memcpy(room.data(), bytes.data() + at, n);
    at += n;
    return n;
  };
}

void fuzz_record(const Seed& seed, Random& random) {
  Bytes bytes = random.one_in(2) ? forged(seed, random) : seed.bytes;
  for (std::size_t n = random.below(4); n > 0; --n)
    mutate(bytes, random);
  std::uint64_t readable = 0;
  bool opened = false;
  try {
    RecordReader reader(in_pieces(bytes, random.word()), "memory");
    opened = true;
    const RecordColumns columns = read_columns(reader);
    require(reader.position() + reader.ignored_bytes() == bytes.size(), "every byte is read or counted as ignored");
    for (const Frame& frame : columns.frames)
      require(frame.payload().size() == frame.size, "a frame holds no more than its data");
    for (const RecordTable& table : columns.tables)
      require(table.values.size() == table.columns.size() * table.monotonic_ns.size(), "a number per column and row");
    readable = columns.records;
  } catch (const mgdd::DataError&) {
    require(!opened, "only the header can be refused");
  }
  if (!random.one_in(4)) return;
  Bytes mended;
  try {
    const RepairReport report = repair_record(in_pieces(bytes, random.word()), "memory", [&](ByteSpan piece) {
      mended.insert(mended.end(), piece.begin(), piece.end());
    });
    require(report.records >= readable, "a repair keeps what could be read");
    RecordReader reader(in_pieces(mended, random.word()), "mended");
    const std::uint64_t header = reader.position();
    std::uint64_t records = 0, bodies = 0;
    while (const auto body = reader.next()) {
      bodies += body->size() + record_head;
      ++records;
    }
    const std::uint64_t heads = (records - report.records) * (record_head + body_head);  // around the damaged places
    require((report.header_lost ? 0 : header) + bodies - heads == bytes.size(), "no byte is lost");
    require(mended.size() == header + bodies, "and none comes from nowhere");
    require(reader.ignored_bytes() == 0, "a repaired record is readable to its end");
    require(records >= report.records, "no record is lost");
    if (report.damaged_bytes == 0 && !report.header_lost) require(mended == bytes, "a whole record stays as it is");
  } catch (const mgdd::DataError&) {
    require(readable == 0, "what is readable is repaired");
  }
}

SignalLayout random_layout(Random& random) {
  const auto real = [&random] {
    return random.one_in(4) ? std::bit_cast<double>(random.word())
                            : static_cast<double>(random.below(2000)) / 100.0 - 5.0;
  };
  SignalLayout layout{.start = static_cast<int>(random.below(random.one_in(8) ? 100000 : 520)) - 4,
                      .length = static_cast<int>(random.below(70)) - 2,
                      .byte_order = static_cast<ByteOrder>(random.below(2)),
                      .type = static_cast<RawType>(random.below(4)),
                      .scale = real(),
                      .offset = real()};
  if (random.one_in(3)) layout.minimum = real();
  if (random.one_in(3)) layout.maximum = real();
  if (layout.type == RawType::float32 && random.one_in(2)) layout.length = 32;
  if (layout.type == RawType::float64 && random.one_in(2)) layout.length = 64;
  return layout;
}

// Whether a message could have it; any other must only be harmless.
bool could_be(const SignalLayout& layout) {
  try {
    validate(layout);
    return true;
  } catch (const mgdd::ParameterError&) {
    return false;
  }
}

void fuzz_codec(Random& random) {
  const SignalLayout layout = random_layout(random);
  Bytes payload(random.below(max_payload + 1));  // of its exact size: the sanitizer sees one byte beyond
  for (std::uint8_t& byte : payload)
    byte = static_cast<std::uint8_t>(random.word());
  const Bytes before = payload;
  static constexpr std::array<double, 5> edges{HUGE_VAL, -HUGE_VAL, -0.0, 0x1p63, 0x1p64};
  const double value = random.one_in(8)   ? edges[random.below(edges.size())]
                       : random.one_in(2) ? std::bit_cast<double>(random.word())
                                          : static_cast<double>(random.below(100000)) / 7.0 - 500.0;
  const auto beyond = static_cast<OutOfRange>(random.below(2));
  const PackStatus status = pack(layout, value, beyond, payload);
  const bool written = status == PackStatus::ok || status == PackStatus::clamped;
  if (!written) require(payload == before, "a refused value writes nothing");
  if (!std::isfinite(value)) require(!written, "NaN and infinity are never sent");
  require(unpack(layout, payload).has_value() == (status != PackStatus::does_not_fit), "pack and unpack agree on room");
  int changed = 0;
  for (std::size_t i = 0; i < payload.size(); ++i)
    changed += std::popcount(static_cast<unsigned>(payload[i] ^ before[i]));
  require(changed <= std::max(layout.length, 0), "no other bit moves");
  const std::uint64_t raw = random.word();
  if (pack_raw(layout, raw, OutOfRange::refuse, payload) == PackStatus::ok) {
    require(unpack_raw(layout, payload) == raw, "a raw value comes back");
  }
  if (could_be(layout) && written)
    require(!std::isnan(unpack(layout, payload).value_or(NAN)) || layout.type >= RawType::float32, "a number");
}

void fuzz_check(E2eCheck& check, const E2eSettings& settings, Random& random) {
  Bytes payload(random.one_in(8) ? random.below(max_payload + 1) : 8);
  for (std::uint8_t& byte : payload)
    byte = static_cast<std::uint8_t>(random.word());
  if (protect(settings, static_cast<int>(random.below(18)) - 1, payload) && random.one_in(2)) mutate(payload, random);
  const std::uint64_t wrong = check.counts().of(E2eStatus::wrong_length);
  check.push(payload);
  require((check.counts().of(E2eStatus::wrong_length) > wrong) == (payload.size() != 8), "wrong lengths are counted");
}

}  // namespace

// NOLINTNEXTLINE(misc-const-correctness): so is main
int main(int argc, char** argv) try {
  const long long runs = argc > 1 ? std::strtoll(argv[1], nullptr, 10) : 20000;
  const unsigned long long start = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  Random random{std::mt19937_64(start)};
  const Seed seed = make_seed();
  const E2eSettings settings{.data_id = 0x120, .counter_modulus = 15};
  E2eCheck check(settings);
  const auto begin = std::chrono::steady_clock::now();
  for (long long i = 0; i < runs; ++i) {
    fuzz_record(seed, random);
    fuzz_codec(random);
    fuzz_check(check, settings, random);
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  std::printf("%lld runs with seed %llu in %.1f s: nothing found\n", runs, start, took.count());
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
