/// \file
/// One instance of MUMPS (from JOB = -1 to JOB = -2) whose matrix is ours to factorize.
#pragma once

#include <dmumps_c.h>

#include <memory>
#include <vector>

#include "common/host_solver.hpp"
#include "common/inertia_solver.hpp"

namespace espalier::hosts::mumps {

/// INFO(1), below 0 an error; INFO(2) in brackets.
enum Error : int {
  kOk = 0,
  kEntriesLeftOut = 1,         ///< a warning [their number]
  kBadCount = -2,              ///< of entries [it]
  kBadJob = -3,                ///< or out of order [JOB]
  kStructurallySingular = -6,  ///< [structural rank]
  kSingular = -10,             ///< or no solution has a small backward error [pivots that are not zero]
  kNoMemory = -13,
  kBadOrder = -16,    ///< N [it]
  kBadPointer = -22,  ///< [Pointer]
  kBadStride = -26,   ///< LRHS [it]
  kBadColumns = -45,  ///< NRHS [it]
  kNotOffered = -800,
};

/// INFO(2) of kBadPointer.
enum Pointer : int { kRows = 1, kColumns = 2, kValues = 4, kRightHandSides = 7, kSparse = 10 };

/// Places of ICNTL, as MUMPS counts them, that say what we do.
enum Control : int {
  kElements = 5,
  kTranspose = 9,
  kRefinement = 10,
  kErrors = 11,
  kBlocks = 15,
  kDistributed = 18,
  kSchur = 19,
  kRightHandSide = 20,
  kDistributedSolution = 21,
  kNullPivots = 24,
  kDiscardFactors = 31,
  kForwardInFactorization = 32,
  kDeterminant = 33,
  kInverse = 30,
};

inline int icntl(const DMUMPS_STRUC_C& id, Control place) { return id.icntl[place - 1]; }

/// Sets INFO and INFOG.
void report(DMUMPS_STRUC_C& id, int error, std::int64_t detail = 0);
void set_info(DMUMPS_STRUC_C& id, int place, std::int64_t value);

class Instance {
 public:
  /// Whether the problem and what is asked of it are ours: an assembled matrix in one place, of valid sizes.
  static bool takes(const DMUMPS_STRUC_C& id);
  /// Whether the real library would be done before our analysis: few entries, and no optimiser that will come again
  /// (they say SYM = 2).
  static bool small(const DMUMPS_STRUC_C& id);
  /// These report to `id` and return whether to go on.
  bool analyze(DMUMPS_STRUC_C& id);
  bool factorize(DMUMPS_STRUC_C& id);
  bool solve(DMUMPS_STRUC_C& id);

  bool real = false;  ///< the real library works on this problem until the next analysis

 private:
  int factorize_values(const double* given, double threshold);
  int make_plain(const char* kind, const double* values);
  bool solve_dense(DMUMPS_STRUC_C& id, double* x, int columns, int stride);
  bool expand_right_hand_sides(DMUMPS_STRUC_C& id, int columns, int stride);
  bool solve_inverse(DMUMPS_STRUC_C& id);
  void say_factor(DMUMPS_STRUC_C& id, std::int64_t negative) const;
  [[nodiscard]] const HostSolver* solver() const;

  int sym_ = 0;
  std::shared_ptr<const HostPattern> pattern_;
  std::unique_ptr<InertiaSolver> indefinite_;  // SYM = 2, and 1 where it is not positive definite
  std::unique_ptr<HostSolver> plain_;          // SYM = 0 and 1
  bool factorized_ = false;
  std::vector<double> values_;  // in the pattern's order
};

}  // namespace espalier::hosts::mumps
