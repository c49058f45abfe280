/// \file
/// A solver package of PETSc, which loads it by -dll_append and finds it under the name "espalier": LU of AIJ and BAIJ
/// matrices, Cholesky (L D L^T, with inertia) of AIJ and SBAIJ. The processes of a matrix share its factorization, and
/// give and get their own rows of it and of vectors.
#include <petsc/private/matimpl.h>

#include <algorithm>
#include <memory>

#include "common/border.hpp"
#include "common/inertia_solver.hpp"
#include "petsc/shared_factor.hpp"

namespace espalier::hosts::petsc {

namespace {

constexpr const char* kName = "espalier";
constexpr auto kSuccess = static_cast<PetscErrorCode>(0);  // PETSC_SUCCESS from version 3.19 on

static_assert(sizeof(PetscInt) == 4 && sizeof(PetscScalar) == 8, "CMake leaves other builds of PETSc out");

/// Behind a factor's Mat::data, in each process.
struct Factor {
  std::unique_ptr<SharedFactor> shared;       // of several processes; of one, one of these two:
  std::unique_ptr<HostSolver> plain;          // LU, and L L^T where the matrix is said to be positive definite
  std::unique_ptr<InertiaSolver> indefinite;  // L D L^T
  bool analyzed = false, factorized = false;

