#include "mgdd/optimize/laws/spsa.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double memory = 10.0;  // measurements behind the limits, half of them
constexpr double blocking_errors = 2.0;
constexpr int clamp_window = 6;             // measurements, at least, before a clamp is judged
constexpr double even_perturbation = 0.25;  // of the perturbation: what is applied unevenly by more has no bend
constexpr double perturbation_rate = 0.25;  // how fast the perturbation follows its target, per iteration
constexpr double second_order_gain = 3.0;
constexpr double own_perturbation = 1.5;   // in scales of the inputs
constexpr double spsa_unseen_bend = 0.38;  // |J''| c^2 over the noise: 0.051 for a perturbation of 1.5 and noise of 0.3

SpsaSettings checked(SpsaSettings s) {
  const bool second = s.form == SpsaForm::second_order;
  const Eigen::Index n = s.space.size();
  s.space = resolved(std::move(s.space));
  for (Inputs* values : {&s.gain, &s.step_max, &s.initial_hessian})
    *values = for_each_input(std::move(*values), n);
  if (second && s.gain.size() == 0) s.gain = Inputs::Constant(n, second_order_gain);
  if (second && s.initial_hessian.size() == 0 && s.curvature && *s.curvature != 0.0)
    s.initial_hessian = Inputs::Constant(n, -std::abs(*s.curvature));
  s.perturbation = or_scaled(std::move(s.perturbation), own_perturbation, s.space);
  validate_entries("perturbation", s.perturbation, n, 0.0, largest_reading);
  if (s.step_max.size() == 0) s.step_max = s.perturbation * (4.0 / 3.0);
  if (s.gain.size() > 0) validate_entries("gain", s.gain, n, 0.0, largest_reading);
  validate_entries("step_max", s.step_max, n, 0.0);
  s.step_max = within_rates(std::move(s.step_max), s.space);
  validate_curvature(s.curvature);
  validate(s.space, s.perturbation * (second ? 2.0 : 1.0));
  if (!(s.stability >= 0.0 && std::isfinite(s.stability))) {
    throw ParameterError("stability", s.stability, "must be >= 0 and finite");
  }
  for (const auto& [name, value] :
       {std::pair{"gain_exponent", s.gain_exponent}, std::pair{"perturbation_exponent", s.perturbation_exponent}}) {
    if (!(value >= 0.0 && value <= 1.0)) {
      throw ParameterError(name, value, "must lie in [0, 1]");
    }
  }
  if (s.schedule == GainSchedule::decreasing && !(s.gain_exponent - s.perturbation_exponent > 0.5)) {
    throw ParameterError("gain_exponent", s.gain_exponent,
                         "must exceed perturbation_exponent = " + text(s.perturbation_exponent) +
                             " by more than 0.5, or the noise does not average out");
  }
  if (s.averaging < 1 || s.averaging > 1000) {
    throw ParameterError("averaging", s.averaging, "must lie in [1, 1000]");
  }
  if (!(s.noise_sd >= 0.0 && std::isfinite(s.noise_sd))) {
    throw ParameterError("noise_sd", s.noise_sd, "must be >= 0 and finite");
  }
  if (s.initial_hessian.size() > 0) {
    validate_entries("initial_hessian", s.initial_hessian, n, -unlimited);
    for (const double value : s.initial_hessian) {
      if (!(value < 0.0)) throw ParameterError("initial_hessian", value, "must be < 0, as at a maximum");
    }
  }
  require_positive("hessian_prior", s.hessian_prior);
  if (!(s.limit_amplitude > 0.0 && s.limit_amplitude <= 1.0)) {
    throw ParameterError("limit_amplitude", s.limit_amplitude, "must be > 0 and <= 1");
  }
  return s;
}

}  // namespace

std::vector<std::string> SpsaSettings::advice() const {
  const bool second = form == SpsaForm::second_order;
  if (!second && !(curvature && gain.size() > 0)) return {};
  const double bend = second ? 1.0 : std::abs(*curvature);
  const double first = gain.size() > 0 ? gain.maxCoeff() : second_order_gain;
  const double now = schedule == GainSchedule::constant ? first : first / std::pow(1.0 + stability, gain_exponent);
  if (!(now * bend > 1.0)) return {};
  return {"gain: the first step factor a_0 |J''| = " + text(now * bend) +
          " is above 1, the bound beyond which every step overshoots; a gain of " + text(first / (now * bend)) +
          " meets it"};
}

