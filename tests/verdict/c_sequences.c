/* Random sequences of calls of the C interface: analyses, values in place, a few values, clones, bad arguments. A
 * solution, whole or of a few unknowns, and the diagonal of the inverse belong to the values of the last factorization
 * that succeeded, or the call says that there is none. Factors go to files and come back, rows come and go around them.
 * Truth: a dense LU of the matrix in long double, which shares nothing with the library. Prints a line for each wrong
 * sequence and a summary; exit code 1 where one was wrong.
 *
 *   espalier_c_sequences [SEQUENCES [SEED [CALLS]]]     default: 1000 sequences, seed 1, 25 calls each */
#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "c_sequence_truth.h"
#include "espalier/espalier.h"

enum { kSolvers = 3 };

typedef struct {
  espalier_solver* solver;
  Matrix a;             /* as it was analysed */
  int factored;         /* 0: no solution may come; 1: that of `truth`; 2: that, or none */
  Wide truth[kEntries]; /* of the last good factorization, by columns */
  double largest;       /* of its values */
} Solver;

typedef struct {
  Solver solvers[kSolvers];
  int count;
  const char* last;
  char wrong[512];
  long calls, solutions, errors;
} Sequence;

/* ---- calls ------------------------------------------------------------------------------------------------------ */

static void wrong(Sequence* s, const Solver* of, const char* what, int code) {
  if (s->wrong[0] != 0) return;
  snprintf(s->wrong, sizeof s->wrong, "%s: %s, status %d, %.200s (call %ld, n %d, storage %d, layout %d, parts %d)",
           s->last, what, code, espalier_last_error(of->solver), s->calls, of->a.n, of->a.storage, of->a.layout,
           of->a.parts);
}

typedef enum { kAnalyze, kFactorize, kAnalyzeChange } What;
/* With arrays that are overwritten when the call is over. */
static int give(Solver* s, const Matrix* a, What what) {
  static int32_t pointers32[kMost + 1], indices32[kEntries];
  static int64_t pointers64[kMost + 1], indices64[kEntries];
  static double values[2 * kEntries];
  memcpy(values, a->values, sizeof values);
  int code = 0;
  if (a->wide) {
    memcpy(pointers64, a->pointers, sizeof pointers64);
    memcpy(indices64, a->indices, sizeof indices64);
    const espalier_matrix_i64 m = {sizeof m, a->n,      a->n,       a->count, pointers64, indices64,
                                   values,   a->layout, a->storage, a->base,  0,          a->parts - 1};
    code = what == kAnalyze         ? espalier_analyze_i64(s->solver, &m, NULL)
           : what == kAnalyzeChange ? espalier_analyze_change_i64(s->solver, &m, NULL, NULL)
                                    : espalier_factorize_i64(s->solver, &m, NULL);
  } else {
    for (int k = 0; k <= a->n; ++k) pointers32[k] = (int32_t)a->pointers[k];
    for (int k = 0; k < a->count; ++k) indices32[k] = (int32_t)a->indices[k];
    const espalier_matrix_i32 m = {sizeof m, a->n,      a->n,       a->count, pointers32, indices32,
                                   values,   a->layout, a->storage, a->base,  0,          a->parts - 1};
    code = what == kAnalyze         ? espalier_analyze_i32(s->solver, &m, NULL)
           : what == kAnalyzeChange ? espalier_analyze_change_i32(s->solver, &m, NULL, NULL)
                                    : espalier_factorize_i32(s->solver, &m, NULL);
  }
  memset(pointers32, 0x77, sizeof pointers32);
  memset(indices32, 0x77, sizeof indices32);
  memset(pointers64, 0x77, sizeof pointers64);
  memset(indices64, 0x77, sizeof indices64);
  for (int k = 0; k < a->parts * a->count; ++k) values[k] = NAN;
  return code;
}

static void took(Solver* s, const Matrix* a) {
  s->a = *a;
  s->factored = 1;
  whole(a, s->truth);
}

