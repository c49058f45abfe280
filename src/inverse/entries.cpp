#include "inverse/entries.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>
#include <numeric>

#include "base/scalar.hpp"
#include "inverse/columns.hpp"

namespace espalier::inverse {

namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr Index kChecked = 8;         // columns: one register of right-hand sides
constexpr Index kColumnsAtOnce = 32;  // that are solved for

constexpr std::int64_t kGrain = 1 << 10, kEntryGrain = 1 << 16;  // columns, entries that a thread takes at a time

// The entries of the prepared matrix, of a symmetric one those of one triangle, numbered by columns.
class MatrixEntries {
 public:
  MatrixEntries(const solver::PreparedMatrix& p, base::ThreadPool& pool)
      : p_(p), both_(p.a.storage == Storage::symmetric_both) {
    if (!both_) return;
    first_.assign(static_cast<std::size_t>(p.n()) + 1, 0);
    pool.for_each_range(p.n(), kGrain, [&](std::int64_t begin, std::int64_t end) {
      for (auto c = static_cast<std::size_t>(begin); c < static_cast<std::size_t>(end); ++c)
        for (Offset q = p_.a.col_ptr[c]; q < p_.a.col_ptr[c + 1]; ++q)
          if (is_taken(q, static_cast<Index>(c))) ++first_[c + 1];
    });
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
  }
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(both_ ? first_.back() : p_.a.nonzeros()); }
  /// use(number, q, r, c) for those of columns [begin, end).
  template <class Use>
  void for_each(std::int64_t begin, std::int64_t end, Use&& use) const {
    for (auto c = static_cast<Index>(begin); c < static_cast<Index>(end); ++c) {
      const auto at = static_cast<std::size_t>(c);
      auto number = static_cast<std::size_t>(both_ ? first_[at] : p_.a.col_ptr[at]);
      for (Offset q = p_.a.col_ptr[at]; q < p_.a.col_ptr[at + 1]; ++q)
        if (is_taken(q, c)) use(number++, q, p_.a.row_ind[static_cast<std::size_t>(q)], c);
    }
  }

 private:
  [[nodiscard]] bool is_taken(Offset q, Index c) const {
    return !both_ || p_.a.row_ind[static_cast<std::size_t>(q)] >= c;
  }
  const solver::PreparedMatrix& p_;
  bool both_;
  std::vector<Offset> first_;  // of symmetric_both: columns + 1
};

// The entries of A^-1 that stand in the diagonal of A A^-1, one for each of these.
Entries entries_of_product(const MatrixEntries& a, Index n, base::ThreadPool& pool) {
  Entries list(a.size());
  pool.for_each_range(n, kGrain, [&](std::int64_t begin, std::int64_t end) {
    a.for_each(begin, end, [&](std::size_t number, Offset, Index r, Index c) { list.set(number, c, r); });
  });
  return list;
}

template <class Value>
class Inverse {
 public:
  Inverse(solver::Session& session, const Entries& entries, std::span<Value> x, InverseResult& result)
      : s_(session), wanted_(entries), x_(x), result_(result), n_(session.current().n()) {}

  void run() {
    refuse_singular();
    result_.error = result_.entry_error = 0;
    if (wanted_.size() == 0) return;
    find_columns();
    std::vector<Index> sample = columns_;
    if (columns_.size() > static_cast<std::size_t>(kChecked)) {
      const MatrixEntries a(s_.current().system->prepared, s_.pool);
      const bool definite = s_.factor->analysis()->kind() == Kind::llt;
      const Entries more = definite ? missing_diagonal() : entries_of_product(a, n_, s_.pool);
      if (more.size() == 0 || more == wanted_) {
        by_factor(wanted_, x_, 0);
        sample = definite ? choose_by_diagonal(a, wanted_, x_) : choose_sample(a, x_);
      } else {  // both together: what they have in common is made once
        const std::size_t others = more.size();
        const Entries all = joined(more, wanted_);
        base::LazyVector<Value> values(all.size());
        by_factor(all, values, others);
        over_entries(wanted_.size(), [&](std::size_t e) { x_[e] = values[others + e]; });
        sample = definite ? choose_by_diagonal(a, all, values) : choose_sample(a, values);
      }
    } else {
      by_factor(wanted_, x_, 0);
    }
    solve_for_others();
    compare(sample);
    if (!(result_.error <= kSure))
      throw Error(
          StatusCode::accuracy_not_reached,
          fmt::format("the inverse is not accurate: entries differ by {:.1e} of the largest of their column from "
                      "those of refined solutions; the matrix is nearly singular, or its factor has too few "
                      "digits (precision)",
                      result_.error));
  }

