#include "inverse/entries.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/scalar.hpp"

namespace espalier::inverse {

namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr Index kChecked = 8;         // columns: one register of right-hand sides
constexpr Index kColumnsAtOnce = 32;  // that are solved for

// Columns of A^-1 by solves, refined until rounding is left. The corrections tell how far they are from the truth.
template <class Value>
class Columns {
 public:
  /// @param rows  of A, one for each column of A^-1
  Columns(solver::Session& session, std::span<const Index> rows) : n_(static_cast<std::size_t>(session.current().n())) {
    const std::size_t count = rows.size();
    x_.resize(n_ * count);
    std::vector<Value> b(n_ * count), r(n_ * count), d(n_ * count);
    for (std::size_t c = 0; c < count; ++c) b[c * n_ + static_cast<std::size_t>(rows[c])] = 1;
    solve(session, b, x_);
    largest_.assign(count, 0);
    error_.assign(count, std::numeric_limits<double>::infinity());
    std::vector<double> before(count, std::numeric_limits<double>::infinity());
    constexpr int kMostSteps = 12;  // as many as a factor in FP32 of a hard matrix takes
    for (int step = 0; step < kMostSteps; ++step) {
      std::vector<solve::ResidualColumn> list;
      for (std::size_t c = 0; c < count; ++c) list.push_back({parts(b, c), parts(x_, c), parts(r, c), {}});
      session.factor->residual().compute(list, false);
      solve(session, r, d);
      bool goes_on = false;
      for (std::size_t c = 0; c < count; ++c) goes_on |= correct(c, d, before[c]);
      if (!goes_on) break;
    }
  }
  [[nodiscard]] Value at(std::size_t column, Index unknown) const {
    return x_[column * n_ + static_cast<std::size_t>(unknown)];
  }
  [[nodiscard]] double largest(std::size_t column) const { return largest_[column]; }
  /// What is left, over the largest entry.
  [[nodiscard]] double error(std::size_t column) const { return error_[column]; }

 private:
  double* parts(std::vector<Value>& v, std::size_t c) const { return reinterpret_cast<double*>(v.data() + c * n_); }
  void solve(solver::Session& session, std::vector<Value>& from, std::vector<Value>& to) const {
    session.pool.check();
    session.factor->solve(parts(from, 0), parts(to, 0), static_cast<Index>(from.size() / n_), false);
  }
  static double magnitude_of(const Value* v, std::size_t n) {
    double most = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double m = std::abs(v[i]);
      if (!(m <= most)) most = std::isnan(m) ? std::numeric_limits<double>::infinity() : m;
    }
    return most;
  }

  // @param before  the size of the last correction. @returns whether another one may help
  bool correct(std::size_t c, const std::vector<Value>& d, double& before) {
    Value* x = x_.data() + c * n_;
    const double correction = magnitude_of(d.data() + c * n_, n_);
    largest_[c] = magnitude_of(x, n_);
    if (!(correction < before)) return false;  // noise, or no convergence: the error that the last one has left
    for (std::size_t i = 0; i < n_; ++i) x[i] += d[c * n_ + i];
    largest_[c] = magnitude_of(x, n_);
    const double rate = std::isfinite(before) ? correction / before : 1;
    error_[c] = largest_[c] > 0 ? std::max(kEps, correction / largest_[c] * rate) : 0;
    before = correction;
    return error_[c] > kEps;
  }

  std::size_t n_;
  std::vector<Value> x_;  // column by column
  std::vector<double> largest_, error_;
};