/* After a failure: no factor, or the last one. */
static void failed(Sequence* q, Solver* s) {
  ++q->errors;
  if (s->factored == 1) s->factored = 2;
}

static int no_factor(Sequence* q, Solver* s, int code) {
  if (code == ESPALIER_MISUSE && s->factored != 1) {
    s->factored = 0;
    ++q->errors;
    return 1;
  }
  if (code != ESPALIER_OK || s->factored == 0) {
    wrong(q, s, s->factored == 0 ? "an answer without a factor" : "no answer", code);
    return 1;
  }
  s->factored = 1;
  return 0;
}

static void compare(Sequence* q, const Solver* s, const double* x, const Wide* truth, double scale) {
  const Wide v = x[0] + (s->a.parts == 2 ? (Wide)x[1] * I : 0);
  if (!(cabsl(v - *truth) <= 1e-9 * scale)) wrong(q, s, "not that of the last values", 0);
}

static void check_solve(Sequence* q, Solver* s) {
  const int n = s->a.n, parts = s->a.parts, columns = 1 + below(kColumns), how = below(3);
  static double b[2 * kMost * kColumns], x[2 * kMost * kColumns];
  static Wide truth[kMost * kColumns];
  for (int k = 0; k < n * columns; ++k) {
    b[parts * k] = number();
    if (parts == 2) b[2 * k + 1] = number();
    truth[k] = b[parts * k] + (parts == 2 ? (Wide)b[2 * k + 1] * I : 0);
  }
  const int in_place = below(2);
  if (in_place) memcpy(x, b, sizeof x);
  if (no_factor(q, s, espalier_solve(s->solver, in_place ? x : b, x, columns, how, NULL))) return;
  dense_solve(n, s->truth, how, columns, truth);
  double largest = 0;
  for (int k = 0; k < n * columns; ++k) largest = fmax(largest, (double)cabsl(truth[k]));
  for (int k = 0; k < n * columns; ++k) compare(q, s, x + parts * k, truth + k, largest);
  ++q->solutions;
}

static void check_rows(Sequence* q, Solver* s) {
  const int n = s->a.n, parts = s->a.parts, how = below(3), wanted = 1 + below(4), bad = below(4) == 0;
  int64_t begin[kColumns + 1] = {0}, rows[4 * kColumns], unknowns[4];
  double values[8 * kColumns], x[8 * kColumns];
  static Wide truth[kMost * kColumns];
  const int columns = 1 + below(kColumns);
  for (int k = 0; k < n * columns; ++k) truth[k] = 0;
  int count = 0;
  for (int c = 0; c < columns; ++c) {
    for (int k = below(5); k > 0; --k, ++count) {
      rows[count] = below(n);
      values[parts * count] = number();
      if (parts == 2) values[2 * count + 1] = number();
      truth[c * n + rows[count]] += values[parts * count] + (parts == 2 ? (Wide)values[2 * count + 1] * I : 0);
    }
    begin[c + 1] = count;
  }
  for (int k = 0; k < wanted; ++k) unknowns[k] = below(n);
  const espalier_columns b = {columns, begin, rows, values};
  if (bad) {
    const int64_t good = unknowns[0];
    unknowns[0] = below(2) ? n : -1;
    const int code = espalier_solve_rows(s->solver, &b, unknowns, wanted, x, wanted * columns, how, NULL);
    if (code != ESPALIER_INVALID_INPUT && code != ESPALIER_MISUSE) wrong(q, s, "took an unknown out of range", code);
    ++q->errors;
    unknowns[0] = good;
  }
  if (no_factor(q, s, espalier_solve_rows(s->solver, &b, unknowns, wanted, x, wanted * columns, how, NULL))) return;
  dense_solve(n, s->truth, how, columns, truth);
  double largest = 1e-3;
  for (int k = 0; k < n * columns; ++k) largest = fmax(largest, (double)cabsl(truth[k]));
  for (int c = 0; c < columns; ++c)
    for (int k = 0; k < wanted; ++k) compare(q, s, x + parts * (c * wanted + k), truth + c * n + unknowns[k], largest);
  ++q->solutions;
}

