// The name that a user types for an enumerator is part of the interface: all of them, in order.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include "mgdd/common/enum_names.hpp"

namespace mgdd::test {

template <class Enum>
void expect_names(const std::vector<std::pair<Enum, std::string_view>>& expected) {
  EXPECT_TRUE(std::ranges::equal(names<Enum>(), expected)) << expected.back().second;
}

}  // namespace mgdd::test