 private:
  static constexpr double kSure = 1e-3;

  void refuse_singular() const {
    const FactorResult& r = s_.factor->result();
    if (r.rank < 0 || r.rank >= n_) return;
    std::string rows = r.dependent_rows.empty() ? "" : ": " + solver::name_rows(r.dependent_rows);
    throw Error(StatusCode::singular,
                fmt::format("the matrix is singular and has no inverse: its rank is {} of {}{}", r.rank, n_, rows),
                r.dependent_rows.empty() ? -1 : r.dependent_rows.front());
  }

  void find_columns() {
    std::vector<char> wanted(static_cast<std::size_t>(n_), 0);
    over_entries(wanted_.size(), [&](std::size_t e) {
      std::atomic_ref<char>(wanted[static_cast<std::size_t>(wanted_.row[e])]).store(1, std::memory_order_relaxed);
    });
    for (Index j = 0; j < n_; ++j)
      if (wanted[static_cast<std::size_t>(j)] != 0) columns_.push_back(j);
  }

  // use(e) for e < count, by all threads.
  template <class Use>
  void over_entries(std::size_t count, Use&& use) const {
    s_.pool.for_each_range(static_cast<std::int64_t>(count), kEntryGrain, [&](std::int64_t begin, std::int64_t end) {
      for (auto e = static_cast<std::size_t>(begin); e < static_cast<std::size_t>(end); ++e) use(e);
    });
  }

  Entries joined(const Entries& x, const Entries& y) const {
    Entries all(x.size() + y.size());
    over_entries(x.size(), [&](std::size_t e) { all.set(e, x.unknown[e], x.row[e]); });
    over_entries(y.size(), [&](std::size_t e) { all.set(x.size() + e, y.unknown[e], y.row[e]); });
    return all;
  }

  // @param first  of those that are asked for
  void by_factor(const Entries& entries, std::span<Value> x, std::size_t first) {
    known_.resize(entries.size());
    first_ = first;
    if (s_.factor->substitutes())  // the factor is not of the matrix alone
      return over_entries(entries.size(), [&](std::size_t e) { known_[e] = 0; });
    solver::Numeric& numeric = s_.factor->numeric();
    if (!numeric.invert_at(entries.unknown, entries.row, reinterpret_cast<double*>(x.data()), known_))
      throw Error(
          StatusCode::device_error,
          fmt::format("entries of the inverse come from a factor in the host's memory or on one GPU, this one is "
                      "elsewhere ({}); make the solver with device cpu, or name one GPU",
                      numeric.device_name()));
  }

  // The diagonal entries of the columns, where they are not asked for.
  Entries missing_diagonal() const {
    std::vector<char> missing(static_cast<std::size_t>(n_), 0);
    for (const Index j : columns_) missing[static_cast<std::size_t>(j)] = 1;
    over_entries(wanted_.size(), [&](std::size_t e) {
      if (wanted_.unknown[e] == wanted_.row[e])
        std::atomic_ref<char>(missing[static_cast<std::size_t>(wanted_.row[e])]).store(0, std::memory_order_relaxed);
    });
    Entries list;
    for (const Index j : columns_)
      if (missing[static_cast<std::size_t>(j)] != 0) list.append(j, j);
    return list;
  }

