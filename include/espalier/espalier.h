/** \file
 * The C interface of Espalier: a sparse direct solver for mechanics.
 *
 *     espalier_solver *solver;
 *     espalier_create(&solver);
 *     espalier_matrix_i32 a = {sizeof a};
 *     a.rows = n; a.cols = n; a.pointers = ...; a.indices = ...; a.values = ...; a.nonzeros = ...;
 *     a.layout = ESPALIER_CSR; a.storage = ESPALIER_SYMMETRIC_UPPER; a.index_base = 1;
 *     if (espalier_analyze_i32(solver, &a, NULL) || espalier_factorize_i32(solver, &a, NULL) ||
 *         espalier_solve(solver, b, x, 1, ESPALIER_NO_TRANSPOSE, NULL))
 *       fprintf(stderr, "%s\n", espalier_last_error(solver));
 *     espalier_destroy(solver);
 *
 * Every function that can fail returns a status; 0 is success. No C++ exception leaves a function. A solver may be used
 * from any thread; calls on one solver wait for each other, calls on different solvers run at the same time.
 *
 * After fork() the child may go on with the parent's solvers: its first call starts the threads again. Two exceptions
 * are said by a status: a solver inside a call of another thread at the fork (ESPALIER_MISUSE), and one that has used a
 * GPU (ESPALIER_DEVICE_ERROR, since CUDA does not follow into the child); make a new solver in the child instead.
 * Where the system refuses threads, fewer work.
 *
 * Structs begin with `size`, which the caller sets to sizeof of the struct as he compiled it: later versions append
 * fields and stay compatible with what is compiled today.
 */
#ifndef ESPALIER_ESPALIER_H
#define ESPALIER_ESPALIER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** How a call ended. The numbers are those of espalier::StatusCode and stay as they are. */
typedef enum espalier_status {
  ESPALIER_OK = 0,
  ESPALIER_MISUSE = 1,                /**< a null pointer, a wrong size, or a call out of order */
  ESPALIER_INVALID_INPUT = 2,         /**< an inconsistent matrix, an unknown option, an unreadable file */
  ESPALIER_SINGULAR = 3,              /**< structurally or numerically singular */
  ESPALIER_NOT_POSITIVE_DEFINITE = 4, /**< kind llt met a pivot that is not positive */
  ESPALIER_OUT_OF_MEMORY = 5,         /**< a budget or the machine's memory is too small */
  ESPALIER_DEVICE_ERROR = 6,          /**< a device failed */
  ESPALIER_ACCURACY_NOT_REACHED = 7,  /**< the solution is returned, its backward error is above what was required */
  ESPALIER_CANCELLED = 8,             /**< espalier_set_interrupt: the caller said stop */
  ESPALIER_INTERNAL_ERROR = 99        /**< a bug of ours; the message says what is known */
} espalier_status;

/** How the arrays of a matrix run. */
typedef enum espalier_layout {
  ESPALIER_CSC = 0, /**< by columns: pointers has cols + 1 entries, indices are rows */
  ESPALIER_CSR = 1  /**< by rows: pointers has rows + 1 entries, indices are columns */
} espalier_layout;

/** Which entries of the matrix the arrays hold; lower and upper are those of the matrix, whatever the layout. */
typedef enum espalier_storage {
  ESPALIER_GENERAL = 0,
  ESPALIER_SYMMETRIC_LOWER = 1, /**< symmetric, entries with row >= column */
  ESPALIER_SYMMETRIC_UPPER = 2, /**< symmetric, entries with row <= column */
  ESPALIER_SYMMETRIC_BOTH = 3,  /**< symmetric, both triangles */
  ESPALIER_HERMITIAN_LOWER = 4, /**< complex: a_ji is the conjugate of a_ij; entries with row >= column */
  ESPALIER_HERMITIAN_UPPER = 5, /**< likewise, entries with row <= column */
  ESPALIER_HERMITIAN_BOTH = 6   /**< likewise, both triangles */
} espalier_storage;

