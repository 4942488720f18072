#include "mgdd/engine/batch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "case_reader.hpp"
#include "cycle_block.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/parallel.hpp"
#include "shared_point.hpp"

namespace mgdd::engine {
namespace {

constexpr std::size_t job_size = 4096;  ///< cases that one thread takes at a time
constexpr double shared_pays = 30.0;    ///< cases of an operating point that make up for its tables

constexpr std::pair<BatchForm, std::string_view> form_names[] = {{BatchForm::automatic, "automatic"},
                                                                 {BatchForm::single, "single"},
                                                                 {BatchForm::lanes, "lanes"},
                                                                 {BatchForm::shared, "shared"}};

/// Where the results go.
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
};

/// One thread's share: takes cases one by one, runs them when a block is full or the next one needs other tables.
class BatchWorker {
 public:
  BatchWorker(const CaseReader& reader, const BatchSettings& settings, const BatchOutput& output)
      : reader_(reader), settings_(settings), output_(output), inputs_(reader.start()) {}

  void run(std::size_t first, std::size_t last) {
    form_ = settings_.form;
    for (std::size_t row = first; row < last; ++row)
      run(row);
    flush();
    form_ = BatchForm::lanes;
    for (const std::size_t row : left_over_)
      run(row);
    flush();
    left_over_.clear();
  }
  std::size_t failed() const noexcept { return failed_; }

 private:
  struct Member {
    std::size_t row = 0;
    Charge<double> charge{};
    std::optional<Burn<double>> burn{};
  };

  void run(std::size_t row) {
    reader_.read(row, inputs_);
    prepare_model();
    form_ == BatchForm::single ? run_alone(row) : add(row);
  }

  void prepare_model() {
    const GeometryParameters<double>& now = inputs_.cylinder.geometry;
    if (model_) {
      const Cylinder& old = model_->cylinder();
      if (old.geometry == now && old.gas.gamma == inputs_.cylinder.gas.gamma) {
        if (form_ == BatchForm::single) model_->set_cylinder(inputs_.cylinder);
        return;
      }
      flush();
      shared_known_ = false;
      if (old.geometry.ivc_cad == now.ivc_cad && old.geometry.evo_cad == now.evo_cad) {
        model_->set_cylinder(inputs_.cylinder);
        return;
      }
    }
    model_.emplace(inputs_.cylinder, crank_grid(inputs_.cylinder, settings_.step_cad), settings_.integrator);
    trace_.resize(block_lanes * model_->angles_cad().size());
    if (form_ == BatchForm::single) work_.emplace(model_->make_workspace());
  }

  void run_alone(std::size_t row) {
    const Charge<double> charge = model_->charge(inputs_.point);
    model_->run(charge, inputs_.soc_cad, *work_);
    if (model_->first_unphysical(*work_) < model_->angles_cad().size()) return fail(row);
    output_.write(row, model_->indicators(charge, inputs_.soc_cad, *work_));
  }

  void add(std::size_t row) {
    const Charge<double> charge = charge_of(inputs_.cylinder, model_->geometry(), inputs_.point);
    const bool burns = charge.fuel_heat_j > 0.0;
    if (form_ == BatchForm::shared) {
      if (!burns) return left_over_.push_back(row);
      share(charge);
    } else {
      load(filled_, charge);
    }
    members_[filled_] = {row, charge, {}};
    if (burns) {
      members_[filled_].burn.emplace(inputs_.cylinder.burn, inputs_.soc_cad, charge.burn_duration_cad);
      load(filled_, *members_[filled_].burn, charge.fuel_heat_j);
    } else {
      load_motored(filled_);
    }
    if (++filled_ == block_lanes) flush();
  }

  /// Sees to it that the shared tables are those of this case: all lanes of a block have one operating point.
  void share(const Charge<double>& charge) {
    const auto same = [&](const Charge<double>& a) {
      return a.pressure_pa == charge.pressure_pa && a.gas_j_per_k == charge.gas_j_per_k &&
             a.speed_rpm == charge.speed_rpm;
    };
    if (shared_known_ && same(shared_charge_) && inputs_.cylinder.wall_heat == shared_wall_) return;
    flush();
    for (std::size_t l = 0; l < block_lanes; ++l)
      load(l, charge);
    shared_.prepare(CycleTables(*model_), block_, inputs_.cylinder.wall_heat.wall_heat_model, settings_.set);
    shared_charge_ = charge;
    shared_wall_ = inputs_.cylinder.wall_heat;
    shared_known_ = true;
  }

