// Slopes of a discrete model along the inputs of a horizon: by dual numbers (Griewank and Walther 2008, chapter 3), or
// those that a model of run-time order gives itself. Units are the model's own. noexcept; by duals heap-free.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "mgdd/dynamics/discrete_model.hpp"

namespace mgdd::control {

/// A model of `order()` states that knows its own slopes: `linearise(x, u, a, b)` gives those of the step from x, and
/// `output_slope(x, c)` that of the output.
template <class M>
concept KnowsSlopes =
    dynamics::DiscreteModel<M> && requires(const M& model, const typename M::State& x, typename M::Scalar u,
                                           Eigen::Matrix<typename M::Scalar, Eigen::Dynamic, Eigen::Dynamic>& a,
                                           Eigen::Matrix<typename M::Scalar, Eigen::Dynamic, 1>& b) {
      { model.order() } noexcept -> std::convertible_to<Eigen::Index>;
      { model.linearise(x, u, a, b) } noexcept;
      { model.output_slope(x, b) } noexcept;
    };

/// Through the first n numbers of the state, on duals.
template <class M, int n>
class HorizonSlopes {
 public:
  using Scalar = typename M::Scalar;

  explicit HorizonSlopes(const M& model) : dual_model_(model.template over<D>()) {}

  static constexpr std::size_t order() noexcept { return static_cast<std::size_t>(n); }
  static constexpr std::size_t n_saved() noexcept { return dynamics::n_numbers<M>; }

  /// From a state along inputs: outputs and the slopes of the stages.
  template <class Inputs, class Stages>
  void along(const typename M::State& state, const Inputs& inputs, Inputs& outputs, Stages& stages) const noexcept {
    auto s = dynamics::lifted<Lifted>(state);
    const auto places = Lifted::numbers(s);
    const auto seed = [&] {
      for (std::size_t i = 0; i < order(); ++i) {
        places[i]->grad = {};
        places[i]->grad[i] = Scalar(1);
      }
    };
    seed();
    for (std::size_t k = 0; k < inputs.size(); ++k) {
      dual_model_.step(s, dynamics::input_of(dual_model_, D::seeded(inputs[k], n)));
      auto& stage = stages[k];
      for (std::size_t i = 0; i < order(); ++i) {
        for (std::size_t j = 0; j < order(); ++j)
          stage.a(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = places[i]->grad[j];
        stage.b(static_cast<Eigen::Index>(i)) = places[i]->grad[order()];
      }
      seed();
      const D y = dual_model_.output(s);
      outputs[k] = y.value;
      for (std::size_t i = 0; i < order(); ++i)
        stage.c(static_cast<Eigen::Index>(i)) = y.grad[i];
    }
  }

 private:
  using D = Dual<n + 1, Scalar>;
  using Lifted = std::remove_const_t<decltype(std::declval<const M&>().template over<D>())>;

  Lifted dual_model_;
};

/// Those that the model gives.
template <KnowsSlopes M>
class HorizonSlopes<M, Eigen::Dynamic> {
 public:
  explicit HorizonSlopes(const M& model) : model_(model) {}

  std::size_t order() const noexcept { return static_cast<std::size_t>(model_.order()); }
  std::size_t n_saved() const noexcept { return order(); }

  template <class Inputs, class Stages>
  void along(const typename M::State& state, const Inputs& inputs, Inputs& outputs, Stages& stages) const noexcept {
    auto s = state;
    for (std::size_t k = 0; k < inputs.size(); ++k) {
      model_.linearise(s, inputs[k], stages[k].a, stages[k].b);
      model_.step(s, dynamics::input_of(model_, inputs[k]));
      outputs[k] = model_.output(s);
      model_.output_slope(s, stages[k].c);
    }
  }

 private:
  M model_;
};

}  // namespace mgdd::control