/** A x = b, A^T x = b, A^H x = b (of real matrices A^T). */
typedef enum espalier_transpose {
  ESPALIER_NO_TRANSPOSE = 0,
  ESPALIER_TRANSPOSE = 1,
  ESPALIER_CONJUGATE_TRANSPOSE = 2
} espalier_transpose;

/**
 * What the values are. All values, right-hand sides, solutions and null vectors of a complex matrix are pairs of
 * doubles, real and imaginary part (C99's double complex, std::complex<double>), passed as pointers to double; counts
 * are those of the numbers, not of the doubles. Complex systems are solved on the host.
 */
typedef enum espalier_numbers { ESPALIER_REAL = 0, ESPALIER_COMPLEX = 1 } espalier_numbers;

/**
 * A square sparse matrix in the caller's arrays, which are read during the call only. Indices within a row or column
 * may stand in any order; repeated entries are summed. At most 2^31 - 1 rows.
 */
typedef struct espalier_matrix_i32 {
  size_t size; /**< sizeof(espalier_matrix_i32) */
  int64_t rows;
  int64_t cols;
  int64_t nonzeros;        /**< length of indices and values; checked against pointers */
  const int32_t* pointers; /**< rows or cols + 1, the first is index_base, the last nonzeros + index_base */
  const int32_t* indices;  /**< nonzeros, from index_base on */
  const double* values;    /**< nonzeros; may be NULL for espalier_analyze */
  int32_t layout;          /**< espalier_layout */
  int32_t storage;         /**< espalier_storage */
  int32_t index_base;      /**< 0 or 1 */
  int32_t reserved;        /**< 0 */
  int64_t numbers;         /**< espalier_numbers; a struct that ends before it is real */
} espalier_matrix_i32;

/** The same with 64-bit pointers and indices. */
typedef struct espalier_matrix_i64 {
  size_t size;
  int64_t rows;
  int64_t cols;
  int64_t nonzeros;
  const int64_t* pointers;
  const int64_t* indices;
  const double* values;
  int32_t layout;
  int32_t storage;
  int32_t index_base;
  int32_t reserved;
  int64_t numbers;
} espalier_matrix_i64;

/** What the analysis found out. */
typedef struct espalier_analysis_info {
  size_t size;    /**< set by the caller to sizeof(espalier_analysis_info); so in the structs below */
  double seconds; /**< the whole call */
  double ordering_seconds;
  double flops;             /**< of the factorization; a multiplication and an addition count as two */
  double predicted_seconds; /**< of the factorization */
  int64_t predicted_bytes;  /**< peak memory of the factorization */
  int64_t nonzeros_factor;
  int64_t fronts;
  int64_t tiers;
  int64_t largest_front; /**< rows */
} espalier_analysis_info;

/** What the factorization did. */
typedef struct espalier_factor_info {
  size_t size;
  double seconds;
  double flops_per_second;
  int64_t positive; /**< inertia: eigenvalues by sign; -1 for lu, and of complex symmetric matrices */
  int64_t negative;
  int64_t zero;
  int64_t two_by_two;      /**< 2x2 pivots */
  int64_t perturbed;       /**< pivots that were too small and were replaced */
  double determinant_sign; /**< -1, 0 or 1 */
  double determinant_log;  /**< natural logarithm of |det A| */
  int64_t peak_host_bytes;
  int64_t rank;                /**< of the matrix to rounding; -1: not known (option "singular": error or report) */
  int64_t delayed;             /**< columns whose elimination was moved to a later front */
  double determinant_phase[2]; /**< of complex matrices: det A over its magnitude (NaN: not known, on GPUs, but of
                                    Hermitian ones); of real ones sign and 0 */
  double work_share;           /**< operations done, over those for all fronts (option "partial_refactorization") */
} espalier_factor_info;

