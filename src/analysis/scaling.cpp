#include <algorithm>
#include <atomic>
#include <cmath>

#include "analysis/matching.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

namespace {

// Ruiz (2001): the maxima converge to 1 linearly with the factor 1/2 in the exponent; three sweeps leave them within
// max^(1/8), a factor of 10 for entries that differ by 1e8, and powers of two do not resolve more than a factor 2.
constexpr int kSweeps = 3;
// Where the maxima of the last sweep were still further apart than that, more follow: 2^2000 needs ten.
constexpr int kMostSweeps = 14;
constexpr double kTooFar = 0x1p32;
constexpr double kMostScale = 0x1p1000;

constexpr std::int64_t kGrain = 1 << 14;  // columns that a thread takes at a time

// A largest number does not depend on who comes first.
void raise(double& most, double value) {
  std::atomic_ref<double> shared(most);
  double now = shared.load(std::memory_order_relaxed);
  while (value > now && !shared.compare_exchange_weak(now, value, std::memory_order_relaxed)) {
  }
}

void maxima(const MatrixView& a, const std::vector<double>& r, const std::vector<double>& c, std::vector<double>& rows,
            std::vector<double>& cols, base::ThreadPool& pool) {
  std::fill(rows.begin(), rows.end(), 0);
  const double *values = a.values.data(), *scale = r.data();
  const Index* row = a.row_ind.data();
  double* found = rows.data();
  const bool alone = pool.size() == 1;  // then nobody else raises them, which takes half the time
  pool.for_each_range(a.cols, kGrain, [&, values, scale, row, found](std::int64_t begin, std::int64_t end) {
    for (auto j = at(begin); j < at(end); ++j) {
      double most = 0;
      const double of_column = c[j];
      for (Offset k = a.col_ptr[j], last = a.col_ptr[j + 1]; k < last; ++k) {
        const double value = std::abs(values[k]) * scale[row[k]] * of_column;
        most = std::max(most, value);
        if (alone)
          found[row[k]] = std::max(found[row[k]], value);
        else
          raise(found[row[k]], value);
      }
      cols[j] = most;
    }
  });
  if (!a.symmetric()) return;
  for (std::size_t j = 0; j < cols.size(); ++j) rows[j] = cols[j] = std::max(rows[j], cols[j]);
}

// change(element) of each, by all threads.
template <class Change>
void change_all(std::vector<double>& scale, base::ThreadPool& pool, const Change& change) {
  pool.for_each_range(static_cast<std::int64_t>(scale.size()), kGrain, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = at(begin); i < at(end); ++i) scale[i] = change(i);
  });
}

void divide_by_root(std::vector<double>& scale, const std::vector<double>& most, base::ThreadPool& pool) {
  change_all(scale, pool, [&](std::size_t i) {
    return most[i] > 0 ? std::clamp(scale[i] / std::sqrt(most[i]), 1 / kMostScale, kMostScale) : scale[i];
  });
}

bool any_far(const std::vector<double>& most) {
  return std::any_of(most.begin(), most.end(), [](double m) { return m > kTooFar || (m < 1 / kTooFar && m > 0); });
}

void round_to_powers_of_two(std::vector<double>& scale, base::ThreadPool& pool) {
  change_all(scale, pool, [&](std::size_t i) { return std::exp2(std::round(std::log2(scale[i]))); });
}

}  // namespace

Scaling equilibrate(const MatrixView& a, base::ThreadPool& pool) {
  Scaling out{std::vector<double>(at(a.rows), 1), std::vector<double>(at(a.cols), 1)};
  std::vector<double> rows(out.row.size()), cols(out.col.size());
  for (int sweep = 0; sweep < kSweeps || (sweep < kMostSweeps && (any_far(rows) || any_far(cols))); ++sweep) {
    maxima(a, out.row, out.col, rows, cols, pool);
    divide_by_root(out.row, rows, pool);
    divide_by_root(out.col, cols, pool);
  }
  round_to_powers_of_two(out.row, pool);
  round_to_powers_of_two(out.col, pool);
  return out;
}

}  // namespace espalier::analysis
