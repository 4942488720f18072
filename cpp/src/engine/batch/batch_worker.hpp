// One thread's share of a batch: takes cases one by one and runs them when a block is full or the next case needs
// other tables. T is double, or Dual<1> for the derivatives along one input. Offline code: it allocates.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "case_reader.hpp"
#include "cycle_block.hpp"
#include "mgdd/engine/batch.hpp"
#include "mgdd/engine/burn.hpp"
#include "mgdd/engine/cycle_indicators.hpp"
#include "mgdd/engine/wall_heat.hpp"
#include "shared_point.hpp"

namespace mgdd::engine {

/// Where the results go: a column for each output.
struct BatchOutput {
  std::span<const IndicatorMember> members;
  std::span<double* const> columns;
  bool burn_angles = false;

  BatchOutput(std::span<const IndicatorMember> m, std::span<double* const> c) noexcept
      : members(m), columns(c), burn_angles(std::ranges::any_of(m, [](IndicatorMember member) {
          return member == &Indicators<double>::ca10_cad || member == &Indicators<double>::ca50_cad ||
                 member == &Indicators<double>::ca90_cad;
        })) {}
  void write(std::size_t row, const Indicators<double>& indicators) const noexcept {
    for (std::size_t i = 0; i < members.size(); ++i)
      columns[i][row] = indicators.*members[i];
  }
  void write(std::size_t row, const Indicators<Dual<1>>& indicators) const noexcept {
    write(row, derivatives(indicators, 0));
  }
};

template <class T>
class BatchWorker {
 public:
  /// `along` is the input of the derivatives; empty for plain numbers.
  BatchWorker(const CaseReader& reader, const BatchSettings& settings, const BatchOutput& output,
              std::string along = {})
      : reader_(reader), settings_(settings), output_(output), along_(std::move(along)), plain_(reader.start()) {}

  void run(std::size_t first, std::size_t last) {
    form_ = settings_.form;
    for (std::size_t row = first; row < last; ++row)
      run(row);
    flush();
    if (left_over_.empty()) return;
    form_ = BatchForm::lanes;
    shared_known_ = false;  // its constants leave the block
    for (const std::size_t row : left_over_)
      run(row);
    flush();
    left_over_.clear();
  }
  std::size_t failed() const noexcept { return failed_; }

 private:
  struct Member {
    std::size_t row = 0;
    Charge<T> charge{};
    std::optional<Burn<T>> burn{};
  };

  void run(std::size_t row) {
    reader_.read(row, plain_);
    prepare_model();
    if (form_ == BatchForm::single) return run_alone(row);
    if constexpr (std::is_same_v<T, double>) {
      add(row, plain_);
    } else {
      CycleInputs<T> inputs{lift<T>(plain_.cylinder), lift<T>(plain_.point), plain_.soc_cad};
      T& variable = input(inputs, along_);
      variable = T::seeded(value_of(variable), 0);
      add(row, inputs);
    }
  }

  void prepare_model() {
    const GeometryParameters<double>& now = plain_.cylinder.geometry;
    if (model_) {
      const Cylinder& old = model_->cylinder();
      if (old.geometry == now && old.gas.gamma == plain_.cylinder.gas.gamma) {
        if (form_ == BatchForm::single) model_->set_cylinder(plain_.cylinder);
        return;
      }
      flush();
      shared_known_ = false;
      if (old.geometry.ivc_cad == now.ivc_cad && old.geometry.evo_cad == now.evo_cad) {
        model_->set_cylinder(plain_.cylinder);
        return lift_model();
      }
    }
    model_.emplace(plain_.cylinder, crank_grid(plain_.cylinder, settings_.step_cad), settings_.integrator);
    trace_.resize(model_->angles_cad().size());
    if (form_ == BatchForm::single) work_.emplace(model_->make_workspace());
    lift_model();
  }
  void lift_model() {
    const BasicCylinder<T> cylinder = lift<T>(model_->cylinder());
    gas_ = cylinder.gas;
    geometry_.emplace(cylinder.geometry);
    volume_.assign(model_->volume_m3().begin(), model_->volume_m3().end());
  }

  void run_alone(std::size_t row) {
    if constexpr (std::is_same_v<T, double>) {
      const Charge<double> charge = model_->charge(plain_.point);
      model_->run(charge, plain_.soc_cad, *work_);
      if (model_->first_unphysical(*work_) < model_->angles_cad().size()) return fail(row);
      output_.write(row, model_->indicators(charge, plain_.soc_cad, *work_));
    }
  }

