/// \file
/// Sources that are part of the binary.
#pragma once

namespace espalier::cli {

struct AdapterText {
  const char* name;
  const char* text;
};

extern const AdapterText kAdapterTexts[4];

}  // namespace espalier::cli
