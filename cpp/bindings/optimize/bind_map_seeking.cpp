// Binds optimize/laws/map_seeking.hpp: a search for a whole map; mgdd.optimize.MapSeeking wraps it.
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "guarded.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/laws/map_seeking.hpp"
#include "optimize/seeker_settings.hpp"

namespace mgdd::bindings {
namespace {

using optimize::MapSeeking;
using optimize::MapSeekingSettings;
using BoundMap = Guarded<MapSeeking>;

}  // namespace

void bind_map_seeking(py::module_& m) {
  using py::arg;
  py::class_<BoundMap> cls(m, "MapSeeking", "A map by Gaussian processes; see mgdd.optimize.MapSeeking.");
  const Members& members = seeker_members<MapSeekingSettings>();
  bind_keywords<MapSeekingSettings>(cls, members, [](MapSeekingSettings settings) {
    return BoundMap("MapSeeking", MapSeeking(std::move(settings)));
  });
  cls.def_property_readonly(
         "settings", [&members](const BoundMap& b) { return members.to_dict(&b.constant().settings()); },
         "Arguments that make this search again.")
      .def(
          "_suggest",
          [](BoundMap& b) {
            const auto held = b.use();
            const MapSeeking::Visit* visit = nullptr;
            {
              const py::gil_scoped_release free_gil;
              visit = &held->suggest();
            }
            return py::make_tuple(input_array(visit->context), input_array(visit->input), visit->gain, visit->sd);
          },
          "Point and input of the next reading, by what it is expected to raise the objective, and what is not known "
          "of "
          "it there, as a standard deviation. Releases the GIL.")
      .def(
          "_ask",
          [](BoundMap& b, const InputArray& context) {
            const optimize::Inputs at = inputs_of_array(context);
            return input_array(b.use()->ask(at));
          },
          arg("context"), "Input of the next reading at a point.")
      .def_property_readonly(
          "_estimate", [](const BoundMap& b) { return input_array(b.use()->estimate()); },
          "Best input at the point of the last _ask, as it was known then.")
      .def(
          "_tell",
          [](BoundMap& b, const InputArray& context, const InputArray& input, double j,
             const std::vector<double>& limits, bool misfire, double readings, const std::vector<double>& sd) {
            const optimize::Inputs at = inputs_of_array(context), applied = inputs_of_array(input);
            optimize::Reading reading;
            reading.components = {&j, 1};
            reading.limits = limits;
            reading.misfire = misfire;
            const auto held = b.use();
            const py::gil_scoped_release free_gil;
            return static_cast<int>(held->tell(at, applied, reading, readings, sd));
          },
          arg("context"), arg("input"), arg("j"), arg("limits"), arg("misfire"), arg("readings"), arg("sd"),
          "What was read: 0 where it was taken, 1 for a misfire, else it was refused. Releases the GIL.")
      .def(
          "_cells",
          [](BoundMap& b) {
            const auto held = b.use();
            const std::size_t limits = held->settings().limits.size();
            py::list out;
            for (std::size_t c = 0; c < held->cells(); ++c) {
              const MapSeeking::Best best = held->best(c);
              std::vector<double> holds(limits);
              for (std::size_t i = 0; i < limits; ++i)
                holds[i] = held->holds(c, i);
              out.append(py::make_tuple(input_array(held->cell(c)), input_array(best.input), input_array(best.input_sd),
                                        best.expected, best.sd, best.regret, best.excess, holds));
            }
            return out;
          },
          "Of every cell: point, best input and its sd, objective there, its sd, expected regret, excess, probability "
          "of limits.")
      .def(
          "reseed", [](BoundMap& b, std::uint64_t seed) { b.use()->reseed(seed); }, arg("seed"),
          "Compare other inputs from here on.")
      .def_property_readonly(
          "readings", [](const BoundMap& b) { return b.use()->readings(); }, "How many there were, failures included.")
      .def_property_readonly(
          "doubts", [](const BoundMap& b) { return b.use()->doubts(); },
          "How often readings were not what was expected, and what was known was aged.")
      .def_property_readonly(
          "noise_sd", [](const BoundMap& b) { return b.use()->noise_sd(); },
          "Standard deviation of one reading of the objective, as learnt.")
      .def_property_readonly(
          "trust", [](const BoundMap& b) { return b.use()->trust(); },
          "Share of the objective's bends that the guide holds, as learnt; 1 without a guide.")
      .def_property_readonly(
          "guide_factor", [](const BoundMap& b) { return b.use()->guide_factor(); },
          "What the guide is multiplied by, as learnt; 0 without one.")
      .def_property(
          "state", [](const BoundMap& b) { return save_state(*b.use()); },
          [](BoundMap& b, const StateColumns& columns) { restore_state(*b.use(), columns); },
          "What a search needs to go on bit for bit; a state that the settings do not allow is refused and changes "
          "nothing.");
}

}  // namespace mgdd::bindings
