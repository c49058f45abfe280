/// \file
/// Residuals in extended precision and backward errors, threaded row by row, with the same bits for any number of
/// threads.
#pragma once

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/memory.hpp"
#include "base/scalar.hpp"
#include "base/thread_pool.hpp"
#include "device/residual_space.hpp"
#include "espalier/matrix.hpp"
#include "matrix/row_index.hpp"
#include "solve/row_sums.hpp"

namespace espalier::solve {

using device::BackwardError;
using device::ResidualColumn;
using device::ResidualSpace;

/// What rows contribute to the errors of a solution: largest magnitudes, so that parts of the rows come to the same in
/// any order.
struct RowErrors {
  double residual = 0, componentwise = 0, x = 0, b = 0;
  bool finite = true;

  void add(const RowErrors& other);
  template <class Value>
  void add(Value residual_i, double scale, Value x_i, Value b_i);
};

/// Computes b - A x and b - A^T x for one pattern and changing values. Products are accumulated in twice the working
/// precision (error-free transformations of Ogita, Rump and Oishi 2005).
///
/// Complex values and vectors are passed as doubles (base::Numbers); size() counts doubles, products and sums with real
/// factors and the scalar product are those of the real space of twice the dimension, which is all that refinement and
/// the Krylov methods ask for.
class ResidualOperator final : public ResidualSpace {
 public:
  /// Indexes the pattern of `a` (any storage; duplicates allowed) by rows. @param a must outlive the operator
  ResidualOperator(const MatrixView& a, base::ThreadPool& pool);
  /// The same with an index that is there already (rows_of()).
  ResidualOperator(const MatrixView& a, std::shared_ptr<const matrix::RowIndex> rows, base::ThreadPool& pool,
                   base::Numbers numbers = base::Numbers::real)
      : a_(a), values_(a.values), pool_(&pool), rows_(std::move(rows)), numbers_(numbers), end_row_(a.rows) {}
  /// The index that operators of a pattern share; without entries where both triangles are stored: there a column is
  /// the row.
  static std::shared_ptr<const matrix::RowIndex> rows_of(const MatrixView& a, base::ThreadPool& pool);

  /// The operator that computes the rows first .. end - 1 of residuals, products and norms alone; of the values that
  /// this one has now.
  [[nodiscard]] ResidualOperator of_rows(Index first, Index end) const;

  /// New values, in the order of `a`. The span must stay valid while the operator is used.
  void set_values(std::span<const double> values);

  /// r = b - op(A) x for one right-hand side (n values each); r may be null when only the errors are wanted.
  BackwardError compute(const double* b, const double* x, double* r, bool transpose) const;
  /// The same for several right-hand sides, two registers of them in each pass over the matrix; each has the bits that
  /// it has alone.
  void compute(std::span<ResidualColumn> columns, bool transpose) const override;
  /// The same in two parts: residuals of rows, and what they say of the solution. @param errors  of each column
  void compute_rows(std::span<const ResidualColumn> columns, std::span<RowErrors> errors, bool transpose) const;
  /// @param norm  |op(A)|_inf of all rows
  [[nodiscard]] static BackwardError judge(const RowErrors& errors, double norm);
  void multiply(const double* x, double* y, bool transpose) const override;
  void multiply_columns(const double* x, double* y, Index columns, bool transpose) const override;
  void combine(double a, const double* x, double b, double* y) const override;
  [[nodiscard]] double dot(const double* a, const double* b) const override;
  void add_columns(const double* z, std::span<const double> factors, double* y) const override;

  /// |op(A)|_inf; computed when first asked for after set_values(). Not safe for concurrent first calls.
  [[nodiscard]] double norm(bool transpose) const;
  /// Doubles in a vector.
  [[nodiscard]] Index size() const override { return base::parts_of(numbers_) * a_.rows; }
  [[nodiscard]] Index rows() const { return a_.rows; }
  [[nodiscard]] Offset entries() const { return a_.nonzeros(); }
  void copy(const double* from, double* to) const override;
  bool add(const double* from, double* to) const override;
  [[nodiscard]] Vectors vectors(Index slot, Index columns) const override;
  /// The row index of the pattern; empty where both triangles are stored.
  [[nodiscard]] const matrix::RowIndex& row_index() const { return *rows_; }
  [[nodiscard]] Offset bytes() const;

 private:
  struct RowRange;
  void residual_rows_fma(const RowRange& rows, RowErrors& errors) const;
  template <class Use>
  void for_each_range(const Use& use) const;
  [[nodiscard]] std::size_t ranges() const;
  [[nodiscard]] static RowErrors total(std::span<const RowErrors> found);
  RowErrors compute_rows(const double* b, const double* x, double* r, bool transpose) const;
  void compute_pass(std::span<const ResidualColumn> columns, std::span<RowErrors> errors, const RowSums& sums,
                    double* packed, bool transpose) const;
  void multiply_pass(const double* x, double* y, std::size_t count, double* packed, bool transpose) const;
  template <class Column>
  void pack(std::size_t count, std::size_t lanes, const Column& column, double* packed) const;
  RowEntries gather_row(Index row, bool transpose, std::vector<double>& values, std::vector<Index>& cols) const;
  template <class Value, class Use0, class Use1>
  void visit_row(Index row, bool transpose, Use0&& use0, Use1&& use1) const;
  template <class Value>
  void residual_rows(const RowRange& rows, RowErrors& errors) const;
  template <class Value>
  void multiply_rows(const Value* x, Value* y, bool transpose) const;
  template <class Value>
  [[nodiscard]] double largest_row_sum(bool transpose) const;

  MatrixView a_;
  std::span<const double> values_;
  base::ThreadPool* pool_ = nullptr;
  std::shared_ptr<const matrix::RowIndex> rows_;
  base::Numbers numbers_ = base::Numbers::real;
  Index first_row_ = 0, end_row_ = 0;  // of what is computed here
  mutable double norm_inf_ = -1;       // -1: not known yet
  mutable double norm_one_ = -1;
};

}  // namespace espalier::solve
