// Binds engine/crank: the angle of an encoder, and samples at even angles.
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/engine/crank/encoder.hpp"

namespace mgdd::bindings {
namespace {

py::dict angle(const InputArray& time, const InputArray& signal, const std::optional<InputArray>& index, long teeth,
               long missing_teeth, bool falling, std::optional<double> level) {
  if (teeth < 0) throw ParameterError("teeth", teeth, "must be in [2, 36000]");
  if (missing_teeth < 0) throw ParameterError("missing_teeth", missing_teeth, "must be >= 0");
  const std::vector<double> t = to_column(time, "time_s"), s = to_column(signal, "signal");
  const std::vector<double> marks = index ? to_column(*index, "index") : std::vector<double>();
  const engine::EncoderAngle found = without_gil([&] {
    return engine::encoder_angle(t, s, marks,
                                 {.teeth = static_cast<std::size_t>(teeth),
                                  .missing_teeth = static_cast<std::size_t>(missing_teeth),
                                  .falling = falling,
                                  .level = level});
  });
  py::dict out;
  out["angle_deg"] = to_array(found.angle_deg);
  out["mark_s"] = to_array(found.mark_s);
  out["lost"] = found.lost;
  out["extra"] = found.extra;
  out["lost_marks"] = found.lost_marks;
  out["slipped_deg"] = found.slipped_deg;
  return out;
}

py::array_t<double> even(const InputArray& angle_deg, const InputArray& values, double from_deg, double step_deg,
                         std::size_t count) {
  const std::vector<double> angles = to_column(angle_deg, "angle_deg"), samples = to_column(values, "values");
  if (samples.size() != angles.size() || angles.size() < 4)
    throw about("values", ShapeError("values must have a sample per angle, and four of them"));
  return to_array(without_gil([&] { return engine::at_even_angles(angles, samples, from_deg, step_deg, count); }));
}

}  // namespace

void bind_encoder(py::module_& m) {
  using py::arg;
  m.def("encoder_angle", &angle, arg("time_s"), arg("signal"), arg("index") = py::none(), arg("teeth") = 360,
        arg("missing_teeth") = 0, arg("falling") = false, arg("level") = py::none(),
        "Crank angle of every sample of an encoder.");
  m.def("at_even_angles", &even, arg("angle_deg"), arg("values"), arg("from_deg"), arg("step_deg"), arg("count"),
        "Samples at even angles.");
}

}  // namespace mgdd::bindings
