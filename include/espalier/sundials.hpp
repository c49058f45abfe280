/// \file
/// Espalier as a SUNLinearSolver of SUNDIALS (6.x, double precision) for CVODE, IDA, KINSOL and ARKODE with sparse
/// Jacobians.
///
///     SUNMatrix A = SUNSparseMatrix(n, n, nonzeros, CSC_MAT, context);     // or CSR_MAT
///     SUNLinearSolver solver = espalier::SUNLinSol_Espalier(y, A, context);
///     IDASetLinearSolver(ida, solver, A);
///     ...
///     SUNLinSolFree(solver);
///
/// Needs SUNDIALS' headers and its libraries for the generic modules and sparse matrices, and espalier::espalier.
#pragma once

#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_nvector.h>
#include <sunmatrix/sunmatrix_sparse.h>

#include <cstdint>
#include <memory>
#include <new>
#include <type_traits>

#include "espalier/espalier.h"

namespace espalier {

static_assert(std::is_same_v<realtype, double>, "Espalier needs SUNDIALS in double precision");

namespace sundials {

/// What a SUNLinearSolver of ours holds.
struct Content {
  Content() { espalier_create(&solver); }
  ~Content() { espalier_destroy(solver); }
  Content(const Content&) = delete;
  Content& operator=(const Content&) = delete;