Spsa::Spsa(SpsaSettings settings)
    : SeekerCore(checked(std::move(settings)), [](const SpsaSettings&) { return 2.0 * memory; }),
      first_(settings_.perturbation, spsa_unseen_bend,
             (settings_.form == SpsaForm::second_order ? settings_.initial_hessian : settings_.gain).size() == 0,
             settings_.curvature),
      candidate_(estimate_),
      gradient_(Inputs::Zero(estimate_.size())),
      sum_(gradient_),
      hessian_(InputMatrix::Zero(estimate_.size(), estimate_.size())),
      hessian_sum_(hessian_),
      metric_(metric_of(settings_.perturbation)),
      missed_(InputMatrix::Zero(estimate_.size(), 4)),
      measured_(4, 0.0) {
  if (settings_.initial_hessian.size() > 0) hessian_.diagonal() = settings_.initial_hessian;
}

int Spsa::per_gradient() const noexcept {
  return settings_.form == SpsaForm::second_order ? 4 : 2;
}

int Spsa::measurements_per_iteration() const noexcept {
  return per_gradient() * settings_.averaging + (settings_.blocking ? 1 : 0);
}

Inputs Spsa::gain() const noexcept {
  if (settings_.gain.size() > 0 || first_.open()) return settings_.gain;
  return first_.even_steps(1.0);
}

Inputs Spsa::gain_now() const noexcept {
  Inputs first = gain();
  if (settings_.schedule == GainSchedule::constant) return first;
  return first / std::pow(static_cast<double>(iteration_) + 1.0 + settings_.stability, settings_.gain_exponent);
}

// How far an input is applied from the estimate at most.
Inputs Spsa::widest() const noexcept {
  return settings_.perturbation * (settings_.form == SpsaForm::second_order ? 2.0 : 1.0);
}

Inputs Spsa::perturbation_now() const noexcept {
  if (settings_.schedule == GainSchedule::constant) return share_ * settings_.perturbation;
  return share_ * settings_.perturbation /
         std::pow(static_cast<double>(iteration_) + 1.0, settings_.perturbation_exponent);
}

// +1 or -1, each with probability one half: bounded away from zero, as the proof of Spall 1992 needs.
double Spsa::direction(int kind, Eigen::Index input) const noexcept {
  const auto stream = static_cast<std::uint64_t>(1000 + kind * max_inputs) + static_cast<std::uint64_t>(input);
  return random::bits(settings_.seed, stream, static_cast<std::uint64_t>(draw_)) >> 63 ? 1.0 : -1.0;
}

const Inputs& Spsa::ask() noexcept {
  if (first_.open()) {
    applied_ = first_.ask(estimate_);
    return send();
  }
  const int per = per_gradient();
  if (stage_ == std::int64_t{per} * settings_.averaging) {
    applied_ = candidate_;
  } else {
    const Inputs c = perturbation_now();
    const auto within = static_cast<int>(stage_) % per;
    for (Eigen::Index i = 0; i < estimate_.size(); ++i) {
      applied_[i] = estimate_[i] + (within % 2 == 0 ? c[i] : -c[i]) * direction(0, i);
      if (within >= 2) applied_[i] += c[i] * direction(1, i);
    }
  }
  return send();
}

void Spsa::learn(const Reading& reading, const Inputs& applied) noexcept {
  const double j = objective_of(reading, settings_.maximize) + filter_.shaping(applied, reading.limits);
  const bool around = first_.open() || stage_ < std::int64_t{per_gradient()} * settings_.averaging;
  if (around && !clamp_.arrived(applied_, applied, estimate_)) return;
  if (first_.open()) {
    first_.learn(applied, j);
    if (!first_.open() && settings_.initial_hessian.size() == 0) hessian_.diagonal() = -first_.bend();
    return;
  }
  const int gradients_end = per_gradient() * settings_.averaging;
  if (stage_ < gradients_end) {
    around_j_ += j;
    watch(applied);
    finish_gradient(j, applied);
    if (++stage_ < gradients_end) return;
    finish_iteration();
    if (settings_.blocking) return;
    estimate_ = candidate_;
  } else {  // the extra measurement of blocking, at the candidate
    // Measured anew in every iteration, so that a plant that has changed cannot block for ever.
    if (j >= around_j_ / gradients_end - blocking_errors * settings_.noise_sd) {
      estimate_ = candidate_;
    } else {
      ++blocked_;
    }
  }
  stage_ = 0;
  around_j_ = 0.0;
  ++iteration_;
}

// A window of the watch: whole iterations, as many as have measured to both sides. The slope rests on the first two
// measurements of a gradient.
void Spsa::watch(const Inputs& applied) noexcept {
  if (stage_ % per_gradient() < 2) clamp_.record(applied_, applied, estimate_);
  if (++watched_ < std::max(std::int64_t{clamp_window}, std::int64_t{per_gradient()} * settings_.averaging)) return;
  watched_ = 0;
  clamp_.close_window();
}

// Adds a rise of J over the perturbation `c` times the direction, less what the plant did not apply of it.
void Spsa::add_slope(double rise, const Inputs& c, const Inputs& missed) noexcept {
  for (Eigen::Index i = 0; i < sum_.size(); ++i) {
    const double asked = c[i] * direction(0, i);
    sum_[i] += slope_between(rise, asked + missed[i], asked);
  }
}

