#include "mgdd/rig/e2e.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>

namespace mgdd::rig {
namespace {

using Payload = std::array<std::uint8_t, 8>;

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
