#include "device/host/delaying_front.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/at.hpp"
#include "device/host/pivoting.hpp"

namespace espalier::device::host {

namespace {

// The entries of L that are allowed here, over those that the factorization allows: tiles may be cut a little
// differently there.
constexpr double kMargin = 0.5;

template <class Value>
void grow(base::Buffer<Value>& buffer, Offset size, base::MemoryBudget* budget) {
  if (buffer.size() >= size) return;
  buffer = base::Buffer<Value>();
  buffer = base::Buffer<Value>(size, budget);
}

}  // namespace

template <class Value>
void DelayingFront<Value>::start(Index pivots, Index rows, Index border) {
  rows_ = rows;
  border_ = border;
  ld_ = padded<Value>(rows);
  grow(c_, ld_ * ld_, budget_);
  std::fill_n(c_.data(), ld_ * ld_, Value(0));
  done_ = failed_ = first_ = 0;
  suspect_ = -1;
  left_ = pivots;
  order_.resize(at(rows));
  std::iota(order_.begin(), order_.end(), 0);
  waits_.assign(at(rows), 1);
  late_.assign(at(pivots), 0);
}

template <class Value>
Index DelayingFront<Value>::next_width() const {
  return std::min(left_, plan::cut_front(done_ + left_, rows_, tiles_).pivot_width);
}

template <class Value>
bool DelayingFront<Value>::eliminate() {
  // Failures behind the first of a tile may be its debris. It is put back alone, unless another try costs much.
  constexpr Index kCheapRows = 512;
  std::size_t batch = 1;
  while (left_ > 0) {
    const Index width = next_width();
    const double tile_work = 2.0 * static_cast<double>(rows_ - done_) * width * width;
    if (effort_ != nullptr && !effort_->spend(tile_work)) return false;
    std::vector<Failure> failures = factor_tile(width);
    if (failures.empty()) {
      const double below = rows_ - done_;
      if (effort_ != nullptr && !effort_->spend((lu_ ? 2 : 1) * below * below * width)) return false;
      update(width);
      done_ += width;
      left_ -= width;
      batch = 1;
      continue;
    }
    failures.resize(std::min(failures.size(), batch));
    if (rows_ > kCheapRows) batch *= 2;
    put_back(culprits(failures), width == left_);
  }
  return true;
}

// The tile, and L in all rows below it. The front does not change.
// @returns the failing pivots of the tile in the order in which they were eliminated
template <class Value>
auto DelayingFront<Value>::factor_tile(Index width) -> std::vector<Failure> {
  take_rows(width);
  const auto& dense = kernels<Value>(hermitian_);
  const std::span<const Index> tile(order_.data() + done_, at(width));
  const Offset ld = padded<Value>(width);
  for (Index j = 0; j < width; ++j)
    for (Index i = lu_ ? 0 : j; i < width; ++i) tile_[j * ld + i] = entry(tile[at(i)], tile[at(j)]);
  const Offset below = rows_ - first_;
  std::vector<Index> pivots(at(width));
  if (lu_) {
    dense.getrf(width, tile_.data(), ld, {rule_.tiny, rule_.tiny}, perm_.data(), replaced_.data());
    dense.invert_upper_transposed(width, tile_.data(), ld, inverse_u_.data());
    pack_columns(tile, false);
    dense.trmm_nt(below, width, panels_.data(), inverse_u_.data(), l_.data());
  } else {
    Value *d = d_.data(), *e = d + width;
    dense.ldlt(width, tile_.data(), ld, {rule_.tiny, rule_.tiny}, perm_.data(), d, e, replaced_.data());
    dense.invert_lower(width, tile_.data(), ld, true, inverse_.data());
    for (Index k = 0; k < width; ++k) pivots[at(k)] = tile[at(perm_[at(k)])];
    pack_columns(pivots, false);
    dense.trmm_nt(below, width, panels_.data(), inverse_.data(), right_.data());
    invert_blocks(width, d, e, d_inverse_.data(), e_inverse_.data(), hermitian_);
    dense.scale_columns(below, width, right_.data(), d_inverse_.data(), e_inverse_.data(), l_.data());
  }
  measure_growth(width);
  const double limit = kMargin / rule_.threshold;
  // The column of a zero is one, too, and stays: of lu its row may be none.
  const double of_zero = rule_.in_place_of_zero > 0 && !lu_ ? kMargin : -1;
  std::vector<Failure> failures;
  for (Index k = 0; k < width; ++k)
    if (!(growth_[at(k)] <= (replaced_[at(k)] != 0 ? of_zero : limit)))
      failures.push_back({lu_ ? k : perm_[at(k)], perm_[at(k)]});
  return failures;
}

// Panels that hold rows of the border alone, or none, are left out; in a panel that holds both, row by row.
template <class Value>
void DelayingFront<Value>::measure_growth(Index width) {
  constexpr Index p = kPanel<Value>;
  growth_.assign(at(width), 0);
  const Index judged = std::max<Index>(0, rows_ - border_ - first_), whole = border_ == 0 ? judged : judged / p * p;
  kernels<Value>().column_max(whole, width, l_.data(), growth_.data());
  const Value* last = l_.data() + Offset{whole} * width;
  for (Index j = 0; j < width; ++j)
    for (Index r = 0; r < judged - whole; ++r)
      if (const double l = std::abs(last[j * p + r]); !(l <= growth_[at(j)])) growth_[at(j)] = l;
}

// Which rows stand below the next tile, and room for what becomes of them.
template <class Value>
void DelayingFront<Value>::take_rows(Index width) {
  constexpr Index kPanelRows = kPanel<Value>;
  for (Index k = 0; k < width; ++k) waits_[at(order_[at(done_ + k)])] = 0;
  Index first = rows_;
  for (Index i = 0; i < rows_ && first == rows_; ++i)
    if (waits_[at(i)] != 0) first = i;
  first_ = first / kPanelRows * kPanelRows;
  const Offset high = padded<Value>(rows_ - first_), wide = padded<Value>(width);
  for (auto* square : {&tile_, &inverse_, &inverse_u_}) grow(*square, wide * wide, budget_);
  for (auto* part : {&columns_, &panels_, &l_, &right_}) grow(*part, high * wide, budget_);
  perm_.resize(at(width));
  replaced_.resize(at(width));
  d_.resize(at(2 * width));
  d_inverse_.resize(at(width));
  e_inverse_.resize(at(width));
}

// The entries of columns (transposed: of rows) in the rows (columns) below the tile, as panels.
template <class Value>
void DelayingFront<Value>::pack_columns(std::span<const Index> columns, bool transposed) {
  const Offset below = rows_ - first_, high = padded<Value>(below);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const Index c = columns[k];
    Value* to = columns_.data() + static_cast<Offset>(k) * high;
    for (Index i = first_; i < rows_; ++i) {
      const Value value = transposed ? entry(c, i) : entry(i, c);
      to[i - first_] = waits_[at(i)] != 0 ? value : Value(0);
    }
  }
  kernels<Value>(hermitian_)
      .pack(below, static_cast<std::int64_t>(columns.size()), columns_.data(), high, panels_.data());
}

