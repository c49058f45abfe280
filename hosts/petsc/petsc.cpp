/// \file
/// A solver package of PETSc, which loads it by -dll_append and finds it under the name "espalier": LU of AIJ and BAIJ
/// matrices, Cholesky (L D L^T, with inertia) of AIJ and SBAIJ. A matrix of several processes is gathered in the first
/// of them, which factorizes and solves.
#include <petsc/private/matimpl.h>

#include <algorithm>
#include <memory>

#include "common/border.hpp"
#include "common/inertia_solver.hpp"

namespace espalier::hosts::petsc {

namespace {

constexpr const char* kName = "espalier";
constexpr auto kSuccess = static_cast<PetscErrorCode>(0);  // PETSC_SUCCESS from version 3.19 on

static_assert(sizeof(PetscInt) == 4 && sizeof(PetscScalar) == 8, "CMake leaves other builds of PETSc out");

/// Behind a factor's Mat::data, in each process; the solvers stand in the first one alone.
struct Factor {
  std::unique_ptr<HostSolver> plain;          // LU, and L L^T where the matrix is said to be positive definite
  std::unique_ptr<InertiaSolver> indefinite;  // L D L^T
  bool analyzed = false, factorized = false;
  Vec whole = nullptr;  // a vector's entries in the first process, where there are several
  VecScatter gather = nullptr;
};

Factor& factor_of(Mat mat) { return *static_cast<Factor*>(mat->data); }

bool several(Mat mat) {
  PetscMPIInt size = 1;
  MPI_Comm_size(PetscObjectComm(reinterpret_cast<PetscObject>(mat)), &size);
  return size > 1;
}

bool first(Mat mat) {
  PetscMPIInt rank = 0;
  MPI_Comm_rank(PetscObjectComm(reinterpret_cast<PetscObject>(mat)), &rank);
  return rank == 0;
}

/// Runs `body`, which returns an espalier_status.
template <class Body>
int status_of(Body&& body) {
  int status = ESPALIER_INTERNAL_ERROR;
  guarded([&] { status = body(); }, [&] { status = ESPALIER_OUT_OF_MEMORY; }, [] {});
  return status;
}

PetscErrorCode solver_type(Mat, MatSolverType* type) {
  *type = kName;
  return kSuccess;
}

/// The whole matrix by rows, with all entries, in the first process; null in the others.
PetscErrorCode gather_matrix(Mat a, Mat* whole) {
  PetscFunctionBegin;
  PetscBool rows = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(a), &rows, MATSEQAIJ, MATMPIAIJ, ""));
  Mat by_rows = a;
  if (!rows)
    PetscCall(MatConvert(a, several(a) ? MATMPIAIJ : MATSEQAIJ, MAT_INITIAL_MATRIX, &by_rows));
  else
    PetscCall(PetscObjectReference(reinterpret_cast<PetscObject>(a)));
  if (!several(a)) {
    *whole = by_rows;
    PetscFunctionReturn(kSuccess);
  }
  IS all = nullptr;
  Mat* parts = nullptr;
  PetscCall(ISCreateStride(PETSC_COMM_SELF, first(a) ? a->rmap->N : 0, 0, 1, &all));
  PetscCall(MatCreateSubMatrices(by_rows, 1, &all, &all, MAT_INITIAL_MATRIX, &parts));
  PetscCall(MatDestroy(&by_rows));
  PetscCall(ISDestroy(&all));
  *whole = nullptr;
  if (first(a)) {
    *whole = parts[0];
    PetscCall(PetscObjectReference(reinterpret_cast<PetscObject>(*whole)));
  }
  PetscCall(MatDestroySubMatrices(1, &parts));
  PetscFunctionReturn(kSuccess);
}

/// A matrix in PETSc's arrays.
struct Rows {
  PetscInt n;
  const PetscInt *pointers, *indices;
  const PetscScalar* values;
};

int factorize_plain(Factor& f, const Rows& a, const char* kind, const espalier_matrix_i32& matrix,
                    const double* values) {
  for (bool afresh = !f.analyzed || f.plain == nullptr;; afresh = true) {
    int status = ESPALIER_OK;
    if (afresh) {
      f.plain = std::make_unique<HostSolver>("petsc");
      f.plain->insist("kind", kind);
      f.plain->set_default("required_backward_error", "inf");
      f.plain->set_default("refinement_target", "1e-14");
      status = f.plain->analyze(matrix);
    }
    if (status == ESPALIER_OK) status = f.plain->factorize(values, matrix.nonzeros);
    if (status == ESPALIER_OK) f.plain->set_refinement(f.plain->factor().perturbed > 0 ? 2 : 0);
    // The scaling may be that of other values.
    const bool weak = status == ESPALIER_SINGULAR || (status == ESPALIER_OK && f.plain->factor().perturbed > 0);
    if (!weak || afresh || a.n == 0) return status;
  }
}

