// The values of a prepared matrix and those of its caller.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <complex>
#include <utility>

#include "base/at.hpp"
#include "base/scalar.hpp"
#include "matrix/norms.hpp"
#include "matrix/validate.hpp"
#include "solver/analysis/analysis_file.hpp"
#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::solver {

namespace {

constexpr std::int64_t kEntriesAtOnce = 1 << 18;  // 2 MiB of values

template <class T>
bool equal_arrays(std::span<const T> x, std::span<const T> y, base::ThreadPool& pool) {
  if (x.size() != y.size()) return false;
  std::atomic<bool> equal{true};
  pool.for_each_range(static_cast<std::int64_t>(x.size()), kEntriesAtOnce, [&](std::int64_t begin, std::int64_t end) {
    if (!std::equal(x.begin() + begin, x.begin() + end, y.begin() + begin))
      equal.store(false, std::memory_order_relaxed);
  });
  return equal;
}

template <class Value>
void copy_numbers(const PreparedMatrix& p, const Value* from, Value* to, base::ThreadPool& pool) {
  std::vector<Value> sums;
  if (!p.target.empty()) {
    const Offset most = *std::max_element(p.target.begin(), p.target.end());
    sums.assign(at(most) + 1, Value(0));
    for (std::size_t q = 0; q < p.target.size(); ++q) sums[at(p.target[q])] += from[q];
    from = sums.data();
  }
  pool.for_each_range(p.a.nonzeros(), kEntriesAtOnce, [&](std::int64_t begin, std::int64_t end) {
    if (p.source.empty()) {
      std::copy(from + begin, from + end, to + begin);
      return;
    }
    for (auto q = at(begin); q < at(end); ++q) {
      const Value value = from[at(p.source[q])];
      to[q] = !p.turned.empty() && p.turned[q] != 0 ? base::conjugate(value) : value;
    }
  });
}

template <class Value>
std::vector<double> numbers_by_caller(const PreparedMatrix& p, const Value* values) {
  std::vector<Value> merged(values, values + p.a.nonzeros());
  if (!p.source.empty()) {
    merged.assign(static_cast<std::size_t>(*std::max_element(p.source.begin(), p.source.end())) + 1, Value(0));
    for (std::size_t q = 0; q < p.source.size(); ++q)
      if (p.turned.empty() || p.turned[q] == 0) merged[at(p.source[q])] = values[q];
  }
  if (!p.target.empty()) {
    std::vector<Value> all(p.target.size());
    for (std::size_t q = 0; q < p.target.size(); ++q) all[q] = std::exchange(merged[at(p.target[q])], Value(0));
    merged = std::move(all);
  }
  const double* parts = reinterpret_cast<const double*>(merged.data());
  return {parts, parts + merged.size() * at(base::parts_of(p.numbers))};
}

}  // namespace

void copy_values(const PreparedMatrix& p, std::span<const double> from, Values& to, base::ThreadPool& pool) {
  if (p.numbers == base::Numbers::real)
    copy_numbers(p, from.data(), to.data(), pool);
  else
    copy_numbers(p, base::as_complex(from.data()), base::as_complex(to.data()), pool);
  if (!p.symmetric_values) return;
  MatrixView general = p.a;
  general.values = to;
  general.storage = Storage::general;
  const bool hermitian = p.numbers == base::Numbers::hermitian;
  const bool same = p.numbers == base::Numbers::real
                        ? matrix::values_are_symmetric(general)
                        : matrix::values_are_symmetric(
                              general, {base::as_complex(general.values.data()), general.values.size() / 2}, hermitian);
  if (!same)
    throw Error(StatusCode::invalid_input,
                fmt::format("the matrix was analyzed as a {} one, but its new values are not {}; call analyze() again",
                            hermitian ? "Hermitian" : "symmetric", hermitian ? "Hermitian" : "symmetric"));
}

std::vector<double> values_by_caller(const PreparedMatrix& p, std::span<const double> values) {
  return base::with_numbers(p.numbers, values.data(), [&](const auto* v) { return numbers_by_caller(p, v); });
}

std::uint64_t caller_hash(const PreparedMatrix& p, base::ThreadPool& pool) {
  if (!p.source.empty() || !p.target.empty()) return p.caller_pattern;
  MatrixView a = p.a;
  if (p.symmetric_values) a.storage = Storage::general;
  return pattern_hash(a, pool);
}

bool same_pattern(const PreparedMatrix& p, const MatrixView& a, base::ThreadPool& pool) {
  if (a.rows != p.a.rows || a.cols != p.a.cols || a.nonzeros() != p.caller_nonzeros) return false;
  if (!p.source.empty() || !p.target.empty()) return pattern_hash(a, pool) == p.caller_pattern;
  const MatrixView mine = p.a;
  return equal_arrays(a.col_ptr, mine.col_ptr, pool) && equal_arrays(a.row_ind, mine.row_ind, pool);
}

}  // namespace espalier::solver
