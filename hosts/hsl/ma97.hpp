/// \file
/// The C interface of the solver MA97 in double precision, as hosts know it: layouts of the structs, and what their
/// fields mean to us. Indices are 0-based, or 1-based where Control::f_arrays is set.
#pragma once

namespace espalier::hosts::ma97 {

/// What a host chooses. Fields that say nothing here are read by no one.
struct Control {
  int f_arrays;  ///< indices are 1-based
  int action;    ///< a singular matrix ends in a warning, with a factor; else in an error
  int nemin;
  double multiplier;
  int ordering;  ///< ours is taken
  int print_level;
  int scaling;   ///< ours is taken
  double small;  ///< smaller pivots of the scaled matrix are zeros
  double u;      ///< threshold of pivoting
  int unit_diagnostics, unit_error, unit_warning;
  long factor_min;
  int solve_blas3;
  long solve_min;
  int solve_mf;
  double consist_tol;
  int ispare[5];
  double rspare[10];
};

/// What a host reads.
struct Info {
  int flag;  ///< Flag
  int flag68, flag77;
  int matrix_dup, matrix_rank, matrix_outrange, matrix_missing_diag;
  int maxdepth, maxfront, num_delay;
  long num_factor, num_flops;
  int num_neg, num_sup, num_two;
  int ordering, stat, maxsupernode;
  int ispare[4];
  double rspare[10];
};

/// Below 0: an error. Of all, hosts tell `singular` from the rest.
enum Flag : int {
  kOk = 0,
  kCallSequence = -1,
  kBadSize = -2,      ///< n < 0
  kBadPointers = -3,  ///< they fall, do not begin at the base, or are null
  kBadMatrix = -4,    ///< an index out of range or above the diagonal
  kBadType = -5,      ///< matrix_type
  kSingular = -7,     ///< or so close to it that no solution has a small backward error
  kNotPositive = -8,  ///< matrix_type 3
  kNotFinite = -9,    ///< an entry
  kBadRightHandSide = -10,
  kBadJob = -11,  ///< of ma97_solve: ours solves with the whole factor alone
  kNoValues = -13,
  kNoMemory = -14,
  kInternal = -99,
  kEntriesLeftOut = 1,  ///< a warning of ma97_analyse with check
  kSingularFactor = 7,  ///< a warning, with Control::action
};

}  // namespace espalier::hosts::ma97
