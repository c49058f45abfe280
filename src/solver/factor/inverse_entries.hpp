/// \file
/// Entries of the inverse of the given matrix, from a factor of the scaled and matched one.
#pragma once

#include <span>
#include <vector>

#include "base/at.hpp"
#include "base/scalar.hpp"
#include "device/executor.hpp"
#include "solver/solution/plan_vectors.hpp"

namespace espalier::solver {

/// What a factor was made of.
struct FactorizedMatrix {
  const plan::Plan& plan;
  const PreparedMatrix& prepared;
  const Scales& scales;
  base::ThreadPool& pool;
  base::MemoryBudget& budget;
};

/// See Numeric::invert_at(). B^-1(c, c') is scaled back to the entry (c, i) of A^-1 for the row i that is matched to
/// c'. Of a real form the first column of its blocks tells both parts. @returns false where the executor cannot
template <bool kRealForm, class T>
bool entries_of_inverse(device::Executor<T>& executor, const FactorizedMatrix& f, std::span<const Index> unknowns,
                        std::span<const Index> rows, base::WideOf<T>* values, std::span<char> known) {
  using Value = base::WideOf<T>;
  constexpr std::size_t kParts = kRealForm ? 2 : 1;
  const auto n = static_cast<std::size_t>(f.plan.tree.n);
  std::vector<Index> position(n), column(static_cast<std::size_t>(f.prepared.n()));
  const auto over = [&](std::int64_t count, auto&& use) {
    constexpr std::int64_t kGrain = 1 << 16;
    f.pool.for_each_range(count, kGrain, [&](std::int64_t begin, std::int64_t end) {
      for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) use(k);
    });
  };
  over(f.plan.tree.n,
       [&](std::size_t k) { position[static_cast<std::size_t>(f.plan.tree.order[k])] = static_cast<Index>(k); });
  over(f.prepared.n(), [&](std::size_t c) {
    column[static_cast<std::size_t>(f.prepared.row_of(static_cast<Index>(c)))] = static_cast<Index>(c);
  });
  const std::size_t count = unknowns.size() * kParts;
  base::Buffer<Index> row(static_cast<Offset>(count), &f.budget), col(static_cast<Offset>(count), &f.budget);
  base::Buffer<T> value(static_cast<Offset>(count), &f.budget);
  base::Buffer<char> found(static_cast<Offset>(count), &f.budget);
  const auto over_entries = [&](auto&& use) { over(static_cast<std::int64_t>(unknowns.size()), use); };
  over_entries([&](std::size_t e) {
    for (std::size_t p = 0; p < kParts; ++p) {
      const auto at = static_cast<Offset>(e * kParts + p);
      row[at] = position[static_cast<std::size_t>(unknowns[e]) * kParts + p];
      col[at] = position[static_cast<std::size_t>(column[static_cast<std::size_t>(rows[e])]) * kParts];
    }
  });
  if (!executor.invert_at({{row.data(), count}, {col.data(), count}, value.span(), found.span()})) return false;
  over_entries([&](std::size_t e) {
    known[e] = 1;
    for (std::size_t p = 0; p < kParts; ++p) {
      const auto at = static_cast<Offset>(e * kParts + p);
      if (found[at] == 0) known[e] = 0;
      if (known[e] != 0)
        values[at] =
            static_cast<Value>(value[at]) * factor_of(f.scales.col, unknowns[e]) * factor_of(f.scales.row, rows[e]);
    }
  });
  return true;
}

}  // namespace espalier::solver