/** What the solve did. */
typedef struct espalier_solve_info {
  size_t size;
  double seconds;
  int64_t refinement_steps;
  double backward_error;      /**< normwise, the largest over the right-hand sides */
  double componentwise_error; /**< componentwise (Oettli-Prager) */
} espalier_solve_info;

/** One solver for one pattern at a time. */
typedef struct espalier_solver espalier_solver;

/** Receives one line of log text without newline, from the thread that called. It must not call back into the solver.
 */
typedef void (*espalier_log_callback)(const char* line, void* user);
/** Whether to stop: 0 goes on, anything else ends the call with ESPALIER_CANCELLED. It must not call back into the
 * solver. */
typedef int (*espalier_interrupt_callback)(void* user);

/** Where a call is that takes long. Strings live as long as the call of the callback; empty ones: nothing. */
typedef struct espalier_progress {
  const char* phase; /**< "factorization", "modes" ... */
  double done;       /**< of `total` in `unit` ("flops", "columns" ...); total 0: nobody knows */
  double total;
  const char* unit;
  double seconds;      /**< since the phase began */
  double seconds_left; /**< NaN: nobody knows */
  const char* inside;  /**< what the phase is at, likewise */
  double inside_done;
  double inside_total;
  const char* inside_unit;
} espalier_progress;
/** Must not call back into what is at work. */
typedef void (*espalier_progress_callback)(const espalier_progress* progress, void* user);

/** "major.minor.patch"; a static string. */
const char* espalier_version(void);
/** The name of a status, for instance "singular"; a static string. */
const char* espalier_status_name(int status);

/**
 * Makes a solver. *solver is NULL on failure. Its options are the defaults, changed by the environment variable
 * ESPALIER_OPTIONS ("device=gpu:0;threads=8;log=stderr": names and values of espalier_set_option, and log=stderr); what
 * cannot be understood there is said by the first analysis. Where no number of threads is set, OMP_NUM_THREADS counts.
 */
int espalier_create(espalier_solver** solver);
/**
 * Makes another solver for the same pattern, with the same options, which shares the analysis of `solver` and has a
 * factor of its own: for batches, load cases and threads. It is analysed as `solver` is, not factorized. Both may be
 * used at the same time, and either may be ended first.
 * @param threads  of the clone, which are its own; 0: as many as `solver` has
 */
int espalier_clone(espalier_solver* solver, int32_t threads, espalier_solver** clone);
/** Ends a solver; NULL is allowed. */
void espalier_destroy(espalier_solver* solver);
/** Why the last call on this solver failed, and what to do; "" after success. Valid until the next call on it. */
const char* espalier_last_error(const espalier_solver* solver);
/** The row of the caller's matrix that the last failure concerns, from 0 on; -1 when none does. */
int64_t espalier_last_error_row(const espalier_solver* solver);
/** The column of the last error, where it is the column that is known: of matrices by rows (ESPALIER_CSR). */
int64_t espalier_last_error_column(const espalier_solver* solver);

/**
 * Sets an option by name, for instance ("kind", "ldlt"), ("threads", "8"), ("host_memory", "2GiB"); the names and
 * values are those of the command line, with '-' or '_'. Takes effect at the next analysis.
 */
int espalier_set_option(espalier_solver* solver, const char* key, const char* value);
/**
 * Applies ESPALIER_OPTIONS once more, over what espalier_set_option has said since: for libraries that serve other
 * programs with defaults of their own, so that the user has the last word.
 */
int espalier_apply_environment(espalier_solver* solver);
/** Where log lines go; NULL: nowhere. Takes effect at the next analysis. */
int espalier_set_log(espalier_solver* solver, espalier_log_callback log, void* user);
/**
 * Who is asked, every 20 ms or so and from the thread that called, whether to stop; NULL: nobody. Takes effect at the
 * next analysis. The solver stays usable: without an analysis if that was stopped, with it but without a factor if a
 * factorization was; a stopped solve leaves x undefined and the factor as it was.
 */
