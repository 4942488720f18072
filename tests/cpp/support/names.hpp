// The name that a user types for an enumerator is part of the interface: each has its own, there and back.
#pragma once

#include <gtest/gtest.h>

#include <initializer_list>
#include <string_view>
#include <utility>

namespace mgdd::test {

template <class Enum>
void expect_names(Enum (*parse)(std::string_view), std::initializer_list<std::pair<Enum, std::string_view>> names) {
  for (const auto& [value, name] : names) {
    EXPECT_EQ(to_string(value), name);
    EXPECT_EQ(parse(name), value) << name;
  }
}

}  // namespace mgdd::test
