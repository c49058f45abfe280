/// \file
/// The backends of this build. CMake writes the list (cmake/EspalierBackend.cmake).
#pragma once

#include <string_view>
#include <vector>

#include "device/backend.hpp"

namespace espalier::device {

/// A backend that this build could have had.
struct LeftOut {
  std::string_view name;
  std::string_view reason;  ///< a sentence for the user
};

struct Registry {
  /// The first is the host's, which takes every system and is there when others fail.
  std::vector<const Backend*> backends;
  std::vector<LeftOut> left_out;

  [[nodiscard]] const Backend& host() const { return *backends.front(); }
  /// By name; null: not in this build.
  [[nodiscard]] const Backend* find(std::string_view name) const {
    for (const Backend* b : backends)
      if (b->name() == name) return b;
    return nullptr;
  }
  /// The same of those that were left out.
  [[nodiscard]] const LeftOut* find_left_out(std::string_view name) const {
    for (const LeftOut& l : left_out)
      if (l.name == name) return &l;
    return nullptr;
  }
};

/// Those that were built.
const Registry& registry();

}  // namespace espalier::device
