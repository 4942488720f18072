// Numbers as short text for messages.
#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace mgdd {

/// At most nine significant digits, as %g prints them.
inline std::string text(double value) {
  std::array<char, 32> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%.9g", value);
  return buffer.data();
}

}  // namespace mgdd