  void add(std::size_t row, const CycleInputs<T>& inputs) {
    const Charge<T> charge = charge_of(inputs.cylinder, *geometry_, inputs.point);
    const bool burns = value_of(charge.fuel_heat_j) > 0.0;
    if (form_ == BatchForm::shared) {
      if (!burns) return left_over_.push_back(row);
      share(charge, inputs.cylinder.wall_heat);
    } else {
      load(filled_, charge, inputs.cylinder.wall_heat);
    }
    members_[filled_] = {row, charge, {}};
    if (burns) {
      members_[filled_].burn.emplace(inputs.cylinder.burn, inputs.soc_cad, charge.burn_duration_cad);
      load(filled_, *members_[filled_].burn, charge.fuel_heat_j);
    } else {
      load_motored(filled_);
    }
    if (++filled_ == block_lanes) flush();
  }

  /// Sees to it that the shared tables are those of this case: all lanes of a block have one operating point.
  void share(const Charge<T>& charge, const WallHeatParameters<T>& wall) {
    const auto same = [&](const Charge<T>& a) {
      return a.pressure_pa == charge.pressure_pa && a.gas_j_per_k == charge.gas_j_per_k &&
             a.speed_rpm == charge.speed_rpm;
    };
    if (shared_known_ && same(shared_charge_) && wall == shared_wall_) return;
    flush();
    for (std::size_t l = 0; l < block_lanes; ++l)
      load(l, charge, wall);
    if constexpr (std::is_same_v<T, double>)
      shared_.prepare(CycleTables(*model_), block_, wall.wall_heat_model, settings_.set);
    shared_charge_ = charge;
    shared_wall_ = wall;
    shared_known_ = true;
  }

  void load(std::size_t l, const Charge<T>& charge, const WallHeatParameters<T>& parameters) noexcept {
    const auto wall =
        WallHeat<T>(parameters, *geometry_, charge.pressure_pa, charge.gas_j_per_k, charge.speed_rpm).constants();
    block_.pressure.set(l, charge.pressure_pa);
    block_.per_gas.set(l, 1.0 / charge.gas_j_per_k);
    block_.scale.set(l, wall.scale);
    block_.wall_k.set(l, wall.wall_k);
    block_.still.set(l, wall.still);
    block_.still_power.set(l, wall.still_power);
    block_.burning.set(l, wall.burning);
    block_.per_pa.set(l, wall.burning_per_pa);
  }

  void load(std::size_t l, const Burn<T>& burn, const T& heat_j) noexcept {
    const std::span<const double> angles = model_->angles_cad();
    const auto begin = angles.begin();
    const auto first = std::lower_bound(begin, angles.end(), burn.start_cad()) - begin;
    const auto end = std::lower_bound(begin, angles.end(), burn.end_cad()) - begin;
    const auto heated_from = static_cast<std::size_t>(std::max<std::ptrdiff_t>(first, 1)) - 1;
    const std::size_t heated_to = std::min(static_cast<std::size_t>(end), angles.size() - 1);
    window_.from = std::min(window_.from, heated_from);
    window_.to = std::max(window_.to, heated_to);
    block_.first_burning.set(l, static_cast<double>(first));
    block_.stop.set(l, static_cast<double>(std::max(heated_to, shared_.tail_from())));
    block_.heat.set(l, heat_j);
    block_.start.set(l, burn.soc_cad);
    block_.per_duration.set(l, 1.0 / burn.duration_cad);
    block_.a.set(l, burn.a);
    block_.exponent.set(l, burn.m + 1.0);
    block_.per_complete.set(l, 1.0 / burn.complete);
    block_.second_share.set(l, burn.second_fraction);
    block_.second_start.set(l, burn.soc_cad + burn.second_delay_cad);
    block_.second_per_duration.set(l, 1.0 / burn.second_duration_cad);
    block_.second_exponent.set(l, burn.second_m + 1.0);
  }

  void load_motored(std::size_t l) noexcept {
    block_.first_burning.set(l, static_cast<double>(model_->angles_cad().size()));
    for (Lane<T>* none : {&block_.heat, &block_.start, &block_.second_start, &block_.second_share})
      none->set(l, T(0.0));
    for (Lane<T>* one : {&block_.per_duration, &block_.a, &block_.exponent, &block_.per_complete,
                         &block_.second_per_duration, &block_.second_exponent})
      one->set(l, T(1.0));
  }