  [[nodiscard]] const HostSolver* solver() const {
    if (shared != nullptr) return shared->solver();
    return plain != nullptr ? plain.get() : indefinite != nullptr ? &indefinite->solver() : nullptr;
  }
};

Factor& factor_of(Mat mat) { return *static_cast<Factor*>(mat->data); }

bool several(Mat mat) {
  PetscMPIInt size = 1;
  MPI_Comm_size(PetscObjectComm(reinterpret_cast<PetscObject>(mat)), &size);
  return size > 1;
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

/// The matrix by rows, with all entries; to be destroyed.
PetscErrorCode by_rows(Mat a, Mat* rows) {
  PetscFunctionBegin;
  PetscBool fits = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(a), &fits, MATSEQAIJ, MATMPIAIJ, ""));
  *rows = a;
  if (!fits)
    PetscCall(MatConvert(a, several(a) ? MATMPIAIJ : MATSEQAIJ, MAT_INITIAL_MATRIX, rows));
  else
    PetscCall(PetscObjectReference(reinterpret_cast<PetscObject>(a)));
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
      f.plain->set_default("required_backward_error", "inf");  // HostSolver looks
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

PetscErrorCode factorize_alone(Mat mat, Mat a, bool definite, int* status) {
  PetscFunctionBegin;
  Factor& f = factor_of(mat);
  Rows rows{};
  PetscBool done = PETSC_FALSE;
  PetscCall(MatGetRowIJ(a, 0, PETSC_FALSE, PETSC_FALSE, &rows.n, &rows.pointers, &rows.indices, &done));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_SUP, "espalier: the matrix has no rows to read");
  PetscCall(MatSeqAIJGetArrayRead(a, &rows.values));
  *status = status_of([&] {
    if (rows.n == 0) return int{ESPALIER_OK};
    return mat->factortype == MAT_FACTOR_LU ? factorize_lu(f, rows) : factorize_symmetric(f, rows, definite);
  });
  PetscCall(MatSeqAIJRestoreArrayRead(a, &rows.values));
  PetscCall(MatRestoreRowIJ(a, 0, PETSC_FALSE, PETSC_FALSE, &rows.n, &rows.pointers, &rows.indices, &done));
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode factorize(Mat mat, Mat a, const MatFactorInfo*) {
  PetscFunctionBegin;
  Factor& f = factor_of(mat);
  const bool definite = a->spd == PETSC_BOOL3_TRUE;
  Mat rows = nullptr;
  PetscCall(by_rows(a, &rows));
  int status = ESPALIER_OK;
  if (f.shared != nullptr)
    PetscCall(f.shared->factorize(rows, definite, &status));
  else
    PetscCall(factorize_alone(mat, rows, definite, &status));
  PetscCall(MatDestroy(&rows));
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
  if (f.factorized) {
    const PetscScalar* right = nullptr;
    PetscScalar* left = nullptr;
    if (b != x) PetscCall(VecGetArrayRead(b, &right));
    PetscCall(VecGetArray(x, &left));
    const PetscScalar* from = b == x ? left : right;
    status = status_of([&] {
      return f.shared != nullptr ? f.shared->solve(from, left, transposed)
                                 : solve_array(f, from, left, mat->rmap->N, transposed);
    });
    PetscCall(VecRestoreArray(x, &left));
    if (b != x) PetscCall(VecRestoreArrayRead(b, &right));
  }
  // A factor that failed has said so, one that cannot solve says it now; PETSc expects a vector of what is no number.
  if (status == ESPALIER_ACCURACY_NOT_REACHED) mat->factorerrortype = MAT_FACTOR_NUMERIC_ZEROPIVOT;
  if (!f.factorized || status == ESPALIER_ACCURACY_NOT_REACHED) {
    PetscCall(VecSetInf(x));
    PetscFunctionReturn(kSuccess);
  }
  PetscCheck(status == ESPALIER_OK, PetscObjectComm(reinterpret_cast<PetscObject>(mat)), PETSC_ERR_LIB, "espalier: %s",
             espalier_status_name(status));
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode solve(Mat mat, Vec b, Vec x) { return solve_with(mat, b, x, false); }

PetscErrorCode solve_transposed(Mat mat, Vec b, Vec x) { return solve_with(mat, b, x, true); }

PetscErrorCode inertia(Mat mat, PetscInt* negative, PetscInt* zero, PetscInt* positive) {
  PetscFunctionBegin;
  const Factor& f = factor_of(mat);
  PetscInt counts[3] = {0, 0, 0};
  const bool signs = f.shared != nullptr ? f.shared->indefinite() : f.indefinite != nullptr;
  if (f.solver() != nullptr && signs) {
    const espalier_factor_info& found = f.solver()->factor();
    counts[0] = static_cast<PetscInt>(found.negative);
    counts[1] = static_cast<PetscInt>(found.zero);
    counts[2] = static_cast<PetscInt>(found.positive);
  } else if (f.solver() != nullptr) {
    counts[2] = mat->rmap->N;
  }
  if (negative != nullptr) *negative = counts[0];
  if (zero != nullptr) *zero = counts[1];
  if (positive != nullptr) *positive = counts[2];
  PetscFunctionReturn(kSuccess);
}

/// The order is found with the values, in the numeric phase.
PetscErrorCode begin(Mat mat) {
  PetscFunctionBegin;
  Factor& f = factor_of(mat);
  f.analyzed = f.factorized = false;
  if (f.shared != nullptr) f.shared->forget();
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
  const HostSolver* solver = factor_of(mat).solver();
  if (text && solver != nullptr)
    PetscCall(PetscViewerASCIIPrintf(viewer, "espalier: %lld entries in the factor, %g flops\n",
                                     static_cast<long long>(solver->analysis().nonzeros_factor),
                                     solver->analysis().flops));
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode get_info(Mat mat, MatInfoType, MatInfo* info) {
  PetscFunctionBegin;
  PetscCall(PetscMemzero(info, sizeof *info));
  const HostSolver* solver = factor_of(mat).solver();
  if (solver != nullptr) info->nz_used = info->nz_allocated = static_cast<double>(solver->analysis().nonzeros_factor);
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode destroy(Mat mat) {
  PetscFunctionBegin;
  delete &factor_of(mat);
  mat->data = nullptr;
  PetscCall(PetscObjectComposeFunction(reinterpret_cast<PetscObject>(mat), "MatFactorGetSolverType_C", nullptr));
  PetscFunctionReturn(kSuccess);
}

PetscErrorCode create(Mat a, MatFactorType type, Mat* made) {
  PetscFunctionBegin;
  PetscCheck(a->rmap->N == a->cmap->N, PetscObjectComm(reinterpret_cast<PetscObject>(a)), PETSC_ERR_ARG_WRONG,
             "espalier: the matrix is not square");
  PetscInt differ = a->rmap->n == a->cmap->n ? 0 : 1;
  PetscCallMPI(
      MPI_Allreduce(MPI_IN_PLACE, &differ, 1, MPIU_INT, MPI_MAX, PetscObjectComm(reinterpret_cast<PetscObject>(a))));
  PetscCheck(differ == 0, PetscObjectComm(reinterpret_cast<PetscObject>(a)), PETSC_ERR_SUP,
             "espalier: a process has other rows than columns; give vectors of both sides the same layout");
  Mat mat = nullptr;
  PetscCall(MatCreate(PetscObjectComm(reinterpret_cast<PetscObject>(a)), &mat));
  PetscCall(MatSetSizes(mat, a->rmap->n, a->cmap->n, a->rmap->N, a->cmap->N));
  PetscCall(PetscStrallocpy(kName, &reinterpret_cast<PetscObject>(mat)->type_name));
  PetscCall(MatSetUp(mat));
  auto* data = new (std::nothrow) Factor;
  PetscCheck(data != nullptr, PETSC_COMM_SELF, PETSC_ERR_MEM, "espalier: out of memory");
  mat->data = data;
  if (several(mat)) {
    data->shared.reset(new (std::nothrow) SharedFactor(PetscObjectComm(reinterpret_cast<PetscObject>(mat)), type));
    PetscCheck(data->shared != nullptr, PETSC_COMM_SELF, PETSC_ERR_MEM, "espalier: out of memory");
  }
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