// use(q, r, c) for the entries of the prepared matrix in their order; of a symmetric one for those of one triangle.
template <class Use>
void for_each_entry(const solver::PreparedMatrix& p, Use&& use) {
  const bool both = p.a.storage == Storage::symmetric_both;
  for (Index c = 0; c < p.n(); ++c)
    for (Offset q = p.a.col_ptr[static_cast<std::size_t>(c)]; q < p.a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      if (const Index r = p.a.row_ind[static_cast<std::size_t>(q)]; !both || r >= c) use(q, r, c);
}

// The entries of A^-1 that stand in the diagonal of A A^-1, one for each of these.
Entries entries_of_product(const solver::PreparedMatrix& p) {
  Entries list;
  list.reserve(static_cast<std::size_t>(p.a.nonzeros()));
  for_each_entry(p, [&](Offset, Index r, Index c) { list.add(c, r); });
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
      const Entries product = entries_of_product(s_.current().system->prepared);
      if (product.unknown == wanted_.unknown && product.row == wanted_.row) {
        by_factor(wanted_, x_);
        sample = choose_sample(x_);
      } else {
        // Both together: what they have in common is made once.
        Entries all = wanted_;
        all.unknown.insert(all.unknown.end(), product.unknown.begin(), product.unknown.end());
        all.row.insert(all.row.end(), product.row.begin(), product.row.end());
        std::vector<Value> values(all.size());
        by_factor(all, values);
        std::copy_n(values.begin(), wanted_.size(), x_.begin());
        sample = choose_sample(std::span<const Value>(values).subspan(wanted_.size()));
      }
    } else {
      by_factor(wanted_, x_);
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
    for (const Index j : wanted_.row) wanted[static_cast<std::size_t>(j)] = 1;
    for (Index j = 0; j < n_; ++j)
      if (wanted[static_cast<std::size_t>(j)] != 0) columns_.push_back(j);
  }

  void by_factor(const Entries& entries, std::span<Value> x) {
    known_.assign(entries.size(), 0);
    if (s_.factor->substitutes()) return;  // the factor is not of the matrix alone
    solver::Numeric& numeric = s_.factor->numeric();
    if (!numeric.invert_at(entries.unknown, entries.row, reinterpret_cast<double*>(x.data()), known_))
      throw Error(
          StatusCode::device_error,
          fmt::format("entries of the inverse come from factors in the host's memory, this one is elsewhere ({}); "
                      "make the solver with device cpu",
                      numeric.device_name()));
  }

  // Columns j by what row j of A and column j of A^-1 come to: the residual of A A^-1 = I there, which is about eps
  // times |A| |A^-1|, a condition of the row; both show where digits are lost. Those with entries that are asked for
  // alone.
  std::vector<Index> choose_sample(std::span<const Value> product) {
    const solver::PreparedMatrix& p = s_.current().system->prepared;
    const auto* values = reinterpret_cast<const Value*>(s_.factor->values_of_entries().data());
    const std::size_t n = static_cast<std::size_t>(n_), first = known_.size() - product.size();
    std::vector<Value> sum(n, Value(-1));
    std::vector<double> magnitude(n, 1);
    const bool symmetric = p.a.storage != Storage::general, hermitian = p.numbers == base::Numbers::hermitian;
    std::size_t at = 0;
    for_each_entry(p, [&](Offset q, Index r, Index c) {
      const std::size_t k = at++;
      if (known_[first + k] == 0) return;
      const Value term = values[q] * product[k];
      const auto add = [&](Index row, Value v) {
        sum[static_cast<std::size_t>(row)] += v;
        magnitude[static_cast<std::size_t>(row)] += std::abs(v);
      };
      add(r, term);
      if (symmetric && r != c) add(c, hermitian ? base::conjugate(term) : term);
    });
    std::vector<double> doubt(n);
    for (std::size_t j = 0; j < n; ++j) {
      doubt[j] = std::max(std::abs(sum[j]), kEps * magnitude[j]);
      if (std::isnan(doubt[j])) doubt[j] = std::numeric_limits<double>::infinity();
    }
    std::vector<Index> order = columns_;
    constexpr Index kWorst = kChecked - 2;
    std::partial_sort(order.begin(), order.begin() + kWorst, order.end(), [&](Index a, Index b) {
      const double da = doubt[static_cast<std::size_t>(a)], db = doubt[static_cast<std::size_t>(b)];
      return da != db ? da > db : a < b;
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
    std::vector<std::size_t> others;
    for (std::size_t e = 0; e < wanted_.size(); ++e)
      if (known_[e] == 0) others.push_back(e);
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
        note(columns, c, others[at]);
      }
      result_.solved += static_cast<Index>(rows.size());
    }
  }

  void compare(const std::vector<Index>& sample) {
    const Columns<Value> columns(s_, sample);
    std::vector<Index> number(static_cast<std::size_t>(n_), -1);
    for (std::size_t c = 0; c < sample.size(); ++c) number[static_cast<std::size_t>(sample[c])] = static_cast<Index>(c);
    for (std::size_t e = 0; e < wanted_.size(); ++e)
      if (const Index c = number[static_cast<std::size_t>(wanted_.row[e])]; c >= 0)
        note(columns, static_cast<std::size_t>(c), e);
    result_.checked = static_cast<Index>(sample.size());
  }

  // Entry e beside what a solution says of it.
  void note(const Columns<Value>& columns, std::size_t c, std::size_t e) {
    const Value truth = columns.at(c, wanted_.unknown[e]);
    const double largest = columns.largest(c), apart = std::abs(x_[e] - truth) + columns.error(c) * largest;
    const auto raise = [](double& most, double error) {
      if (!(error <= most)) most = std::isnan(error) ? std::numeric_limits<double>::infinity() : error;
    };
    raise(result_.error, apart / largest);
    if (x_[e] != truth) raise(result_.entry_error, std::abs(x_[e] - truth) / std::abs(truth));
  }

  solver::Session& s_;
  const Entries& wanted_;
  std::span<Value> x_;
  InverseResult& result_;
  Index n_;
  std::vector<Index> columns_;  // with entries that are asked for, ascending
  std::vector<char> known_;     // of the last call of by_factor()
};

}  // namespace

template <class Value>
void invert_entries(solver::Session& session, const Entries& entries, std::span<Value> x, InverseResult& result) {
  Inverse<Value>(session, entries, x, result).run();
}

template void invert_entries(solver::Session&, const Entries&, std::span<double>, InverseResult&);
template void invert_entries(solver::Session&, const Entries&, std::span<std::complex<double>>, InverseResult&);

}  // namespace espalier::inverse
