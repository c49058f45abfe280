/// \file
/// Parameters of tests in words: of types that it does not know, gtest prints bytes, with the addresses of this run.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "solver/options/option_text.hpp"

namespace espalier::test {

/// The words of a generated matrix and the kind of its factorization.
inline std::ostream& print(std::ostream& out, const std::vector<std::string>& words, Kind kind) {
  for (const std::string& word : words) out << word << ' ';
  return out << name_of(solver::kKinds, kind);
}

}  // namespace espalier::test
