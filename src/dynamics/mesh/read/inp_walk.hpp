/// \file
/// The keyword lines of an .inp file and of those that it includes.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "dynamics/mesh/read/inp_lines.hpp"

namespace espalier::dynamics {

/// Calls `take` at each keyword in the order of the deck; data lines that it does not read are passed over.
/// @throws Error(invalid_input) that names file and line, also for files that include themselves
void walk_inp(const std::string& path, const std::function<void(LineReader&, const InpKeyword&)>& take);

/// Sections by the names that sets have in the mesh: those of a part as they are and, behind all others, once for each
/// of its instances.
class InpInstances {
 public:
  /// Notes *PART and *INSTANCE.
  void take(const InpKeyword& keyword);
  /// The part that is being read; empty: none.
  [[nodiscard]] const std::string& part() const { return part_; }
  /// "INSTANCE.SET" of each instance of a part.
  [[nodiscard]] std::vector<std::string> names(const std::string& part, const std::string& set) const;

 private:
  std::string part_;
  std::multimap<std::string, std::string> instances_;  // of parts
};

}  // namespace espalier::dynamics
