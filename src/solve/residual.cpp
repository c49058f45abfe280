#include "solve/residual.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <utility>

#include "solve/residual_rows.hpp"

namespace espalier::solve {

namespace {

constexpr std::size_t kGroups = 2;  // registers of right-hand sides in one pass over the matrix

// A sum of products in twice the working precision: TwoProduct by fused multiply-add, TwoSum of Knuth.
class LongSum {
 public:
  explicit LongSum(double start) : high_(start) {}
  [[gnu::always_inline]] void subtract_product(double a, double b) {
    const double p = -a * b;
    const double error = std::fma(-a, b, -p);
    const double s = high_ + p;
    const double z = s - high_;
    low_ += ((high_ - (s - z)) + (p - z)) + error;
    high_ = s;
  }
  void add(const LongSum& other) {
    const double s = high_ + other.high_;
    const double z = s - high_;
    low_ += ((high_ - (s - z)) + (other.high_ - z)) + other.low_;
    high_ = s;
  }
  [[nodiscard]] double value() const { return high_ + low_; }

 private:
  double high_;
  double low_ = 0;
};

double ratio(double above, double below) {
  if (below > 0) return above / below;
  return above == 0 ? 0 : std::numeric_limits<double>::infinity();
}

}  // namespace

ResidualOperator::ResidualOperator(const MatrixView& a, base::ThreadPool& pool)
    : ResidualOperator(a, rows_of(a, pool), pool) {}

std::shared_ptr<const matrix::RowIndex> ResidualOperator::rows_of(const MatrixView& a, base::ThreadPool& pool) {
  if (a.storage == Storage::symmetric_both) return std::make_shared<const matrix::RowIndex>();
  return std::make_shared<const matrix::RowIndex>(matrix::index_rows(a, pool));
}

void ResidualOperator::set_values(std::span<const double> values) {
  values_ = values;
  norm_inf_ = norm_one_ = -1;
}

double ResidualOperator::norm(bool transpose) const {
  double& known = transpose && a_.storage == Storage::general ? norm_one_ : norm_inf_;
  if (known < 0)
    known = numbers_ == base::Numbers::real ? largest_row_sum<double>(transpose)
                                            : largest_row_sum<std::complex<double>>(transpose);
  return known;
}

std::size_t ResidualOperator::ranges() const { return at((end_row_ - first_row_ + kRowsPerRange - 1) / kRowsPerRange); }

ResidualOperator ResidualOperator::of_rows(Index first, Index end) const {
  ResidualOperator part = *this;
  part.first_row_ = first;
  part.end_row_ = end;
  part.norm_inf_ = part.norm_one_ = -1;
  return part;
}

template <class Value>
double ResidualOperator::largest_row_sum(bool transpose) const {
  std::vector<double> range_max(ranges(), 0);
  for_each_range([&](std::size_t range, Index begin, Index end) {
    double most = 0;
    for (Index r = begin; r < end; ++r) {
      double sum0 = 0;
      double sum1 = 0;
      visit_row<Value>(
          r, transpose, [&](Value v, Index) { sum0 += std::abs(v); }, [&](Value v, Index) { sum1 += std::abs(v); });
      most = std::max(most, sum0 + sum1);
    }
    range_max[range] = most;
  });
  return range_max.empty() ? 0.0 : *std::max_element(range_max.begin(), range_max.end());
}

// One row: its residual, the sum of the magnitudes of its terms, and its entries of the vectors.
template <class Value>
void RowErrors::add(Value residual_i, double scale, Value x_i, Value b_i) {
  const double magnitude = std::abs(residual_i);
  finite = finite && std::isfinite(magnitude) && std::isfinite(std::abs(x_i));
  residual = std::max(residual, magnitude);
  componentwise = std::max(componentwise, ratio(magnitude, scale));
  x = std::max(x, std::abs(x_i));
  b = std::max(b, std::abs(b_i));
}

void RowErrors::add(const RowErrors& other) {
  residual = std::max(residual, other.residual);
  componentwise = std::max(componentwise, other.componentwise);
  x = std::max(x, other.x);
  b = std::max(b, other.b);
  finite = finite && other.finite;
}

// Rows [begin, end) of r = b - op(A) x; r may be null.
struct ResidualOperator::RowRange {
  Index begin, end;
  const double* b;
  const double* x;
  double* r;
  bool transpose;
};

template <>
[[gnu::always_inline]] inline void ResidualOperator::residual_rows<double>(const RowRange& rows,
                                                                           RowErrors& errors) const {
  const double* const x = rows.x;
  for (Index i = rows.begin; i < rows.end; ++i) {
    const double b_i = rows.b[i];
    LongSum sum0(b_i);
    LongSum sum1(0);
    double scale0 = std::abs(b_i);
    double scale1 = 0;
    visit_row<double>(
        i, rows.transpose,
        [&](double v, Index c) __attribute__((always_inline)) {
          sum0.subtract_product(v, x[c]);
          scale0 += std::abs(v * x[c]);
        },
        [&](double v, Index c) __attribute__((always_inline)) {
          sum1.subtract_product(v, x[c]);
          scale1 += std::abs(v * x[c]);
        });
    sum0.add(sum1);
    const double value = sum0.value();
    errors.add(value, scale0 + scale1, x[i], b_i);
    if (rows.r != nullptr) rows.r[i] = value;
  }
}

namespace {

// The parts of a complex sum.
struct LongComplexSum {
  LongSum re, im;
  double scale;

