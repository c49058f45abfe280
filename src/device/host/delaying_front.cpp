#include "device/host/delaying_front.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace espalier::device::host {

namespace {

auto at(Index k) { return static_cast<std::size_t>(k); }

// The entries of L that are allowed here, over those that the factorization allows: tiles may be cut a little
// differently there.
constexpr double kMargin = 0.5;

void grow(base::Buffer<double>& buffer, Offset size, base::MemoryBudget* budget) {
  if (buffer.size() >= size) return;
  buffer = base::Buffer<double>();
  buffer = base::Buffer<double>(size, budget);
}

}  // namespace

void DelayingFront::start(Index pivots, Index rows) {
  constexpr Offset kPanelRows = kPanel<double>;
  rows_ = rows;
  ld_ = padded<double>(rows);
  // Kernels work on whole panels, from the first row of any tile on.
  const Offset size = ld_ * (ld_ + kPanelRows) + kPanelRows;
  grow(c_, size, budget_);
  grow(saved_, size, budget_);
  std::fill_n(c_.data(), size, 0.0);
  done_ = failed_ = 0;
  suspect_ = -1;
  left_ = pivots;
  order_.resize(at(rows));
  std::iota(order_.begin(), order_.end(), 0);
  late_.assign(at(pivots), 0);
  perm_.resize(at(pivots));
  replaced_.resize(at(pivots));
  grow(d_, 2 * padded<double>(pivots), budget_);
}

Index DelayingFront::next_width() const {
  return std::min(left_, plan::cut_front(done_ + left_, rows_, tiles_).pivot_width);
}

void DelayingFront::eliminate() {
  // Failures behind the first of a tile may be its debris. It is put back alone, unless another try costs much.
  constexpr Index kCheapRows = 512;
  std::size_t batch = 1;
  while (left_ > 0) {
    const Index width = next_width();
    std::vector<Failure> failures = factor_tile(width);
    if (failures.empty()) {
      done_ += width;
      left_ -= width;
      batch = 1;
      continue;
    }
    failures.resize(std::min(failures.size(), batch));
    if (rows_ > kCheapRows) batch *= 2;
    put_back(culprits(failures), width == left_);
  }
}

// @returns the failing pivots of the tile in the order in which they were eliminated
std::vector<DelayingFront::Failure> DelayingFront::factor_tile(Index width) {
  const Index rows = rows_ - done_;
  double* c = c_.data() + done_ * ld_ + done_;
  for (Index j = 0; j < rows; ++j) {
    const Offset column = (done_ + j) * ld_ + done_;
    std::copy_n(c_.data() + column, rows, saved_.data() + column);
  }
  const auto& dense = kernels<double>();
  if (lu_)
    dense.partial_getrf(rows, width, c, ld_, rule_.tiny, perm_.data(), replaced_.data());
  else
    dense.partial_ldlt(rows, width, c, ld_, rule_.tiny, perm_.data(), d_.data(), d_.data() + padded<double>(width),
                       replaced_.data());
  const double limit = kMargin / rule_.threshold;
  std::vector<Failure> failures;
  for (Index k = 0; k < width; ++k) {
    bool stable = replaced_[at(k)] == 0;
    for (Index i = width; i < rows && stable; ++i) stable = std::abs(c[k * ld_ + i]) <= limit;  // NaN is not
    if (stable) continue;
    failures.push_back({lu_ ? k : perm_[at(k)], perm_[at(k)]});
  }
  return failures;
}

// A column of lu may fail for its own sake, or for that of the row which is left over for it. The first time the column
// goes; when the next one fails with the same row, the row does.
std::vector<Index> DelayingFront::culprits(std::span<const Failure> failures) {
  std::vector<Index> found;
  for (const Failure& f : failures) {
    const Index row = order_[at(done_ + f.row)];
    const Index culprit = row == suspect_ ? f.row : f.column;
    suspect_ = row;
    if (std::find(found.begin(), found.end(), culprit) == found.end()) found.push_back(culprit);
  }
  return found;
}

// Undoes the tile; the failing pivots go behind all others of the front or, after their last try, leave it.
void DelayingFront::put_back(std::span<const Index> failing, bool last_tile) {
  std::vector<Index> kept, again, out, order;  // by places from done_ on
  for (Index k = 0; k < left_; ++k) {
    if (std::find(failing.begin(), failing.end(), k) == failing.end()) {
      kept.push_back(k);
      continue;
    }
    char& late = late_[at(order_[at(done_ + k)])];
    (last_tile || late != 0 ? out : again).push_back(k);
    late = 1;
  }
  for (const auto* part : {&kept, &again, &out}) order.insert(order.end(), part->begin(), part->end());
  for (Index k = left_; k < rows_ - done_; ++k) order.push_back(k);
  restore(order);
  left_ -= static_cast<Index>(out.size());
  failed_ += static_cast<Index>(out.size());
}

void DelayingFront::restore(std::span<const Index> order) {
  const Index rows = rows_ - done_;
  for (Index j = 0; j < rows; ++j) {
    double* to = c_.data() + (done_ + j) * ld_ + done_;
    for (Index i = lu_ ? 0 : j; i < rows; ++i) {
      const Index r = order[at(i)], c = order[at(j)];
      to[i] = saved_[(done_ + (lu_ ? c : std::min(r, c))) * ld_ + done_ + (lu_ ? r : std::max(r, c))];
    }
  }
  std::vector<Index> moved(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) moved[k] = order_[at(done_ + order[k])];
  std::copy(moved.begin(), moved.end(), order_.begin() + done_);
}

}  // namespace espalier::device::host