int espalier_set_interrupt(espalier_solver* solver, espalier_interrupt_callback interrupt, void* user);

/**
 * Who is told, some ten times a second, how far calls of this thread are; NULL: nobody. Of solvers that are analysed
 * from now on; of others, whenever a phase begins.
 */
int espalier_listen(espalier_progress_callback tell, void* user);

/** Orders the matrix and lays out the factorization. `info` may be NULL, here and below. */
int espalier_analyze_i32(espalier_solver* solver, const espalier_matrix_i32* a, espalier_analysis_info* info);
int espalier_analyze_i64(espalier_solver* solver, const espalier_matrix_i64* a, espalier_analysis_info* info);
/** Factorizes a matrix of the analysed pattern, given in the same arrays or equal ones. */
int espalier_factorize_i32(espalier_solver* solver, const espalier_matrix_i32* a, espalier_factor_info* info);
int espalier_factorize_i64(espalier_solver* solver, const espalier_matrix_i64* a, espalier_factor_info* info);
/** New values for the analysed pattern, in the order of its indices. @param count their number, checked */
int espalier_refactorize(espalier_solver* solver, const double* values, int64_t count, espalier_factor_info* info);
/**
 * The values of the last factorization but for `count` of them: values[k] at places[k] (from 0, in the order of the
 * analysed matrix's indices; of a symmetric matrix that is stored in both triangles both places). With the option
 * "partial_refactorization" only what these values reach is made again. ESPALIER_INVALID_INPUT for places that the
 * matrix does not have or has twice, and for values that are not finite: the factor is as it was then. Where the
 * matrix becomes singular, the status says so, and the factor is that of the values before.
 */
int espalier_refactorize_entries(espalier_solver* solver, const int64_t* places, const double* values, int64_t count,
                                 espalier_factor_info* info);
/**
 * Solves A X = B (or with A^T, A^H) for `columns` right-hand sides, stored column by column, rows values each. x may be
 * b. With ESPALIER_ACCURACY_NOT_REACHED x holds the best solution that was found.
 */
int espalier_solve(espalier_solver* solver, const double* b, double* x, int64_t columns, int transpose,
                   espalier_solve_info* info);
/** What a solve for a few unknowns did. */
typedef struct espalier_rows_info {
  size_t size;
  double seconds;
  double backward_error;      /**< of a whole solution without refinement, once for each factorization; where whole */
  double componentwise_error; /**< solutions were made, of these; NaN: nobody asks for them */
  double share;               /**< of the factor's entries, those that were read */
} espalier_rows_info;
/** Right-hand sides with few entries, all from 0: those of column c are values[k] in row rows[k] for k from begin[c] to
 * begin[c + 1] - 1; entries in one place are added. Of a complex matrix a value is two doubles. */
typedef struct espalier_columns {
  int64_t columns;
  const int64_t* begin; /**< columns + 1, ascending from 0 */
  const int64_t* rows;  /**< begin[columns] of them; likewise the values */
  const double* values;
} espalier_columns;
/**
 * Solves A X = B (or with A^T, A^H) for some unknowns: x gets `wanted` values for each column, those of unknowns[k] in
 * row k, column after column. Only the part of the factor that leads from the entries of B to them is read; the
 * numbers are those of a solve without refinement: see solve_rows.hpp. ESPALIER_INVALID_INPUT for indices out of range
 * and numbers that are not finite; x is undefined then, and the factor stays.
 * @param count  of values that x has room for, wanted * columns, checked
 */
int espalier_solve_rows(espalier_solver* solver, const espalier_columns* b, const int64_t* unknowns, int64_t wanted,
                        double* x, int64_t count, int transpose, espalier_rows_info* info);
/**
 * The same as espalier_solve with arrays in the memory of the GPU that holds the factor, in core; otherwise the status
 * is ESPALIER_DEVICE_ERROR. The calls wait for what is enqueued on `stream` (a cudaStream_t; NULL: the default stream)
 * and return when the GPU is done.
 */
