/* Random matrices in every form that the C interface takes, and their truth: dense, in long double, solved by an LU
 * that shares nothing with the library. For c_sequences.c. */
#pragma once

#include <complex.h>
#include <math.h>
#include <string.h>

#include "espalier/espalier.h"

enum { kMost = 60, kEntries = kMost * kMost, kColumns = 3 };
typedef long double complex Wide;

/* ---- random numbers: splitmix64 -------------------------------------------------------------------------------- */

static uint64_t state;
static uint64_t next(void) {
  uint64_t z = state += 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}
static int below(int n) { return (int)(next() % (uint64_t)n); }
static double number(void) { return (double)(next() >> 11) * 0x1p-52 - 1; } /* -1 to 1 */

/* ---- matrices -------------------------------------------------------------------------------------------------- */

typedef struct {
  int n, count, layout, storage, base, wide, parts; /* parts: doubles in a number */
  int64_t pointers[kMost + 1], indices[kEntries];
  double values[2 * kEntries];
} Matrix;

static int row_of(const Matrix* a, int major, int q) {
  return a->layout == ESPALIER_CSR ? major : (int)a->indices[q] - a->base;
}
static int column_of(const Matrix* a, int major, int q) {
  return a->layout == ESPALIER_CSR ? (int)a->indices[q] - a->base : major;
}
static int is_hermitian(int storage) { return storage >= ESPALIER_HERMITIAN_LOWER; }
static int one_triangle(int storage) {
  return storage != ESPALIER_GENERAL && storage != ESPALIER_SYMMETRIC_BOTH && storage != ESPALIER_HERMITIAN_BOTH;
}
static int is_lower(int storage) { return storage == ESPALIER_SYMMETRIC_LOWER || storage == ESPALIER_HERMITIAN_LOWER; }

/* New values on the pattern: random ones, the diagonal dominant, of one sign where `definite`. */
static void make_values(Matrix* a, int definite) {
  static double real[kEntries], imag[kEntries];
  for (int k = 0; k < a->n * a->n; ++k) real[k] = number(), imag[k] = a->parts == 2 ? 0.3 * number() : 0;
  double sum[kMost] = {0};
  for (int j = 0; j < a->n; ++j)
    for (int q = (int)a->pointers[j] - a->base; q < (int)a->pointers[j + 1] - a->base; ++q) {
      int i = row_of(a, j, q), c = column_of(a, j, q), sign = 1;
      int from = i * a->n + c;
      if (a->storage != ESPALIER_GENERAL && i < c) { /* one number for both */
        from = c * a->n + i;
        sign = is_hermitian(a->storage) ? -1 : 1;
      }
      a->values[a->parts * q] = real[from];
      if (a->parts == 2) a->values[2 * q + 1] = sign * imag[from];
      sum[i] += fabs(real[from]) + fabs(imag[from]);
      if (i != c) sum[c] += fabs(real[from]) + fabs(imag[from]);
    }
  for (int j = 0; j < a->n; ++j)
    for (int q = (int)a->pointers[j] - a->base; q < (int)a->pointers[j + 1] - a->base; ++q)
      if (row_of(a, j, q) == column_of(a, j, q)) {
        a->values[a->parts * q] = (definite || below(3) ? 1 : -1) * (1 + 2 * sum[j]);
        if (a->parts == 2 && is_hermitian(a->storage)) a->values[2 * q + 1] = 0;
      }
}

static void make_matrix(Matrix* a) {
  static const int kStorages[] = {ESPALIER_GENERAL,        ESPALIER_SYMMETRIC_LOWER, ESPALIER_SYMMETRIC_UPPER,
                                  ESPALIER_SYMMETRIC_BOTH, ESPALIER_HERMITIAN_LOWER, ESPALIER_HERMITIAN_UPPER};
  memset(a, 0, sizeof *a);
  a->n = 1 + below(below(4) ? 20 : kMost);
  a->parts = below(4) ? 1 : 2;
  a->storage = kStorages[below(a->parts == 2 ? 6 : 4)];
  a->layout = below(2);
  a->base = below(2);
  a->wide = below(2);
  static char has[kEntries];
  for (int i = 0; i < a->n; ++i)
    for (int j = 0; j <= i; ++j) {
      has[i * a->n + j] = i == j || below(a->n) < 3;
      has[j * a->n + i] = a->storage == ESPALIER_GENERAL ? i == j || below(a->n) < 3 : has[i * a->n + j];
    }
  for (int j = 0; j < a->n; ++j) {
    a->pointers[j] = a->count + a->base;
    for (int k = 0; k < a->n; ++k) {
      const int i = a->layout == ESPALIER_CSR ? j : k, c = a->layout == ESPALIER_CSR ? k : j;
      if (!has[i * a->n + c] || (one_triangle(a->storage) && (is_lower(a->storage) ? i < c : i > c))) continue;
      a->indices[a->count++] = k + a->base;
    }
  }
  a->pointers[a->n] = a->count + a->base;
  make_values(a, below(2));
}

static void whole(const Matrix* a, Wide* dense) {
  for (int k = 0; k < a->n * a->n; ++k) dense[k] = 0;
  for (int j = 0; j < a->n; ++j)
    for (int q = (int)a->pointers[j] - a->base; q < (int)a->pointers[j + 1] - a->base; ++q) {
      const int i = row_of(a, j, q), c = column_of(a, j, q);
      const Wide v = a->values[a->parts * q] + (a->parts == 2 ? (Wide)a->values[2 * q + 1] * I : 0);
      dense[c * a->n + i] += v;
      if (one_triangle(a->storage) && i != c) dense[i * a->n + c] += is_hermitian(a->storage) ? conjl(v) : v;
    }
}

/* ---- the truth: LU with row exchanges, columns of b become solutions -------------------------------------------- */

/* Number k of an array whose numbers are one double or two. */
static Wide wide(const double* of, int k, int parts) {
  return parts == 2 ? of[2 * k] + of[2 * k + 1] * (Wide)I : of[k];
}

static void dense_solve(int n, const Wide* matrix, int how, int columns, Wide* b) {
  static Wide m[kEntries];
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i)
      m[j * n + i] = how == ESPALIER_NO_TRANSPOSE ? matrix[j * n + i]
                     : how == ESPALIER_TRANSPOSE  ? matrix[i * n + j]
                                                  : conjl(matrix[i * n + j]);
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int i = k + 1; i < n; ++i)
      if (cabsl(m[k * n + i]) > cabsl(m[k * n + best])) best = i;
    for (int j = 0; j < n; ++j) {
      const Wide t = m[j * n + k];
      m[j * n + k] = m[j * n + best];
      m[j * n + best] = t;
    }
    for (int c = 0; c < columns; ++c) {
      const Wide t = b[c * n + k];
      b[c * n + k] = b[c * n + best];
      b[c * n + best] = t;
    }
    for (int i = k + 1; i < n; ++i) {
      const Wide l = m[k * n + i] / m[k * n + k];
      if (l == 0) continue;
      for (int j = k + 1; j < n; ++j) m[j * n + i] -= l * m[j * n + k];
      for (int c = 0; c < columns; ++c) b[c * n + i] -= l * b[c * n + k];
    }
  }
  for (int c = 0; c < columns; ++c)
    for (int k = n - 1; k >= 0; --k) {
      for (int j = k + 1; j < n; ++j) b[c * n + k] -= m[j * n + k] * b[c * n + j];
      b[c * n + k] /= m[k * n + k];
    }
}
