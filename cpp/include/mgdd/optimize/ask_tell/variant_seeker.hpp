// Any of the seekers as one type, for what is compiled once and not once per seeker. Each call goes to the seeker that
// it holds, bit for bit. ask and tell are noexcept and allocation-free.
#pragma once

#include <cstdint>
#include <utility>
#include <variant>
#include <vector>

#include "mgdd/common/variant.hpp"
#include "mgdd/optimize/ask_tell/seekers.hpp"

namespace mgdd::optimize {

class VariantSeeker {
 public:
  /// What the settings of all seekers share.
  struct Settings {
    SearchSpace space;
    bool maximize;
    std::vector<Limit> limits;
  };

  explicit VariantSeeker(Seeker seeker) : seeker_(std::move(seeker)), settings_(shared_settings(seeker_)) {}

  const Inputs& ask() noexcept {
    return on(seeker_, [](auto& s) -> const Inputs& { return s.ask(); });
  }
  TellStatus tell(const Reading& reading) noexcept {
    return on(seeker_, [&](auto& s) { return s.tell(reading); });
  }
  void restart() noexcept {
    on(seeker_, [](auto& s) { s.restart(); });
  }
  void shift_estimate(const Inputs& by) noexcept {
    on(seeker_, [&](auto& s) { s.shift_estimate(by); });
  }
  /// Another seed where the seeker draws.
  void reseed(std::uint64_t seed) noexcept {
    on(seeker_, [seed](auto& s) {
      if constexpr (requires { s.reseed(seed); }) s.reseed(seed);
    });
  }

  const Inputs& estimate() const noexcept {
    return on(seeker_, [](auto& s) -> const Inputs& { return s.estimate(); });
  }
  const Inputs& applied() const noexcept {
    return on(seeker_, [](auto& s) -> const Inputs& { return s.applied(); });
  }
  const Protocol& protocol() const noexcept {
    return on(seeker_, [](auto& s) -> const Protocol& { return s.protocol(); });
  }
  std::size_t component_count() const noexcept {
    return on(seeker_, [](auto& s) { return s.component_count(); });
  }
  std::size_t limit_count() const noexcept { return settings_.limits.size(); }
  LimitState limit_state(std::size_t i) const noexcept {
    return on(seeker_, [&](const auto& s) { return limit_state_of(s, i); });
  }
  double limit_delay(std::size_t i) const noexcept {
    return on(seeker_, [&](const auto& s) { return limit_delay_of(s, i); });
  }
  double excess(const Inputs& at) const noexcept {
    return on(seeker_, [&](const auto& s) { return excess_of(s, at); });
  }
  const Settings& settings() const noexcept { return settings_; }
  const Seeker& variant() const noexcept { return seeker_; }

  void require_usable() const {
    std::visit([](const auto& s) { s.require_usable(); }, seeker_);
  }
  template <class Self, class V>
  static void visit(Self& self, V& v) {
    std::visit([&](auto& s) { std::decay_t<decltype(s)>::visit(s, v); }, self.seeker_);
  }

 private:
  static Settings shared_settings(const Seeker& seeker) {
    return std::visit(
        [](const auto& s) { return Settings{s.settings().space, s.settings().maximize, s.settings().limits}; }, seeker);
  }

  Seeker seeker_;
  Settings settings_;
};

static_assert(AnySeeker<VariantSeeker>);

}  // namespace mgdd::optimize
