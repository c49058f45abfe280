/// \file
/// The systems of the benchmark by their words: a file or a generator.
#pragma once

#include <string>

#include "espalier/matrix.hpp"

namespace espalier::bench {

/// A matrix file (a name that ends in .mtx, .rb, .esm ... and exists) or a generator with its sizes ("poisson 30 30
/// 30").
/// @throws Error(invalid_input) with the known words when neither is meant
SparseMatrix make_system(const std::string& words);

/// What automatic means for `a`: lu unless symmetric; llt where every diagonal entry is positive, else ldlt.
Kind automatic_kind(const MatrixView& a);

}  // namespace espalier::bench
