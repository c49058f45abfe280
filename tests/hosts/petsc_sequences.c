/* Random sequences of calls of PETSc on our package: values in place, scalings, other patterns, factors that are kept
 * on purpose, duplicates, values that are no numbers, singular matrices. A solution belongs to the values of the last
 * factorization, or PETSc says that there is none. Truth: a dense LU in long double of what the program itself wrote
 * down. Prints a line for each wrong sequence and a summary; exit code 1 where one was wrong.
 *   mpicc tests/hosts/petsc_sequences.c $(pkg-config --cflags --libs petsc) -lm -o petsc_sequences
 *   PETSC_OPTIONS="-dll_append libespalier_petsc.so -pc_factor_mat_solver_type espalier" ./petsc_sequences [SEQUENCES
 *   [SEED [CALLS]]]     default: 1000 sequences, seed 1, 20 calls each
 */
#include <math.h>
#include <petscksp.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { kMost = 60, kActors = 2 };

static uint64_t state;
static uint64_t next(void) {
  uint64_t z = state += 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}
static int below(int n) { return (int)(next() % (uint64_t)n); }
static double number(void) { return (double)(next() >> 11) * 0x1p-52 - 1; }

typedef struct {
  int n, symmetric, spd, keeps; /* keeps: the factor, whatever the values (KSPSetReusePreconditioner) */
  int has_factor, failed;       /* what the last factorization came to */
  int bad;                      /* the values have no factor */
  KSP ksp;
  Mat a;
  char has[kMost * kMost];
  double now[kMost * kMost], factored[kMost * kMost]; /* by rows */
} Actor;

static Actor actors[kActors];
static int count;
static const char* last;
static char said[300];
static long solutions, errors;

static void wrong(const Actor* s, const char* what, double by) {
  if (said[0] == 0)
    snprintf(said, sizeof said, "%s: %s, %g (n %d, symmetric %d, spd %d)", last, what, by, s->n, s->symmetric, s->spd);
}

#define CALL(call)                       \
  do {                                   \
    if ((call) != 0) wrong(s, #call, 0); \
    if (said[0] != 0) return;            \
  } while (0)

static void write_values(Actor* s) {
  for (int i = 0; i < s->n; ++i)
    for (int j = s->symmetric ? i : 0; j < s->n; ++j)
      if (s->has[i * s->n + j]) CALL(MatSetValue(s->a, i, j, s->now[i * s->n + j], INSERT_VALUES));
  CALL(MatAssemblyBegin(s->a, MAT_FINAL_ASSEMBLY));
  CALL(MatAssemblyEnd(s->a, MAT_FINAL_ASSEMBLY));
}

static void new_values(Actor* s) {
  double sum[kMost] = {0};
  for (int i = 0; i < s->n; ++i)
    for (int j = 0; j < s->n; ++j) {
      if (i == j || !s->has[i * s->n + j]) continue;
      if (!s->symmetric || i < j) s->now[i * s->n + j] = number();
      if (s->symmetric && i > j) s->now[i * s->n + j] = s->now[j * s->n + i];
      sum[i] += fabs(s->now[i * s->n + j]);
      sum[j] += fabs(s->now[i * s->n + j]);
    }
  for (int i = 0; i < s->n; ++i) s->now[i * s->n + i] = (s->spd || below(3) ? 1 : -1) * (1 + sum[i]);
  s->bad = 0;
}

static void make(Actor* s) {
  memset(s, 0, sizeof *s);
  s->n = 1 + below(below(4) ? 20 : kMost);
  s->symmetric = below(2);
  s->spd = s->symmetric && below(2);
  for (int i = 0; i < s->n; ++i)
    for (int j = 0; j <= i; ++j) {
      s->has[i * s->n + j] = i == j || below(s->n) < 3;
      s->has[j * s->n + i] = s->symmetric || i == j ? s->has[i * s->n + j] : below(s->n) < 3;
    }
  new_values(s);
  CALL(MatCreate(PETSC_COMM_SELF, &s->a));
  CALL(MatSetSizes(s->a, s->n, s->n, s->n, s->n));
  CALL(MatSetType(s->a, s->symmetric ? MATSEQSBAIJ : MATSEQAIJ));
  CALL(MatSeqAIJSetPreallocation(s->a, s->n, NULL));
  CALL(MatSeqSBAIJSetPreallocation(s->a, 1, s->n, NULL));
  if (s->spd) CALL(MatSetOption(s->a, MAT_SPD, PETSC_TRUE));
  write_values(s);
}

static void attach(Actor* s) {
  PC pc;
  CALL(KSPCreate(PETSC_COMM_SELF, &s->ksp));
  CALL(KSPSetOperators(s->ksp, s->a, s->a));
  CALL(KSPSetType(s->ksp, KSPPREONLY));
  CALL(KSPGetPC(s->ksp, &pc));
  CALL(PCSetType(pc, s->symmetric ? PCCHOLESKY : PCLU));
  CALL(PCFactorSetMatSolverType(pc, "espalier"));
  CALL(KSPSetFromOptions(s->ksp));
}

static void drop(Actor* s) {
  KSPDestroy(&s->ksp);
  MatDestroy(&s->a);
}

/* b becomes the solution. */
static void dense_solve(int n, const double* rows, int transposed, long double* b) {
  static long double m[kMost * kMost];
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) m[i * n + j] = transposed ? rows[j * n + i] : rows[i * n + j];
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int i = k + 1; i < n; ++i)
      if (fabsl(m[i * n + k]) > fabsl(m[best * n + k])) best = i;
    for (int j = 0; j < n; ++j) {
      const long double t = m[k * n + j];
      m[k * n + j] = m[best * n + j];
      m[best * n + j] = t;
    }
    const long double t = b[k];
    b[k] = b[best];
    b[best] = t;
    for (int i = k + 1; i < n; ++i) {
      const long double l = m[i * n + k] / m[k * n + k];
      for (int j = k + 1; j < n; ++j) m[i * n + j] -= l * m[k * n + j];
      b[i] -= l * b[k];
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    for (int j = k + 1; j < n; ++j) b[k] -= m[k * n + j] * b[j];
    b[k] /= m[k * n + k];
  }
}

