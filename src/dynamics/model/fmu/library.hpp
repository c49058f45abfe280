/// \file
/// The binary of the FMUs that we write.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace espalier::dynamics::model {

/// Where espalier_fmu.so is. @param given  by the caller; empty: beside the file that this code is in (a program, or
/// Python's extension) as builds, installations and wheels lay it. @throws Error(invalid_input) with what to do
[[nodiscard]] std::string find_fmu_library(const std::string& given);

/// Names and paths of the library itself (under its name in the FMU) and of those libraries it needs that not every
/// Linux system has. @throws Error(invalid_input) where it cannot be loaded
[[nodiscard]] std::vector<std::pair<std::string, std::string>> fmu_binaries(const std::string& library,
                                                                            const std::string& name);

/// Names and paths of the licences that lie beside the library, which go with it. @throws Error(invalid_input) where
/// they do not
[[nodiscard]] std::vector<std::pair<std::string, std::string>> fmu_licenses(const std::string& library);

}  // namespace espalier::dynamics::model
