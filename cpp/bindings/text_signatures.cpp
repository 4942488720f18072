// Signatures as `inspect.signature` and `help` read them, made of those of pybind11: names and defaults, without kinds.
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "binding.hpp"

namespace mgdd::bindings {
namespace {

// The parts between commas outside of brackets and quotes.
std::vector<std::string_view> split(std::string_view text) {
  std::vector<std::string_view> parts;
  std::size_t from = 0, depth = 0;
  char quote = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quote != 0) {
      quote = c == quote && text[i - 1] != '\\' ? 0 : quote;
    } else if (c == '\'' || c == '"') {
      quote = c;
    } else if (c == '[' || c == '(' || c == '{' || c == '<') {
      ++depth;
    } else if ((c == ']' || c == ')' || c == '}' || c == '>') && depth > 0) {
      --depth;
    } else if (c == ',' && depth == 0) {
      parts.push_back(text.substr(from, i - from));
      from = i + 2;
    }
  }
  if (from < text.size()) parts.push_back(text.substr(from));
  return parts;
}

// A default that Python can read again; an object is only known to be there.
std::string literal(std::string_view value) {
  if (value == "inf" || value == "-inf") return value == "inf" ? "1e999" : "-1e999";
  const bool constant = value == "None" || value == "True" || value == "False";
  const bool text = value.size() > 1 && value.front() == '\'' && value.back() == '\'';
  const bool numbers = value.find_first_not_of("0123456789.eE+-,[]() ") == std::string_view::npos;
  return constant || text || numbers ? std::string(value) : "...";
}

// `(self, a, *, b=1.0)` of `(self: T, a: float, *, b: float = 1.0) -> None`.
std::string plain(std::string_view signature) {
  std::string out;
  for (const std::string_view part : split(signature.substr(1, signature.rfind(") -> ") - 1))) {
    const std::size_t end = part.find(':'), value = part.rfind(" = ");
    out += out.empty() ? "" : ", ";
    out += part.substr(0, end);
    if (end != std::string_view::npos && value != std::string_view::npos) out += "=" + literal(part.substr(value + 3));
  }
  return "(" + out + ")\n--\n\n";
}

// The overload with the most arguments stands for all.
std::string_view longest(const py::detail::function_record* record) {
  std::string_view best;
  for (; record != nullptr; record = record->next) {
    const std::string_view each = record->signature;
    if (best.empty() || split(each).size() > split(best).size()) best = each;
  }
  return best;
}

}  // namespace

void show_signature(PyCFunctionObject* function, const py::detail::function_record* record) {
  const std::string doc = function->m_ml->ml_doc == nullptr ? "" : function->m_ml->ml_doc;
  const std::string text = function->m_ml->ml_name + plain(longest(record)) + doc;
  std::free(const_cast<char*>(function->m_ml->ml_doc));  // NOLINT(cppcoreguidelines-no-malloc): pybind11 does so
  function->m_ml->ml_doc = ::strdup(text.c_str());
}

}  // namespace mgdd::bindings