static void check(Actor* s) {
  Vec b, x;
  long double truth[kMost];
  const int transposed = below(2);
  const PetscScalar* found;
  KSPConvergedReason reason;
  CALL(MatCreateVecs(s->a, &x, &b));
  for (int i = 0; i < s->n; ++i) {
    truth[i] = number();
    CALL(VecSetValue(b, i, (double)truth[i], INSERT_VALUES));
  }
  CALL(VecAssemblyBegin(b));
  CALL(VecAssemblyEnd(b));
  if (!(s->keeps && s->has_factor)) memcpy(s->factored, s->now, sizeof s->now);
  const int expected = s->keeps && (s->has_factor || s->failed) ? s->has_factor : !s->bad;
  const PetscErrorCode code = transposed ? KSPSolveTranspose(s->ksp, b, x) : KSPSolve(s->ksp, b, x);
  reason = KSP_DIVERGED_NANORINF;
  if (code == 0) KSPGetConvergedReason(s->ksp, &reason);
  s->has_factor = code == 0 && reason > 0;
  s->failed = !s->has_factor;
  if (s->has_factor != expected) {
    wrong(s, expected ? "no solution" : "a solution of what has none", reason);
  } else if (!expected) {
    ++errors;
    if (code != 0) { /* after an error, unlike a factorization that says it failed, PETSc's own KSP is of no use */
      KSPDestroy(&s->ksp);
      s->keeps = s->failed = 0;
      attach(s);
    }
  } else {
    double largest = 0, error = 0;
    dense_solve(s->n, s->factored, transposed, truth);
    CALL(VecGetArrayRead(x, &found));
    for (int i = 0; i < s->n; ++i) {
      largest = fmax(largest, (double)fabsl(truth[i]));
      error = fmax(error, (double)fabsl(truth[i] - found[i]));
      if (!isfinite(found[i])) error = INFINITY;
    }
    CALL(VecRestoreArrayRead(x, &found));
    if (!(error <= 1e-9 * largest)) wrong(s, "the solution is not that of the last values", error / largest);
    ++solutions;
  }
  VecDestroy(&b);
  VecDestroy(&x);
}

