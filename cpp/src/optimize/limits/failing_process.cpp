#include "mgdd/optimize/limits/failing_process.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace mgdd::optimize {
namespace {

constexpr double label_bend = 3.0;                      // of a label
constexpr double label_noise = 0.3;                     // of whether a cycle works: 1 or -1
constexpr double surest = 0.02;                         // probability: the process of labels promises too much
constexpr double usual_rate = 0.1, rate_memory = 0.99;  // of cycles that fail anywhere, before any was seen

ProcessModel::Settings settings_of(ProcessModel::Settings out) {
  out.guide = {};
  out.bends_down = false;
  out.bend = label_bend;
  out.noise_sd = label_noise;
  out.labels = true;
  return out;
}

}  // namespace

FailingProcess::FailingProcess(ProcessModel::Settings settings)
    : model_(settings_of(std::move(settings))), here_(InputTable::Zero(1, model_.inputs())) {}

// Whether cycles fail by their input or anywhere, by how well either foretold this one.
void FailingProcess::record(const Inputs& z, bool worked, const Inputs& about) noexcept {
  if (known()) {
    here_.row(0) = z.transpose();
    model_.predict_means(here_, 1);
    const double here = std::clamp(0.5 * (1.0 + model_.mean(0)), surest, 1.0 - surest);
    const double rate = (failed_ + 1.0) / (seen_ + 1.0 / usual_rate);
    anywhere_ += std::log(worked ? (1.0 - rate) / (1.0 - here) : rate / here);
    anywhere_ = std::clamp(anywhere_, least_anywhere, -least_anywhere);
  }
  seen_ = rate_memory * seen_ + 1.0;
  failed_ = rate_memory * failed_ + (worked ? 0.0 : 1.0);
  model_.record(z, worked ? -1.0 : 1.0, about);
}

void FailingProcess::forget() noexcept {
  model_.forget();
  seen_ = failed_ = 0.0;
  anywhere_ = least_anywhere;
}

}  // namespace mgdd::optimize
