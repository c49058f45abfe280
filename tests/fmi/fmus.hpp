/// \file
/// FMUs for the tests.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "fmi/zip.hpp"

namespace espalier::fmi {

/// A folder that goes with the test.
class TestFolder {
 public:
  TestFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "espalier_fmi_XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~TestFolder() { std::filesystem::remove_all(path_); }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;
  [[nodiscard]] std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

inline std::string bytes_of_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
inline void write_file(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

/// modelDescription.xml of lag.c.
inline std::string lag_description(int version, bool state = true) {
  struct Row {
    const char *name, *type, *causality;
  };
  const Row rows[] = {
      {"u", "real", "input"},     {"enable", "Boolean", "input"},   {"y", "real", "output"},
      {"count", "int", "output"}, {"is.high", "Boolean", "output"}, {"gain", "real", "parameter"},
      {"T", "real", "parameter"}, {"at", "real", "parameter"},      {"mischief", "String", "parameter"}};
  const bool three = version == 3;
  std::string variables;
  for (std::size_t k = 0; k < std::size(rows); ++k) {
    const std::string kind = rows[k].type;
    const std::string type = kind == "real"  ? (three ? "Float64" : "Real")
                             : kind == "int" ? (three ? "Int32" : "Integer")
                                             : kind;
    const std::string head =
        fmt::format("name=\"{}\" valueReference=\"{}\" causality=\"{}\"", rows[k].name, k, rows[k].causality);
    variables += three ? fmt::format("<{} {}/>", type, head)
                       : fmt::format("<ScalarVariable {}><{}/></ScalarVariable>", head, type);
  }
  return fmt::format(
      "<?xml version=\"1.0\"?><fmiModelDescription fmiVersion=\"{}.0\" modelName=\"lag\" {}=\"{{lag-{}}}\">"
      "<CoSimulation modelIdentifier=\"lag\" {}=\"{}\" {}=\"{}\"/><ModelVariables>{}</ModelVariables>"
      "</fmiModelDescription>",
      version, three ? "instantiationToken" : "guid", version, three ? "canGetAndSetFMUState" : "canGetAndSetFMUstate",
      state, three ? "canSerializeFMUState" : "canSerializeFMUstate", state, variables);
}

/// The FMU of lag.c.
inline std::string lag_fmu(int version, bool state = true) {
  return make_zip(
      {{"modelDescription.xml", lag_description(version, state)},
       {version == 3 ? "binaries/x86_64-linux/lag.so" : "binaries/linux64/lag.so", bytes_of_file(TEST_LAG_LIBRARY)},
       {"resources/readme.txt", "nothing"}});
}

}  // namespace espalier::fmi