static void check_inverse(Sequence* q, Solver* s) {
  const int n = s->a.n, i = below(s->a.n);
  static double x[2 * kMost];
  static Wide truth[kMost];
  if (no_factor(q, s, espalier_inverse_blocks(s->solver, 1, x, n, NULL))) return;
  for (int k = 0; k < n; ++k) truth[k] = k == i;
  dense_solve(n, s->truth, ESPALIER_NO_TRANSPOSE, 1, truth);
  double largest = 0;
  for (int k = 0; k < n; ++k) largest = fmax(largest, (double)cabsl(truth[k]));
  compare(q, s, x + s->a.parts * i, truth + i, largest);
  ++q->solutions;
}

/* Entries of the diagonal become larger; or what is given cannot be. */
static void some_entries(Sequence* q, Solver* s, int bad) {
  Matrix a = s->a;
  int64_t places[4];
  double values[8];
  int count = 0;
  for (int j = 0; j < a.n && count < 3; ++j)
    for (int k = (int)a.pointers[j] - a.base; k < (int)a.pointers[j + 1] - a.base && count < 3; ++k)
      if (row_of(&a, j, k) == column_of(&a, j, k) && below(3) == 0) {
        a.values[a.parts * k] *= 1.5;
        places[count] = k;
        memcpy(values + a.parts * count++, a.values + a.parts * k, sizeof(double) * (size_t)a.parts);
      }
  if (bad) {
    if (count == 0) places[count++] = 0, values[0] = values[1] = 1;
    const int which = below(3);
    if (which == 0) places[0] = below(2) ? a.count : -1;
    if (which == 1) values[0] = NAN;
    if (which == 2) count = -1;
  }
  const int code = espalier_refactorize_entries(s->solver, places, values, count, NULL);
  if (bad) {
    if (code != ESPALIER_INVALID_INPUT && code != ESPALIER_MISUSE) wrong(q, s, "took bad entries", code);
    ++q->errors; /* the factor is as it was */
    return;
  }
  if (code == ESPALIER_MISUSE && s->factored != 1) return failed(q, s);
  if (code != ESPALIER_OK) return wrong(q, s, "refused good entries", code);
  if (s->factored == 0) return wrong(q, s, "took entries without a factor", code);
  took(s, &a);
}

static void new_values(Sequence* q, Solver* s) {
  Matrix a = s->a;
  static double values[2 * kEntries];
  make_values(&a, below(2));
  memcpy(values, a.values, sizeof values);
  const int code = espalier_refactorize(s->solver, values, a.count, NULL);
  for (int k = 0; k < 2 * kEntries; ++k) values[k] = NAN;
  if (code != ESPALIER_OK) return wrong(q, s, "refused good values", code);
  took(s, &a);
}

static void bad_values(Sequence* q, Solver* s) {
  static double values[2 * kEntries + 2];
  const int which = below(4), numbers = s->a.parts * s->a.count;
  for (int k = 0; k < numbers + 2; ++k) values[k] = which == 1 ? 0 : 1 + number();
  if (which == 0) values[below(numbers)] = below(2) ? NAN : INFINITY;
  const int code = which == 3   ? espalier_refactorize_device(s->solver, values, s->a.count, NULL, NULL)
                   : which == 2 ? espalier_refactorize(s->solver, values, s->a.count + 1, NULL)
                                : espalier_refactorize(s->solver, values, s->a.count, NULL);
  static const int expected[] = {ESPALIER_INVALID_INPUT, ESPALIER_SINGULAR, ESPALIER_MISUSE, ESPALIER_DEVICE_ERROR};
  if (code != expected[which]) return wrong(q, s, "bad values", code);
  failed(q, s);
}

