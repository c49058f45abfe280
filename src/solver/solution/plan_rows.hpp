/// \file
/// Solves that touch a part of the tree: which fronts, and the few rows of a plan's vectors that come and go.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/at.hpp"
#include "base/memory.hpp"
#include "device/executor.hpp"
#include "plan/plan.hpp"
#include "solver/analysis/prepared_matrix.hpp"
#include "solver/analysis/real_form.hpp"
#include "solver/factor/numeric.hpp"
#include "solver/solution/plan_vectors.hpp"

namespace espalier::solver {

/// Fronts on the way from some rows to the roots.
class FrontMarks {
 public:
  explicit FrontMarks(const plan::Plan& plan) : plan_(plan), marks_(at(plan.fronts())) {}
  void clear() {
    std::fill(marks_.begin(), marks_.end(), 0);
    entries_ = 0;
  }
  /// The front of a position in the order of elimination, and all above it.
  void add(Index position) {
    const auto& first = plan_.tree.first;
    auto f = static_cast<Index>(std::upper_bound(first.begin(), first.end(), position) - first.begin()) - 1;
    for (; f >= 0 && marks_[at(f)] == 0; f = plan_.tree.parent[at(f)]) {
      marks_[at(f)] = 1;
      entries_ += static_cast<double>(plan_.layout[f].factor_size());
    }
  }
  [[nodiscard]] std::span<const char> marks() const { return marks_; }
  /// Entries of the factor, in these fronts.
  [[nodiscard]] double entries() const { return entries_; }

 private:
  const plan::Plan& plan_;
  std::vector<char> marks_;  // fronts
  double entries_ = 0;
};

/// T, kRealForm: as for PlanVectors. All arguments outlive it.
template <class T, bool kRealForm>
class PlanRows {
  using Value = base::WideOf<T>;

 public:
  /// @param form  null: none
  PlanRows(const PreparedMatrix& prepared, const RealForm* form, base::MemoryBudget& budget)
      : prepared_(prepared), conjugated_(kRealForm && !form->hermitian), budget_(budget) {}

  /// The next plan is another one.
  void forget() {
    of_column_.clear();
    of_row_.clear();
    whole_ = 0;
  }

  /// Columns by groups of `most`; width(columns): of a row of so many. solve(PathSolve): see
  /// Executor::solve_on_paths().
  /// @returns the share of the factor's entries that were read; nothing where solve() returned false
  template <class Width, class Solve>
  std::optional<double> solve(const plan::Plan& plan, const Scales& scales, const RowsJob& job, Index most,
                              Width&& width, Solve&& solve) {
    find_places(plan);
    const std::vector<Index>& solution = job.transpose ? of_row_ : of_column_;
    const std::vector<Index>& right = job.transpose ? of_column_ : of_row_;
    const std::vector<Index> wanted = positions(job.unknowns, solution);
    FrontMarks up(plan), down(plan);
    for (const Index k : wanted) down.add(k);
    const auto columns = static_cast<Index>(job.col_ptr.size() - 1);
    double read = 0;
    int groups = 0;
    for (Index first = 0; first < columns; first += most, ++groups) {
      const Index now = std::min(most, columns - first), row = width(now);
      const std::span<const Offset> some = job.col_ptr.subspan(at(first), at(now) + 1);
      const auto entries = job.row_ind.subspan(at(some.front()), at(some.back() - some.front()));
      const std::vector<Index> given = positions(entries, right);
      up.clear();
      for (const Index k : given) up.add(k);
      base::Buffer<T> b(static_cast<Offset>(given.size()) * row, &budget_);
      base::Buffer<T> x(static_cast<Offset>(wanted.size()) * row, &budget_);
      std::fill(b.span().begin(), b.span().end(), T(0));
      take(scales, job, some, right, given, row, b.data());
      if (!solve(
              device::PathSolve<T>{{up.marks(), down.marks()}, given, b.data(), wanted, x.data(), row, job.transpose}))
        return {};
      give(scales, job, solution, wanted, first, now, row, x.data());
      read += up.entries() + down.entries();
    }
    return whole_ > 0 ? read / (2 * whole_ * groups) : 1;
  }

