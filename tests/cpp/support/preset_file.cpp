#include "support/preset_file.hpp"

#include <fstream>

namespace mgdd::test_support {

PresetValues preset_values(const std::string& preset, const std::string& section) {
  std::ifstream file(std::string(MGDD_PRESETS_DIR) + "/" + preset + ".toml");
  PresetValues values;
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with('[')) inside = line == "[" + section + "]";
    const std::string key = " = { value = ";
    const auto at = line.find(key);
    if (!inside || at == std::string::npos) continue;
    const auto from = at + key.size();
    values[line.substr(0, at)] = line.substr(from, line.find(", unit") - from);
  }
  return values;
}

}  // namespace mgdd::test_support