  // Positive definite matrices: columns by a_jj z_jj, the variance of an unknown over what it were if all others were
  // known. So many times rounding is lost in z_jj, which bounds the entries beside it: |z_ij|^2 <= z_ii z_jj.
  std::vector<Index> choose_by_diagonal(const MatrixEntries& a, const Entries& entries, std::span<const Value> x) {
    const auto* values = reinterpret_cast<const Value*>(s_.factor->values_of_entries().data());
    const auto n = static_cast<std::size_t>(n_);
    std::vector<double> of_a(n, 0), doubt(n, 0);
    s_.pool.for_each_range(n_, kGrain, [&](std::int64_t begin, std::int64_t end) {
      a.for_each(begin, end, [&](std::size_t, Offset q, Index r, Index c) {
        if (r == c) of_a[static_cast<std::size_t>(c)] += std::real(values[q]);
      });
    });
    over_entries(entries.size(), [&](std::size_t e) {
      if (entries.unknown[e] != entries.row[e]) return;
      const auto j = static_cast<std::size_t>(entries.row[e]);
      const double size = of_a[j] * std::abs(x[e]);
      std::atomic_ref<double>(doubt[j]).store(std::isnan(size) ? std::numeric_limits<double>::infinity() : size,
                                              std::memory_order_relaxed);
    });
    return worst_columns(doubt);
  }

  // Columns j by what row j of A and column j of A^-1 come to: the residual of A A^-1 = I there, which is about eps
  // times |A| |A^-1|, a condition of the row; both show where digits are lost. Those with entries that are asked for
  // alone.
  // @param product  values of its entries, the first ones of those of by_factor()
  std::vector<Index> choose_sample(const MatrixEntries& a, std::span<const Value> product) {
    const solver::PreparedMatrix& p = s_.current().system->prepared;
    const auto* values = reinterpret_cast<const Value*>(s_.factor->values_of_entries().data());
    const auto n = static_cast<std::size_t>(n_);
    const bool symmetric = p.a.storage != Storage::general, hermitian = p.numbers == base::Numbers::hermitian;
    // Parts of the columns have sums of their own, as many as there is little memory for, whatever the threads.
    const std::size_t parts = std::clamp<std::size_t>((std::size_t{1} << 22) / n, 1, 16);
    base::LazyVector<Value> sum(n * parts);
    base::LazyVector<double> magnitude(n * parts);
    s_.pool.for_each_range(static_cast<std::int64_t>(parts), 1, [&](std::int64_t part, std::int64_t) {
      Value* s = sum.data() + static_cast<std::size_t>(part) * n;
      double* m = magnitude.data() + static_cast<std::size_t>(part) * n;
      std::fill_n(s, n, Value(0));
      std::fill_n(m, n, 0.0);
      const auto count = static_cast<std::int64_t>(parts);
      a.for_each(n_ * part / count, n_ * (part + 1) / count, [&](std::size_t k, Offset q, Index r, Index c) {
        if (known_[k] == 0) return;
        const Value term = values[q] * product[k];
        const double size = std::abs(term);
        s[r] += term;
        m[r] += size;
        if (!symmetric || r == c) return;
        s[c] += hermitian ? base::conjugate(term) : term;
        m[c] += size;
      });
    });
    std::vector<double> doubt(n);
    over_entries(n, [&](std::size_t j) {
      Value residual = Value(-1);
      double size = 1;
      for (std::size_t part = 0; part < parts; ++part) {
        residual += sum[part * n + j];
        size += magnitude[part * n + j];
      }
      doubt[j] = std::max(std::abs(residual), kEps * size);
      if (std::isnan(doubt[j])) doubt[j] = std::numeric_limits<double>::infinity();
    });
    return worst_columns(doubt);
  }

  // Six of them, and two others.
  [[nodiscard]] std::vector<Index> worst_columns(const std::vector<double>& doubt) const {
    std::vector<Index> order = columns_;
    constexpr Index kWorst = kChecked - 2;
    std::partial_sort(order.begin(), order.begin() + kWorst, order.end(), [&](Index i, Index j) {
      const double di = doubt[static_cast<std::size_t>(i)], dj = doubt[static_cast<std::size_t>(j)];
      return di != dj ? di > dj : i < j;
    });
    order.resize(kWorst);
    for (const std::size_t part : {std::size_t{1}, std::size_t{2}})
      order.push_back(columns_[columns_.size() * part / 3]);
    std::sort(order.begin(), order.end());
    order.erase(std::unique(order.begin(), order.end()), order.end());
    return order;
  }