int espalier_refactorize_device(espalier_solver* solver, const double* values, int64_t count, void* stream,
                                espalier_factor_info* info);
int espalier_solve_device(espalier_solver* solver, const double* b, double* x, int64_t columns, int transpose,
                          void* stream, espalier_solve_info* info);
/**
 * Sets the options refinement_steps and required_backward_error (infinity: none) for the solves to come, at once.
 * ESPALIER_MISUSE for values that they cannot have.
 */
int espalier_set_refinement(espalier_solver* solver, int32_t steps, double required_backward_error);
/**
 * What the last factorization found of a singular matrix: rows that depend on the others, and vectors v with A v = 0 to
 * rounding, whose largest entry is 1. Ask after ESPALIER_SINGULAR, or with the option "singular" set to "report" or
 * "null_vectors".
 * @param capacity  rows and vectors that the caller has room for
 * @param rows      `capacity` indices from 0 on, ascending, of which n - rank are written, or all; NULL: not wanted
 * @param vectors   `capacity` times as many values as A has rows, one vector after another; NULL: not wanted
 * @param found     how many there are, 0 for a regular matrix; of more than `capacity` the first are handed out. With
 *                  "report" it may be less than rows - rank where zeros are many.
 */
int espalier_null_space(espalier_solver* solver, int64_t capacity, int64_t* rows, double* vectors, int64_t* found);
/** Estimates the condition number of the factored matrix (1-norm; infinity norm for a general matrix given by rows). */
int espalier_condition_estimate(espalier_solver* solver, double* estimate);

/** What a call found out about the entries of an inverse that it returned. */
typedef struct espalier_inverse_info {
  size_t size;
  double seconds;
  double error;       /**< estimated: of an entry over the largest of its column */
  double entry_error; /**< likewise over the entry itself */
  double trace_error; /**< of espalier_trace_of_inverse: absolute, estimated */
  int64_t checked;    /**< columns of A^-1 that were solved for and compared */
  int64_t solved;     /**< columns that were solved for, since entries lie outside the pattern of the factor */
} espalier_inverse_info;

/**
 * Entries of A^-1 by the factor that is there, see inverse.hpp: x[q] is that of the entry q that `pattern` stores, in
 * the order of its arrays; of A^-T and A^-H likewise. Its values are not read. With the pattern of A and
 * ESPALIER_TRANSPOSE it is the gradient of log|det A| by the values of A. The factor must lie on the host, in one
 * process. With ESPALIER_ACCURACY_NOT_REACHED x holds what was found.
 * @param count  of entries that x has room for, checked; of complex matrices two doubles each, here and below
 */
int espalier_selected_inverse_i32(espalier_solver* solver, const espalier_matrix_i32* pattern, double* x, int64_t count,
                                  int transpose, espalier_inverse_info* info);
int espalier_selected_inverse_i64(espalier_solver* solver, const espalier_matrix_i64* pattern, double* x, int64_t count,
                                  int transpose, espalier_inverse_info* info);
/** Blocks of `block` unknowns on the diagonal of A^-1, which divides rows, each by columns; 1: the diagonal.
 * @param count  rows * block, checked */
int espalier_inverse_blocks(espalier_solver* solver, int64_t block, double* x, int64_t count,
                            espalier_inverse_info* info);
/** trace(A^-1 B), one number; of complex matrices two. */
int espalier_trace_of_inverse_i32(espalier_solver* solver, const espalier_matrix_i32* b, double* trace,
                                  espalier_inverse_info* info);
int espalier_trace_of_inverse_i64(espalier_solver* solver, const espalier_matrix_i64* b, double* trace,
                                  espalier_inverse_info* info);

