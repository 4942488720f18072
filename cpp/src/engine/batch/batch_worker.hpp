// One thread's share of a batch: takes cases one by one and runs them when a block is full or the next case needs
// other tables. T is double, or Dual<1> for the derivatives along one input. Offline code: it allocates.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "case_reader.hpp"
#include "mgdd/engine/batch/batch.hpp"
#include "mgdd/engine/batch/cycle_lanes.hpp"
#include "shared_point.hpp"

namespace mgdd::engine {

/// Where the results go: a column for each output.
struct BatchOutput {
  std::span<const IndicatorMember> members;
  std::span<double* const> columns;
  std::vector<std::size_t> fields;  ///< places of the members in `indicator_fields()`
  bool burn_angles = false;

  BatchOutput(std::span<const IndicatorMember> m, std::span<double* const> c) noexcept
      : members(m), columns(c), burn_angles(std::ranges::any_of(m, [](IndicatorMember member) {
          return member == &Indicators<double>::ca10_cad || member == &Indicators<double>::ca50_cad ||
                 member == &Indicators<double>::ca90_cad;
        })) {
    constexpr auto known = indicator_fields<double>();
    for (const IndicatorMember member : m) {
      const auto found = std::ranges::find(known, member, &IndicatorField<double>::member);
      fields.push_back(static_cast<std::size_t>(found - known.begin()));
    }
  }
  /// Column by column: the same place of many columns often shares one set of the cache.
  void write(const std::array<std::size_t, block_lanes>& rows, std::size_t count,
             const IndicatorLanes& indicators) const noexcept {
    for (std::size_t i = 0; i < fields.size(); ++i) {
      for (std::size_t l = 0; l < count; ++l)
        columns[i][rows[l]] = indicators.get(l, fields[i]);
    }
  }
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
  void run(std::size_t row) {
    changes_ = reader_.read(row, row_, plain_);
    row_ = row;
    if (changes_ >= BatchColumn::Changes::point) shared_known_ = false;
    if (changes_ >= BatchColumn::Changes::cylinder) prepare_model();
    if (form_ == BatchForm::single) return run_alone(row);
    if constexpr (plain) {
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
    }
    if (model_ && model_->cylinder().geometry.ivc_cad == now.ivc_cad &&
        model_->cylinder().geometry.evo_cad == now.evo_cad) {
      model_->set_cylinder(plain_.cylinder);
    } else {
      model_.emplace(plain_.cylinder, crank_grid(plain_.cylinder, settings_.step_cad), settings_.integrator);
      if (form_ == BatchForm::single) work_.emplace(model_->make_workspace());
    }
    lanes_.use(*model_);
  }

  void run_alone(std::size_t row) {
    if constexpr (plain) {
      const Charge<double> charge = model_->charge(plain_.point);
      model_->run(charge, plain_.soc_cad, *work_);
      if (model_->first_unphysical(*work_) < model_->angles_cad().size()) return fail(row);
      output_.write(row, model_->indicators(charge, plain_.soc_cad, *work_));
    }
  }

  void add(std::size_t row, const CycleInputs<T>& inputs) {
    const Charge<T> charge = charge_at(inputs);
    if constexpr (plain) {
      if (form_ == BatchForm::shared) {
        if (!(charge.fuel_heat_j > 0.0)) return left_over_.push_back(row);
        share(charge, inputs.cylinder.wall_heat);
      }
    }
    lanes_.set_charge(filled_, charge, inputs.cylinder.wall_heat);
    lanes_.set_burn(filled_, inputs.cylinder.burn, inputs.soc_cad);
    rows_[filled_] = row;
    if (++filled_ == block_lanes) flush();
  }

  /// Its powers are worth keeping while only the timing changes.
  Charge<T> charge_at(const CycleInputs<T>& inputs) {
    if constexpr (plain) {
      if (changes_ <= BatchColumn::Changes::timing) return charge_;
    }
    return charge_ = charge_of(inputs.cylinder, lanes_.geometry(), inputs.point);
  }

