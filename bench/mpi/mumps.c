/* One system on the ranks of MPI by MUMPS, for comparison only: a JSON line with the times of factorizations.
 *     mumps FILE.mtx SYM REPEATS     SYM: 1 positive definite, 2 symmetric; a lower triangle in Matrix Market
 * bench/mpi_ranks.py compiles it against the parallel build of Debian. */
#include <dmumps_c.h>
#include <math.h>
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>

#define ICNTL(k) icntl[(k)-1]
#define INFOG(k) infog[(k)-1]
enum { kUseCommWorld = -987654 };

static void fail(const char* what, int number) {
  fprintf(stderr, "mumps: %s (%d)\n", what, number);
  MPI_Abort(MPI_COMM_WORLD, 1);
}

static void job(DMUMPS_STRUC_C* m, int number) {
  m->job = number;
  dmumps_c(m);
  if (m->INFOG(1) < 0) fail("INFOG(1)", m->INFOG(1));
}

static void read_matrix(DMUMPS_STRUC_C* m, const char* path) {
  char line[1024];
  long long n = 0, cols = 0, count = 0, k;
  FILE* file = fopen(path, "r");
  if (file == NULL) fail("the matrix cannot be read", 0);
  do
    if (fgets(line, sizeof line, file) == NULL) fail("the matrix has no head", 0);
  while (line[0] == '%');
  if (sscanf(line, "%lld %lld %lld", &n, &cols, &count) != 3) fail("the matrix has no sizes", 0);
  m->n = (MUMPS_INT)n;
  m->nnz = count;
  m->irn = malloc((size_t)count * sizeof *m->irn);
  m->jcn = malloc((size_t)count * sizeof *m->jcn);
  m->a = malloc((size_t)count * sizeof *m->a);
  for (k = 0; k < count; ++k) {
    int row, col;
    if (fscanf(file, "%d %d %lf", &row, &col, &m->a[k]) != 3) fail("the matrix ends early", 0);
    m->irn[k] = row;
    m->jcn[k] = col;
  }
  fclose(file);
}

/* Backward error of A x = (1, ..., 1): |b - A x| / (|A| |x| + 1), largest entries. */
static double backward_error(const DMUMPS_STRUC_C* m) {
  double* r = malloc((size_t)m->n * sizeof *r);
  double* s = calloc((size_t)m->n, sizeof *s);
  double most = 0;
  MUMPS_INT8 k;
  int i;
  for (i = 0; i < m->n; ++i) r[i] = 1;
  for (k = 0; k < m->nnz; ++k) {
    const int row = m->irn[k] - 1, col = m->jcn[k] - 1;
    const double a = m->a[k];
    r[row] -= a * m->rhs[col];
    s[row] += fabs(a * m->rhs[col]);
    if (row == col) continue;
    r[col] -= a * m->rhs[row];
    s[col] += fabs(a * m->rhs[row]);
  }
  for (i = 0; i < m->n; ++i) most = fmax(most, fabs(r[i]) / (s[i] + 1));
  free(r);
  free(s);
  return most;
}

int main(int argc, char** argv) {
  DMUMPS_STRUC_C m = {0};
  int rank = 0, k, i;
  MPI_Init(&argc, &argv);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (argc != 4) fail("give FILE SYM REPEATS", argc);
  m.sym = atoi(argv[2]);
  m.par = 1;
  m.comm_fortran = kUseCommWorld;
  job(&m, -1);
  for (k = 1; k <= 4; ++k) m.ICNTL(k) = k == 4 ? 0 : -1; /* silent */
  if (rank == 0) read_matrix(&m, argv[1]);
  job(&m, 1);
  job(&m, 2);
  if (rank == 0) printf("{\"seconds\": [");
  for (k = 0; k < atoi(argv[3]); ++k) {
    double start;
    MPI_Barrier(MPI_COMM_WORLD);
    start = MPI_Wtime();
    job(&m, 2);
    MPI_Barrier(MPI_COMM_WORLD);
    if (rank == 0) printf("%s%.6f", k > 0 ? ", " : "", MPI_Wtime() - start);
  }
  if (rank == 0) {
    m.rhs = malloc((size_t)m.n * sizeof *m.rhs);
    for (i = 0; i < m.n; ++i) m.rhs[i] = 1;
  }
  job(&m, 3);
  if (rank == 0) printf("], \"error\": %.3g}\n", backward_error(&m));
  job(&m, -2);
  MPI_Finalize();
  return 0;
}
