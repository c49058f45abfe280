/// \file
/// The two versions of FMI behind ForeignFmu.
#pragma once

#include "fmi/foreign.hpp"

namespace espalier::fmi {

[[nodiscard]] std::unique_ptr<ForeignFmu> load_fmi2(const std::string& name, const std::string& title,
                                                    ModelDescription description, const ZipArchive& archive);
[[nodiscard]] std::unique_ptr<ForeignFmu> load_fmi3(const std::string& name, const std::string& title,
                                                    ModelDescription description, const ZipArchive& archive);

}  // namespace espalier::fmi
