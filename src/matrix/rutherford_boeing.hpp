/// \file
/// Rutherford-Boeing files (I. Duff, R. Grimes, J. Lewis, "The Rutherford-Boeing sparse matrix collection",
/// RAL-TR-97-031) and their predecessor Harwell-Boeing, whose right-hand sides are skipped.
///
/// Read: real (r), integer (i) and pattern (p); symmetric (s), unsymmetric (u), skew (z) and rectangular (r); assembled
/// (a). Complex and elemental files are refused. Fields are fixed-width Fortran fields, exponents D included.
/// Patterns, symmetric files that hold both triangles, repeated entries and skew files: as in matrix_market.hpp.
#pragma once

#include <string>
#include <string_view>

#include "matrix/entries.hpp"

namespace espalier::matrix {

/// True when the third line begins with a matrix type such as "rsa".
bool is_rutherford_boeing(std::string_view text);

/// Reads a matrix from a text in memory. @param name for messages, usually the path
/// @throws Error(invalid_input) with name and line
SparseMatrix parse_rutherford_boeing(std::string_view text, const std::string& name, const ReadOptions& options = {});

}  // namespace espalier::matrix
