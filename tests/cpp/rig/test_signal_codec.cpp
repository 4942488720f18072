// Numbers in a payload, and its protection.
#include "mgdd/common/error.hpp"
#include "mgdd/rig/e2e.hpp"
#include "mgdd/rig/signal_codec.hpp"
#include "support/test.hpp"

namespace mgdd::rig {
namespace {

using Payload = std::array<std::uint8_t, 8>;
constexpr auto big = ByteOrder::big_endian;
constexpr auto with_sign = RawType::signed_integer;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
static_assert(noexcept(pack({}, 0.0, OutOfRange::clamp, {})) && noexcept(unpack({}, {})));

Payload packed(const SignalLayout& layout, double value, PackStatus wanted = PackStatus::ok,
               OutOfRange beyond = OutOfRange::clamp) {
  Payload payload{};
  EXPECT_EQ(pack(layout, value, beyond, payload), wanted);
  return payload;
}

TEST(SignalCodec, NothingWraps) {
  const SignalLayout duty{.start = 5, .length = 12, .type = with_sign, .scale = 0.0005};  // +-1.0235
  for (const double value : {1.1, 3.2, 1e9, 1e300, std::numeric_limits<double>::max()}) {
    for (const double sign : {1.0, -1.0}) {
      const double sent = unpack(duty, packed(duty, sign * value, PackStatus::clamped)).value_or(nan);
      EXPECT_EQ(sent, sign > 0.0 ? 2047 * 0.0005 : -2048 * 0.0005);
      EXPECT_EQ(packed(duty, sign * value, PackStatus::out_of_range, OutOfRange::refuse), Payload{});
    }
  }
  EXPECT_EQ(packed({.length = 8}, -1e-9), Payload{}) << "rounds to 0";
  EXPECT_EQ(packed({.length = 8}, -1.0, PackStatus::clamped), Payload{});
  EXPECT_EQ(packed({.length = 8}, 255.5, PackStatus::clamped), Payload{0xFF}) << "halves to even: 256";
  EXPECT_EQ(packed({.length = 8}, 254.5), Payload{0xFE});
  Payload all{};
  all.fill(0xFF);
  EXPECT_EQ(packed({.length = 64}, 0x1p64, PackStatus::clamped), all);
  EXPECT_EQ(packed({.length = 64, .type = with_sign}, 0x1p63, PackStatus::clamped)[7], 0x7F);
  EXPECT_EQ(packed({.length = 64, .type = with_sign}, -0x1p63)[7], 0x80);
}

TEST(SignalCodec, WhatIsNotFiniteIsRefused) {
  for (const SignalLayout& layout :
       {SignalLayout{.length = 16}, SignalLayout{.length = 32, .type = RawType::float32},
        SignalLayout{.length = 64, .type = RawType::float64, .minimum = 0.0, .maximum = 1.0}}) {
    for (const double value : {std::nan(""), HUGE_VAL, -HUGE_VAL})
      EXPECT_EQ(packed(layout, value, PackStatus::not_finite), Payload{});
  }
  EXPECT_EQ(packed({.length = 8, .scale = 0.0}, 0.0, PackStatus::not_finite), Payload{}) << "unchecked layout";
}

TEST(SignalCodec, FloatsNeverBecomeInfinite) {
  const SignalLayout layout{.length = 32, .type = RawType::float32};
  constexpr double most = std::numeric_limits<float>::max();
  EXPECT_EQ(unpack(layout, packed(layout, 1e39, PackStatus::clamped)), most);
  EXPECT_EQ(unpack(layout, packed(layout, -1e300, PackStatus::clamped)), -most);
  EXPECT_EQ(unpack(layout, packed(layout, most)), most);
}

TEST(SignalCodec, BeyondThePayload) {
  Payload payload{};
  const auto three = std::span(payload).first(3);
  EXPECT_EQ(pack({.start = 16, .length = 9}, 1.0, OutOfRange::clamp, three), PackStatus::does_not_fit);
  EXPECT_EQ(pack({.start = 16, .length = 8}, 1.0, OutOfRange::clamp, three), PackStatus::ok);
  EXPECT_EQ(pack({.start = 17, .length = 3, .byte_order = big}, 1.0, OutOfRange::clamp, three),
            PackStatus::does_not_fit);
  EXPECT_FALSE(unpack({.start = 24, .length = 1}, three));
  EXPECT_FALSE(unpack({.start = -8, .length = 4}, three)) << "unchecked layout";
  EXPECT_FALSE(unpack({.start = 0, .length = 0}, three)) << "unchecked layout";
  EXPECT_FALSE(unpack({.start = 0, .length = 16, .type = RawType::float32}, three)) << "unchecked layout";
}

TEST(SignalCodec, BranchesOfAMultiplexerShareBits) {
  const Signal kp{.name = "Kp", .layout = {.start = 8, .length = 32}, .branches = {0, 3}};
  Signal ki{.name = "Ki", .layout = {.start = 8, .length = 32}, .branches = {1}};
  EXPECT_NO_THROW(validate(std::vector{kp, ki}, 8));
  ki.branches = {1, 3};
  EXPECT_THROW(validate(std::vector{kp, ki}, 8), ParameterError);
  ki.branches = {};
  EXPECT_THROW(validate(std::vector{kp, ki}, 8), ParameterError);
}

/// Settings far from the defaults in every field.
E2eSettings odd() {
  return {.crc = {.polynomial = 0x2F, .start = 0x5A, .final_xor = 0xA5},
          .data_id = 0xBEEF,
          .data_id_mode = DataIdMode::alternating,
          .size = 8,
          .crc_byte = 7,
          .counter_byte = 2,
          .counter_place = CounterPlace::high_nibble,
          .counter_modulus = 15,
          .max_step = 2,
          .bad_until_invalid = 2,
          .good_until_valid = 3};
}

Payload sent(const E2eSettings& s, int counter, std::uint8_t content = 0x37) {
  Payload payload{};
  payload.fill(content);
  EXPECT_TRUE(protect(s, counter, payload));
  return payload;
}

TEST(E2e, AFrameOfAnotherDataIdIsRefused) {
  for (const DataIdMode mode : {DataIdMode::low, DataIdMode::both, DataIdMode::alternating}) {
    E2eSettings own = odd(), other = odd();
    own.data_id_mode = other.data_id_mode = mode;
    other.data_id = 0xBEEE;
    E2eCheck check(own);
    EXPECT_EQ(check.push(sent(other, 4)), E2eStatus::wrong_crc);
    EXPECT_EQ(check.push(sent(own, 4)), E2eStatus::initial);
  }
  E2eSettings own = odd(), other = odd();
  own.data_id_mode = other.data_id_mode = DataIdMode::list;
  own.data_id_list = std::array<std::uint8_t, 16>{1, 2, 3, 4, 5, 6, 7, 8};
  other.data_id_list = std::array<std::uint8_t, 16>{1, 2, 3, 4, 5, 6, 7, 9};
  E2eCheck check(own);
  EXPECT_EQ(check.push(sent(other, 6)), E2eStatus::initial);
  EXPECT_EQ(check.push(sent(other, 7)), E2eStatus::wrong_crc);
}

TEST(E2e, ACorrectFrameWithAnImpossibleCounterIsBad) {
  E2eSettings wider = odd();
  wider.counter_modulus = 16;
  E2eCheck check(odd());
  EXPECT_EQ(check.push(sent(odd(), 13)), E2eStatus::initial);
  EXPECT_EQ(check.push(sent(wider, 15)), E2eStatus::wrong_counter);
  EXPECT_EQ(check.push(sent(odd(), 14)), E2eStatus::ok);
}

TEST(E2e, ValidOnlyAfterGoodFramesAndUntilTooManyBadOnes) {
  const E2eSettings s = odd();  // 3 good, 2 bad
  E2eCheck check(s);
  int counter = 0;
  const auto good = [&] { return check.push(sent(s, counter = next_counter(s, counter))); };
  const auto bad = [&] { return check.push(std::array<std::uint8_t, 3>{}); };
  good();  // initial
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(good(), E2eStatus::ok);
    EXPECT_FALSE(check.valid());
  }
  good();
  EXPECT_TRUE(check.valid());
  bad();
  EXPECT_TRUE(check.valid()) << "one bad frame is not two";
  good();
  bad();
  EXPECT_TRUE(check.valid()) << "not in a row";
  bad();
  EXPECT_FALSE(check.valid());
  good();
  good();
  EXPECT_FALSE(check.valid());
  good();
  EXPECT_TRUE(check.valid());
  check.reset();
  EXPECT_FALSE(check.valid());
  EXPECT_EQ(good(), E2eStatus::initial);
}

TEST(E2e, AFrozenSenderBecomesInvalid) {
  const E2eSettings s{};
  E2eCheck check(s);
  for (const int counter : {0, 1, 2})
    check.push(sent(s, counter));
  ASSERT_TRUE(check.valid());
  for (int i = 0; i < s.bad_until_invalid; ++i)
    EXPECT_EQ(check.push(sent(s, 2)), E2eStatus::repeated);
  EXPECT_FALSE(check.valid());
}

TEST(E2e, AByteAsCounter) {
  const E2eSettings s{.counter_place = CounterPlace::byte, .counter_modulus = 256};
  E2eCheck check(s);
  EXPECT_EQ(check.push(sent(s, 255)), E2eStatus::initial);
  EXPECT_EQ(check.push(sent(s, 0)), E2eStatus::ok);
  EXPECT_EQ(next_counter(s, 255), 0);
}

}  // namespace
}  // namespace mgdd::rig
