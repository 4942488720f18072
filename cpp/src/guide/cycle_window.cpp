#include "mgdd/guide/cycle_window.hpp"

#include <algorithm>
#include <cmath>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"

namespace mgdd::guide {
namespace {

constexpr double changed_fraction = 0.05;   // of speed, fuel, intake pressure or temperature: another operating point
constexpr std::ptrdiff_t flat_samples = 4;  // at the maximum; the top of a real trace is round
constexpr double percent = 100.0;
constexpr double least_variance = 1e-10;   // CAD^2: timings that differ by rounding only
constexpr std::int64_t median_cycles = 3;  // below, a median says nothing

bool differs(double now, double before) noexcept {
  return std::abs(now - before) > changed_fraction * std::abs(before);
}
bool differs(const std::optional<double>& now, const std::optional<double>& before) noexcept {
  return now.has_value() != before.has_value() || (now && differs(*now, *before));
}

bool usable(const engine::OperatingPoint& point) noexcept {
  for (const auto& field : engine::operating_point_fields<double>()) {
    if (!field.info.domain.contains(field.in(point))) return false;
  }
  const auto inside = [](const std::optional<double>& value, const FieldInfo& info) {
    return !value || info.domain.contains(*value);
  };
  return inside(point.burn_duration_cad, engine::burn_duration_info) &&
         inside(point.trapped_mass_g, engine::trapped_mass_info) &&
         inside(point.ivc_temperature_k, engine::ivc_temperature_info);
}

bool is_saturated(std::span<const double> pressure) noexcept {
  const double highest = *std::max_element(pressure.begin(), pressure.end());
  std::ptrdiff_t run = 0, longest = 0;
  for (const double p : pressure) {
    run = p == highest ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return longest >= flat_samples;
}

}  // namespace

CycleWindow::CycleWindow(const CycleWindowSettings& settings, std::span<const double> volume_m3, double swept_m3)
    : settings_(settings), volume_m3_(volume_m3.begin(), volume_m3.end()), swept_m3_(swept_m3) {
  require_within("window_cycles", settings.window_cycles, 2.0, 500.0, "cycles");
  require_within("steady_cycles", settings.steady_cycles, 0.0, 1e4, "cycles");
  require_in(above(0.0, 100.0), "cov_limit_percent", settings.cov_limit_percent, "%");
  const auto m = static_cast<std::size_t>(settings.window_cycles);
  pressure_bar_.resize(m * volume_m3_.size());
  soc_cad_.resize(m);
  imep_bar_.resize(m);
  points_.resize(m * point_numbers);
  sorted_.resize(m);
}

bool CycleWindow::same_point(const PointNumbers& now, const engine::OperatingPoint& point) const noexcept {
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (differs(now[i], reference_[i])) return false;
  }
  return !differs(point.burn_duration_cad, optionals_.burn_duration_cad) &&
         !differs(point.trapped_mass_g, optionals_.trapped_mass_g) &&
         !differs(point.ivc_temperature_k, optionals_.ivc_temperature_k);
}

double CycleWindow::imep_bar(std::span<const double> pressure_bar) const noexcept {
  double work = 0.0;
  for (std::size_t k = 0; k + 1 < volume_m3_.size(); ++k)
    work += 0.5 * (pressure_bar[k] + pressure_bar[k + 1]) * (volume_m3_[k + 1] - volume_m3_[k]);
  return work / swept_m3_;
}

bool CycleWindow::looks_misfired(double imep_bar) const noexcept {
  if (imep_bar <= 0.0) return true;
  if (held_ < median_cycles) return false;
  const auto m = static_cast<std::int64_t>(imep_bar_.size());
  for (std::int64_t back = 1; back <= held_; ++back)
    sorted_[static_cast<std::size_t>(back - 1)] = imep_bar_[static_cast<std::size_t>((next_ + m - back) % m)];
  const auto middle = sorted_.begin() + held_ / 2;
  std::nth_element(sorted_.begin(), middle, sorted_.begin() + held_);
  return imep_bar < 0.5 * *middle;
}

CalibrationStatus CycleWindow::offer(std::span<const double> pressure_bar, const engine::OperatingPoint& point,
                                     double soc_cad, bool misfire) noexcept {
  if (pressure_bar.size() != volume_m3_.size()) return CalibrationStatus::wrong_size;
  const bool finite = std::all_of(pressure_bar.begin(), pressure_bar.end(), [](double p) { return std::isfinite(p); });
  if (!finite || !usable(point) || !(soc_cad > -180.0 && soc_cad < 180.0)) return CalibrationStatus::unusable;
  PointNumbers now{};
  const auto fields = engine::operating_point_fields<double>();
  for (std::size_t i = 0; i < now.size(); ++i)
    now[i] = fields[i].in(point);
  if (!has_point_ || !same_point(now, point)) {
    if (has_point_) {
      steady_left_ = settings_.steady_cycles;
      ++points_seen_;
    }
    held_ = 0;
    has_point_ = true;
    reference_ = now;
    optionals_ = point;
  }
  if (steady_left_ > 0) {
    --steady_left_;
    reference_ = now;
    return CalibrationStatus::unsteady;
  }
  if (misfire) return CalibrationStatus::misfire;
  if (is_saturated(pressure_bar)) return CalibrationStatus::saturated;
  const double imep = imep_bar(pressure_bar);
  if (point.fuel_mg > 0.0 && looks_misfired(imep)) return CalibrationStatus::misfire;
  const auto at = static_cast<std::size_t>(next_);
  std::copy(pressure_bar.begin(), pressure_bar.end(),
            pressure_bar_.begin() + static_cast<std::ptrdiff_t>(at * volume_m3_.size()));
  soc_cad_[at] = soc_cad;
  imep_bar_[at] = imep;
  std::copy(now.begin(), now.end(), points_.begin() + static_cast<std::ptrdiff_t>(at * point_numbers));
  const auto m = static_cast<std::int64_t>(imep_bar_.size());
  next_ = (next_ + 1) % m;
  held_ = std::min(held_ + 1, m);
  ++accepted_;
  return CalibrationStatus::accepted;
}

void CycleWindow::drop_newest() noexcept {
  if (held_ == 0) return;
  const auto m = static_cast<std::int64_t>(imep_bar_.size());
  next_ = (next_ + m - 1) % m;
  --held_;
  --accepted_;
}

double CycleWindow::cov_percent() const noexcept {
  if (held_ < 2 || !(reference_[1] > 0.0)) return 0.0;
  const auto m = static_cast<std::int64_t>(imep_bar_.size());
  double mean = 0.0, squares = 0.0;
  const auto at = [&](std::int64_t back) { return imep_bar_[static_cast<std::size_t>((next_ + m - back) % m)]; };
  for (std::int64_t back = 1; back <= held_; ++back)
    mean += at(back) / static_cast<double>(held_);
  for (std::int64_t back = 1; back <= held_; ++back)
    squares += (at(back) - mean) * (at(back) - mean);
  return percent * std::sqrt(squares / static_cast<double>(held_ - 1)) / std::abs(mean);
}

engine::OperatingPoint CycleWindow::point_of(const PointNumbers& numbers) const noexcept {
  engine::OperatingPoint point = optionals_;
  const auto fields = engine::operating_point_fields<double>();
  for (std::size_t i = 0; i < numbers.size(); ++i)
    fields[i].in(point) = numbers[i];
  return point;
}

CalibrationConditions CycleWindow::mean(std::span<double> pressure_bar) const noexcept {
  const auto m = static_cast<std::int64_t>(imep_bar_.size());
  const double share = 1.0 / static_cast<double>(std::max<std::int64_t>(held_, 1));
  CalibrationConditions out;
  PointNumbers numbers{};
  std::fill(pressure_bar.begin(), pressure_bar.end(), 0.0);
  for (std::int64_t back = 1; back <= held_; ++back) {
    const auto at = static_cast<std::size_t>((next_ + m - back) % m);
    for (std::size_t k = 0; k < pressure_bar.size(); ++k)
      pressure_bar[k] += share * pressure_bar_[at * pressure_bar.size() + k];
    for (std::size_t i = 0; i < numbers.size(); ++i)
      numbers[i] += share * points_[at * point_numbers + i];
    out.soc_cad += share * soc_cad_[at];
  }
  double squares = 0.0;
  for (std::int64_t back = 1; back <= held_; ++back) {
    const double own = soc_cad_[static_cast<std::size_t>((next_ + m - back) % m)] - out.soc_cad;
    squares += share * own * own;
  }
  out.soc_sd_cad = squares > least_variance ? std::sqrt(squares) : 0.0;
  out.point = point_of(numbers);
  return out;
}

CalibrationConditions CycleWindow::newest(std::span<double> pressure_bar) const noexcept {
  const auto m = static_cast<std::int64_t>(imep_bar_.size());
  const auto at = static_cast<std::size_t>((next_ + m - 1) % m);
  CalibrationConditions out;
  PointNumbers numbers{};
  std::copy_n(pressure_bar_.begin() + static_cast<std::ptrdiff_t>(at * pressure_bar.size()), pressure_bar.size(),
              pressure_bar.begin());
  std::copy_n(points_.begin() + static_cast<std::ptrdiff_t>(at * point_numbers), numbers.size(), numbers.begin());
  out.soc_cad = soc_cad_[at];
  out.point = point_of(numbers);
  return out;
}

}  // namespace mgdd::guide