/** The solver works on several ranks from its next analysis on (<espalier/mpi.h> calls this for an MPI communicator).
 * Collective, as all calls are then that analyze, factorize or solve: all ranks make them in the same order, with the
 * same options, and all get the same status; an argument that cannot be is ESPALIER_MISUSE where it was given, and
 * ESPALIER_INVALID_INPUT on the others. Matrices are given by espalier_analyze_rows, values and vectors in parts.
 * @param functions  taken over; see espalier/ranks.h
 * @param patience  seconds after which a rank that sends nothing, while others wait for it, counts as lost; 0: 300 */
struct espalier_rank_functions;
int espalier_use_ranks(espalier_solver* solver, const struct espalier_rank_functions* functions, double patience);

/** What ranks take for one machine: 0: those of a host, which reach the memory of each other's GPUs; 1: each rank is
 * one of its own, and what GPUs make goes by messages. Between espalier_use_ranks and the first analysis, the same on
 * all ranks; not collective. */
int espalier_set_nodes(espalier_solver* solver, int each_process);

/** Rows first_row, first_row + 1, ... of a matrix of n rows and columns, with the columns of the whole matrix. Rows
 * that several ranks have and entries that come twice are summed, in the order of ranks. */
typedef struct espalier_local_rows_i32 {
  size_t size;             /**< sizeof of this struct */
  int64_t n;               /**< of the whole matrix, the same on all ranks */
  int64_t first_row;       /**< from index_base on */
  int64_t rows;            /**< of this rank; may be 0 */
  const int32_t* pointers; /**< rows + 1, from index_base on */
  const int32_t* indices;  /**< columns, from index_base on */
  const double* values;    /**< NULL on all ranks: a pattern */
  int storage;             /**< espalier_storage; what all ranks together hold */
  int index_base;          /**< 0 or 1 */
  int64_t numbers;         /**< espalier_numbers, the same on all ranks; a struct that ends before it is real */
} espalier_local_rows_i32;
typedef struct espalier_local_rows_i64 {
  size_t size;
  int64_t n;
  int64_t first_row;
  int64_t rows;
  const int64_t* pointers;
  const int64_t* indices;
  const double* values;
  int storage;
  int index_base;
  int64_t numbers;
} espalier_local_rows_i64;
/** After it espalier_refactorize takes this rank's values, and espalier_solve vectors of this rank's rows. Without
 * ranks there is one part. Entries of one triangle that stand in the other one are taken for their mirror images. */
int espalier_analyze_rows_i32(espalier_solver* solver, const espalier_local_rows_i32* part,
                              espalier_analysis_info* info);
int espalier_analyze_rows_i64(espalier_solver* solver, const espalier_local_rows_i64* part,
                              espalier_analysis_info* info);
/** From the next solve on this rank gives and gets `count` rows of vectors from `first` (from 0) on: all ranks together
 * give every row. Not collective; holds until the next analysis. */
int espalier_set_rows(espalier_solver* solver, int64_t first, int64_t count);
/** In place of espalier_analyze_rows: with the analysis of this pattern from a file of espalier_save_analysis, which
 * all ranks read. */
int espalier_load_analysis_rows_i32(espalier_solver* solver, const char* path, const espalier_local_rows_i32* part,
                                    espalier_analysis_info* info);
int espalier_load_analysis_rows_i64(espalier_solver* solver, const char* path, const espalier_local_rows_i64* part,
                                    espalier_analysis_info* info);
/** Saves the analysis to a file, for espalier_load_analysis of the same pattern. With ranks, rank 0 writes it. */
int espalier_save_analysis(espalier_solver* solver, const char* path);
/** Saves the last factorization, with matrix and analysis, to a file that appears under its name when all of it is on
 * the medium. Not of ranks. */
int espalier_save_factor(espalier_solver* solver, const char* path);
/** In place of analyze and factorize: the factor of a file of espalier_save_factor, real or complex; kind and precision
 * are those of the file. Its numbers are taken from the file where this machine lays out fronts alike, else the matrix
 * is factorized again. espalier_refactorize then takes values in the order of the file: that of the matrix that was
 * saved, without duplicates; of lu all entries. ESPALIER_INVALID_INPUT for a file that is cut off, damaged, none of
 * these, or newer: the solver has no matrix then. @param info may be null */
