/// \file
/// The systems of the benchmark by their words: a file or a generator.
#pragma once

#include <string>

#include "rivals/system_view.hpp"

namespace espalier::bench {

/// A matrix file (a name that ends in .mtx, .rb, .esm ... and exists) or a generator with its sizes ("poisson 30 30
/// 30").
/// @throws Error(invalid_input) with the known words when neither is meant
SparseMatrix make_system(const std::string& words);

/// A system that owns its arrays; values as in SystemView.
struct System {
  SparseMatrix a;
  Numbers numbers = Numbers::real;
  [[nodiscard]] SystemView view() const { return {a, numbers}; }
};

/// A real system of make_system(), a complex matrix file, or a complex system made of a real one A with the diagonal d,
/// whose negative entries count as zero:
///  - "damped WORDS": the dynamic stiffness (1 + 0.02 i) A + (0.001 i - 0.01) d, complex symmetric where A is
///  symmetric.
///    With d for a mass matrix, a few frequencies of a fine mesh lie below that of this load.
///  - "hermitian WORDS": P A P^*, P a diagonal of random phases, as waves in periodic structures have them. A must be
///    symmetric; definiteness and inertia are those of A.
/// @throws Error(invalid_input) as make_system(), and where A is not what is asked for
System make_any_system(const std::string& words);

/// What automatic means for `a`: lu unless symmetric or Hermitian; llt where every diagonal entry is positive and the
/// matrix is not complex symmetric, else ldlt.
Kind automatic_kind(const SystemView& a);

}  // namespace espalier::bench
