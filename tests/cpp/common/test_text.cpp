// Texts, names and errors: short, exact, and a field that stays in its context.
#include <variant>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"
#include "support/test.hpp"

namespace mgdd {
namespace {

enum class Colour { red, dark_blue, grey_2 };
constexpr std::string_view other_name(Colour colour) noexcept {
  return colour == Colour::dark_blue ? "blue" : "";
}
constexpr std::pair<Colour, std::string_view> warm[] = {{Colour::red, "fire"}};

TEST(CommonText, ShortButUnambiguous) {
  EXPECT_EQ(text(-86.0), "-86");
  EXPECT_EQ(text(0.1), "0.1");
  EXPECT_EQ(text(1.0 / 3.0), "0.333333333");
  EXPECT_EQ(text(-1e300), "-1e+300");
}

TEST(CommonText, NamesGoBothWaysAndListTheValidOnes) {
  static_assert(names<Colour>().size() == 3);
  EXPECT_EQ(parse_name<Colour>("colour", "blue"), Colour::dark_blue);
  EXPECT_EQ(parse_name<Colour>("colour", "fire", warm), Colour::red);
  EXPECT_EQ(name_of(Colour::red), "red");
  EXPECT_EQ(name_of(Colour::grey_2), "grey_2");
  EXPECT_EQ(name_of(static_cast<Colour>(7)), "unknown");
  EXPECT_EQ(name_of(static_cast<Colour>(-1)), "unknown");
  try {
    parse_name<Colour>("colour", "green");
    FAIL();
  } catch (const ParameterError& error) {
    EXPECT_STREQ(error.what(), "colour = 'green': must be one of red, blue, grey_2");
    EXPECT_EQ(error.field, "colour");
    EXPECT_EQ(std::get<std::string>(error.value), "green");
    EXPECT_EQ(error.bound, "one of red, blue, grey_2");
  }
}

TEST(CommonText, AnErrorCarriesFieldValueAndBoundBesideItsMessage) {
  const ParameterError number("bore_mm", -86.0, "must be > 0", "mm");
  EXPECT_STREQ(number.what(), "bore_mm = -86 mm: must be > 0");
  EXPECT_EQ(number.field, "bore_mm");
  EXPECT_EQ(std::get<double>(number.value), -86.0);
  EXPECT_EQ(number.bound, "> 0");

  const ParameterError owned = within("cylinder", number);
  EXPECT_STREQ(owned.what(), "cylinder.bore_mm = -86 mm: must be > 0");
  EXPECT_EQ(owned.field, "cylinder.bore_mm");
  EXPECT_EQ(std::get<double>(owned.value), -86.0);
  EXPECT_EQ(owned.bound, "> 0");

  const ParameterError told = in_context("cycle 7: ", number);
  EXPECT_STREQ(told.what(), "cycle 7: bore_mm = -86 mm: must be > 0");
  EXPECT_EQ(told.field, "bore_mm");
  EXPECT_EQ(told.bound, "> 0");

  const DataError count("samples", std::size_t{3}, "needs at least 8", "-");
  EXPECT_STREQ(count.what(), "samples = 3: needs at least 8");
  EXPECT_EQ(std::get<double>(count.value), 3.0);
  EXPECT_EQ(count.bound, "needs at least 8");

  const ShapeError plain("J is missing");
  EXPECT_STREQ(plain.what(), "J is missing");
  EXPECT_TRUE(plain.field.empty() && plain.bound.empty());
  EXPECT_TRUE(std::holds_alternative<std::monostate>(plain.value));
}

TEST(CommonText, SharedBoundsSetThemToo) {
  const auto caught = [](auto refused) -> ParameterError {
    try {
      refused();
    } catch (const ParameterError& error) {
      return error;
    }
    return ParameterError("nothing thrown");
  };
  const ParameterError closed = caught([] { require_within("gain", 2.0, 0.0, 1.0, "deg"); });
  EXPECT_STREQ(closed.what(), "gain = 2 deg: must be in [0, 1]");
  EXPECT_EQ(closed.field, "gain");
  EXPECT_EQ(closed.bound, "in [0, 1]");
  const ParameterError nan = caught([] { require_positive("rate", std::numeric_limits<double>::quiet_NaN()); });
  EXPECT_EQ(nan.field, "rate");
  EXPECT_TRUE(std::isnan(std::get<double>(nan.value)));
  EXPECT_EQ(nan.bound, "> 0 and finite");
}

TEST(CommonText, UnitsOfTheFieldAreExact) {
  EXPECT_EQ(units::pa_per_bar * units::m3_per_l, 100.0);  // bar L = 100 J
  EXPECT_EQ(units::pa_per_kpa * units::m3_per_l, 1.0);    // kPa L = 1 J
  EXPECT_EQ(units::rad_per_deg * 180.0, std::numbers::pi);
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
