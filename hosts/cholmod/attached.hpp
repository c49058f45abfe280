/// \file
/// What we know of a factor of CHOLMOD's. The host holds the real library's own object, with its order: what we do not
/// do, the real library does with it.
#pragma once

// This header wants the other before it.
#include <suitesparse/SuiteSparse_config.h>
//
#include <suitesparse/cholmod_core.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "common/host_solver.hpp"
#include "common/real_library.hpp"

namespace espalier::hosts::cholmod {

using Long = SuiteSparse_long;

RealLibrary& real_library();

/// The function of the real library for integers of this type; null: there is none.
template <class Int, class Function>
Function* real_function(const char* what) {
  const std::string prefix = sizeof(Int) == 4 ? "cholmod_" : "cholmod_l_";
  return real_library().function<Function>((prefix + what).c_str());
}

/// Its answer, `otherwise` where it is not there.
template <class Int, class Answer, class... Arguments>
Answer ask_real(const char* what, Answer otherwise, Arguments... arguments) {
  auto* function = real_function<Int, Answer(Arguments...)>(what);
  if (function == nullptr) return otherwise;
  const InsideReal inside;
  return function(arguments...);
}

/// A solver beside a cholmod_factor. Our analysis has to pay: it begins once the real library has spent about as much
/// on the matrices of this pattern as our analysis would take, or will have done with the next one.
template <class Int>
class Attached {
 public:
  /// @param flops, entries  of the factorization by the real library's order, and of one triangle
  Attached(double flops, double entries) : flops_(flops), entries_(entries) {}

  [[nodiscard]] bool pays() const;
  /// The real library has factorized one, in so many seconds.
  void note_real(double seconds) {
    spent_ += seconds;
    factorized = false;
  }
  /// Whether matrices like this are ours: real, square, one triangle given.
  static bool takes(const cholmod_sparse& a);
  /// Factorizes. @pre takes(a) @returns an espalier_status
  int factorize(const cholmod_sparse& a);
  /// Solves for b.ncol right-hand sides; x has room for as many, x.d values apart. @returns an espalier_status
  int solve(const cholmod_dense& b, cholmod_dense& x);
  /// 1 / (|A| |A^-1 v|) in the infinity norm, v of ones and minus ones.
  double reciprocal_condition();
  /// The matrix of the last factorization in our arrays, for the real library.
  cholmod_sparse matrix();
  [[nodiscard]] const espalier_analysis_info& analysis() const { return solver_->analysis(); }

  const void* const site = Caller::current();  // who has made the factor
  bool factorized = false;
  std::mutex mutex;  // for all calls

 private:
  const double flops_, entries_;
  double spent_ = 0;
  std::int64_t n_ = 0;
  int stype_ = 0;
  std::vector<Int> pointers_, indices_;
  std::vector<double> values_;
  std::unique_ptr<HostSolver> solver_;
};

}  // namespace espalier::hosts::cholmod
