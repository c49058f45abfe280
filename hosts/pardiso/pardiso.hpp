/// \file
/// What the interfaces of PARDISO have in common: phases, types of matrices, errors.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "common/host_solver.hpp"

namespace espalier::hosts::pardiso {

/// Matrices that are solved. Complex ones (3, 4, -4, 6, 13) are refused.
enum Type : int { kStructurallySymmetric = 1, kPositiveDefinite = 2, kIndefinite = -2, kUnsymmetric = 11 };

enum Error : int {
  kOk = 0,
  kBadInput = -1,  ///< inconsistent, or not offered by us
  kNoMemory = -2,
  kNoOrder = -3,  ///< the structure has no factorization
  kZeroPivot = -4,
  kInternal = -5,
};

/// What a call asks for, from whatever array the host keeps it in.
struct Settings {
  bool zero_based = false;
  bool into_b = false;       ///< the solution also overwrites the right-hand side
  bool single = false;       ///< values and vectors are floats
  bool check = false;        ///< refuse unsorted rows and entries below the diagonal of a symmetric matrix
  bool matching = false;     ///< the analysis may look at values
  int transpose = 0;         ///< 0: A, else A^T
  int refinement_steps = 0;  ///< at most; 0: two where pivots were perturbed
  int threads = 0;           ///< 0: ours or the user's choice
  int perturbation = 13;     ///< pivots below 10^-this are replaced
};

/// The arguments of a call, as the host gives them.
template <class Int>
struct Call {
  Int maxfct = 1, mnum = 1, type = 0, phase = 0, n = 0, columns = 0;
  const void* values = nullptr;
  const Int* pointers = nullptr;
  const Int* indices = nullptr;
  void* b = nullptr;
  void* x = nullptr;
  Settings settings;
};

/// What a call leaves for the host to read. Below 0: nothing new.
struct Report {
  std::int64_t refinement_steps = -1, perturbed = -1, positive = -1, negative = -1;
  std::int64_t analysis_kilobytes = -1, factor_kilobytes = -1;
  std::int64_t factor_entries = -1, megaflops = -1;
  std::int64_t bad_row = -1;  ///< from 1 on: where a pivot vanished
};

/// The factors behind one handle of the host: up to maxfct of one pattern.
class Problem {
 public:
  explicit Problem(const char* interface) : interface_(interface) {}
  /// @returns an Error
  template <class Int>
  int run(const Call<Int>& call, Report& report);

 private:
  template <class Int>
  int analyze(const Call<Int>& call, Report& report);
  template <class Int>
  int factorize(const Call<Int>& call, Report& report);
  template <class Int>
  int solve(const Call<Int>& call, Report& report);
  int analyze_again(const double* values);
  int give_solver(std::size_t slot);
  const double* as_doubles(const void* from, std::int64_t count, bool single, std::vector<double>& buffer) const;

  struct Slot {
    std::unique_ptr<HostSolver> solver;
    bool factorized = false;
  };
  const char* interface_;
  std::mutex mutex_;
  int type_ = 0;
  std::int64_t n_ = -1, entries_ = 0;
  bool values_pending_ = false;                   // the analysis wants values, and has seen none
  std::vector<std::int64_t> pointers_, indices_;  // 0-based, while values are pending
  std::vector<Slot> slots_;
  std::vector<double> values_, right_hand_sides_;  // where the host's are floats
};

}  // namespace espalier::hosts::pardiso
