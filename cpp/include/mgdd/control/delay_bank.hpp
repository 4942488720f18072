// Which of several delays explains the readings: every member of a bank predicts with its own delay and learns its own
// belief (multiple models, Magill 1965); their squared innovations are compared where they differ. Understating a delay
// makes a loop swing, overstating it costs little, so a neighbour is left as it is and the choice leans upwards.
// noexcept, heap-free.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "mgdd/common/state.hpp"
#include "mgdd/control/filtered_rate.hpp"

namespace mgdd::control {

inline constexpr int most_delays = 7;

template <class T>
class DelayBank {
 public:
  /// `noise_deg` of the measured angle: smaller differences decide nothing.
  DelayBank(int members, double sample_s, double noise_deg) noexcept
      : members_(members),
        alike_(static_cast<int>((1.0 + 1e-6) * lag_s / sample_s)),
        apart_(T(3.3 * noise_deg)),
        variance_(T(noise_deg * noise_deg)),
        unknown_(variance_ * T(std::fmax(1.0, sample_s * sample_s / (lag_s * lag_s)))) {}

  int members() const noexcept { return members_; }
  int chosen() const noexcept { return static_cast<int>(chosen_); }
  /// Nothing was read yet; the choice stays.
  void restart() noexcept {
    sums_.fill(T(0.0));
    weight_ = T(0.0);
    readings_ = 0;
  }
  void reset() noexcept {
    restart();
    chosen_ = 0;
  }

  /// Innovations of all members at one sample; whether another one is chosen now.
  bool judge(const std::array<T, most_delays>& innovations) noexcept {
    const auto end = innovations.begin() + members_;
    const auto [least, most] = std::minmax_element(innovations.begin(), end);
    if (!(*most - *least > apart_)) return false;
    for (std::size_t j = 0; j < static_cast<std::size_t>(members_); ++j)
      sums_[j] += std::min(innovations[j] * innovations[j], largest * unknown_) - forgets * sums_[j];
    weight_ += T(1.0) - forgets * weight_;
    readings_ = std::min(readings_ + 1, enough);
    return choose();
  }

  template <class Self, class V>
  static void visit(Self& self, V&& v) {
    v("chosen", self.chosen_, most_delays);
    v("readings", self.readings_, enough + 1);
    visit_number(v, "weight", self.weight_);
    for (std::size_t j = 0; j < most_delays; ++j)
      visit_number(v, names[j], self.sums_[j]);
  }

 private:
  bool choose() noexcept {
    const auto at = [&](int j) { return sums_[static_cast<std::size_t>(j)]; };
    const T best = *std::min_element(sums_.begin(), sums_.begin() + members_);
    const T doubt = doubted * variance_;
    int b = 0;
    while (at(b) > near_best * best + lean * doubt)
      ++b;
    const int now = chosen();
    const bool down = b < now;
    if (std::abs(b - now) <= alike_ || !(best <= explained * unknown_ * weight_)) return false;
    if (!down && readings_ < (b - now <= alike_ + 2 ? enough : few)) return false;
    const T near = alike_ == 0 ? at(now) : std::min(at(now), at(down ? now - 1 : now + 1));
    if (!(near > (down ? worse_down : worse_up) * best + doubt)) return false;
    chosen_ = b;
    return true;
  }

  static constexpr std::array<const char*, most_delays> names{"sum_0", "sum_1", "sum_2", "sum_3",
                                                              "sum_4", "sum_5", "sum_6"};
  static constexpr double lag_s = 1e-3;    // what sensors, bristles and gaps add to a delay
  static constexpr T forgets = T(0.0125);  // per sample in which the members differ: 80 of them
  static constexpr T doubted = T(50.0);    // a sum of squares that decides nothing, over the noise
  static constexpr T largest = T(280.0);   // square that counts of a reading far off, over `unknown_`
  static constexpr T explained = T(11.0);  // mean square of a member that explains the readings, over `unknown_`
  static constexpr T near_best = T(1.2), lean = T(0.15);
  static constexpr T worse_up = T(1.3), worse_down = T(2.0);
  static constexpr std::int64_t enough = 15, few = 5;  // readings for a step upwards, of few samples and of more

  int members_;
  int alike_;  // samples by which a delay may be wrong
  T apart_, variance_;
  T unknown_;  // variance of what the belief does not know: an acceleration grows with the square of the sample
  std::array<T, most_delays> sums_{};
  T weight_{0.0};
  std::int64_t readings_ = 0, chosen_ = 0;
};

}  // namespace mgdd::control
