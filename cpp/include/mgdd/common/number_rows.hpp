// Rows of numbers in a text: where they stand, how many cells they have, and the numbers of some of their columns.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace mgdd {

/// The rows of a text that say something: first byte, one behind the last, and number of the line.
struct TextRows {
  std::vector<std::int64_t> begin, end, line;
  std::int64_t lines = 0;  ///< all of them, also those left out
};

/// Finds the rows of a text whose first line has this number; empty ones and remarks behind # are left out.
/// Blanks at both ends do not belong to a row; tabs do, as they may separate cells.
TextRows text_rows(std::string_view text, std::int64_t first_line);

/// How to take a row apart: what stands between cells (nothing: blanks), and whether the decimal mark is a comma.
struct RowForm {
  std::string_view mark;
  bool decimal_comma = false;
};

/// Cells of a row.
std::int64_t cell_count(std::string_view row, std::string_view mark);

/// Reads columns, which must increase, into `out` (column by column) and says which of them hold nothing but finite
/// numbers; what stands in `out` of the others is undefined.
std::vector<bool> row_numbers(std::string_view text, std::span<const std::int64_t> begin,
                              std::span<const std::int64_t> end, RowForm form, std::span<const std::int64_t> columns,
                              std::span<double> out);

}  // namespace mgdd