  espalier_solver* solver = nullptr;
  bool analyzed = false, factorized = false;
  sunindextype last_flag = 0;  ///< an espalier_status
};

inline Content& content_of(SUNLinearSolver solver) { return *static_cast<Content*>(solver->content); }

using Matrix = std::conditional_t<sizeof(sunindextype) == 8, espalier_matrix_i64, espalier_matrix_i32>;

inline Matrix view(SUNMatrix a) {
  Matrix m{};
  m.size = sizeof m;
  m.rows = SM_ROWS_S(a);
  m.cols = SM_COLUMNS_S(a);
  m.pointers = SM_INDEXPTRS_S(a);
  m.indices = SM_INDEXVALS_S(a);
  m.values = SM_DATA_S(a);
  const bool by_rows = SM_SPARSETYPE_S(a) == CSR_MAT;
  m.nonzeros = m.pointers[by_rows ? m.rows : m.cols];
  m.layout = by_rows ? ESPALIER_CSR : ESPALIER_CSC;
  return m;
}

inline int analyze(espalier_solver* s, const espalier_matrix_i32& a) { return espalier_analyze_i32(s, &a, nullptr); }
inline int analyze(espalier_solver* s, const espalier_matrix_i64& a) { return espalier_analyze_i64(s, &a, nullptr); }
inline int factorize(espalier_solver* s, const espalier_matrix_i32& a) {
  return espalier_factorize_i32(s, &a, nullptr);
}
inline int factorize(espalier_solver* s, const espalier_matrix_i64& a) {
  return espalier_factorize_i64(s, &a, nullptr);
}

/// How SUNDIALS is told: a matrix that cannot be factorized is tried again with a shorter step.
inline int flag_of(Content& c, int status) {
  c.last_flag = status;
  switch (status) {
    case ESPALIER_OK:
    case ESPALIER_ACCURACY_NOT_REACHED:
      return SUNLS_SUCCESS;
    case ESPALIER_SINGULAR:
    case ESPALIER_INVALID_INPUT:  // an entry that is not finite
      return SUNLS_LUFACT_FAIL;
    case ESPALIER_OUT_OF_MEMORY:
      return SUNLS_MEM_FAIL;
    default:
      return SUNLS_PACKAGE_FAIL_UNREC;
  }
}

inline SUNLinearSolver_Type get_type(SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; }
inline SUNLinearSolver_ID get_id(SUNLinearSolver) { return SUNLINEARSOLVER_CUSTOM; }

inline int initialize(SUNLinearSolver solver) {
  Content& c = content_of(solver);
  c.analyzed = c.factorized = false;
  c.last_flag = ESPALIER_OK;
  return SUNLS_SUCCESS;
}

/// Factorizes. A pattern that differs from the one before is analyzed first.
inline int setup(SUNLinearSolver solver, SUNMatrix a) {
  Content& c = content_of(solver);
  if (a == nullptr || SUNMatGetID(a) != SUNMATRIX_SPARSE) return c.last_flag = ESPALIER_MISUSE, SUNLS_ILL_INPUT;
  const Matrix m = view(a);
  c.factorized = false;
  int status = c.analyzed ? factorize(c.solver, m) : int{ESPALIER_INVALID_INPUT};
  if (status == ESPALIER_INVALID_INPUT || status == ESPALIER_MISUSE) {
    status = analyze(c.solver, m);
    c.analyzed = status == ESPALIER_OK;
    if (c.analyzed) status = factorize(c.solver, m);
  }
  c.factorized = status == ESPALIER_OK;
  return flag_of(c, status);
}

/// A x = b with the last factor; `tolerance` is not needed.
inline int solve(SUNLinearSolver solver, SUNMatrix, N_Vector x, N_Vector b, realtype) {
  Content& c = content_of(solver);
  const double* from = N_VGetArrayPointer(b);
  double* to = N_VGetArrayPointer(x);
  if (!c.factorized || from == nullptr || to == nullptr) return c.last_flag = ESPALIER_MISUSE, SUNLS_MEM_NULL;
  return flag_of(c, espalier_solve(c.solver, from, to, 1, ESPALIER_NO_TRANSPOSE, nullptr));
}

inline sunindextype last_flag(SUNLinearSolver solver) { return content_of(solver).last_flag; }

inline int space(SUNLinearSolver, long int* reals, long int* integers) {
  *reals = *integers = 0;  // what a direct solver takes is not SUNDIALS' memory
  return SUNLS_SUCCESS;
}

inline int free(SUNLinearSolver solver) {
  if (solver == nullptr) return SUNLS_SUCCESS;
  delete static_cast<Content*>(solver->content);
  solver->content = nullptr;
  SUNLinSolFreeEmpty(solver);
  return SUNLS_SUCCESS;
}

}  // namespace sundials

/// A direct solver for `a`, which must be a square sparse SUNMatrix, and vectors like `y`, whose entries lie in one
/// array. SUNLinSolFree() ends it. Newton's method refines by itself, so residuals are not computed; ESPALIER_OPTIONS
/// and SUNLinSol_EspalierHandle() change that.
/// @returns null for other matrices and vectors, and where memory is short
inline SUNLinearSolver SUNLinSol_Espalier(N_Vector y, SUNMatrix a, SUNContext context) {
  if (y == nullptr || a == nullptr || SUNMatGetID(a) != SUNMATRIX_SPARSE || SM_ROWS_S(a) != SM_COLUMNS_S(a) ||
      N_VGetArrayPointer(y) == nullptr || N_VGetLength(y) != SM_ROWS_S(a))
    return nullptr;
  std::unique_ptr<sundials::Content> content(new (std::nothrow) sundials::Content);
  if (content == nullptr || content->solver == nullptr) return nullptr;
  SUNLinearSolver solver = SUNLinSolNewEmpty(context);
  if (solver == nullptr) return nullptr;
  espalier_set_option(content->solver, "kind", "lu");
  espalier_set_option(content->solver, "refinement_steps", "0");
  espalier_set_option(content->solver, "required_backward_error", "inf");
  espalier_apply_environment(content->solver);
  solver->content = content.release();
  solver->ops->gettype = sundials::get_type;
  solver->ops->getid = sundials::get_id;
  solver->ops->initialize = sundials::initialize;
  solver->ops->setup = sundials::setup;
  solver->ops->solve = sundials::solve;
  solver->ops->lastflag = sundials::last_flag;
  solver->ops->space = sundials::space;
  solver->ops->free = sundials::free;
  return solver;
}

/// The solver of the C interface inside, for options before the first setup and for messages after a failure.
inline espalier_solver* SUNLinSol_EspalierHandle(SUNLinearSolver solver) { return sundials::content_of(solver).solver; }

}  // namespace espalier