// Takes one measurement in; at the last one of a gradient, adds that gradient to the sum of the iteration.
void Spsa::finish_gradient(double j, const Inputs& applied) noexcept {
  const int per = per_gradient();
  const auto within = static_cast<std::size_t>(stage_) % static_cast<std::size_t>(per);
  const Inputs c = perturbation_now();
  measured_[within] = j;
  missed_.col(static_cast<Eigen::Index>(within)) = applied - applied_;
  if (within + 1 < static_cast<std::size_t>(per)) return;
  add_slope(measured_[0] - measured_[1], 2.0 * c, missed_.col(0) - missed_.col(1));
  const InputMatrix uneven = missed_.colwise() - missed_.col(0);  // an offset common to all four does not matter
  const bool cut_off = (uneven.cwiseAbs().rowwise().maxCoeff().array() > even_perturbation * c.array()).any();
  if (settings_.form == SpsaForm::second_order && cut_off) {
    hessian_sum_ += hessian_;  // perturbations that are cut off bend whatever they measure
  } else if (settings_.form == SpsaForm::second_order) {
    const double bend = ((measured_[2] - measured_[0]) - (measured_[3] - measured_[1])) / 2.0;
    for (Eigen::Index i = 0; i < sum_.size(); ++i) {
      for (Eigen::Index k = 0; k < sum_.size(); ++k) {
        hessian_sum_(i, k) +=
            0.5 * bend / (c[i] * c[k]) * (direction(0, i) * direction(1, k) + direction(1, i) * direction(0, k));
      }
    }
  }
  ++draw_;
}

// -H with H shifted until it bends down in every direction, at least a fifth as much as at the start; directions are
// those of inputs counted in perturbations.
InputMatrix Spsa::bent_down() noexcept {
  const double q = settings_.averaging;
  const double seen = static_cast<double>(iteration_) + settings_.hessian_prior;
  hessian_ += (hessian_sum_ / q - hessian_) / (seen + 1.0);
  hessian_sum_.setZero();
  const Inputs& first = settings_.initial_hessian.size() > 0 ? settings_.initial_hessian : first_.bend();
  const Inputs squares = settings_.perturbation.cwiseAbs2();
  const Inputs least = 0.2 * first.cwiseAbs().cwiseProduct(squares).minCoeff() * squares.cwiseInverse();
  const InputMatrix floor = least.asDiagonal();
  InputMatrix bent = -hessian_;
  for (double shift = 1.0; Eigen::LLT<InputMatrix>(bent - floor).info() != Eigen::Success && shift < 1e300;
       shift *= 2.0)
    bent.diagonal() += shift * least;
  return bent;
}

void Spsa::finish_iteration() noexcept {
  gradient_ = sum_ / settings_.averaging;
  sum_.setZero();
  const bool second = settings_.form == SpsaForm::second_order;
  // The noise of a gradient grows with 1/c: the gain follows c squared, so that the estimate does not get rougher.
  Inputs direction = gradient_;
  if (second) {
    const Eigen::LLT<InputMatrix> bent(bent_down());
    direction = bent.solve(gradient_);
    if (!settings_.limits.empty()) metric_ = bent.solve(InputMatrix::Identity(direction.size(), direction.size()));
  }
  Inputs step = share_ * share_ * gain_now().cwiseProduct(direction);
  const Inputs& most = settings_.step_max;
  const Inputs reach = perturbation_now() * (second ? 2.0 : 1.0), room = widest();
  step = filter_.project(estimate_, step, {settings_.space, room, clamp_.reach(reach), most, most, metric_});
  candidate_ = estimate_;
  move_within(candidate_, step, settings_.space, room, clamp_);
  share_ += perturbation_rate * ((filter_.active() ? settings_.limit_amplitude : 1.0) - share_);
}

// Of first readings one of which bent the Hessian and led the estimate away.
void Spsa::begin_anew() noexcept {
  restart();
  estimate_ = candidate_ = settings_.space.start;
  hessian_.setZero();
  if (settings_.initial_hessian.size() > 0) hessian_.diagonal() = settings_.initial_hessian;
}

void Spsa::restart() noexcept {
  iteration_ = 0;
  stage_ = 0;
  ++draw_;
  sum_.setZero();
  hessian_sum_.setZero();
  around_j_ = 0.0;
  share_ = 1.0;
  watched_ = 0;
  first_.restart();
  forget();
}

void Spsa::shift_estimate(const Inputs& by) noexcept {
  const Inputs reach = widest();
  move_within(estimate_, by, settings_.space, reach);
  move_within(candidate_, by, settings_.space, reach);
}

}  // namespace mgdd::optimize