  explicit LongComplexSum(std::complex<double> start) : re(start.real()), im(start.imag()), scale(std::abs(start)) {}
  [[gnu::always_inline]] void subtract_product(std::complex<double> a, std::complex<double> b) {
    re.subtract_product(a.real(), b.real());
    re.subtract_product(-a.imag(), b.imag());
    im.subtract_product(a.real(), b.imag());
    im.subtract_product(a.imag(), b.real());
    // |a b|; near the overflow the library's magnitudes say whether it is one
    const double plain = (a.real() * a.real() + a.imag() * a.imag()) * (b.real() * b.real() + b.imag() * b.imag());
    scale += plain > 0x1p-900 && plain < 0x1p900 ? std::sqrt(plain) : std::abs(a) * std::abs(b);
  }
};

}  // namespace

template <>
[[gnu::always_inline]] inline void ResidualOperator::residual_rows<std::complex<double>>(const RowRange& rows,
                                                                                         RowErrors& errors) const {
  using Value = std::complex<double>;
  const Value *const x = base::as_complex(rows.x), *const b = base::as_complex(rows.b);
  for (Index i = rows.begin; i < rows.end; ++i) {
    LongComplexSum sum(b[i]);
    const auto subtract = [&](Value v, Index c) __attribute__((always_inline)) { sum.subtract_product(v, x[c]); };
    visit_row<Value>(i, rows.transpose, subtract, subtract);
    const Value value(sum.re.value(), sum.im.value());
    errors.add(value, sum.scale, x[i], b[i]);
    if (rows.r != nullptr) base::as_complex(rows.r)[i] = value;
  }
}

// std::fma is a call into the C library unless the compiler may assume the instruction, so the rows are compiled once
// more for processors that have it. Both give the same bits.
#if defined(__x86_64__)
__attribute__((target("avx2,fma"))) void ResidualOperator::residual_rows_fma(const RowRange& rows,
                                                                             RowErrors& errors) const {
  if (numbers_ == base::Numbers::real)
    residual_rows<double>(rows, errors);
  else
    residual_rows<std::complex<double>>(rows, errors);
}
#endif

BackwardError ResidualOperator::compute(const double* b, const double* x, double* r, bool transpose) const {
  return judge(compute_rows(b, x, r, transpose), norm(transpose));
}

RowErrors ResidualOperator::compute_rows(const double* b, const double* x, double* r, bool transpose) const {
  std::vector<RowErrors> found(ranges());
  for_each_range([&](std::size_t range, Index begin, Index end) {
    RowErrors& errors = found[range];
    const RowRange rows{begin, end, b, x, r, transpose};
#if defined(__x86_64__)
    static const bool fma = __builtin_cpu_supports("fma") != 0 && __builtin_cpu_supports("avx2") != 0;
    if (fma) return residual_rows_fma(rows, errors);
#endif
    if (numbers_ == base::Numbers::real)
      residual_rows<double>(rows, errors);
    else
      residual_rows<std::complex<double>>(rows, errors);
  });
  return total(found);
}

RowErrors ResidualOperator::total(std::span<const RowErrors> found) {
  RowErrors all;
  for (const RowErrors& e : found) all.add(e);
  return all;
}

BackwardError ResidualOperator::judge(const RowErrors& all, double norm) {
  if (!all.finite) {
    const double infinity = std::numeric_limits<double>::infinity();
    return {infinity, infinity};
  }
  const double scale = norm * all.x + all.b;
  if (std::isinf(scale)) return {all.componentwise, all.componentwise};  // which is never below the normwise error
  return {ratio(all.residual, scale), all.componentwise};
}

void ResidualOperator::compute(std::span<ResidualColumn> columns, bool transpose) const {
  std::vector<RowErrors> errors(columns.size());
  compute_rows(columns, errors, transpose);
  for (std::size_t k = 0; k < columns.size(); ++k) columns[k].error = judge(errors[k], norm(transpose));
}

void ResidualOperator::compute_rows(std::span<const ResidualColumn> columns, std::span<RowErrors> errors,
                                    bool transpose) const {
  const RowSums& sums = row_sums();
  const auto lanes = at(sums.lanes);
  base::Buffer<double> packed;
  while (!columns.empty()) {
    if (lanes == 0 || columns.size() == 1 || numbers_ != base::Numbers::real) {
      const ResidualColumn& c = columns.front();
      errors.front() = compute_rows(c.b, c.x, c.r, transpose);
      columns = columns.subspan(1);
      errors = errors.subspan(1);
      continue;
    }
    const std::size_t now = std::min(kGroups * lanes, columns.size());
    const auto groups = static_cast<Index>((now + lanes - 1) / lanes);
    if (packed.size() == 0) packed = base::Buffer<double>(Offset{a_.rows} * sums.lanes * groups, nullptr);
    compute_pass(columns.first(now), errors.first(now), sums, packed.data(), transpose);
    columns = columns.subspan(now);
    errors = errors.subspan(now);
  }
}

// The entries of a row of op(A), side by side, in the two chains of a single right-hand side: what visit_row() gives
// use0 stands at even places, what it gives use1 at odd ones. Zeros fill the shorter chain; they change no sum.
RowEntries ResidualOperator::gather_row(Index row, bool transpose, std::vector<double>& values,
                                        std::vector<Index>& cols) const {
  auto most = at(a_.col_ptr[row + 1] - a_.col_ptr[row]) + 2;
  if (!rows_->ptr.empty()) most += at(rows_->ptr[row + 1] - rows_->ptr[row]);
  if (values.size() < most) {
    values.resize(2 * most);
    cols.resize(2 * most);
  }
  std::size_t next[2] = {0, 1};
  const auto keep = [&](int chain) {
    return [&, chain ](double v, Index c) __attribute__((always_inline)) {
      values[next[chain]] = v;
      cols[next[chain]] = c;
      next[chain] += 2;
    };
  };
  visit_row<double>(row, transpose, keep(0), keep(1));
  while (next[1] < next[0]) keep(1)(0, row);
  const std::size_t count = next[1] - 1;
  return {std::span<const double>(values).first(count), std::span<const Index>(cols).first(count)};
}

// One pass over the matrix. The columns are packed in groups of sums.lanes.
void ResidualOperator::compute_pass(std::span<const ResidualColumn> columns, std::span<RowErrors> errors,
                                    const RowSums& sums, double* packed, bool transpose) const {
  const auto lanes = at(sums.lanes);
  const auto n = at(a_.rows);
  const std::size_t count = columns.size(), padded = (count + lanes - 1) / lanes * lanes;
  pack(
      count, lanes, [&](std::size_t k) { return columns[k].x; }, packed);
  const std::size_t each = ranges();
  std::vector<RowErrors> found(each * count);
  for_each_range([&](std::size_t range, Index begin, Index end) {
    std::vector<double> values, b(padded, 0), residual(padded), scale(padded);
    std::vector<Index> cols;
    std::vector<RowErrors> mine(count);
    for (Index i = begin; i < end; ++i) {
      const RowEntries row = gather_row(i, transpose, values, cols);
      for (std::size_t k = 0; k < count; ++k) b[k] = columns[k].b[i];
      for (std::size_t k = 0; k < padded; k += lanes) sums.sum(row, packed + k * n, &b[k], &residual[k], &scale[k]);
      for (std::size_t k = 0; k < count; ++k) {
        mine[k].add(residual[k], scale[k], columns[k].x[i], b[k]);
        if (columns[k].r != nullptr) columns[k].r[i] = residual[k];
      }
    }
    for (std::size_t k = 0; k < count; ++k) found[k * each + range] = mine[k];
  });
  for (std::size_t k = 0; k < count; ++k) errors[k] = total(std::span<const RowErrors>(found).subspan(k * each, each));
}

}  // namespace espalier::solve