static void step(Actor* s) {
  switch (below(12)) {
    case 0:
    case 1:
    case 2:
      last = "new values";
      new_values(s);
      return write_values(s);
    case 3: {
      last = "MatScale";
      const double by = ldexp(1, below(5) - 2);
      for (int k = 0; k < s->n * s->n; ++k) s->now[k] *= by;
      CALL(MatScale(s->a, by));
      return;
    }
    case 4: {
      last = "one value";
      const int i = below(s->n);
      s->now[i * s->n + i] *= 1.5;
      CALL(MatSetValue(s->a, i, i, s->now[i * s->n + i], INSERT_VALUES));
      CALL(MatAssemblyBegin(s->a, MAT_FINAL_ASSEMBLY));
      CALL(MatAssemblyEnd(s->a, MAT_FINAL_ASSEMBLY));
      return;
    }
    case 5:
      last = "no number";
      s->now[0] = NAN;
      s->bad = 1;
      return write_values(s);
    case 6:
      last = "singular";
      for (int k = 0; k < s->n * s->n; ++k) s->now[k] = 0;
      s->bad = 1;
      return write_values(s);
    case 7: {
      last = "another matrix";
      Actor old = *s;
      make(s);
      if (said[0] != 0) return;
      if (s->symmetric == old.symmetric) {
        s->ksp = old.ksp;
        CALL(KSPSetReusePreconditioner(s->ksp, PETSC_FALSE));
        if (s->n != old.n) CALL(KSPReset(s->ksp)); /* PETSc asks for it */
        CALL(KSPSetOperators(s->ksp, s->a, s->a));
        MatDestroy(&old.a);
        return;
      }
      drop(&old);
      return attach(s);
    }
    case 8:
      last = "KSPSetReusePreconditioner";
      s->keeps = !s->keeps;
      CALL(KSPSetReusePreconditioner(s->ksp, s->keeps ? PETSC_TRUE : PETSC_FALSE));
      return;
    case 9: {
      last = "MatDuplicate";
      if (count == kActors) return drop(&actors[--count]);
      if (s->bad) return;
      Actor* twin = &actors[count];
      *twin = *s;
      twin->has_factor = twin->failed = twin->keeps = 0;
      CALL(MatDuplicate(s->a, MAT_COPY_VALUES, &twin->a));
      if (s->spd) CALL(MatSetOption(twin->a, MAT_SPD, PETSC_TRUE));
      attach(twin);
      ++count;
      return;
    }
    case 10:
      last = "KSPReset";
      CALL(KSPReset(s->ksp));
      CALL(KSPSetOperators(s->ksp, s->a, s->a));
      s->has_factor = s->failed = 0;
      return;
    default:
      last = "MatCopy";
      if (count < 2 || s == &actors[1] || s->n != actors[1].n || s->symmetric != actors[1].symmetric || actors[1].bad ||
          memcmp(s->has, actors[1].has, sizeof s->has) != 0)
        return;
      memcpy(s->now, actors[1].now, sizeof s->now);
      s->bad = 0;
      CALL(MatCopy(actors[1].a, s->a, SAME_NONZERO_PATTERN));
      return;
  }
}

static void run(uint64_t seed, int calls) {
  state = seed * 0x2545f4914f6cdd1du + 1;
  said[0] = 0;
  last = "begin";
  count = 1;
  make(&actors[0]);
  attach(&actors[0]);
  for (int k = 0; k < calls && said[0] == 0; ++k) {
    step(&actors[below(count)]);
    if (said[0] == 0) check(&actors[below(count)]);
  }
  while (count > 0) drop(&actors[--count]);
}

int main(int argc, char** argv) {
  const long sequences = argc > 1 ? atol(argv[1]) : 1000, seed = argc > 2 ? atol(argv[2]) : 1;
  const int calls = argc > 3 ? atoi(argv[3]) : 20;
  long bad = 0;
  if (PetscInitialize(&argc, &argv, NULL, NULL) != 0) return 2;
  if (argc < 5)
    PetscPushErrorHandler(PetscIgnoreErrorHandler, NULL); /* errors are expected; a fourth word shows them */
  for (long k = 0; k < sequences; ++k) {
    run((uint64_t)(seed + k), calls);
    if (said[0] == 0) continue;
    ++bad;
    printf("WRONG seed %ld: %s\n", seed + k, said);
  }
  printf("%ld sequences: %ld solutions beside dense ones, %ld errors as they should be; %ld wrong\n", sequences,
         solutions, errors, bad);
  PetscFinalize();
  return bad == 0 ? 0 : 1;
}
