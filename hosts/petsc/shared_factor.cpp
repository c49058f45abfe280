#include "petsc/shared_factor.hpp"

#include <espalier/mpi.h>

#include <utility>

#include "common/border.hpp"
#include "common/inertia_solver.hpp"

namespace espalier::hosts::petsc {

namespace {

constexpr auto kSuccess = static_cast<PetscErrorCode>(0);  // PETSC_SUCCESS from version 3.19 on

}  // namespace

// What fails in one process before a collective call must not leave the others in it.
int SharedFactor::agreed(int status) const {
  int worst = status;
  if (MPI_Allreduce(&status, &worst, 1, MPI_INT, MPI_MAX, comm_) != MPI_SUCCESS) return ESPALIER_DEVICE_ERROR;
  return worst;
}

PetscErrorCode SharedFactor::take_rows(Mat a, bool* same) {
  PetscFunctionBegin;
  PetscInt end = 0;
  PetscCall(MatGetSize(a, &n_, nullptr));
  PetscCall(MatGetOwnershipRange(a, &first_, &end));
  std::vector<PetscInt> pointers{0}, indices;
  values_.clear();
  for (PetscInt row = first_; row < end; ++row) {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    PetscCall(MatGetRow(a, row, &count, &columns, &values));
    for (PetscInt k = 0; k < count; ++k) {
      if (!lu_ && columns[k] < row) continue;
      indices.push_back(columns[k]);
      values_.push_back(values[k]);
    }
    PetscCall(MatRestoreRow(a, row, &count, &columns, &values));
    pointers.push_back(static_cast<PetscInt>(indices.size()));
  }
  *same = pointers == pointers_ && indices == indices_;
  pointers_ = std::move(pointers);
  indices_ = std::move(indices);
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode SharedFactor::factorize(Mat a, bool definite, int* status) {
  PetscFunctionBegin;
  bool same = false;
  int own = ESPALIER_INTERNAL_ERROR;
  PetscErrorCode error = kSuccess;
  guarded(
      [&] {
        error = take_rows(a, &same);
        own = ESPALIER_OK;
      },
      [&] { own = ESPALIER_OUT_OF_MEMORY; }, [] {});
  PetscCall(error);
  *status = agreed(own);
  if (agreed(same ? 0 : 1) != 0) forget();
  if (*status != ESPALIER_OK || n_ == 0) PetscFunctionReturn(kSuccess);
  *status = ESPALIER_INTERNAL_ERROR;
  guarded([&] { *status = factorize_rows(definite); }, [&] { *status = ESPALIER_OUT_OF_MEMORY; }, [] {});
  PetscFunctionReturn(kSuccess);
}

int SharedFactor::factorize_rows(bool definite) {
  if (lu_) return refactorize("lu");
  if (definite) {
    const int status = refactorize("llt");
    if (status != ESPALIER_NOT_POSITIVE_DEFINITE) return status;
  }
  const int status = refactorize("ldlt");
  if (status != ESPALIER_OK) return status;
  const espalier_factor_info& f = solver_->factor();
  return f.zero > 0 || f.perturbed > 0 ? int{ESPALIER_SINGULAR} : status;
}

// Analyzed anew where there is no analysis for this kind, or where its scaling may be that of other values.
int SharedFactor::refactorize(const char* kind) {
  for (bool afresh = solver_ == nullptr || kind_ != kind;; afresh = true) {
    if (afresh) {
      kind_ = kind;
      if (const int status = analyze(); status != ESPALIER_OK) return status;
    }
    const int status = solver_->factorize(values_.data(), static_cast<std::int64_t>(values_.size()));
    const bool perturbed = status == ESPALIER_OK && solver_->factor().perturbed > 0;
    if (kind_ != "ldlt" && status == ESPALIER_OK) solver_->set_refinement(perturbed ? 2 : 0);
    if (afresh || kind_ == "ldlt" || !(perturbed || status == ESPALIER_SINGULAR)) return status;
  }
}

int SharedFactor::analyze() {
  solver_ = std::make_unique<HostSolver>("petsc");
  if (kind_ == "ldlt") {
    InertiaSolver::prepare(*solver_);
    InertiaSolver::choose_pivots(*solver_, PivotWish{});
  } else {
    solver_->insist("kind", kind_);
    solver_->set_default("required_backward_error", "inf");  // HostSolver looks
    solver_->set_default("refinement_target", "1e-14");
  }
  if (const int status = espalier_use_mpi(solver_->handle(), comm_, 0); status != ESPALIER_OK) return status;
  auto part = sized<espalier_local_rows_i32>();
  part.n = n_;
  part.first_row = first_;
  part.rows = static_cast<PetscInt>(pointers_.size()) - 1;
  part.pointers = pointers_.data();
  part.indices = indices_.data();
  part.values = values_.data();
  part.storage = lu_ ? ESPALIER_GENERAL : ESPALIER_SYMMETRIC_UPPER;
  return solver_->analyze(part);
}

int SharedFactor::solve(const double* b, double* x, bool transposed) {
  if (n_ == 0) return ESPALIER_OK;
  if (solver_ == nullptr) return ESPALIER_MISUSE;
  return solver_->solve(b, x, 1, transposed ? ESPALIER_TRANSPOSE : ESPALIER_NO_TRANSPOSE);
}

}  // namespace espalier::hosts::petsc
