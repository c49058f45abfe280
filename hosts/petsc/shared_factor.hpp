/// \file
/// A factorization that all processes of a matrix share: each gives its rows and keeps a part of the factor.
#pragma once

#include <petscmat.h>

#include <memory>
#include <string>
#include <vector>

#include "common/host_solver.hpp"

namespace espalier::hosts::petsc {

/// All calls are collective over the communicator, and all processes get the same status.
class SharedFactor {
 public:
  SharedFactor(MPI_Comm comm, MatFactorType type) : comm_(comm), lu_(type == MAT_FACTOR_LU) {}

  /// @param a  MATMPIAIJ, of a symmetric matrix both triangles
  /// @param definite  Cholesky: L L^T is tried before L D L^T
  /// @param status  an espalier_status
  PetscErrorCode factorize(Mat a, bool definite, int* status);
  /// This process's rows of b and x. @returns an espalier_status
  int solve(const double* b, double* x, bool transposed);
  /// The pattern may be another one.
  void forget() { solver_ = nullptr; }

  /// Null: there is no factorization.
  [[nodiscard]] const HostSolver* solver() const { return solver_.get(); }
  /// Whether it tells the signs of the eigenvalues.
  [[nodiscard]] bool indefinite() const { return kind_ == "ldlt"; }

 private:
  PetscErrorCode take_rows(Mat a, bool* same);
  int analyze();
  int factorize_rows(bool definite);
  int refactorize(const char* kind);
  [[nodiscard]] int agreed(int status) const;

  MPI_Comm comm_;
  bool lu_;
  std::unique_ptr<HostSolver> solver_;
  std::string kind_;
  PetscInt n_ = 0, first_ = 0;
  std::vector<PetscInt> pointers_{0}, indices_;  // of this process's rows; of a symmetric matrix the upper triangle
  std::vector<double> values_;
};

}  // namespace espalier::hosts::petsc
