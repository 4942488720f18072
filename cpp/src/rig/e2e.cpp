#include "mgdd/rig/e2e.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/rig/frame.hpp"

namespace mgdd::rig {
namespace {

constexpr std::array<std::pair<std::string_view, Crc8>, 2> named{{{"sae_j1850", crc8_sae_j1850}, {"h2f", crc8_h2f}}};

static_assert(crc8_sae_j1850.of(std::array<std::uint8_t, 9>{'1', '2', '3', '4', '5', '6', '7', '8', '9'}) == 0x4B);
static_assert(crc8_h2f.of(std::array<std::uint8_t, 9>{'1', '2', '3', '4', '5', '6', '7', '8', '9'}) == 0xDF);

constexpr int counter_values(CounterPlace place) noexcept {
  return place == CounterPlace::byte ? 256 : 16;
}

int counter_of(const E2eSettings& s, std::span<const std::uint8_t> payload) noexcept {
  const int byte = payload[static_cast<std::size_t>(s.counter_byte)];
  switch (s.counter_place) {
    case CounterPlace::low_nibble:
      return byte & 0x0F;
    case CounterPlace::high_nibble:
      return byte >> 4;
    case CounterPlace::byte:
      break;
  }
  return byte;
}

void put_counter(const E2eSettings& s, int counter, std::span<std::uint8_t> payload) noexcept {
  std::uint8_t& byte = payload[static_cast<std::size_t>(s.counter_byte)];
  switch (s.counter_place) {
    case CounterPlace::low_nibble:
      byte = static_cast<std::uint8_t>((byte & 0xF0) | counter);
      return;
    case CounterPlace::high_nibble:
      byte = static_cast<std::uint8_t>((byte & 0x0F) | (counter << 4));
      return;
    case CounterPlace::byte:
      byte = static_cast<std::uint8_t>(counter);
      return;
  }
}

std::uint8_t checksum(const E2eSettings& s, std::span<const std::uint8_t> payload) noexcept {
  const int counter = counter_of(s, payload);
  const auto low = static_cast<std::uint8_t>(s.data_id & 0xFF), high = static_cast<std::uint8_t>(s.data_id >> 8);
  std::uint8_t sum = s.crc.start;
  switch (s.data_id_mode) {
    case DataIdMode::low:
      sum = s.crc.next(sum, low);
      break;
    case DataIdMode::both:
      sum = s.crc.next(s.crc.next(sum, low), high);
      break;
    case DataIdMode::alternating:
      sum = s.crc.next(sum, counter % 2 == 0 ? low : high);
      break;
    case DataIdMode::none:
    case DataIdMode::list:
      break;
  }
  const auto own = static_cast<std::size_t>(s.crc_byte);
  for (std::size_t i = 0; i < payload.size(); ++i)
    if (i != own) sum = s.crc.next(sum, payload[i]);
  if (s.data_id_mode == DataIdMode::list && s.data_id_list) {
    sum = s.crc.next(sum, (*s.data_id_list)[static_cast<std::size_t>(counter & 15)]);
  }
  return static_cast<std::uint8_t>(sum ^ s.crc.final_xor);
}

}  // namespace

Crc8 named_crc8(std::string_view name) {
  std::string valid;
  for (const auto& [known, crc] : named) {
    if (known == name) return crc;
    valid.append(valid.empty() ? "" : ", ").append(known);
  }
  throw ParameterError("crc", name, "must be one of " + valid + ", or (polynomial, start, final xor)");
}

std::optional<std::string_view> crc_name(const Crc8& crc) noexcept {
  for (const auto& [name, known] : named)
    if (known == crc) return name;
  return std::nullopt;
}

void validate(const E2eSettings& s) {
  require_fields(fields_of(s), s);
  if ((s.data_id_mode == DataIdMode::list) != s.data_id_list.has_value()) {
    throw about("data_id_list",
                ParameterError(s.data_id_list ? "data_id_list: must be None unless data_id_mode is 'list'"
                                              : "data_id_list: must be 16 bytes for data_id_mode='list'"));
  }
  require_within("crc_byte", s.crc_byte, 0, s.size - 1);
  require_within("counter_byte", s.counter_byte, 0, s.size - 1);
  if (s.crc_byte == s.counter_byte) {
    throw ParameterError("counter_byte", s.counter_byte, "must be another byte than crc_byte: the CRC fills its byte");
  }
  require_within("counter_modulus", s.counter_modulus, 2, counter_values(s.counter_place));
  require_within("max_step", s.max_step, 1, s.counter_modulus - 1);
}

bool protect(const E2eSettings& settings, int counter, std::span<std::uint8_t> payload) noexcept {
  const bool fits = payload.size() == static_cast<std::size_t>(settings.size) && counter >= 0 &&
                    counter < settings.counter_modulus && counter < counter_values(settings.counter_place) &&
                    std::max(settings.crc_byte, settings.counter_byte) < settings.size &&
                    std::min(settings.crc_byte, settings.counter_byte) >= 0;
  if (!fits) return false;
  put_counter(settings, counter, payload);
  payload[static_cast<std::size_t>(settings.crc_byte)] = checksum(settings, payload);
  return true;
}

E2eCheck::E2eCheck(const E2eSettings& settings) : settings_(settings) {
  validate(settings);
}

E2eStatus E2eCheck::push(std::span<const std::uint8_t> payload) noexcept {
  const E2eStatus status = judged(payload);
  ++counts_.by_status[static_cast<std::size_t>(status)];
  if (status == E2eStatus::initial) return status;
  if (status == E2eStatus::ok) {
    bad_ = 0;
    good_ = std::min(good_ + 1, settings_.good_until_valid);
    if (good_ == settings_.good_until_valid) valid_ = true;
  } else {
    good_ = 0;
    bad_ = std::min(bad_ + 1, settings_.bad_until_invalid);
    if (bad_ == settings_.bad_until_invalid) valid_ = false;
  }
  return status;
}

E2eStatus E2eCheck::judged(std::span<const std::uint8_t> payload) noexcept {
  if (payload.size() != static_cast<std::size_t>(settings_.size)) return E2eStatus::wrong_length;
  if (checksum(settings_, payload) != payload[static_cast<std::size_t>(settings_.crc_byte)]) {
    return E2eStatus::wrong_crc;
  }
  const int counter = counter_of(settings_, payload), before = last_;
  if (counter >= settings_.counter_modulus) return E2eStatus::wrong_counter;
  last_ = counter;
  if (before < 0) return E2eStatus::initial;
  const int step = (counter - before + settings_.counter_modulus) % settings_.counter_modulus;
  if (step == 0) return E2eStatus::repeated;
  counts_.missing += static_cast<std::uint64_t>(step - 1);
  return step <= settings_.max_step ? E2eStatus::ok : E2eStatus::lost;
}

void E2eCheck::reset() noexcept {
  last_ = -1;
  good_ = bad_ = 0;
  valid_ = false;
}

}  // namespace mgdd::rig
