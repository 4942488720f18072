#include "mgdd/common/number_rows.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <system_error>
#include <vector>

namespace mgdd {
namespace {

constexpr std::string_view kBlanks = " \t\v\f\r\n";
constexpr std::size_t kLongest = 64;  // letters of a number whose decimal comma is replaced; longer ones Python reads

std::string_view stripped(std::string_view cell, std::string_view of) {
  const std::size_t first = cell.find_first_not_of(of);
  if (first == std::string_view::npos) return {};
  return cell.substr(first, cell.find_last_not_of(of) - first + 1);
}

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

std::optional<double> plain_number(std::string_view cell) {
  if (!cell.empty() && cell.front() == '+') {
    cell.remove_prefix(1);
    if (!cell.empty() && cell.front() == '-') return {};
  }
  const std::string_view digits = !cell.empty() && cell.front() == '-' ? cell.substr(1) : cell;
  if (digits.empty() || !(is_digit(digits.front()) || digits.front() == '.')) return {};  // "inf" and "nan" are none
  double value = 0.0;
  const auto [rest, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc{} || rest != cell.data() + cell.size()) return {};
  return value;
}

std::optional<double> number(std::string_view cell, bool decimal_comma) {
  if (cell.empty() || !(is_digit(cell.front()) && is_digit(cell.back())))
    cell = stripped(stripped(stripped(cell, kBlanks), "\""), kBlanks);
  if (!decimal_comma) return plain_number(cell);
  if (cell.size() > kLongest || cell.find('.') != std::string_view::npos) return {};
  std::array<char, kLongest> pointed{};
  std::replace_copy(cell.begin(), cell.end(), pointed.begin(), ',', '.');
  return plain_number({pointed.data(), cell.size()});
}

/// Takes the next cell off the rest of a row; of blanks any number separates.
std::string_view next_cell(std::string_view& rest, std::string_view mark) {
  if (mark.empty()) {
    rest.remove_prefix(std::min(rest.find_first_not_of(kBlanks), rest.size()));
    const std::string_view cell = rest.substr(0, rest.find_first_of(kBlanks));
    rest.remove_prefix(cell.size());
    return cell;
  }
  const std::size_t at = mark.size() == 1 ? rest.find(mark.front()) : rest.find(mark);
  const std::string_view cell = rest.substr(0, at);
  rest.remove_prefix(at == std::string_view::npos ? rest.size() : at + mark.size());
  return cell;
}

}  // namespace

TextRows text_rows(std::string_view text, std::int64_t first_line) {
  TextRows out;
  std::size_t at = 0, feed = 0, back = 0;  // the next \n and \r, each looked for no more than once
  while (at < text.size()) {
    if (feed < at || at == 0) feed = std::min(text.find('\n', at), text.size());
    if (back < at || at == 0) back = std::min(text.find('\r', at), text.size());
    const std::size_t end = std::min(feed, back);
    const std::string_view line = text.substr(at, end - at);
    const std::size_t said = line.find_first_not_of(kBlanks);
    if (said != std::string_view::npos && line[said] != '#') {
      const std::size_t first = line.find_first_not_of(" \v\f"), last = line.find_last_not_of(" \v\f");
      out.begin.push_back(static_cast<std::int64_t>(at + first));
      out.end.push_back(static_cast<std::int64_t>(at + last + 1));
      out.line.push_back(first_line + out.lines);
    }
    ++out.lines;
    at = end + (text.substr(end, 2) == "\r\n" ? 2 : 1);
  }
  return out;
}

std::int64_t cell_count(std::string_view row, std::string_view mark) {
  if (mark.size() == 1) return 1 + std::count(row.begin(), row.end(), mark.front());
  std::int64_t count = mark.empty() ? 0 : 1;
  if (mark.empty()) {
    while (!next_cell(row, mark).empty())
      ++count;
  } else {
    for (std::size_t at = row.find(mark); at != std::string_view::npos; at = row.find(mark, at + mark.size()))
      ++count;
  }
  return count;
}

std::vector<bool> row_numbers(std::string_view text, std::span<const std::int64_t> begin,
                              std::span<const std::int64_t> end, RowForm form, std::span<const std::int64_t> columns,
                              std::span<double> out) {
  std::vector<bool> plain(columns.size(), true);
  const std::size_t rows = begin.size();
  for (std::size_t row = 0; row < rows; ++row) {
    const auto first = static_cast<std::size_t>(begin[row]);
    std::string_view rest = text.substr(first, static_cast<std::size_t>(end[row]) - first);
    std::int64_t next = 0;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      for (; next < columns[k]; ++next)
        next_cell(rest, form.mark);
      const std::optional<double> value = number(next_cell(rest, form.mark), form.decimal_comma);
      ++next;
      out[k * rows + row] = value.value_or(0.0);
      if (!value) plain[k] = false;
    }
  }
  return plain;
}

}  // namespace mgdd
