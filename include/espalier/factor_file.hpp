/// \file
/// A factor on file, with its matrix and analysis: another process, another machine goes on with it.
#pragma once

#include <string>

#include "espalier/solver.hpp"

namespace espalier {

/// Writes the last factorization of a solver: matrix, analysis, and the numbers of the factor where it lies in the
/// host's memory, in core. The file appears under its name when all of it is on the medium, or not at all; what stood
/// there before stays until then. Every part of it has a checksum. Its numbers are those of this machine's byte order.
/// @pre solver.state() == factorized; a solver of one process. @throws std::logic_error otherwise
/// @returns invalid_input with the system's reason where the file cannot be written
/// @param transposed  the solver holds A^T of what the caller calls A: kept in the file (C and Python, matrices by
/// rows)
Status save_factor(Solver& solver, const std::string& path, bool transposed = false);

/// What load_factor() has made.
struct LoadedFactor {
  Solver solver;            ///< factorized, if `result.status` is ok
  FactorResult result;      ///< as the factorization that was saved
  bool transposed = false;  ///< as it was saved
  bool restored = false;    ///< the factor's numbers are those of the file; else the matrix was factorized again
};

/// A solver with the factor of a file. Kind and precision are those of the file, whatever the options say; threads,
/// devices and all else are those of the options. The numbers of the factor are taken from the file where the host
/// works in core and both versions lay out fronts alike: solutions then have the bits of the solver that was saved, for
/// any number of threads. Else the matrix is factorized again, in the order of the file, without an analysis.
///
/// The matrix is that of the file: of kind lu all entries, else one triangle, duplicates summed; refactorize() takes
/// values in that order.
/// @returns invalid_input in `result.status` for a file that is cut off, damaged, none of ours, or of a newer version.
///          Reading takes no more memory than the file has bytes, besides what the factorization needs
LoadedFactor load_factor(const std::string& path, Options options = {});

}  // namespace espalier