  void flush() {
    if (filled_ == 0) return;
    if (form_ == BatchForm::shared) {
      if constexpr (plain) run_shared();
    } else {
      lanes_.run(filled_, settings_.set);
      if constexpr (plain) {
        lanes_.indicators(indicators_, output_.burn_angles, settings_.set);
        output_.write(rows_, filled_, indicators_);
      }
      for (std::size_t l = 0; l < filled_; ++l) {
        if (!lanes_.physical(l)) {
          fail(rows_[l]);
        } else if constexpr (!plain) {
          output_.write(rows_[l], lanes_.indicators(l, output_.burn_angles));
        }
      }
    }
    filled_ = 0;
  }

  /// Sees to it that the shared tables are those of this case: all lanes of a block have one operating point.
  void share(const Charge<double>& charge, const WallHeatParameters<double>& wall) {
    if (shared_known_) return;
    flush();
    lanes_.set_charge(0, charge, wall);
    shared_.prepare(CycleTables(*model_), lanes_.block(), wall.wall_heat_model, settings_.set);
    shared_known_ = true;
  }

  void run_shared() {
    lanes_.fill_up(filled_);
    const CycleTables tables(*model_);
    CycleBlock<double>& block = lanes_.block();
    HeatWindow window = lanes_.heat_window();
    lanes_.forget_window();
    // The second sum: the neighbour of a peak that stands at the first sample of the tail.
    window.to = std::min(std::max(window.to, shared_.tail_from()) + 1, tables.n - 1);
    TailLanes& tails = tails_;
    for (std::size_t l = 0; l < block_lanes; ++l) {
      tails.from[l] = std::max(lanes_.heated_to(l < filled_ ? l : 0), shared_.tail_from());
      block.stop.set(l, static_cast<double>(tails.from[l]));
    }
    shared_.begin(window.from, block);
    integrate_window(tables, lanes_.shape(), lanes_.wall_model(), window, block, lanes_.trace(), settings_.set);
    const Lane<double>* trace = lanes_.trace();
    for (std::size_t l = 0; l < block_lanes; ++l)
      tails.pressure.set(l, trace[tails.from[l]].value[l]);
    shared_.find(tails, settings_.set);
    for (std::size_t l = 0; l < block_lanes; ++l) {
      const auto pressure = [&](std::size_t k) {
        return k < window.from ? shared_.motored(k).pressure : trace[k].value[l];
      };
      indicators_.set(l,
                      lanes_.figures(l, block.work.get(l) + tails.work.get(l), block.loss.get(l) + tails.loss.get(l),
                                     tails.last_pressure.get(l), pressure),
                      lanes_.charge(l));
    }
    lanes_.finish(indicators_, output_.burn_angles, settings_.set);
    output_.write(rows_, filled_, indicators_);
    for (std::size_t l = 0; l < filled_; ++l) {
      if (!tails.known[l]) left_over_.push_back(rows_[l]);
    }
  }

  void fail(std::size_t row) noexcept {
    output_.write(row, Indicators<double>{});
    ++failed_;
  }

  static constexpr bool plain = std::is_same_v<T, double>;
  const CaseReader& reader_;
  const BatchSettings& settings_;
  const BatchOutput& output_;
  std::string along_;
  CycleInputs<double> plain_;
  BatchForm form_ = BatchForm::lanes;
  std::optional<CycleModel<double>> model_;
  std::optional<CycleWorkspace<double>> work_;  // one by one
  CycleLanes<T> lanes_;
  IndicatorLanes indicators_;
  Charge<T> charge_{};
  std::size_t row_ = CaseReader::no_row;  // that stands in the inputs
  BatchColumn::Changes changes_ = BatchColumn::Changes::grid;
  std::array<std::size_t, block_lanes> rows_{};
  std::size_t filled_ = 0, failed_ = 0;
  SharedPoint shared_{};
  TailLanes tails_{};
  bool shared_known_ = false;
  std::vector<std::size_t> left_over_;  // of the shared form: to be run in lanes
};

}  // namespace mgdd::engine
