/* The C interface: a 1-based symmetric matrix by rows, upper triangle, as Fortran programs and PARDISO users keep it.
 */
#include <espalier/espalier.h>
#include <math.h>
#include <stdio.h>

static int check(espalier_solver* solver, int status) {
  if (status != ESPALIER_OK) fprintf(stderr, "%s: %s\n", espalier_status_name(status), espalier_last_error(solver));
  return status;
}

int main(void) {
  /*  4 -1  0      row 1: (1, 1) (1, 2)
   * -1  4 -1      row 2: (2, 2) (2, 3)
   *  0 -1  4      row 3: (3, 3)         */
  const int32_t pointers[] = {1, 3, 5, 6};
  const int32_t indices[] = {1, 2, 2, 3, 3};
  const double values[] = {4, -1, 4, -1, 4};
  const double b[] = {3, 2, 3}; /* A times (1, 1, 1) */
  double x[3];

  espalier_matrix_i32 a = {0};
  espalier_factor_info factor = {0};
  espalier_solve_info solution = {0};
  espalier_solver* solver = NULL;
  int status;

  factor.size = sizeof factor;
  solution.size = sizeof solution;
  a.size = sizeof a;
  a.rows = a.cols = 3;
  a.nonzeros = 5;
  a.pointers = pointers;
  a.indices = indices;
  a.values = values;
  a.layout = ESPALIER_CSR;
  a.storage = ESPALIER_SYMMETRIC_UPPER;
  a.index_base = 1;

  if (espalier_create(&solver) != ESPALIER_OK) return 1;
  status = check(solver, espalier_set_option(solver, "kind", "llt"));
  if (!status) status = check(solver, espalier_analyze_i32(solver, &a, NULL));
  if (!status) status = check(solver, espalier_factorize_i32(solver, &a, &factor));
  if (!status) status = check(solver, espalier_solve(solver, b, x, 1, ESPALIER_NO_TRANSPOSE, &solution));
  espalier_destroy(solver);
  if (status) return 1;

  printf("espalier %s: x = %g %g %g, backward error %.1e, det A = %g\n", espalier_version(), x[0], x[1], x[2],
         solution.backward_error, factor.determinant_sign * exp(factor.determinant_log));
  return fabs(x[0] - 1) + fabs(x[1] - 1) + fabs(x[2] - 1) < 1e-12 ? 0 : 1;
}
