// What an error says and what it carries beside the text.
#include "mgdd/common/error.hpp"

#include <gtest/gtest.h>

#include <variant>

namespace mgdd {
namespace {

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