  void load(std::size_t l, const Charge<double>& charge) noexcept {
    const auto wall = WallHeat<double>(inputs_.cylinder.wall_heat, model_->geometry(), charge.pressure_pa,
                                       charge.gas_j_per_k, charge.speed_rpm)
                          .constants();
    block_.pressure[l] = charge.pressure_pa;
    block_.per_gas[l] = 1.0 / charge.gas_j_per_k;
    block_.scale[l] = wall.scale;
    block_.wall_k[l] = wall.wall_k;
    block_.still[l] = wall.still;
    block_.still_power[l] = wall.still_power;
    block_.burning[l] = wall.burning;
    block_.per_pa[l] = wall.burning_per_pa;
  }

  void load(std::size_t l, const Burn<double>& burn, double heat_j) noexcept {
    const std::span<const double> angles = model_->angles_cad();
    const auto begin = angles.begin();
    const double start = burn.start_cad();
    const auto first = std::lower_bound(begin, angles.end(), start) - begin;
    const auto end = std::lower_bound(begin, angles.end(), burn.end_cad()) - begin;
    block_.first_burning[l] = static_cast<double>(first);
    const auto heated = static_cast<std::size_t>(std::max<std::ptrdiff_t>(first, 1)) - 1;
    window_.from = std::min(window_.from, heated);
    const std::size_t last = angles.size() - 1, heated_to = std::min(static_cast<std::size_t>(end), last);
    window_.to = std::max(window_.to, heated_to);
    block_.stop[l] = static_cast<double>(std::max(heated_to, shared_.tail_from()));
    block_.heat[l] = heat_j;
    block_.start[l] = burn.soc_cad;
    block_.per_duration[l] = 1.0 / burn.duration_cad;
    block_.a[l] = burn.a;
    block_.exponent[l] = burn.m + 1.0;
    block_.per_complete[l] = 1.0 / burn.complete;
    block_.second_share[l] = burn.second_fraction;
    block_.second_start[l] = burn.soc_cad + burn.second_delay_cad;
    block_.second_per_duration[l] = 1.0 / burn.second_duration_cad;
    block_.second_exponent[l] = burn.second_m + 1.0;
  }

  void load_motored(std::size_t l) noexcept {
    block_.first_burning[l] = static_cast<double>(model_->angles_cad().size());
    block_.heat[l] = 0.0;
    for (Lane* law : {&block_.start, &block_.second_start, &block_.second_share})
      (*law)[l] = 0.0;
    for (Lane* law : {&block_.per_duration, &block_.a, &block_.exponent, &block_.per_complete,
                      &block_.second_per_duration, &block_.second_exponent})
      (*law)[l] = 1.0;
  }

  void flush() {
    if (filled_ == 0) return;
    for (std::size_t l = filled_; l < block_lanes; ++l)
      repeat_first(l);
    const CycleTables tables(*model_);
    const std::size_t last = tables.n - 1;
    HeatWindow window{std::min(window_.from, last), std::min(window_.to, last)};
    window.to = std::max(window.to, window.from);
    const BurnShape shape = inputs_.cylinder.burn.burn_shape;
    const WallHeatModel wall = inputs_.cylinder.wall_heat.wall_heat_model;
    if (form_ == BatchForm::shared) {
      window.to = std::min(std::max(window.to, shared_.tail_from()) + 1, last);  // with the neighbour of a peak there
      shared_.begin(window.from, block_);
      integrate_window(tables, shape, wall, window, block_, trace_.data(), settings_.set);
    } else {
      block_.begin(tables);
      integrate(tables, shape, wall, window, block_, trace_.data(), settings_.set);
    }
    for (std::size_t l = 0; l < filled_; ++l)
      form_ == BatchForm::shared ? finish_shared(l, window) : finish(l);
    filled_ = 0;
    window_ = {std::numeric_limits<std::size_t>::max(), 0};
  }

  void repeat_first(std::size_t l) noexcept {
    for (Lane* lane : {&block_.pressure,
                       &block_.per_gas,
                       &block_.scale,
                       &block_.wall_k,
                       &block_.still,
                       &block_.still_power,
                       &block_.burning,
                       &block_.per_pa,
                       &block_.first_burning,
                       &block_.heat,
                       &block_.start,
                       &block_.per_duration,
                       &block_.a,
                       &block_.exponent,
                       &block_.per_complete,
                       &block_.second_share,
                       &block_.second_start,
                       &block_.second_per_duration,
                       &block_.second_exponent,
                       &block_.stop})
      (*lane)[l] = (*lane)[0];
  }

