/// \file
/// Small systems in integers, real and complex, whose rank and inertia are known without rounding: by elimination
/// modulo primes, by fraction-free elimination, and by their construction. Disguises (numbering, powers of two up to
/// 1e+-150, storage, duplicates, stored zeros) change none of both. For tests/solver/singular/exact_rank_test.cpp and
/// the campaign (tests/verdict/exact_campaign.cpp).
#pragma once

#include <complex>
#include <cstdint>
#include <string>
#include <vector>

#include "espalier/solver.hpp"

namespace espalier::verdict {

/// A square matrix of (Gaussian) integers, column-major.
struct IntegerMatrix {
  Index n = 0;
  std::vector<std::complex<double>> entries;  ///< n * n, exact

  explicit IntegerMatrix(Index size)
      : n(size), entries(static_cast<std::size_t>(size) * static_cast<std::size_t>(size), 0.0) {}
  std::complex<double>& at(Index r, Index c) { return entries[static_cast<std::size_t>(Offset{c} * n + r)]; }
  [[nodiscard]] std::complex<double> at(Index r, Index c) const {
    return entries[static_cast<std::size_t>(Offset{c} * n + r)];
  }
};

enum class Symmetry { general, symmetric, hermitian };  ///< of real matrices both are `symmetric`

struct ExactCase {
  std::string name;
  IntegerMatrix a{0};
  bool complex = false;
  Symmetry symmetry = Symmetry::general;
  Index zeros = 0;
  Index negative = -1;  ///< eigenvalues below zero; -1: they are not real
  /// |A|_2 over the smallest singular value that is not zero, after equilibration: beyond some 1e12, rounding and
  /// singularity cannot be told apart.
  double condition = 1;
};

/// Rank modulo two primes, with i as a root of -1: the larger one, which is the rank but for a chance of 1e-17.
Index exact_rank(const IntegerMatrix& a);
/// Inertia by fraction-free elimination in 128 bits (of a complex matrix: Hermitian, by its real form).
/// @returns whether no number left their range
bool exact_inertia(const IntegerMatrix& a, Index& negative, Index& zeros);

/// One of all structures, n from 1 to some 60.
ExactCase make_exact_case(std::uint64_t seed);

/// How the same matrix is given to a solver.
struct Disguise {
  Storage storage = Storage::general;
  int units = 0;          ///< all entries times 2^units
  int range = 0;          ///< rows and columns times powers of two up to 2^+-range, alike where they must be
  bool renumber = false;  ///< rows and columns (alike where symmetric)
  bool split = false;     ///< some entries stand twice, rows in any order
  bool zeros = false;     ///< some zeros are stored
};
ComplexSparseMatrix disguised(const ExactCase& c, const Disguise& d, std::uint64_t seed);
/// What a solver makes of it against the truth: rank, inertia, dependent rows, null vectors on both sides, the status,
/// and the backward error of a solution whose right-hand side is in the range of the matrix.
/// @returns what is wrong; empty: nothing. "late": the solution told what the factorization had not
std::string judge(const ExactCase& c, const Disguise& d, const Options& options, std::uint64_t seed);

/// The disguise and options of one run of a campaign, and their names.
struct Trial {
  Disguise disguise;
  Options options;
  std::string name;
};
Trial make_trial(const ExactCase& c, std::uint64_t seed);

}  // namespace espalier::verdict
