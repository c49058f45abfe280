/// \file
/// Residuals and products of which each of several ranks computes a part of the rows.
#pragma once

#include <span>

#include "ranks/communicator.hpp"
#include "solve/residual.hpp"

namespace espalier::solve {

/// Rows of which a rank computes residuals: first .. end - 1.
struct OwnRows {
  Index first, end;
};
OwnRows own_rows(Index rows, int rank, int ranks);

/// Vectors are whole on every rank. A row is summed by one rank in the order of one process, and gathered by all;
/// errors are largest magnitudes; sums and scalar products are made on each rank alike. So the bits are those of one
/// process.
///
/// All calls but size(), copy(), add(), combine() and dot() are collective.
class RankResidual final : public ResidualSpace {
 public:
  /// @param mine  of own_rows(); must outlive this, with its values
  /// @param shared  false: `mine` has all rows on each rank, of a matrix that is sooner computed with than gathered
  RankResidual(const ResidualOperator& mine, ranks::Communicator& link, bool shared = true);

  /// |op(A)|_inf. Collective
  [[nodiscard]] double norm(bool transpose) const;
  [[nodiscard]] Index size() const override { return mine_.size(); }
  void compute(std::span<ResidualColumn> columns, bool transpose) const override;
  void multiply(const double* x, double* y, bool transpose) const override;
  void multiply_columns(const double* x, double* y, Index columns, bool transpose) const override;
  void copy(const double* from, double* to) const override { mine_.copy(from, to); }
  bool add(const double* from, double* to) const override { return mine_.add(from, to); }
  void combine(double a, const double* x, double b, double* y) const override { mine_.combine(a, x, b, y); }
  [[nodiscard]] double dot(const double* a, const double* b) const override { return mine_.dot(a, b); }
  /// @throws Error(out_of_memory) on all ranks where one has no room
  [[nodiscard]] Vectors vectors(Index slot, Index columns) const override;

 private:
  struct Range {
    Offset first, count;  // doubles of a vector
  };
  [[nodiscard]] Range range_of(int rank) const;
  void gather_all(std::span<double* const> vectors) const;

  const ResidualOperator& mine_;
  ranks::Communicator& link_;
  bool shared_;
};

}  // namespace espalier::solve
