#include "dynamics/dae/products.hpp"

#include "base/at.hpp"
#include "base/parallel.hpp"

namespace espalier::dynamics {

namespace {
constexpr Offset kManyEntries = 1 << 15;  // some 30 microseconds of one thread
// Numbers of dense columns that one thread adds up in 10 to 20 microseconds. Projections ask for such sums some ten
// times a pass: where each wakes the other threads, these find no time to sleep (./run's engine, 18 columns of 1,677).
constexpr std::size_t kManyNumbers = 1 << 16;
}  // namespace

void multiply_by_rows(const SparsePattern& p, ConstSpan values, ConstSpan x, Span y, base::ThreadPool* pool) {
  base::for_each(p.nonzeros() < kManyEntries ? nullptr : pool, p.rows, [&](std::int64_t i) {
    double sum = 0;
    for (auto k = at(p.ptr[at(i)]); k < at(p.ptr[at(i) + 1]); ++k) sum += values[k] * x[at(p.ind[k])];
    y[at(i)] = sum;
  });
}

void add_transposed(const SparsePattern& p, ConstSpan values, ConstSpan x, Span y) {
  const std::size_t lines = p.ptr.size() - 1;
  for (std::size_t i = 0; i < lines; ++i) {
    const double xi = x[i];
    if (xi == 0) continue;
    for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) y[at(p.ind[k])] += values[k] * xi;
  }
}

namespace {

// x += the sum of kCount columns, `stride` numbers apart, times their factors: column by column in each entry.
template <int kCount>
void add_group(const double* columns, std::size_t stride, const double* factors, std::size_t begin, std::size_t end,
               double* __restrict x) {
  for (std::size_t i = begin; i < end; ++i) {
    double sum = x[i];
    for (std::size_t c = 0; c < kCount; ++c) sum += factors[c] * columns[c * stride + i];
    x[i] = sum;
  }
}

}  // namespace

// By rows that stay in cache while the columns pass by.
void add_columns(const double* columns, ConstSpan factors, Span x, base::ThreadPool* pool) {
  constexpr std::int64_t kRows = 1024;
  constexpr int kTogether = 6;  // columns: x is then read and written a sixth as often
  if (factors.size() * x.size() < kManyNumbers) pool = nullptr;
  base::for_each_range(pool, static_cast<std::int64_t>(x.size()), kRows, [&](std::int64_t begin, std::int64_t end) {
    std::size_t c = 0;
    for (; c + kTogether <= factors.size(); c += kTogether)
      add_group<kTogether>(columns + c * x.size(), x.size(), &factors[c], at(begin), at(end), x.data());
    for (; c < factors.size(); ++c)
      add_group<1>(columns + c * x.size(), x.size(), &factors[c], at(begin), at(end), x.data());
  });
}

}  // namespace espalier::dynamics
