/// \file
/// What stands behind the Symbolic and Numeric objects that a host holds.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "common/handles.hpp"
#include "common/host_solver.hpp"
#include "common/real_library.hpp"

namespace espalier::hosts::umfpack {

RealLibrary& real_library();

/// A copy of what a host has set; empty: it has left that to the library.
using Control = std::vector<double>;

/// "umfpack_di_" or "umfpack_dl_" before `what`.
template <class Int>
std::string name_of(const char* what) {
  return std::string(sizeof(Int) == 4 ? "umfpack_di_" : "umfpack_dl_") + what;
}

/// The real library's answer; `otherwise` where it is not there. Its functions for long integers return long in version
/// 5 and int in version 6: no status needs more.
template <class Int, class... Arguments>
int ask_real(const char* what, int otherwise, Arguments... arguments) {
  auto* function = real_library().function<int(Arguments...)>(name_of<Int>(what).c_str());
  if (function == nullptr) return otherwise;
  const InsideReal inside;
  return function(arguments...);
}

/// A Symbolic object: a pattern, and solvers that share its analysis. Values decide our order as well, so it is made
/// with those of the first factorization. It has to pay: it begins once the real library has spent about as much on
/// this pattern as our analysis would take, or will have done with the next matrix.
template <class Int>
class Symbolic {
 public:
  /// @param real   the real library's object for the same matrix, which is now ours to end; null: there is none
  /// @param flops  of a factorization by its order, as far as it knows
  Symbolic(Int n, const Int* pointers, const Int* indices, void* real, double flops);
  ~Symbolic();
  Symbolic(const Symbolic&) = delete;
  Symbolic& operator=(const Symbolic&) = delete;

  /// A solver that no one uses; where there is none yet, or `afresh` says so, one that is ordered by `values`: then
  /// `afresh` is true afterwards. Null: `status` says why.
  std::shared_ptr<HostSolver> take(const double* values, bool& afresh, int& status);
  [[nodiscard]] bool same_pattern(const Int* pointers, const Int* indices) const;
  /// The real library's object; null: there is none.
  [[nodiscard]] void* real() const { return real_; }
  [[nodiscard]] bool pays();
  /// Whether our order is so much worse than the real library's that its factorization is the faster one.
  [[nodiscard]] bool too_costly(double our_flops) const;
  /// The real library has factorized one, in so many seconds.
  void note_real(double seconds);

  const Int n;
  const void* const site = Caller::current();  // who has made it
  const std::vector<Int> pointers, indices;

 private:
  void* real_;
  const double flops_;
  std::mutex mutex_;  // of the two below
  std::vector<std::shared_ptr<HostSolver>> solvers_;
  double spent_ = 0;
};

/// A Numeric object. It keeps the values, for hosts that will ask for the factors themselves.
template <class Int>
class Numeric {
 public:
  Numeric(std::shared_ptr<Symbolic<Int>> of, const double* values, const double* control);
  ~Numeric();
  Numeric(const Numeric&) = delete;
  Numeric& operator=(const Numeric&) = delete;

  /// @returns an espalier_status; ESPALIER_CANCELLED where it was too costly
  int factorize();
  /// 1 / (|R A| |(R A)^-1 v|), R the inverse of the rows' sums and v of ones and minus ones: about what the ratio of
  /// pivots says, by which UMFPACK judges.
  double reciprocal_condition();
  /// @returns an espalier_status
  int solve(const double* b, double* x, bool transposed, int steps, espalier_solve_info& info);
  /// The real library's factor; null: there is none.
  void* real();
  [[nodiscard]] bool factorized() const { return solver_ != nullptr; }

  const std::shared_ptr<Symbolic<Int>> symbolic;
  [[nodiscard]] const HostSolver& solver() const { return *solver_; }

 private:
  const std::vector<double> values_;
  const Control control_;
  std::mutex mutex_;                    // of all below
  std::shared_ptr<HostSolver> solver_;  // null: there is no factor
  void* real_ = nullptr;
};

}  // namespace espalier::hosts::umfpack
