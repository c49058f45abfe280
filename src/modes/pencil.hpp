/// \file
/// K - s M on one pattern: one analysis, a factorization for each s, and what its inertia says.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "espalier/modes.hpp"

namespace espalier::modes {

/// The lower triangle of a symmetric matrix from outside: rows rising, no duplicates, numbers finite. A general matrix
/// must be symmetric to 1e-12 of its largest entry; the mean of both triangles is taken.
/// @param name of the matrix, for messages: "K"
/// @throws Error(invalid_input)
SparseMatrix symmetric_lower(const MatrixView& a, const std::string& name, base::ThreadPool& pool);

/// Any real square matrix from outside in general storage: rows rising, duplicates summed, numbers finite.
/// @throws Error(invalid_input)
SparseMatrix general_of(const MatrixView& a, const std::string& name, base::ThreadPool& pool);

/// alpha A + beta B of two lower triangles, on the union of their patterns. @param pool  null: by one thread
SparseMatrix sum(double alpha, const SparseMatrix& a, double beta, const SparseMatrix& b,
                 base::ThreadPool* pool = nullptr);

/// The diagonal, zero where there is no entry.
std::vector<double> diagonal_of(const SparseMatrix& lower);

/// Options for factors of ours: `from` with the kind, and without refinement, which the search has no need for.
Options factor_options(const Options& from, Kind kind);

/// How a factorization of K - s M ended.
struct Shifted {
  Status status;       ///< singular: s is an eigenvalue, to rounding
  Index negative = 0;  ///< eigenvalues of K - s M
  bool exact = true;   ///< no pivot was replaced
};

class Pencil {
 public:
  /// Both lower triangles of one size. @param options, pool  outlive the pencil
  Pencil(SparseMatrix k, SparseMatrix m, const ModesOptions& options, base::ThreadPool& pool);

  /// The analysis, by the values of this shift. What is wrong with them factorize() says.
  void prepare(double shift);
  /// @throws Error where memory or devices fail, or the caller interrupts
  Shifted factorize(double shift);
  /// Solves with the last factor. @throws Error
  void solve(const double* b, double* x, Index columns);
  /// The same in the memory of the GPU that has it, when what is enqueued on its queue (a cudaStream_t) is done.
  void solve_device(const double* b, double* x, Index columns, void* queue);
  /// Number of that GPU; -1: there is none.
  [[nodiscard]] int gpu() const { return solver_.gpu(); }

  [[nodiscard]] const SparseMatrix& k() const { return k_; }
  [[nodiscard]] const SparseMatrix& m() const { return m_; }
  [[nodiscard]] Index n() const { return k_.rows; }
  [[nodiscard]] double shift() const { return shift_; }

  Index factorizations = 0;
  double analysis_seconds = 0, factor_seconds = 0;
  Offset factor_peak_bytes = 0;
  Offset device_bytes = 0;  ///< that the last factor held on its (first) device

 private:
  void lay_out();

  SparseMatrix k_, m_;
  const Options& options_;
  base::ThreadPool& pool_;
  Solver solver_;
  AnalysisResult analysis_;
  SparseMatrix pattern_;
  std::vector<double> k_values_, m_values_;
  double shift_ = 0;
};

}  // namespace espalier::modes
