/// \file
/// Between the caller's vectors and those of a plan, which are scaled and in the order of elimination.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/at.hpp"
#include "base/scalar.hpp"
#include "base/thread_pool.hpp"
#include "device/executor.hpp"
#include "plan/plan.hpp"
#include "solver/analysis/prepared_matrix.hpp"
#include "solver/analysis/real_form.hpp"
#include "solver/factor/numeric.hpp"

namespace espalier::solver {

/// FP32: a right-hand side may be far from 1 where the scaled matrix is not. Each is measured in a power of two, which
/// changes no digit.
template <class T>
class ColumnScales {
  using Value = base::WideOf<T>;

 public:
  void reset(Index columns) {
    if (!base::keeps_fp64<T>) unit_.assign(at(columns), 1);
  }
  /// most: largest magnitude in the column.
  void set(Index c, double most) {
    if (base::keeps_fp64<T>) return;
    const bool far = most > 0 && std::isfinite(most) && (most > kFar || most < 1 / kFar);
    unit_[at(c)] = far ? std::ldexp(1.0, std::clamp(std::ilogb(most), -1000, 1000)) : 1;
  }
  [[nodiscard]] T in(Value v, Index c) const { return base::narrowed<T>(base::keeps_fp64<T> ? v : v / unit_[at(c)]); }
  [[nodiscard]] Value from(T v, Index c) const {
    return base::keeps_fp64<T> ? Value(v) : static_cast<Value>(v) * unit_[at(c)];
  }

 private:
  static constexpr double kFar = 0x1p40;  // from 1: then a right-hand side gets a unit of its own

  std::vector<double> unit_;  // of the right-hand sides in work
};

/// T: scalar of the factor. kRealForm: it is that of a complex system's real form (real_form.hpp), of whose vectors two
/// rows, a number's parts, stand for one number. Vectors of the plan are row-major, `width` values a row.
template <class T, bool kRealForm>
class PlanVectors {
  using Value = base::WideOf<T>;
  using Number = std::conditional_t<kRealForm, std::complex<double>, Value>;  // of the system's vectors

 public:
  /// All arguments outlive it. @param form  null: none
  PlanVectors(const PreparedMatrix& prepared, const RealForm* form, base::ThreadPool& pool)
      : prepared_(prepared), real_form_(form), pool_(pool) {}

  /// Scaled right-hand sides in elimination order; columns that pad the width are zero. Those of a real form are
  /// conjugated, but for Hermitian matrices.
  void take(const plan::Plan& plan, const Scales& scales, const double* from, Index columns, Index width,
            bool transpose, T* to) {
    find_units(scales, reinterpret_cast<const Number*>(from), columns, transpose);
    const Index n = prepared_.n();
    const auto* b = reinterpret_cast<const Value*>(from);
    const bool conjugated = kRealForm && !real_form_->hermitian;
    const std::vector<double>& factors = transpose ? scales.col : scales.row;
    pool_.for_each_range(plan.tree.n, kRows, [&](std::int64_t begin, std::int64_t end) {
      for (auto k = begin; k < end; ++k) {
        const auto [col, part] = unknown_of(plan.tree.order[at(k)]);
        const Index i = transpose ? col : prepared_.row_of(col);
        const double scale = factor_of(factors, i);
        const double s = conjugated && part == 1 ? -scale : scale;
        T* row = to + k * width;
        if (width == 1) {
          *row = units_.in(s * b[place(i, part)], 0);
          continue;
        }
        for (Index c = 0; c < columns; ++c) row[c] = units_.in(s * b[place(static_cast<Offset>(c) * n + i, part)], c);
        std::fill(row + columns, row + width, T(0));
      }
    });
  }

  /// Solutions.
  void give(const plan::Plan& plan, const Scales& scales, const T* from, Index columns, Index width, bool transpose,
            double* to) const {
    const Index n = prepared_.n();
    auto* x = reinterpret_cast<Value*>(to);
    const std::vector<double>& factors = transpose ? scales.row : scales.col;
    pool_.for_each_range(plan.tree.n, kRows, [&](std::int64_t begin, std::int64_t end) {
      for (auto k = begin; k < end; ++k) {
        const auto [col, part] = unknown_of(plan.tree.order[at(k)]);
        const Index i = transpose ? prepared_.row_of(col) : col;
        const double s = factor_of(factors, i);
        const T* row = from + k * width;
        for (Index c = 0; c < columns; ++c) x[place(static_cast<Offset>(c) * n + i, part)] = s * units_.from(row[c], c);
      }
    });
  }

 private:
  void find_units(const Scales& scales, const Number* b, Index columns, bool transpose) {
    if (base::keeps_fp64<T>) return;
    units_.reset(columns);
    const Index n = prepared_.n();
    pool_.for_each_range(columns, 1, [&](std::int64_t c, std::int64_t) {
      double most = 0;
      for (Index k = 0; k < n; ++k) {
        const Index i = transpose ? k : prepared_.row_of(k);
        const double v =
            std::abs(factor_of(transpose ? scales.col : scales.row, i) * b[static_cast<Offset>(c) * n + i]);
        if (v > most) most = v;
      }
      units_.set(static_cast<Index>(c), most);
    });
  }

  // The number, or part of a number, that a column of the plan stands for.
  struct Unknown {
    Index number, part;
  };
  static Unknown unknown_of(Index col) { return kRealForm ? Unknown{col / 2, col % 2} : Unknown{col, 0}; }
  // Where it stands in a vector, in terms of Value.
  static Offset place(Offset number, Index part) { return kRealForm ? 2 * number + part : number; }

  static constexpr std::int64_t kRows = 8192;  // rows per range of work

  const PreparedMatrix& prepared_;
  const RealForm* real_form_;
  base::ThreadPool& pool_;
  ColumnScales<T> units_;
};

}  // namespace espalier::solver