static void other_matrix(Sequence* q, Solver* s, What what) {
  Matrix a;
  if (what == kAnalyze && below(2) == 0) {
    make_matrix(&a);
  } else {
    a = s->a;
    make_values(&a, below(2));
  }
  const int code = give(s, &a, what);
  if (code != ESPALIER_OK) return wrong(q, s, "refused a good matrix", code);
  if (what == kFactorize) return took(s, &a);
  s->a = a;
  s->factored = 0;
}

/* To a file and back: into another solver where there is room for one, else into the same. */
static void saved(Sequence* q, Solver* s) {
  char path[64];
  snprintf(path, sizeof path, "/tmp/espalier-c-sequence-%ld", (long)getpid());
  if (no_factor(q, s, espalier_save_factor(s->solver, path))) return;
  Solver* to = q->count < kSolvers ? &q->solvers[q->count] : s;
  if (to != s) {
    if (espalier_create(&to->solver) != ESPALIER_OK) exit(2);
    ++q->count;
    to->a = s->a;
    memcpy(to->truth, s->truth, sizeof to->truth);
    espalier_set_option(to->solver, "device", "cpu");
    espalier_set_option(to->solver, "threads", below(2) ? "1" : "3");
    espalier_set_option(to->solver, "partial_refactorization", below(2) ? "on" : "off");
  }
  const int code = espalier_load_factor(to->solver, path, NULL);
  remove(path);
  to->factored = code == ESPALIER_OK;
  if (code != ESPALIER_OK) return wrong(q, to, "a saved factor is not taken", code);
  check_solve(q, to);
}

/* An unknown that has come and one that is gone, with A and A^T; a factor that is another one is noticed. */
static void around(Sequence* q, Solver* s) {
  const int n = s->a.n, gone = below(n), how = below(3), m = n + 1, parts = s->a.parts;
  if (n < 2 || n == kMost) return;
  espalier_changed* changed = NULL;
  if (no_factor(q, s, espalier_changed_create(s->solver, &changed))) return;
  static Wide full[kEntries], truth[kMost];
  static double g[2 * kMost], h[2 * kMost], b[2 * kMost], x[2 * kMost];
  static int64_t rows[kMost];
  const double corner[2] = {4 * kMost, 1};
  const int64_t begin[2] = {0, n}, list[1] = {gone};
  for (int i = 0; i < n; ++i) rows[i] = i;
  for (int i = 0; i < parts * n; ++i) g[i] = number(), h[i] = number();
  for (int i = 0; i < parts * m; ++i) b[i] = number();
  const espalier_columns column = {1, begin, rows, g}, row = {1, begin, rows, h};
  int code = espalier_changed_add(changed, &column, &row, corner);
  if (code == ESPALIER_OK) code = espalier_changed_remove(changed, list, 1);
  if (code == ESPALIER_OK) code = espalier_changed_solve(changed, b, x, m, 1, how, NULL);
  for (int j = 0; j < m; ++j)
    for (int i = 0; i < m; ++i)
      full[j * m + i] = i == gone || j == gone ? i == j
                        : i < n && j < n       ? s->truth[j * n + i]
                        : i < n                ? wide(g, i, parts)
                        : j < n                ? wide(h, j, parts)
                                               : wide(corner, 0, parts);
  for (int i = 0; i < m; ++i) truth[i] = i == gone ? 0 : wide(b, i, parts);
  dense_solve(m, full, how, 1, truth);
  double largest = 0;
  for (int i = 0; i < m; ++i) largest = fmax(largest, (double)cabsl(truth[i]));
  if (code != ESPALIER_OK) wrong(q, s, "no changes around a factor", code);
  for (int i = 0; i < m && code == ESPALIER_OK; ++i) compare(q, s, x + parts * i, truth + i, largest);
  new_values(q, s);
  if (espalier_changed_solve(changed, b, x, m, 1, how, NULL) != ESPALIER_MISUSE)
    wrong(q, s, "changes around a factor that is gone", 0);
  ++q->errors;
  ++q->solutions;
  espalier_changed_destroy(changed);
}