  void flush() {
    if (filled_ == 0) return;
    for (std::size_t l = filled_; l < block_lanes; ++l)
      block_.copy_lane(0, l);
    const CycleTables tables(*model_);
    const std::size_t last = tables.n - 1;
    HeatWindow window{std::min(window_.from, last), std::min(window_.to, last)};
    window.to = std::max(window.to, window.from);
    const BurnShape shape = plain_.cylinder.burn.burn_shape;
    const WallHeatModel wall = plain_.cylinder.wall_heat.wall_heat_model;
    bool alone = true;
    if constexpr (std::is_same_v<T, double>) {
      if (form_ == BatchForm::shared) {
        alone = false;
        window.to = std::min(std::max(window.to, shared_.tail_from()) + 1, last);  // and the neighbour of a peak there
        shared_.begin(window.from, block_);
        integrate_window(tables, shape, wall, window, block_, trace_.data(), settings_.set);
        for (std::size_t l = 0; l < filled_; ++l)
          finish_shared(l, window);
      }
    }
    if (alone) {
      block_.begin(tables);
      integrate(tables, shape, wall, window, block_, trace_.data(), settings_.set);
      for (std::size_t l = 0; l < filled_; ++l)
        finish(l, block_.work.get(l), block_.loss.get(l), block_.pressure.get(l),
               [this, l](std::size_t k) { return trace_[k].get(l); });
    }
    filled_ = 0;
    window_ = {std::numeric_limits<std::size_t>::max(), 0};
  }

  void finish_shared(std::size_t l, HeatWindow window) {
    const auto end = static_cast<std::size_t>(block_.stop.get(l));
    const Tail tail = shared_.tail(end, trace_[end].value[l]);
    if (!tail.known) return left_over_.push_back(members_[l].row);
    finish(l, block_.work.get(l) + tail.work, block_.loss.get(l) + tail.loss, tail.last_pressure,
           [&](std::size_t k) { return k < window.from ? shared_.motored(k).pressure : trace_[k].value[l]; });
  }

  template <class Pressure>
  void finish(std::size_t l, const T& twice_work, const T& loss, const T& last_pressure,
              const Pressure& pressure) noexcept {
    const Member& member = members_[l];
    // A pressure that was not positive made the root, and all that follows, NaN.
    const double last = value_of(last_pressure);
    if (!(std::isfinite(last) && last > 0.0)) return fail(member.row);
    TraceSums<T> sums;
    sums.work_closed_j = 0.5 * twice_work;
    sums.heat_loss_j = loss;
    sums.last_pressure_pa = last_pressure;
    sums.p_max_at = static_cast<std::size_t>(block_.p_at.get(l));
    sums.t_max_at = static_cast<std::size_t>(block_.energy_at.get(l));
    sums.dp_max_at = static_cast<std::size_t>(block_.rise_at.get(l));
    Indicators<T> indicators = indicators_of<T>(gas_, *geometry_, member.charge, model_->angles_cad(),
                                                std::span<const T>(volume_), sums, pressure);
    if (member.burn && output_.burn_angles) {
      indicators.ca10_cad = member.burn->angle_of(0.1);
      indicators.ca50_cad = member.burn->angle_of(0.5);
      indicators.ca90_cad = member.burn->angle_of(0.9);
    }
    output_.write(member.row, indicators);
  }

  void fail(std::size_t row) noexcept {
    output_.write(row, Indicators<double>{});
    ++failed_;
  }

  const CaseReader& reader_;
  const BatchSettings& settings_;
  const BatchOutput& output_;
  std::string along_;
  CycleInputs<double> plain_;
  BatchForm form_ = BatchForm::lanes;
  std::optional<CycleModel<double>> model_;
  std::optional<CycleWorkspace<double>> work_;  // one by one
  GasParameters<T> gas_{};                      // of the model
  std::optional<Geometry<T>> geometry_;
  std::vector<T> volume_;
  CycleBlock<T> block_{};
  HeatWindow window_{std::numeric_limits<std::size_t>::max(), 0};
  std::vector<Lane<T>> trace_;
  std::array<Member, block_lanes> members_{};
  std::size_t filled_ = 0, failed_ = 0;
  SharedPoint shared_{};
  Charge<T> shared_charge_{};
  WallHeatParameters<T> shared_wall_{};
  bool shared_known_ = false;
  std::vector<std::size_t> left_over_;  // of the shared form: to be run in lanes
};

}  // namespace mgdd::engine