int espalier_load_factor(espalier_solver* solver, const char* path, espalier_factor_info* info);
int espalier_load_analysis_i32(espalier_solver* solver, const char* path, const espalier_matrix_i32* a,
                               espalier_analysis_info* info);
int espalier_load_analysis_i64(espalier_solver* solver, const char* path, const espalier_matrix_i64* a,
                               espalier_analysis_info* info);

/**
 * Analyses a pattern that differs from the analysed one here and there, in a small part of the time of an analysis; see
 * Solver::analyze_change() in solver.hpp; real or complex, as the analysed one. Where the matrix is refused, analysis
 * and factor are as before.
 * @param anew  1: all was ordered anew, 0: it was not; NULL: not wanted
 */
int espalier_analyze_change_i32(espalier_solver* solver, const espalier_matrix_i32* a, int32_t* anew,
                                espalier_analysis_info* info);
int espalier_analyze_change_i64(espalier_solver* solver, const espalier_matrix_i64* a, int32_t* anew,
                                espalier_analysis_info* info);

/** Rows and columns that come and go around the factor of a solver, see changed_system.hpp. Indices are from 0. Why a
 * call failed is said by the solver (espalier_last_error), under whose lock all calls are. End it before the solver,
 * and make it anew, or reset it, when that has factorized again. Around complex matrices each number is two doubles, in
 * arrays, columns and corners; counts are of numbers. What is left out there is the conjugate where the solver has
 * taken the matrix as a Hermitian one. */
typedef struct espalier_changed espalier_changed;
int espalier_changed_create(espalier_solver* solver, espalier_changed** changed);
void espalier_changed_destroy(espalier_changed* changed);
/** Forgets all changes, and takes the factor that the solver has now. */
int espalier_changed_reset(espalier_changed* changed);
/** Adds an unknown and an equation for each column. @param rows  the equations, each as a column; NULL: as `columns`.
 * @param corner  among the new ones, column by column; NULL: zeros */
int espalier_changed_add(espalier_changed* changed, const espalier_columns* columns, const espalier_columns* rows,
                         const double* corner);
/** Another column and row for each of `count` unknowns; rows NULL: as `columns`. */
int espalier_changed_replace(espalier_changed* changed, const int64_t* unknowns, int64_t count,
                             const espalier_columns* columns, const espalier_columns* rows);
/** Unknowns go with their equations, x is 0 there; come back; or do the one or the other, as each stands. */
int espalier_changed_remove(espalier_changed* changed, const int64_t* unknowns, int64_t count);
int espalier_changed_restore(espalier_changed* changed, const int64_t* unknowns, int64_t count);
int espalier_changed_flip(espalier_changed* changed, const int64_t* unknowns, int64_t count);
/** A + U C V^T. @param c  column by column; NULL: the identity. @param v  NULL: as u */
int espalier_changed_add_low_rank(espalier_changed* changed, const espalier_columns* u, const double* c,
                                  const espalier_columns* v);
/** Makes the columns of what is new now; a solve does so, too. */
int espalier_changed_prepare(espalier_changed* changed);
/** Factorizes the changed matrix now, or by itself where that is cheaper (1, as at first) or never (0). */
int espalier_changed_fold(espalier_changed* changed);
int espalier_changed_set_folding(espalier_changed* changed, int automatic);
/** Unknowns: those of A and all that were added. */
int espalier_changed_size(espalier_changed* changed, int64_t* size);
/** @param count  of values in b, and in x, which may be b: unknowns times columns, checked
 * @param transpose  espalier_transpose, of the changed matrix */
int espalier_changed_solve(espalier_changed* changed, const double* b, double* x, int64_t count, int64_t columns,
                           int transpose, espalier_solve_info* info);