int factorize_lu(Factor& f, const Rows& a) {
  auto matrix = sized<espalier_matrix_i32>();
  matrix.rows = matrix.cols = a.n;
  matrix.nonzeros = a.pointers[a.n];
  matrix.pointers = a.pointers;
  matrix.indices = a.indices;
  matrix.values = a.values;
  matrix.layout = ESPALIER_CSR;
  return factorize_plain(f, a, "lu", matrix, a.values);
}

/// Rows as columns: of a symmetric matrix that is the same, and the pattern leaves the upper triangle out.
int factorize_symmetric(Factor& f, const Rows& a, bool definite) {
  const auto pattern =
      std::make_shared<const HostPattern>(HostPattern::from_columns(a.n, a.pointers, a.indices, 0, true));
  if (definite) {
    std::vector<double> buffer;
    const double* values = pattern->gather(a.values, buffer);
    const int status = factorize_plain(f, a, "llt", pattern->matrix(values), values);
    if (status != ESPALIER_NOT_POSITIVE_DEFINITE) return status;
    f.analyzed = false;
  }
  f.plain = nullptr;
  if (!f.analyzed || f.indefinite == nullptr) f.indefinite = std::make_unique<InertiaSolver>("petsc", pattern);
  const Inertia inertia = f.indefinite->factorize(a.values, {});
  return inertia.status == ESPALIER_OK && inertia.singular ? int{ESPALIER_SINGULAR} : inertia.status;
}

PetscErrorCode factorize(Mat mat, Mat a, const MatFactorInfo*) {
  PetscFunctionBegin;
  Factor& f = factor_of(mat);
  Mat whole = nullptr;
  PetscCall(gather_matrix(a, &whole));
  int status = ESPALIER_OK;
  if (whole != nullptr) {
    Rows rows{};
    PetscBool done = PETSC_FALSE;
    PetscCall(MatGetRowIJ(whole, 0, PETSC_FALSE, PETSC_FALSE, &rows.n, &rows.pointers, &rows.indices, &done));
    PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_SUP, "espalier: the matrix has no rows to read");
    PetscCall(MatSeqAIJGetArrayRead(whole, &rows.values));
    const bool definite = a->spd == PETSC_BOOL3_TRUE;
    status = status_of([&] {
      if (rows.n == 0) return int{ESPALIER_OK};
      return mat->factortype == MAT_FACTOR_LU ? factorize_lu(f, rows) : factorize_symmetric(f, rows, definite);
    });
    PetscCall(MatSeqAIJRestoreArrayRead(whole, &rows.values));
    PetscCall(MatRestoreRowIJ(whole, 0, PETSC_FALSE, PETSC_FALSE, &rows.n, &rows.pointers, &rows.indices, &done));
  }
  PetscCall(MatDestroy(&whole));
  if (several(mat))
    PetscCallMPI(MPI_Bcast(&status, 1, MPI_INT, 0, PetscObjectComm(reinterpret_cast<PetscObject>(mat))));
  f.analyzed = f.factorized = status == ESPALIER_OK;
  mat->assembled = PETSC_TRUE;
  mat->factorerrortype = MAT_FACTOR_NOERROR;
  if (status == ESPALIER_SINGULAR) mat->factorerrortype = MAT_FACTOR_NUMERIC_ZEROPIVOT;
  if (status == ESPALIER_OUT_OF_MEMORY) mat->factorerrortype = MAT_FACTOR_OUTMEMORY;
  const bool told = status == ESPALIER_OK || (mat->factorerrortype != MAT_FACTOR_NOERROR && !a->erroriffailure);
  PetscCheck(told, PetscObjectComm(reinterpret_cast<PetscObject>(mat)), PETSC_ERR_LIB, "espalier: %s",
             espalier_status_name(status));
  PetscFunctionReturn(kSuccess);
}