  // What the factor does not know, column by column.
  void solve_for_others() {
    std::atomic<bool> all_known = true;
    s_.pool.for_each_range(static_cast<std::int64_t>(wanted_.size()), kEntryGrain,
                           [&](std::int64_t begin, std::int64_t end) {
                             const char* known = known_.data() + first_;
                             if (std::find(known + begin, known + end, 0) != known + end) all_known = false;
                           });
    if (all_known) return;
    std::vector<std::size_t> others;
    for (std::size_t e = 0; e < wanted_.size(); ++e)
      if (known_[first_ + e] == 0) others.push_back(e);
    std::stable_sort(others.begin(), others.end(),
                     [&](std::size_t a, std::size_t b) { return wanted_.row[a] < wanted_.row[b]; });
    for (std::size_t at = 0; at < others.size();) {
      std::vector<Index> rows;
      std::size_t end = at;
      for (; end < others.size(); ++end) {
        const Index row = wanted_.row[others[end]];
        if (!rows.empty() && rows.back() == row) continue;
        if (rows.size() == static_cast<std::size_t>(kColumnsAtOnce)) break;
        rows.push_back(row);
      }
      const Columns<Value> columns(s_, rows);
      std::size_t c = 0;
      for (; at < end; ++at) {
        while (rows[c] != wanted_.row[others[at]]) ++c;
        x_[others[at]] = columns.at(c, wanted_.unknown[others[at]]);
        note(columns, c, others[at], result_.error, result_.entry_error);
      }
      result_.solved += static_cast<Index>(rows.size());
    }
  }

  void compare(const std::vector<Index>& sample) {
    const Columns<Value> columns(s_, sample);
    std::vector<Index> number(static_cast<std::size_t>(n_), -1);
    for (std::size_t c = 0; c < sample.size(); ++c) number[static_cast<std::size_t>(sample[c])] = static_cast<Index>(c);
    std::mutex mutex;
    s_.pool.for_each_range(static_cast<std::int64_t>(wanted_.size()), kEntryGrain,
                           [&](std::int64_t begin, std::int64_t end) {
                             double error = 0, entry_error = 0;
                             for (auto e = static_cast<std::size_t>(begin); e < static_cast<std::size_t>(end); ++e)
                               if (const Index c = number[static_cast<std::size_t>(wanted_.row[e])]; c >= 0)
                                 note(columns, static_cast<std::size_t>(c), e, error, entry_error);
                             const std::lock_guard lock(mutex);
                             result_.error = std::max(result_.error, error);
                             result_.entry_error = std::max(result_.entry_error, entry_error);
                           });
    result_.checked = static_cast<Index>(sample.size());
  }

  // Entry e beside what a solution says of it.
  void note(const Columns<Value>& columns, std::size_t c, std::size_t e, double& error, double& entry_error) const {
    const Value truth = columns.at(c, wanted_.unknown[e]);
    const double largest = columns.largest(c), apart = std::abs(x_[e] - truth) + columns.error(c) * largest;
    const auto raise = [](double& most, double found) {
      if (!(found <= most)) most = std::isnan(found) ? std::numeric_limits<double>::infinity() : found;
    };
    raise(error, apart / largest);
    if (x_[e] != truth) raise(entry_error, std::abs(x_[e] - truth) / std::abs(truth));
  }

  solver::Session& s_;
  const Entries& wanted_;
  std::span<Value> x_;
  InverseResult& result_;
  Index n_;
  std::vector<Index> columns_;    // with entries that are asked for, ascending
  base::LazyVector<char> known_;  // of the last call of by_factor()
  std::size_t first_ = 0;         // likewise
};

}  // namespace

template <class Value>
void invert_entries(solver::Session& session, const Entries& entries, std::span<Value> x, InverseResult& result) {
  Inverse<Value>(session, entries, x, result).run();
}

template void invert_entries(solver::Session&, const Entries&, std::span<double>, InverseResult&);
template void invert_entries(solver::Session&, const Entries&, std::span<std::complex<double>>, InverseResult&);

}  // namespace espalier::inverse
