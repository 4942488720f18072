// Numbers in the warnings of an analysed trace.
#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace mgdd::engine {

/// Four digits, which are enough for a warning.
inline std::string shown(double value) {
  std::array<char, 32> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%.4g", value);
  return buffer.data();
}

}  // namespace mgdd::engine
