/// \file
/// What refinement needs of the memory in which it works, be it that of the host or of a device.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <span>

#include "base/at.hpp"
#include "espalier/types.hpp"

namespace espalier::device {

/// Backward errors of an approximate solution.
struct BackwardError {
  double normwise = 0;       ///< |b - A x|_inf / (|A|_inf |x|_inf + |b|_inf)  (Rigal and Gaches 1967)
  double componentwise = 0;  ///< max_i |b - A x|_i / (|A| |x| + |b|)_i  (Oettli and Prager 1964); 0/0 counts as 0
};

/// One of several right-hand sides (n values each); r may be null when only the error is wanted.
struct ResidualColumn {
  const double* b = nullptr;
  const double* x = nullptr;
  double* r = nullptr;
  BackwardError error;  ///< result
};

/// A matrix of order n and vectors of n values. All pointers are into the space's own memory.
class ResidualSpace {
 public:
  virtual ~ResidualSpace() = default;
  [[nodiscard]] virtual Index size() const = 0;
  /// r = b - op(A) x for each column, with its backward errors.
  virtual void compute(std::span<ResidualColumn> columns, bool transpose) const = 0;
  /// Copies and sums may be under way on return, in the order of the calls; compute() waits.
  virtual void copy(const double* from, double* to) const = 0;
  /// to += from. @returns whether all of `to` was finite before; true where that is not known yet: then its residual
  /// is infinite
  virtual bool add(const double* from, double* to) const = 0;
  /// y = op(A) x in plain double precision. May be under way on return.
  virtual void multiply(const double* x, double* y, bool transpose) const = 0;
  /// The same for `columns` vectors, one after another; each with the bits that it has alone.
  virtual void multiply_columns(const double* x, double* y, Index columns, bool transpose) const {
    for (Index k = 0; k < columns; ++k) multiply(x + Offset{k} * size(), y + Offset{k} * size(), transpose);
  }
  /// y = a x + b y; y is not read where b is zero. May be under way on return.
  virtual void combine(double a, const double* x, double b, double* y) const = 0;
  /// Sum of the products of two vectors, in an order that depends on n alone. Waits.
  [[nodiscard]] virtual double dot(const double* a, const double* b) const = 0;
  /// Memory for so many vectors, one after another, as long as the owner lives and nobody asks for the same slot again.
  /// Slots are numbered from 0.
  struct Vectors {
    double* data = nullptr;
    std::shared_ptr<void> owner;
  };
  [[nodiscard]] virtual Vectors vectors(Index slot, Index columns) const = 0;
  /// Memory of the caller's own for so many vectors, which the space must outlive. @throws Error(out_of_memory)
  [[nodiscard]] virtual std::shared_ptr<double[]> memory(Index columns) const {
    return std::make_shared_for_overwrite<double[]>(at(size()) * at(columns));
  }
  /// y[places[k]] = values[k], once the first `cleared` vectors of y have been set to zero. May be under way on return;
  /// the lists are of the host, and not read any more.
  virtual void scatter(std::span<const Offset> places, std::span<const double> values, double* y, Index cleared) const {
    std::fill_n(y, at(size()) * at(cleared), 0.0);
    for (std::size_t k = 0; k < places.size(); ++k) y[places[k]] = values[k];
  }
  /// to[k] = y[places[k]], to memory of the host. Waits.
  virtual void gather(const double* y, std::span<const Offset> places, double* to) const {
    for (std::size_t k = 0; k < places.size(); ++k) to[k] = y[places[k]];
  }
  /// The largest magnitude in each of some vectors, to memory of the host; NaN where one is. Waits.
  virtual void largest(std::span<const double* const> vectors, std::span<double> found) const {
    for (std::size_t k = 0; k < vectors.size(); ++k) {
      found[k] = 0;
      for (Index i = 0; i < size() && !std::isnan(found[k]); ++i)
        if (const double magnitude = std::abs(vectors[k][i]); !(magnitude <= found[k])) found[k] = magnitude;
    }
  }
  /// y += sum_k factors[k] z_k of vectors that stand one after another, added in their order. May be under way on
  /// return.
  virtual void add_columns(const double* z, std::span<const double> factors, double* y) const {
    for (const double factor : factors) {
      if (factor != 0) combine(factor, z, 1, y);
      z += size();
    }
  }
};

/// Some right-hand sides, one vector after another; r may be null when only errors are wanted.
struct ResidualColumns {
  const double* b = nullptr;
  const double* x = nullptr;
  double* r = nullptr;
  Index columns = 1;
};

/// A space whose matrix is block-diagonal: equal parts, none of which is coupled with another one.
class PartSpace : public ResidualSpace {
 public:
  /// compute() with the errors of each part. Waits.
  /// @param errors  columns x parts: of all parts of one column after another
  virtual void compute_parts(const ResidualColumns& columns, std::span<BackwardError> errors, bool transpose) const = 0;
  /// to = from in the parts for which `taken` (columns x parts) has a 1. May be under way on return; `taken` is not
  /// read any more.
  virtual void copy_parts(const double* from, double* to, Index columns, std::span<const char> taken) const = 0;
};

}  // namespace espalier::device