 private:
  static constexpr Index kParts = kRealForm ? 2 : 1;  // rows that stand for a number

  // Where the parts of the caller's numbers stand in the order of elimination.
  void find_places(const plan::Plan& plan) {
    if (!of_column_.empty() || plan.tree.n == 0) return;
    whole_ = 0;
    for (Index f = 0; f < plan.fronts(); ++f) whole_ += static_cast<double>(plan.layout[f].factor_size());
    const Index n = prepared_.n();
    of_row_.resize(at(plan.tree.n));
    of_column_.resize(at(plan.tree.n));
    for (Index k = 0; k < plan.tree.n; ++k) of_column_[at(plan.tree.order[at(k)])] = k;
    for (Index c = 0; c < n; ++c)
      for (Index part = 0; part < kParts; ++part)
        of_row_[at(prepared_.row_of(c) * kParts + part)] = of_column_[at(c * kParts + part)];
  }

  // Ascending, each once.
  static std::vector<Index> positions(std::span<const Index> numbers, const std::vector<Index>& place) {
    std::vector<Index> list;
    list.reserve(numbers.size() * at(kParts));
    for (const Index i : numbers)
      for (Index part = 0; part < kParts; ++part) list.push_back(place[at(i * kParts + part)]);
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    return list;
  }
  static Offset row_of(const std::vector<Index>& list, Index position) {
    return std::lower_bound(list.begin(), list.end(), position) - list.begin();
  }

  // Scaled entries of the columns.
  void take(const Scales& scales, const RowsJob& job, std::span<const Offset> col_ptr, const std::vector<Index>& place,
            const std::vector<Index>& given, Index width, T* to) {
    const auto* values = reinterpret_cast<const Value*>(job.values);
    const std::vector<double>& factors = job.transpose ? scales.col : scales.row;
    const auto scaled = [&](Offset q, Index part) {
      const double factor = factor_of(factors, job.row_ind[at(q)]);
      return (conjugated_ && part == 1 ? -factor : factor) * values[q * kParts + part];
    };
    units_.reset(static_cast<Index>(col_ptr.size()) - 1);
    for (Index c = 0; at(c) + 1 < col_ptr.size(); ++c) {
      double most = 0;
      for (Offset q = col_ptr[at(c)]; q < col_ptr[at(c) + 1]; ++q)
        for (Index part = 0; part < kParts; ++part)
          most = std::max(most, static_cast<double>(std::abs(scaled(q, part))));
      units_.set(c, most);
      for (Offset q = col_ptr[at(c)]; q < col_ptr[at(c) + 1]; ++q)
        for (Index part = 0; part < kParts; ++part)
          to[row_of(given, place[at(job.row_ind[at(q)] * kParts + part)]) * width + c] = units_.in(scaled(q, part), c);
    }
  }

  void give(const Scales& scales, const RowsJob& job, const std::vector<Index>& place, const std::vector<Index>& wanted,
            Index first, Index columns, Index width, const T* from) const {
    auto* x = reinterpret_cast<Value*>(job.x);
    const std::vector<double>& factors = job.transpose ? scales.row : scales.col;
    const auto count = static_cast<Offset>(job.unknowns.size());
    for (Offset u = 0; u < count; ++u) {
      const Index i = job.unknowns[at(u)];
      for (Index part = 0; part < kParts; ++part) {
        const T* row = from + row_of(wanted, place[at(i * kParts + part)]) * width;
        for (Index c = 0; c < columns; ++c)
          x[((Offset{first} + c) * count + u) * kParts + part] = factor_of(factors, i) * units_.from(row[c], c);
      }
    }
  }

  const PreparedMatrix& prepared_;
  bool conjugated_;
  base::MemoryBudget& budget_;
  std::vector<Index> of_column_, of_row_;  // empty until they are asked for
  double whole_ = 0;                       // entries of the factor
  ColumnScales<T> units_;
};

}  // namespace espalier::solver
