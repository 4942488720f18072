#include "mgdd/rig/transport.hpp"

#include <utility>

namespace mgdd::rig {
namespace {

constexpr std::pair<SendResult, std::string_view> results[] = {
    {SendResult::sent, "sent"}, {SendResult::full, "full"}, {SendResult::failed, "failed"}};

}  // namespace

Names<SendResult> send_result_names() noexcept {
  return results;
}

}  // namespace mgdd::rig
