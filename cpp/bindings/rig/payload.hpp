// Bytes of Python as a payload: bytes, bytearray, memoryview or a uint8 array, copied.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/rig/frame.hpp"

namespace mgdd::bindings {

/// ShapeError for anything but up to 64 bytes in a row.
inline std::vector<std::uint8_t> to_payload(const py::buffer& payload) {
  const py::buffer_info info = payload.request();
  if (info.ndim != 1 || info.itemsize != 1) {
    throw about("payload", ShapeError("payload has " + std::to_string(info.ndim) + " dimensions of " +
                                      std::to_string(info.itemsize) + "-byte elements: must be bytes in a row"));
  }
  if (info.size > static_cast<py::ssize_t>(rig::max_payload)) {
    throw about("payload", ShapeError("payload has " + std::to_string(info.size) + " bytes: must be at most 64"));
  }
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(info.size));
  const auto* at = static_cast<const std::uint8_t*>(info.ptr);
  for (std::size_t i = 0; i < bytes.size(); ++i)
    bytes[i] = at[static_cast<py::ssize_t>(i) * info.strides[0]];
  return bytes;
}

inline py::bytes as_bytes(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace mgdd::bindings
