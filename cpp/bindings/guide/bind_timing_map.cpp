// Binds guide/timing_map.hpp: the look-up table of the best timing that learns.
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "guarded.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/guide/timing_map.hpp"

namespace mgdd::bindings {
namespace {

using BoundMap = Guarded<guide::TimingMap>;

}  // namespace

void bind_timing_map(py::module_& m) {
  using py::arg;
  py::class_<BoundMap> cls(m, "TimingMap", "A map of the best timing; see mgdd.guide.TimingMap.");
  cls.def(py::init([](std::vector<std::vector<double>> axes, std::vector<double> values_cad, double prior_sd_cad,
                      double forgetting) {
            return BoundMap("TimingMap",
                            guide::TimingMap({std::move(axes), std::move(values_cad), prior_sd_cad, forgetting}));
          }),
          py::kw_only(), arg("axes"), arg("values_cad"), arg("prior_sd_cad"), arg("forgetting"));
  cls.def(
      "_lookup",
      [](const BoundMap& b, const std::vector<double>& point) {
        const guide::TimingLookup found = b.use()->lookup(point);
        return py::make_tuple(found.value_cad, found.sd_cad, found.support, found.held_outside);
      },
      arg("point"), "Value, its standard deviation, support, and whether it is held outside of the axes.");
  cls.def(
      "_learn",
      [](BoundMap& b, const std::vector<double>& point, double value_cad, double sd_cad) {
        return b.use()->learn(point, value_cad, sd_cad);
      },
      arg("point"), arg("value_cad"), arg("sd_cad"), "One confirmed optimum; False where it was not taken.");
  cls.def_property(
      "_columns", [](const BoundMap& b) { return save_state(*b.use()); },
      [](BoundMap& b, const StateColumns& columns) { restore_state(*b.use(), columns); },
      "Values, variances and support of all cells.");
}

}  // namespace mgdd::bindings