int solve_array(Factor& f, const double* b, double* x, PetscInt n, bool transposed) {
  if (n == 0) return ESPALIER_OK;
  if (f.plain != nullptr) return f.plain->solve(b, x, 1, transposed ? ESPALIER_TRANSPOSE : ESPALIER_NO_TRANSPOSE);
  if (f.indefinite == nullptr) return ESPALIER_MISUSE;
  if (x != b) std::copy_n(b, n, x);
  return f.indefinite->solve(x, 1, n);
}

PetscErrorCode solve_with(Mat mat, Vec b, Vec x, bool transposed) {
  PetscFunctionBegin;
  Factor& f = factor_of(mat);
  int status = f.factorized ? ESPALIER_OK : ESPALIER_MISUSE;
  Vec from = b, to = x;
  if (several(mat)) {
    if (f.whole == nullptr) PetscCall(VecScatterCreateToZero(b, &f.gather, &f.whole));
    PetscCall(VecScatterBegin(f.gather, b, f.whole, INSERT_VALUES, SCATTER_FORWARD));
    PetscCall(VecScatterEnd(f.gather, b, f.whole, INSERT_VALUES, SCATTER_FORWARD));
    from = to = f.whole;
  }
  if (f.factorized && first(mat)) {
    const PetscScalar* right = nullptr;
    PetscScalar* left = nullptr;
    if (from != to) PetscCall(VecGetArrayRead(from, &right));
    PetscCall(VecGetArray(to, &left));
    status = status_of([&] { return solve_array(f, from == to ? left : right, left, mat->rmap->N, transposed); });
    PetscCall(VecRestoreArray(to, &left));
    if (from != to) PetscCall(VecRestoreArrayRead(from, &right));
  }
  if (several(mat)) {
    PetscCallMPI(MPI_Bcast(&status, 1, MPI_INT, 0, PetscObjectComm(reinterpret_cast<PetscObject>(mat))));
    PetscCall(VecScatterBegin(f.gather, f.whole, x, INSERT_VALUES, SCATTER_REVERSE));
    PetscCall(VecScatterEnd(f.gather, f.whole, x, INSERT_VALUES, SCATTER_REVERSE));
  }
  // A factor that failed has said so; PETSc expects a vector of what is no number.
  if (!f.factorized) {
    PetscCall(VecSetInf(x));
    PetscFunctionReturn(kSuccess);
  }
  PetscCheck(status == ESPALIER_OK || status == ESPALIER_ACCURACY_NOT_REACHED,
             PetscObjectComm(reinterpret_cast<PetscObject>(mat)), PETSC_ERR_LIB, "espalier: %s",
             espalier_status_name(status));
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode solve(Mat mat, Vec b, Vec x) { return solve_with(mat, b, x, false); }

PetscErrorCode solve_transposed(Mat mat, Vec b, Vec x) { return solve_with(mat, b, x, true); }

PetscErrorCode inertia(Mat mat, PetscInt* negative, PetscInt* zero, PetscInt* positive) {
  PetscFunctionBegin;
  const Factor& f = factor_of(mat);
  PetscInt counts[3] = {0, 0, 0};
  if (f.indefinite != nullptr) {
    const espalier_factor_info& found = f.indefinite->solver().factor();
    counts[0] = static_cast<PetscInt>(found.negative);
    counts[1] = static_cast<PetscInt>(found.zero);
    counts[2] = static_cast<PetscInt>(found.positive);
  } else if (f.plain != nullptr) {
    counts[2] = mat->rmap->N;
  }
  if (several(mat))
    PetscCallMPI(MPI_Bcast(counts, 3, MPIU_INT, 0, PetscObjectComm(reinterpret_cast<PetscObject>(mat))));
  if (negative != nullptr) *negative = counts[0];
  if (zero != nullptr) *zero = counts[1];
  if (positive != nullptr) *positive = counts[2];
  PetscFunctionReturn(kSuccess);
}

/// The order is found with the values, in the numeric phase.
PetscErrorCode begin(Mat mat) {
  PetscFunctionBegin;
  factor_of(mat).analyzed = factor_of(mat).factorized = false;
  mat->ops->solve = solve;
  mat->ops->solvetranspose = solve_transposed;
  if (mat->factortype == MAT_FACTOR_LU) {
    mat->ops->lufactornumeric = factorize;
  } else {
    mat->ops->choleskyfactornumeric = factorize;
    mat->ops->getinertia = inertia;
  }
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode begin_lu(Mat mat, Mat, IS, IS, const MatFactorInfo*) { return begin(mat); }

PetscErrorCode begin_cholesky(Mat mat, Mat, IS, const MatFactorInfo*) { return begin(mat); }

PetscErrorCode view(Mat mat, PetscViewer viewer) {
  PetscFunctionBegin;
  PetscBool text = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(viewer), PETSCVIEWERASCII, &text));
  const Factor& f = factor_of(mat);
  const HostSolver* solver = f.plain != nullptr        ? f.plain.get()
                             : f.indefinite != nullptr ? &f.indefinite->solver()
                                                       : nullptr;
  if (text && solver != nullptr)
    PetscCall(PetscViewerASCIIPrintf(viewer, "espalier: %lld entries in the factor, %g flops\n",
                                     static_cast<long long>(solver->analysis().nonzeros_factor),
                                     solver->analysis().flops));
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode get_info(Mat mat, MatInfoType, MatInfo* info) {
  PetscFunctionBegin;
  PetscCall(PetscMemzero(info, sizeof *info));
  const Factor& f = factor_of(mat);
  const HostSolver* solver = f.plain != nullptr        ? f.plain.get()
                             : f.indefinite != nullptr ? &f.indefinite->solver()
                                                       : nullptr;
  if (solver != nullptr) info->nz_used = info->nz_allocated = static_cast<double>(solver->analysis().nonzeros_factor);
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode destroy(Mat mat) {
  PetscFunctionBegin;
  Factor& f = factor_of(mat);
  PetscCall(VecScatterDestroy(&f.gather));
  PetscCall(VecDestroy(&f.whole));
  delete &f;
  mat->data = nullptr;
  PetscCall(PetscObjectComposeFunction(reinterpret_cast<PetscObject>(mat), "MatFactorGetSolverType_C", nullptr));
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode create(Mat a, MatFactorType type, Mat* made) {
  PetscFunctionBegin;
  PetscCheck(a->rmap->N == a->cmap->N, PetscObjectComm(reinterpret_cast<PetscObject>(a)), PETSC_ERR_ARG_WRONG,
             "espalier: the matrix is not square");
  Mat mat = nullptr;
  PetscCall(MatCreate(PetscObjectComm(reinterpret_cast<PetscObject>(a)), &mat));
  PetscCall(MatSetSizes(mat, a->rmap->n, a->cmap->n, a->rmap->N, a->cmap->N));
  PetscCall(PetscStrallocpy(kName, &reinterpret_cast<PetscObject>(mat)->type_name));
  PetscCall(MatSetUp(mat));
  auto* data = new (std::nothrow) Factor;
  PetscCheck(data != nullptr, PETSC_COMM_SELF, PETSC_ERR_MEM, "espalier: out of memory");
  mat->data = data;
  mat->ops->getinfo = get_info;
  mat->ops->destroy = destroy;
  mat->ops->view = view;
  if (type == MAT_FACTOR_LU)
    mat->ops->lufactorsymbolic = begin_lu;
  else
    mat->ops->choleskyfactorsymbolic = begin_cholesky;
  mat->factortype = type;
  mat->assembled = mat->preallocated = mat->trivialsymbolic = PETSC_TRUE;
  mat->canuseordering = PETSC_FALSE;
  PetscCall(PetscFree(mat->solvertype));
  PetscCall(PetscStrallocpy(kName, &mat->solvertype));
  PetscCall(PetscObjectComposeFunction(reinterpret_cast<PetscObject>(mat), "MatFactorGetSolverType_C", solver_type));
  *made = mat;
  PetscFunctionReturn(kSuccess);
}

}  // namespace

/// What -dll_append calls, by the file's name.
ESPALIER_HOST_CALL PetscErrorCode PetscDLLibraryRegister_espalier_petsc(void) {
  PetscFunctionBegin;
  for (const char* type : {MATSEQAIJ, MATMPIAIJ, MATSEQBAIJ, MATMPIBAIJ})
    PetscCall(MatSolverTypeRegister(kName, type, MAT_FACTOR_LU, create));
  for (const char* type : {MATSEQAIJ, MATMPIAIJ, MATSEQSBAIJ, MATMPISBAIJ})
    PetscCall(MatSolverTypeRegister(kName, type, MAT_FACTOR_CHOLESKY, create));
  PetscFunctionReturn(kSuccess);
}

}  // namespace espalier::hosts::petsc
