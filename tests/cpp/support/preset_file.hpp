// Numbers and names of a shipped preset, read from its file: lines `name = { value = 86.0, ...` below `[section]`.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>

namespace mgdd::test_support {

using PresetValues = std::map<std::string, std::string>;

PresetValues preset_values(const std::string& preset, const std::string& section);

/// What a user gets who says nothing is that preset: every number, and every option, whose names `options` gives.
template <class Record>
void expect_preset(const Record& record, const auto& fields, const std::map<std::string, std::string_view>& options,
                   const std::string& preset, const std::string& section) {
  const PresetValues values = preset_values(preset, section);
  EXPECT_EQ(values.size(), fields.size() + options.size());
  for (const auto& field : fields) {
    const auto value = values.find(std::string(field.info.name));
    ASSERT_NE(value, values.end()) << field.info.name;
    EXPECT_EQ(field.in(record), std::stod(value->second)) << field.info.name;
  }
  for (const auto& [name, chosen] : options)
    EXPECT_EQ(values.at(name), "\"" + std::string(chosen) + "\"") << name;
}

}  // namespace mgdd::test_support
