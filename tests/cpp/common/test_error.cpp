// What an error says and what it carries beside the text.
#include "mgdd/common/error.hpp"

#include <gtest/gtest.h>

#include <string>
#include <variant>

namespace mgdd {
namespace {

TEST(Error, CarriesFieldValueAndBoundBesideItsSentence) {
  const ParameterError number("bore_mm", -86.5, "must be > 0", "mm");
  EXPECT_STREQ(number.what(), "bore_mm = -86.5 mm: must be > 0");
  EXPECT_EQ(number.field, "bore_mm");
  EXPECT_EQ(std::get<double>(number.value), -86.5);
  EXPECT_EQ(number.bound, "> 0");
  const ParameterError name("kind", "pw_q", "must be one of pw_r, pw_w");
  EXPECT_STREQ(name.what(), "kind = 'pw_q': must be one of pw_r, pw_w");
  EXPECT_EQ(std::get<std::string>(name.value), "pw_q");
  const ParameterError remedy("lead", 3, "needs a learning_function");
  EXPECT_STREQ(remedy.what(), "lead = 3: needs a learning_function");
  EXPECT_EQ(remedy.bound, "needs a learning_function");
}

TEST(Error, KeepsItsFieldInContext) {
  const ShapeError inner = about("duty", ShapeError("duty has 3 samples: angle_deg has 4"));
  EXPECT_EQ(inner.field, "duty");
  EXPECT_TRUE(std::holds_alternative<std::monostate>(inner.value));
  const ShapeError outer = in_context("record 2: ", inner);
  EXPECT_STREQ(outer.what(), "record 2: duty has 3 samples: angle_deg has 4");
  EXPECT_EQ(outer.field, "duty");
  EXPECT_EQ(within("fit", inner).field, "fit.duty");
}

}  // namespace
}  // namespace mgdd
