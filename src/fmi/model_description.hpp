/// \file
/// What a foreign FMU says of itself in modelDescription.xml.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "fmi/types.hpp"

namespace espalier::fmi {

/// A variable of a foreign FMU.
struct ForeignVariable {
  enum class Type { real, float32, int8, uint8, int16, uint16, int32, uint32, int64, uint64, boolean, text, other };
  std::string name;
  ValueReference reference = 0;
  Type type = Type::real;
  std::string causality;  ///< "input", "output", "parameter", ...
  bool array = false;
};

struct ModelDescription {
  int version = 0;         ///< 2 or 3
  std::string token;       ///< GUID, instantiationToken
  std::string identifier;  ///< of the binary for co-simulation
  bool serializes_state = false;
  std::vector<ForeignVariable> variables;

  /// Null: there is none of that name.
  [[nodiscard]] const ForeignVariable* find(std::string_view name) const;
};

/// @param fmu its name for messages @throws Error(invalid_input) for what is no description of FMI 2 or 3 with
/// co-simulation
[[nodiscard]] ModelDescription read_description(const std::string& xml, const std::string& fmu);

}  // namespace espalier::fmi
