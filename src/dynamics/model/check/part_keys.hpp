/// \file
/// The keys that the readers of a model know, by section and type, for messages.
#pragma once

#include <span>
#include <string_view>

#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {

/// The keys of one kind of part: those of the calls in read_*.cpp, as docs/site/model_parts.py has found them.
struct PartKeys {
  std::string_view section;  ///< "" for the top of a model
  std::string_view type;     ///< "" where the section has no types
  std::string_view keys;     ///< with blanks between them
};
[[nodiscard]] std::span<const PartKeys> all_part_keys();

/// To be called when a part is wrong in some way: a misspelt key is the likeliest reason, also of a missing one.
/// @throws Error(invalid_input) for the first key that no reader of such a part knows; nothing where the type of the
/// part is not known either, and where the error is about that key and says more
void refuse_unknown_keys(std::string_view section, const Value& part, const Error& error);
/// The same of the top of a model and of its sections that have no named parts.
void refuse_unknown_sections(const Value& root, const Error& error);

}  // namespace espalier::dynamics::model
