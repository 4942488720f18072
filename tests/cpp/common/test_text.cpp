// Numbers as text, names of enumerators, exact units and the error tree.
#include <array>
#include <type_traits>

#include <gtest/gtest.h>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"

namespace mgdd {
namespace {

enum class Colour { red, blue };
constexpr std::pair<Colour, std::string_view> colours[] = {{Colour::red, "red"}, {Colour::blue, "blue"}};

TEST(CommonText, ShortButUnambiguous) {
  EXPECT_EQ(text(-86.0), "-86");
  EXPECT_EQ(text(0.1), "0.1");
  EXPECT_EQ(text(1.0 / 3.0), "0.333333333");
  EXPECT_EQ(text(-1e300), "-1e+300");
}

TEST(CommonText, NamesGoBothWaysAndListTheValidOnes) {
  EXPECT_EQ(parse_name<Colour>(colours, "colour", "blue"), Colour::blue);
  EXPECT_EQ(name_of<Colour>(colours, Colour::red), "red");
  EXPECT_EQ(name_of<Colour>(colours, static_cast<Colour>(7)), "unknown");
  try {
    parse_name<Colour>(colours, "colour", "green");
    FAIL();
  } catch (const ParameterError& error) {
    EXPECT_STREQ(error.what(), "colour = 'green': must be one of red, blue");
  }
}

TEST(CommonText, UnitsOfTheFieldAreExact) {
  EXPECT_EQ(units::pa_per_bar * units::m3_per_l, 100.0);  // bar L = 100 J
  EXPECT_EQ(units::pa_per_kpa * units::m3_per_l, 1.0);    // kPa L = 1 J
  EXPECT_EQ(units::rad_per_deg * 180.0, std::numbers::pi);
}

TEST(CommonText, OneRootForEveryError) {
  static_assert(std::is_base_of_v<Error, ParameterError> && std::is_base_of_v<Error, ShapeError>);
  static_assert(std::is_base_of_v<Error, DataError> && std::is_base_of_v<Error, ConvergenceError>);
}

}  // namespace
}  // namespace mgdd
