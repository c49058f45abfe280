/// \file
/// Residuals and products of which each of several ranks computes a part of the rows.
#pragma once

#include <span>

#include "ranks/link.hpp"
#include "solve/residual.hpp"

namespace espalier::solve {

/// Vectors are whole on every rank. A row is summed by one rank in the order of one process, and gathered by all;
/// errors are largest magnitudes; sums and scalar products are made on each rank alike. So the bits are those of one
/// process.
///
/// All calls but copy(), add(), combine() and dot() are collective.
class RankResidual final : public ResidualSpace {
 public:
  /// @param whole  must outlive this, with its values
  /// @param shared  false: each rank computes all rows, of a matrix that is sooner computed with than gathered
  RankResidual(const ResidualOperator& whole, ranks::Link& link, bool shared = true);

  [[nodiscard]] Index size() const override { return whole_.size(); }
  void compute(std::span<ResidualColumn> columns, bool transpose) const override;
  void multiply(const double* x, double* y, bool transpose) const override;
  void multiply_columns(const double* x, double* y, Index columns, bool transpose) const override;
  void copy(const double* from, double* to) const override { whole_.copy(from, to); }
  bool add(const double* from, double* to) const override { return whole_.add(from, to); }
  void combine(double a, const double* x, double b, double* y) const override { whole_.combine(a, x, b, y); }
  [[nodiscard]] double dot(const double* a, const double* b) const override { return whole_.dot(a, b); }
  /// @throws Error(out_of_memory) on all ranks where one has no room
  [[nodiscard]] Vectors vectors(Index slot, Index columns) const override;

 private:
  struct Range {
    Offset first, count;  // doubles of a vector
  };
  [[nodiscard]] Range range_of(int rank) const;
  void gather(std::span<double* const> vectors) const;

  const ResidualOperator& whole_;
  ranks::Link& link_;
  Index rows_;
  bool shared_;
  ResidualOperator part_;
};

}  // namespace espalier::solve
