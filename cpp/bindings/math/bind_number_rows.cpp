// Binds common/number_rows.hpp: rows of numbers in a text of any length.
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/number_rows.hpp"

namespace mgdd::bindings {
namespace {

using RowPlaces = py::array_t<std::int64_t, py::array::c_style>;

py::array_t<std::int64_t> row_places(const std::vector<std::int64_t>& found) {
  return py::array_t<std::int64_t>(static_cast<py::ssize_t>(found.size()), found.data());
}

std::span<const std::int64_t> row_span(const RowPlaces& given) {
  return {given.data(), static_cast<std::size_t>(given.size())};
}

/// Rows of a text that lie within it.
void require_rows_within(std::string_view text, const RowPlaces& begin, const RowPlaces& end) {
  bool within = begin.size() == end.size();
  for (std::size_t k = 0; within && k < row_span(begin).size(); ++k)
    within = row_span(begin)[k] >= 0 && row_span(begin)[k] <= row_span(end)[k] &&
             row_span(end)[k] <= static_cast<std::int64_t>(text.size());
  if (!within) throw about("begin", ShapeError("begin, end: must be places in the text, as text_rows gives them"));
}

}  // namespace

void bind_number_rows(py::module_& m) {
  using py::arg;
  m.def(
      "text_rows",
      [](const py::bytes& text, std::int64_t first_line) {
        const std::string_view view = text;
        const TextRows found = without_gil([&] { return text_rows(view, first_line); });
        return py::make_tuple(row_places(found.begin), row_places(found.end), row_places(found.line), found.lines);
      },
      arg("text"), arg("first_line"),
      "First byte, end and line of each row of a text, without empty ones and remarks, and the number of lines.");
  m.def(
      "cell_counts",
      [](const py::bytes& text, const RowPlaces& begin, const RowPlaces& end, const std::string& mark) {
        const std::string_view view = text;
        require_rows_within(view, begin, end);
        std::vector<std::int64_t> counts(static_cast<std::size_t>(begin.size()));
        without_gil([&] {
          for (std::size_t k = 0; k < counts.size(); ++k) {
            const auto first = static_cast<std::size_t>(row_span(begin)[k]);
            counts[k] = cell_count(view.substr(first, static_cast<std::size_t>(row_span(end)[k]) - first), mark);
          }
        });
        return row_places(counts);
      },
      arg("text"), arg("begin"), arg("end"), arg("mark"), "Number of cells of each row; an empty mark is blanks.");
  m.def(
      "row_numbers",
      [](const py::bytes& text, const RowPlaces& begin, const RowPlaces& end, const std::string& mark,
         bool decimal_comma, const std::vector<std::int64_t>& columns) {
        const std::string_view view = text;
        require_rows_within(view, begin, end);
        for (std::size_t k = 0; k < columns.size(); ++k)
          if (columns[k] < 0 || (k > 0 && columns[k] <= columns[k - 1]))
            throw about("columns", ShapeError("columns: must increase from 0 or more"));
        py::array_t<double> out({static_cast<py::ssize_t>(columns.size()), begin.size()});
        const std::span<double> to(out.mutable_data(), static_cast<std::size_t>(out.size()));
        const std::vector<bool> plain = without_gil(
            [&] { return row_numbers(view, row_span(begin), row_span(end), {mark, decimal_comma}, columns, to); });
        return py::make_tuple(out, plain);
      },
      arg("text"), arg("begin"), arg("end"), arg("mark"), arg("decimal_comma"), arg("columns"),
      "Columns of rows as the rows of an array, and which of them hold nothing but finite numbers.");
}

}  // namespace mgdd::bindings