static void step(Sequence* q) {
  static const char* const kNames[] = {"analyze",     "analyze_change", "factorize", "refactorize", "entries",
                                       "bad entries", "bad values",     "clone",     "solve",       "solve_rows",
                                       "inverse",     "save_factor",    "changed"};
  static const int kWeights[] = {1, 1, 2, 3, 3, 2, 2, 1, 3, 3, 1, 2, 1};
  int which = 0, left = below(25);
  while (left >= kWeights[which]) left -= kWeights[which++];
  Solver* s = &q->solvers[below(q->count)];
  q->last = kNames[which];
  switch (which) {
    case 0:
      return other_matrix(q, s, kAnalyze);
    case 1:
      return other_matrix(q, s, kAnalyzeChange);
    case 2:
      return other_matrix(q, s, kFactorize);
    case 3:
      return new_values(q, s);
    case 4:
      return some_entries(q, s, 0);
    case 5:
      return some_entries(q, s, 1);
    case 6:
      return bad_values(q, s);
    case 7: {
      if (q->count == kSolvers) {
        espalier_destroy(q->solvers[--q->count].solver);
        return;
      }
      Solver* twin = &q->solvers[q->count];
      twin->a = s->a;
      twin->factored = 0;
      const int code = espalier_clone(s->solver, 1, &twin->solver);
      if (code != ESPALIER_OK) return wrong(q, s, "no clone", code);
      ++q->count;
      return;
    }
    case 8:
      return check_solve(q, s);
    case 9:
      return check_rows(q, s);
    case 11:
      return saved(q, s);
    case 12:
      return around(q, s);
    default:
      return check_inverse(q, s);
  }
}

static void run(Sequence* q, uint64_t seed, int calls) {
  state = seed * 0x2545f4914f6cdd1du + 1;
  q->count = 1;
  q->calls = q->solutions = q->errors = 0;
  q->wrong[0] = 0;
  q->last = "begin";
  Solver* s = &q->solvers[0];
  make_matrix(&s->a);
  s->factored = 0;
  if (espalier_create(&s->solver) != ESPALIER_OK) exit(2);
  espalier_set_option(s->solver, "device", "cpu");
  espalier_set_option(s->solver, "threads", below(4) ? "1" : "2");
  espalier_set_option(s->solver, "partial_refactorization", below(2) ? "on" : "off");
  if (below(2)) espalier_set_option(s->solver, "max_block_size", "16");
  if (below(2)) espalier_set_refinement(s->solver, 0, INFINITY);
  if (give(s, &s->a, kAnalyze) != ESPALIER_OK) wrong(q, s, "analyze", 0);
  for (; q->calls < calls && q->wrong[0] == 0; ++q->calls) {
    step(q);
    Solver* any = &q->solvers[below(q->count)];
    if (q->wrong[0] == 0 && below(2)) check_solve(q, any);
  }
  while (q->count > 0) espalier_destroy(q->solvers[--q->count].solver);
}

int main(int argc, char** argv) {
  const long sequences = argc > 1 ? atol(argv[1]) : 1000, seed = argc > 2 ? atol(argv[2]) : 1;
  const int calls = argc > 3 ? atoi(argv[3]) : 25;
  static Sequence q;
  long all = 0, solutions = 0, errors = 0, bad = 0;
  for (long k = 0; k < sequences; ++k) {
    run(&q, (uint64_t)(seed + k), calls);
    all += q.calls;
    solutions += q.solutions;
    errors += q.errors;
    if (q.wrong[0] == 0) continue;
    ++bad;
    printf("WRONG seed %ld: %s\n", seed + k, q.wrong);
  }
  printf("%ld sequences, %ld calls: %ld answers beside dense ones, %ld errors as they should be; %ld wrong\n",
         sequences, all, solutions, errors, bad);
  return bad == 0 ? 0 : 1;
}