// The rest of the front less L D L^T or L U.
template <class Value>
void DelayingFront<Value>::update(Index width) {
  const auto& dense = kernels<Value>(hermitian_);
  if (lu_) {
    const std::span<const Index> tile(order_.data() + done_, at(width));
    dense.invert_lower(width, tile_.data(), padded<Value>(width), true, inverse_.data());
    std::vector<Index> rows(at(width));
    for (Index k = 0; k < width; ++k) rows[at(k)] = tile[at(perm_[at(k)])];
    pack_columns(rows, true);
    dense.trmm_nt(rows_ - first_, width, panels_.data(), inverse_.data(), right_.data());
  }
  constexpr Offset kColumns = 128;
  static_assert(kColumns % kPanel<Value> == 0);
  const auto some_columns = [&](Offset begin, Offset end) {
    Value* c = c_.data() + (first_ + begin) * ld_ + first_;
    if (lu_)
      dense.gemm_nt(rows_ - first_, end - begin, width, l_.data(), right_.data() + begin * width, c, ld_);
    else
      dense.syrk_nt(rows_ - first_ - begin, end - begin, width, l_.data() + begin * width,
                    right_.data() + begin * width, c + begin, ld_);
  };
  const Offset below = rows_ - first_;
  if (pool_ != nullptr && below > 4 * kColumns) return pool_->for_each_range(below, kColumns, some_columns);
  for (Offset begin = 0; begin < below; begin += kColumns) some_columns(begin, std::min(below, begin + kColumns));
}

// A column of lu may fail for its own sake, or for that of the row which is left over for it. The first time the column
// goes; when the next one fails with the same row, the row does.
template <class Value>
std::vector<Index> DelayingFront<Value>::culprits(std::span<const Failure> failures) {
  std::vector<Index> found;
  for (const Failure& f : failures) {
    const Index row = order_[at(done_ + f.row)];
    const Index culprit = row == suspect_ ? f.row : f.column;
    suspect_ = row;
    if (std::find(found.begin(), found.end(), culprit) == found.end()) found.push_back(culprit);
  }
  return found;
}

// The failing pivots go behind all others of the front or, after their last try, leave it.
template <class Value>
void DelayingFront<Value>::put_back(std::span<const Index> failing, bool last_tile) {
  const auto begin = order_.begin() + done_;
  std::vector<Index> kept, again, out;
  for (Index k = 0; k < left_; ++k) {
    const Index row = begin[k];
    waits_[at(row)] = 1;
    if (std::find(failing.begin(), failing.end(), k) == failing.end()) {
      kept.push_back(row);
      continue;
    }
    char& late = late_[at(row)];
    (last_tile || late != 0 ? out : again).push_back(row);
    late = 1;
  }
  auto to = begin;
  for (const auto* part : {&kept, &again, &out}) to = std::copy(part->begin(), part->end(), to);
  left_ -= static_cast<Index>(out.size());
  failed_ += static_cast<Index>(out.size());
}

template class DelayingFront<double>;
template class DelayingFront<std::complex<double>>;

}  // namespace espalier::device::host