/** Eigenvalues above, below and at zero; -1 where something is not symmetric (complex: not Hermitian). */
int espalier_changed_inertia(espalier_changed* changed, int64_t inertia[3]);
/** Operations and seconds, see ChangeCost. */
typedef struct espalier_change_cost {
  size_t size;
  double changes;       /**< operations since the last factorization of the changed matrix */
  double factorization; /**< that one would take */
  int64_t columns;
  int64_t factorizations;
  double column_seconds;
  double factorization_seconds;
} espalier_change_cost;
int espalier_changed_cost(espalier_changed* changed, espalier_change_cost* cost);

/** A matrix that is condensed onto some unknowns: S = A_ss - A_sr A_rr^-1 A_rs, see schur.hpp. Calls as for a solver.
 */
typedef struct espalier_schur espalier_schur;
/** With the options, the log and the interrupt of `solver` as they are now. *schur is NULL on failure. */
int espalier_schur_create(espalier_solver* solver, espalier_schur** schur);
void espalier_schur_destroy(espalier_schur* schur);
/** As espalier_last_error() and espalier_last_error_row(). */
const char* espalier_schur_last_error(const espalier_schur* schur);
int64_t espalier_schur_last_error_row(const espalier_schur* schur);
/** @param unknowns  `count` indices, from the index base of `a` on, each once, in the order that S shall have */
int espalier_schur_analyze_i32(espalier_schur* schur, const espalier_matrix_i32* a, const int64_t* unknowns,
                               int64_t count, espalier_analysis_info* info);
int espalier_schur_analyze_i64(espalier_schur* schur, const espalier_matrix_i64* a, const int64_t* unknowns,
                               int64_t count, espalier_analysis_info* info);
/** Factorizes A_rr and forms S. `values` in the order of the analysed arrays; `info` is that of A_rr. */
int espalier_schur_factorize(espalier_schur* schur, const double* values, int64_t count, espalier_factor_info* info);
/** S, column by column; both triangles also of a symmetric one. @param count  of values that `s` has room for, checked
 */
int espalier_schur_complement(espalier_schur* schur, double* s, int64_t count);
/** g = b_s - A_sr A_rr^-1 b_r; b has as many values a column as A rows, g as many as unknowns are listed. */
int espalier_schur_condense(espalier_schur* schur, const double* b, double* g, int64_t columns, int transpose,
                            espalier_solve_info* info);
/** x_r = A_rr^-1 (b_r - A_rs x_s), x_s at the listed unknowns. x may be b. */
int espalier_schur_expand(espalier_schur* schur, const double* b, const double* xs, double* x, int64_t columns,
                          int transpose, espalier_solve_info* info);
/** A x = b by way of S. x may be b. */
int espalier_schur_solve(espalier_schur* schur, const double* b, double* x, int64_t columns, int transpose,
                         espalier_solve_info* info);
/** Eigenvalues above, below and at zero, of A_rr and of S; -1 for lu. */
int espalier_schur_inertia(espalier_schur* schur, int64_t rest[3], int64_t complement[3]);

/**
 * Solves `count` systems of the pattern of `a`, one on each thread, with the options of `solver`, whose analysis and
 * factor are not touched; see batch.hpp. The status is that of the first system that failed.
 * @param values    count times as many as `a` has: of one system after another, in the order of its arrays
 * @param b         count * columns * rows
 * @param x         as many; may be b
 * @param statuses  count; NULL: not wanted
 */
int espalier_solve_batch_i32(espalier_solver* solver, const espalier_matrix_i32* a, const double* values,
                             const double* b, double* x, int64_t count, int64_t columns, int transpose,
                             int32_t* statuses);
int espalier_solve_batch_i64(espalier_solver* solver, const espalier_matrix_i64* a, const double* values,
                             const double* b, double* x, int64_t count, int64_t columns, int transpose,
                             int32_t* statuses);

#ifdef __cplusplus
}
#endif

#endif
