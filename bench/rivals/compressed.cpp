#include "rivals/compressed.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "rivals/process_memory.hpp"
#include "rivals/rival.hpp"

namespace espalier::bench {
namespace {

/// One wanted entry of a column (row) of the result.
struct Target {
  Offset source;  ///< k for entry k of the view, -2 - k for its mirror image, -1 for a diagonal that may be missing
  Index minor;
};

bool lower_triangle(const MatrixView& a) {
  return a.storage == Storage::symmetric_lower || a.storage == Storage::hermitian_lower;
}
bool upper_triangle(const MatrixView& a) {
  return a.storage == Storage::symmetric_upper || a.storage == Storage::hermitian_upper;
}
bool one_triangle(const MatrixView& a) { return lower_triangle(a) || upper_triangle(a); }
/// The shapes with half of a symmetric matrix, whose arrays are the same.
bool is_half(Shape shape) { return shape == Shape::lower_by_column || shape == Shape::upper_by_row; }

/// Whether the view's arrays are what `shape` wants, entry by entry: ascending, no duplicates, a full diagonal. So are
/// those of the generators, of which the largest have 2e8 entries.
bool is_in_shape(const MatrixView& a, Shape shape) {
  const bool lower = is_half(shape) && lower_triangle(a);
  const bool full = shape == Shape::full_by_column && !one_triangle(a);
  if (!lower && !full) return false;
  for (Index column = 0; column < a.cols; ++column) {
    bool diagonal = false;
    for (Offset k = a.col_ptr[column]; k < a.col_ptr[column + 1]; ++k) {
      if (k > a.col_ptr[column] && a.row_ind[k] <= a.row_ind[k - 1]) return false;
      diagonal |= a.row_ind[k] == column;
    }
    if (!diagonal) return false;
  }
  return true;
}

/// Calls visit(major, target) for every entry that `shape` wants of `a`, in the order of the view, then for the
/// diagonal.
template <typename Visit>
void for_each_wanted(const MatrixView& a, Shape shape, Visit&& visit) {
  const bool lower = is_half(shape), by_row = shape == Shape::full_by_row, half = one_triangle(a);
  for (Index column = 0; column < a.cols; ++column) {
    for (Offset k = a.col_ptr[column]; k < a.col_ptr[column + 1]; ++k) {
      const Index row = a.row_ind[k];
      if (lower) {
        if (half || row >= column) visit(std::min(row, column), Target{k, std::max(row, column)});
        continue;
      }
      visit(by_row ? row : column, Target{k, by_row ? column : row});
      if (half && row != column) visit(by_row ? column : row, Target{-2 - k, by_row ? row : column});
    }
  }
  for (Index i = 0; i < a.rows; ++i) visit(i, Target{-1, i});
}

}  // namespace

CompressedMatrix::CompressedMatrix(const SystemView& a, Shape shape, int base)
    : size_(a.rows), parts_(static_cast<std::size_t>(a.parts())) {
  // Where both triangles are stored, the lower one is taken.
  conjugate_mirror_ = a.numbers == Numbers::hermitian;
  conjugate_ = conjugate_mirror_ && is_half(shape) && upper_triangle(a) != (shape == Shape::upper_by_row);
  if (is_in_shape(a, shape)) {
    pointers.assign(a.col_ptr.begin(), a.col_ptr.end());
    indices.assign(a.row_ind.begin(), a.row_ind.end());
    for (std::int32_t& index : indices) index += base;
  } else {
    convert(a, shape, base);
  }
  for (Offset& p : pointers) p += base;
  values.resize(parts_ * indices.size());
  if (!a.values.empty()) fill(a.values);
  reset_peak_memory();
}

void CompressedMatrix::convert(const MatrixView& a, Shape shape, int base) {
  std::vector<Offset> start(static_cast<std::size_t>(size_) + 1, 0);
  for_each_wanted(a, shape, [&](Index major, const Target&) { ++start[major + 1]; });
  std::partial_sum(start.begin(), start.end(), start.begin());
  std::vector<Target> targets(static_cast<std::size_t>(start.back()));
  std::vector<Offset> next(start.begin(), start.end() - 1);
  for_each_wanted(a, shape, [&](Index major, const Target& target) { targets[next[major]++] = target; });
  slot_.assign(static_cast<std::size_t>(a.nonzeros()), -1);
  if (!is_half(shape) && one_triangle(a)) mirror_.assign(slot_.size(), -1);
  indices.reserve(targets.size());
  pointers.assign(1, 0);
  const auto by_minor = [](const Target& x, const Target& y) { return x.minor < y.minor; };
  for (Index major = 0; major < size_; ++major) {
    const auto first = targets.begin() + start[major], last = targets.begin() + start[major + 1];
    if (!std::is_sorted(first, last, by_minor)) std::stable_sort(first, last, by_minor);
    for (auto target = first; target != last; ++target) {
      if (target == first || target->minor != (target - 1)->minor) indices.push_back(target->minor + base);
      const Offset place = nonzeros() - 1;
      if (target->source >= 0) slot_[target->source] = place;
      if (target->source < -1) mirror_[-2 - target->source] = place;
    }
    pointers.push_back(nonzeros());
  }
}

void CompressedMatrix::fill(std::span<const double> source) {
  if (slot_.empty()) {
    std::copy(source.begin(), source.end(), values.begin());
    for (std::size_t k = 1; conjugate_ && k < values.size(); k += 2) values[k] = -values[k];
    return;
  }
  std::fill(values.begin(), values.end(), 0.0);
  const auto add = [&](Offset place, std::size_t k, bool conjugate) {
    if (place < 0) return;
    double* to = values.data() + static_cast<std::size_t>(place) * parts_;
    to[0] += source[k * parts_];
    if (parts_ == 2) to[1] += conjugate ? -source[2 * k + 1] : source[2 * k + 1];
  };
  for (std::size_t k = 0; k < slot_.size(); ++k) {
    add(slot_[k], k, conjugate_);
    if (!mirror_.empty()) add(mirror_[k], k, conjugate_mirror_);
  }
}

Offset CompressedMatrix::map_bytes() const {
  return static_cast<Offset>((slot_.size() + mirror_.size()) * sizeof(Offset));
}

std::vector<std::int32_t> CompressedMatrix::narrow_pointers() const {
  if (pointers.back() > std::numeric_limits<std::int32_t>::max())
    throw Failure(Outcome::not_offered, "more than 2^31 entries in the matrix: this interface counts in 32 bits");
  return {pointers.begin(), pointers.end()};
}

}  // namespace espalier::bench
