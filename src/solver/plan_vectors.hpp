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
#include "solver/numeric.hpp"
#include "solver/prepared_matrix.hpp"
#include "solver/real_form.hpp"

namespace espalier::solver {

[[nodiscard]] inline double factor_of(const std::vector<double>& scale, Index i) {
  return scale.empty() ? 1.0 : scale[at(i)];
}

/// The front of a position in the order of elimination, and all above it.
inline void mark_path(const plan::Plan& plan, Index position, std::vector<char>& fronts) {
  const auto& first = plan.tree.first;
  auto f = static_cast<Index>(std::upper_bound(first.begin(), first.end(), position) - first.begin()) - 1;
  for (; f >= 0 && fronts[at(f)] == 0; f = plan.tree.parent[at(f)]) fronts[at(f)] = 1;
}
/// Of the factor, in these fronts.
[[nodiscard]] inline double entries_on(const plan::Plan& plan, const std::vector<char>& fronts) {
  double entries = 0;
  for (Index f = 0; f < plan.fronts(); ++f)
    if (fronts[at(f)] != 0) entries += static_cast<double>(plan.layout[f].factor_size());
  return entries;
}

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
        const auto [col, part] = unknown_of(plan.tree.order[static_cast<std::size_t>(k)]);
        const Index i = transpose ? col : prepared_.row_of(col);
        const double scale = factor_of(factors, i);
        const double s = conjugated && part == 1 ? -scale : scale;
        T* row = to + k * width;
        if (width == 1) {
          *row = in_unit(s * b[place(i, part)], 0);
          continue;
        }
        for (Index c = 0; c < columns; ++c) row[c] = in_unit(s * b[place(static_cast<Offset>(c) * n + i, part)], c);
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
        const auto [col, part] = unknown_of(plan.tree.order[static_cast<std::size_t>(k)]);
        const Index i = transpose ? prepared_.row_of(col) : col;
        const double s = factor_of(factors, i);
        const T* row = from + k * width;
        for (Index c = 0; c < columns; ++c) x[place(static_cast<Offset>(c) * n + i, part)] = s * from_unit(row[c], c);
      }
    });
  }

  /// Where numbers of the caller's vectors stand in the order of elimination; of a real form their first parts.
  struct Places {
    std::vector<Index> of_right, of_solution;
  };
  [[nodiscard]] Places places(const plan::Plan& plan, bool transpose) const {
    const auto n = at(prepared_.n());
    std::vector<Index> of_column(n), of_row(n);
    for (Index k = 0; k < plan.tree.n; ++k)
      if (const auto [col, part] = unknown_of(plan.tree.order[at(k)]); part == 0) of_column[at(col)] = k;
    for (Index c = 0; c < prepared_.n(); ++c) of_row[at(prepared_.row_of(c))] = of_column[at(c)];
    if (transpose) return {std::move(of_column), std::move(of_row)};
    return {std::move(of_row), std::move(of_column)};
  }

  /// Scaled entries of some columns; other rows on the paths become zero.
  void take_entries(const plan::Plan& plan, const Scales& scales, const RowsJob& job, const Places& places,
                    std::span<const Offset> col_ptr, Index width, const device::FrontPaths& paths, T* to) {
    for (Index f = 0; f < plan.fronts(); ++f)
      if (paths.up[at(f)] != 0 || paths.down[at(f)] != 0)
        std::fill_n(to + Offset{plan.tree.first[f]} * width, Offset{plan.layout[f].pivots} * width, T(0));
    const auto* values = reinterpret_cast<const Value*>(job.values);
    const std::vector<double>& factors = job.transpose ? scales.col : scales.row;
    constexpr Index kParts = kRealForm ? 2 : 1;
    unit_.assign(col_ptr.size() - 1, 1);
    for (std::size_t c = 0; c + 1 < col_ptr.size(); ++c) {
      double most = 0;
      for (auto q = at(col_ptr[c]); q < at(col_ptr[c + 1]); ++q)
        for (Index part = 0; part < kParts; ++part)
          most = std::max(most,
                          std::abs(factor_of(factors, job.row_ind[q]) * values[place(static_cast<Offset>(q), part)]));
      if (!base::keeps_fp64<T>) unit_[c] = unit_for(most);
      for (auto q = at(col_ptr[c]); q < at(col_ptr[c + 1]); ++q)
        for (Index part = 0; part < kParts; ++part) {
          const Index i = job.row_ind[q];
          const bool turned = kRealForm && !real_form_->hermitian && part == 1;
          const Value v = (turned ? -1 : 1) * factor_of(factors, i) * values[place(static_cast<Offset>(q), part)];
          const Offset k = places.of_right[at(i)] + part;
          to[k * width + static_cast<Offset>(c)] = in_unit(v, static_cast<Index>(c));
        }
    }
  }

  void give_unknowns(const Scales& scales, const RowsJob& job, const Places& places, Index first, Index columns,
                     Index width, const T* from) const {
    auto* x = reinterpret_cast<Value*>(job.x);
    const std::vector<double>& factors = job.transpose ? scales.row : scales.col;
    constexpr Index kParts = kRealForm ? 2 : 1;
    const auto count = static_cast<Offset>(job.unknowns.size());
    for (Index c = 0; c < columns; ++c)
      for (Offset u = 0; u < count; ++u) {
        const Index i = job.unknowns[at(u)];
        for (Index part = 0; part < kParts; ++part)
          x[place((Offset{first} + c) * count + u, part)] =
              factor_of(factors, i) * from_unit(from[Offset{places.of_solution[at(i)] + part} * width + c], c);
      }
  }

 private:
  // FP32: a right-hand side may be far from 1 where the scaled matrix is not. It is measured in a power of two, which
  // changes no digit.
  void find_units(const Scales& scales, const Number* b, Index columns, bool transpose) {
    if (base::keeps_fp64<T>) return;
    unit_.assign(static_cast<std::size_t>(columns), 1);
    const Index n = prepared_.n();
    pool_.for_each_range(columns, 1, [&](std::int64_t c, std::int64_t) {
      double most = 0;
      for (Index k = 0; k < n; ++k) {
        const Index i = transpose ? k : prepared_.row_of(k);
        const double v =
            std::abs(factor_of(transpose ? scales.col : scales.row, i) * b[static_cast<Offset>(c) * n + i]);
        if (v > most) most = v;
      }
      unit_[static_cast<std::size_t>(c)] = unit_for(most);
    });
  }
  static double unit_for(double most) {
    if (!(most > 0 && std::isfinite(most) && (most > kFar || most < 1 / kFar))) return 1;
    return std::ldexp(1.0, std::clamp(std::ilogb(most), -1000, 1000));
  }

  [[nodiscard]] T in_unit(Value v, Index c) const {
    return base::narrowed<T>(base::keeps_fp64<T> ? v : v / unit_[static_cast<std::size_t>(c)]);
  }
  [[nodiscard]] Value from_unit(T v, Index c) const {
    return base::keeps_fp64<T> ? Value(v) : static_cast<Value>(v) * unit_[static_cast<std::size_t>(c)];
  }

  // The number, or part of a number, that a column of the plan stands for.
  struct Unknown {
    Index number, part;
  };
  static Unknown unknown_of(Index col) { return kRealForm ? Unknown{col / 2, col % 2} : Unknown{col, 0}; }
  // Where it stands in a vector, in terms of Value.
  static Offset place(Offset number, Index part) { return kRealForm ? 2 * number + part : number; }

  static constexpr std::int64_t kRows = 8192;  // rows per range of work
  static constexpr double kFar = 0x1p40;       // from 1: then a right-hand side gets a unit of its own

  const PreparedMatrix& prepared_;
  const RealForm* real_form_;
  base::ThreadPool& pool_;
  std::vector<double> unit_;  // FP32: of the right-hand sides in work
};

}  // namespace espalier::solver