  void finish(std::size_t l) noexcept {
    report(l, block_.work[l], block_.loss[l], block_.pressure[l],
           [this, l](std::size_t k) { return trace_[k * block_lanes + l]; });
  }

  void finish_shared(std::size_t l, HeatWindow window) {
    const auto end = static_cast<std::size_t>(block_.stop[l]);
    const Tail tail = shared_.tail(end, trace_[end * block_lanes + l]);
    if (!tail.known) return left_over_.push_back(members_[l].row);
    report(l, block_.work[l] + tail.work, block_.loss[l] + tail.loss, tail.last_pressure,
           [&](std::size_t k) { return k < window.from ? shared_.motored(k).pressure : trace_[k * block_lanes + l]; });
  }

  template <class Pressure>
  void report(std::size_t l, double twice_work, double loss, double last_pressure, const Pressure& pressure) noexcept {
    const Member& member = members_[l];
    // A pressure that was not positive made the root, and all that follows, NaN.
    if (!(std::isfinite(last_pressure) && last_pressure > 0.0)) return fail(member.row);
    TraceSums<double> sums;
    sums.work_closed_j = 0.5 * twice_work;
    sums.heat_loss_j = loss;
    sums.last_pressure_pa = last_pressure;
    sums.p_max_at = static_cast<std::size_t>(block_.p_at[l]);
    sums.t_max_at = static_cast<std::size_t>(block_.energy_at[l]);
    sums.dp_max_at = static_cast<std::size_t>(block_.rise_at[l]);
    Indicators<double> indicators = indicators_of<double>(model_->cylinder().gas, model_->geometry(), member.charge,
                                                          model_->angles_cad(), model_->volume_m3(), sums, pressure);
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
  CycleInputs<double> inputs_;
  BatchForm form_ = BatchForm::lanes;
  std::optional<CycleModel<double>> model_;
  std::optional<CycleWorkspace<double>> work_;  // one by one
  CycleBlock block_{};
  HeatWindow window_{std::numeric_limits<std::size_t>::max(), 0};
  std::vector<double> trace_;
  std::array<Member, block_lanes> members_{};
  SharedPoint shared_{};
  Charge<double> shared_charge_{};
  WallHeatParameters<double> shared_wall_{};
  bool shared_known_ = false;
  std::vector<std::size_t> left_over_;  // of the shared form: to be run in lanes
  std::size_t filled_ = 0, failed_ = 0;
};

}  // namespace

std::string_view to_string(BatchForm form) noexcept {
  return name_of<BatchForm>(form_names, form);
}
BatchForm parse_batch_form(std::string_view name) {
  return parse_name<BatchForm>(form_names, "form", name);
}

void validate(const BatchCases& cases) {
  CaseReader(cases).require_valid();
}

IndicatorMember parse_indicator(std::string_view name) {
  std::string valid;
  for (const auto& field : indicator_fields<double>()) {
    if (field.name == name) return field.member;
    valid.append(valid.empty() ? "" : ", ").append(field.name);
  }
  throw ParameterError("outputs", name, "must be one of " + valid);
}

BatchForm form_of(const BatchCases& cases, BatchForm wanted) {
  if (cases.cylinder.gas.gamma_model != GammaModel::constant) return BatchForm::single;
  if (wanted != BatchForm::automatic) return wanted;
  const CaseReader reader(cases);
  return reader.cases_per_point() >= shared_pays ? BatchForm::shared : BatchForm::lanes;
}

std::size_t simulate_batch(const BatchCases& cases, const BatchSettings& settings,
                           std::span<const IndicatorMember> outputs, std::span<double* const> columns) {
  const CaseReader reader(cases);
  reader.require_valid();
  static_cast<void>(crank_grid(cases.cylinder, settings.step_cad));  // refuses a step before any work
  BatchSettings known = settings;
  known.form = form_of(cases, settings.form);
  const BatchOutput output(outputs, columns);
  const std::size_t n = cases.size(), jobs = (n + job_size - 1) / job_size;
  std::vector<BatchWorker> workers(thread_count(jobs, settings.threads), BatchWorker(reader, known, output));
  static_cast<void>(parallel_for(jobs, settings.threads, [&](std::size_t job, std::size_t worker, StopRequest&) {
    workers[worker].run(job * job_size, std::min(n, (job + 1) * job_size));
  }));
  std::size_t failed = 0;
  for (const BatchWorker& worker : workers)
    failed += worker.failed();
  return failed;
}

}  // namespace mgdd::engine
