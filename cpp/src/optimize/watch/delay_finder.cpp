#include "mgdd/optimize/watch/delay_finder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mgdd/optimize/ask_tell/reading.hpp"

namespace mgdd::optimize {
namespace {

constexpr int most_judged = 40, fewest_judged = 8;
constexpr std::int64_t looked_back = 48;  // cycles that readings are looked for in
constexpr std::int64_t judged_every = 4;  // cycles
constexpr double lead = 10.0;             // natural logarithm of the likelihood ratio, twice in a row

}  // namespace

DelayFinder::DelayFinder(double told, int uncertainty, Eigen::Index inputs)
    : told_(std::llround(told)),
      uncertainty_(uncertainty),
      later_(told_),
      wanted_later_(told_),
      applied_(InputTable::Zero(told_ + uncertainty_ + (uncertainty_ > 0 ? looked_back : 1), inputs)),
      values_(Eigen::VectorXd::Constant(applied_.rows(), unread)),
      newest_(Eigen::VectorXd::Zero(most_judged)),
      ages_(newest_),
      causes_(InputTable::Zero(most_judged, inputs)) {}

void DelayFinder::record(const Inputs& z) noexcept {
  ++cycles_;
  applied_.row(row_of(cycles_ - 1)) = z.transpose();
  values_[row_of(cycles_ - 1)] = unread;
}

void DelayFinder::read(double value) noexcept {
  values_[row_of(cycles_ - 1)] = value;
}

// The newest readings, the oldest first, that have an input under every delay.
int DelayFinder::gather() noexcept {
  const std::int64_t first = std::max<std::int64_t>(told_ + uncertainty_, cycles_ - looked_back);
  int count = 0;
  std::int64_t from = cycles_;
  while (from > first && count < most_judged)
    count += values_[row_of(--from)] == unread ? 0 : 1;
  count = 0;
  for (std::int64_t cycle = from; cycle < cycles_ && count < most_judged; ++cycle) {
    const double value = values_[row_of(cycle)];
    if (value == unread) continue;
    newest_[count] = value;
    ages_[count++] = static_cast<double>(cycles_ - 1 - cycle);
  }
  return count;
}

void DelayFinder::cause_of(int count, std::int64_t off) noexcept {
  for (int i = 0; i < count; ++i) {
    const auto back = static_cast<std::int64_t>(ages_[i]) + told_ + off;
    causes_.row(i) = applied_.row(row_of(cycles_ - 1 - back));
  }
}

bool DelayFinder::judge(ProcessModel& process, const Inputs& about) noexcept {
  if (uncertainty_ == 0 || cycles_ % judged_every != 0 || process.count() < process.fewest()) return false;
  const int count = gather();
  if (count < fewest_judged) return false;
  double most = -std::numeric_limits<double>::infinity(), taken = most;
  std::int64_t best = off_;
  for (std::int64_t off = -std::min(uncertainty_, told_); off <= uncertainty_; ++off) {
    cause_of(count, off);
    const double found = process.likelihood(causes_, newest_, ages_, count);
    if (off == off_) taken = found;
    if (found > most) {
      most = found;
      best = off;
    }
  }
  const bool again = best == wanted_;
  wanted_ = most - taken > lead ? best : off_;
  wanted_later_ = told_ + wanted_;
  if (wanted_ == off_ || !again) return false;
  off_ = wanted_;
  later_ = delay();
  cause_of(count, off_);
  process.replace(causes_, newest_, ages_, count, about);
  return true;
}

void DelayFinder::forget() noexcept {
  cycles_ = 0;
  wanted_ = off_;
  wanted_later_ = later_;
  applied_.setZero();
  values_.setConstant(unread);
}

}  // namespace mgdd::optimize
