/// \file
/// modelDescription.xml of the FMUs that we write.
#pragma once

#include <string>

#include "fmi/contents.hpp"

namespace espalier::fmi {

struct Description {
  int version = 3;         ///< 2 or 3
  std::string name;        ///< of the model, for people
  std::string identifier;  ///< of the binary
  std::string title;       ///< a sentence about it; may be empty
  std::string tool;        ///< that made it
  double step = 0;         ///< a communication step that suits
  bool model_exchange = false;
};

[[nodiscard]] std::string describe(const Description& description, const Contents& contents);

}  // namespace espalier::fmi
