/// \file
/// A factor on file, with its matrix and analysis: another process, another machine goes on with it.
#pragma once

#include <complex>
#include <string>
#include <type_traits>

#include "espalier/complex_solver.hpp"
#include "espalier/solver.hpp"

namespace espalier {

/// Writes the last factorization of a solver: matrix, analysis, and the numbers of the factor where it lies in the
/// host's memory, in core. The file appears under its name when all of it is on the medium, or not at all; what stood
/// there before stays until then. Every part of it has a checksum. Its numbers are those of this machine's byte order.
/// @pre solver.state() == factorized; a solver of one process. @throws std::logic_error otherwise
/// @returns invalid_input with the system's reason where the file cannot be written
/// @param by_rows  the solver's columns are the rows of what the caller calls A (C and Python, compressed rows): so it
///                 holds A^T, which of a symmetric matrix is A and of a Hermitian one its conjugate. Kept in the file
Status save_factor(Solver& solver, const std::string& path, bool by_rows = false);
Status save_factor(ComplexSolver& solver, const std::string& path, bool by_rows = false);

/// What load_factor() and load_complex_factor() have made.
template <class Value>
struct LoadedFactorOf {
  SolverOf<Value> solver;  ///< factorized, if `result.status` is ok
  std::conditional_t<std::is_same_v<Value, double>, FactorResult, ComplexFactorResult> result;  ///< as it was saved
  Storage storage = Storage::general;  ///< of the matrix, see factorized_matrix()
  bool by_rows = false;                ///< as it was saved
  bool restored = false;  ///< the factor's numbers are those of the file; else the matrix was factorized again
};
using LoadedFactor = LoadedFactorOf<double>;
using LoadedComplexFactor = LoadedFactorOf<std::complex<double>>;

/// A solver with the factor of a file. Kind and precision are those of the file, whatever the options say; threads,
/// devices and all else are those of the options. The numbers of the factor are taken from the file where the host
/// works in core and both versions lay out fronts alike: solutions then have the bits of the solver that was saved, for
/// any number of threads. Else the matrix is factorized again, in the order of the file, without an analysis.
///
/// The matrix is that of the file, duplicates summed, see factorized_matrix(); refactorize() takes values in its order.
/// @returns invalid_input in `result.status` for a file that is cut off, damaged, none of ours, of a newer version, or
///          of the other sort of numbers. Reading takes no more memory than the file has bytes, besides what the
///          factorization needs
LoadedFactor load_factor(const std::string& path, Options options = {});
LoadedComplexFactor load_complex_factor(const std::string& path, Options options = {});

/// Whether the matrix in a file is complex. Its checksums are left to those who load it.
/// @throws Error(invalid_input) as they would return it
bool is_complex_factor(const std::string& path);

/// A copy of the matrix of the last factorization, as files have it: duplicates summed; of kind lu all entries, else as
/// it was stored. @throws std::logic_error as save_factor()
SparseMatrix factorized_matrix(Solver& solver);
ComplexSparseMatrix factorized_matrix(ComplexSolver& solver);

}  // namespace espalier
