#include "rivals/compressed.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "rivals/process_memory.hpp"
#include "rivals/rival.hpp"

namespace espalier::bench {
namespace {

/// One wanted entry: where it goes and which number of the view it takes (-1: a diagonal added for completeness).
struct Target {
  Index major, minor;
  Offset source;  ///< k for entry k itself, -2 - k for its mirror image, -1 for none
};

/// Every entry that `shape` wants of `a`, in the order of the view, then the whole diagonal.
std::vector<Target> wanted_entries(const MatrixView& a, Shape shape) {
  const bool lower = shape == Shape::lower_by_column;
  const bool one_triangle = a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper;
  std::vector<Target> targets;
  targets.reserve(static_cast<std::size_t>(a.nonzeros() * (one_triangle && !lower ? 2 : 1) + a.rows));
  for (Index column = 0; column < a.cols; ++column) {
    for (Offset k = a.col_ptr[column]; k < a.col_ptr[column + 1]; ++k) {
      const Index row = a.row_ind[k];
      if (lower) {
        if (one_triangle || row >= column) targets.push_back({std::min(row, column), std::max(row, column), k});
        continue;
      }
      const bool by_row = shape == Shape::full_by_row;
      targets.push_back({by_row ? row : column, by_row ? column : row, k});
      if (one_triangle && row != column) targets.push_back({by_row ? column : row, by_row ? row : column, -2 - k});
    }
  }
  for (Index i = 0; i < a.rows; ++i) targets.push_back({i, i, -1});
  return targets;
}

/// Stable counting sort of `order` (positions in targets) by `key`.
template <typename Key>
void counting_sort(const std::vector<Target>& targets, Index size, Key key, std::vector<Offset>& order) {
  std::vector<Offset> start(static_cast<std::size_t>(size) + 1, 0);
  for (const Target& t : targets) ++start[key(t) + 1];
  std::partial_sum(start.begin(), start.end(), start.begin());
  std::vector<Offset> sorted(order.size());
  for (const Offset t : order) sorted[start[key(targets[t])]++] = t;
  order.swap(sorted);
}

}  // namespace

CompressedMatrix::CompressedMatrix(const MatrixView& a, Shape shape, int base) : size_(a.rows) {
  {
    const std::vector<Target> targets = wanted_entries(a, shape);
    std::vector<Offset> order(targets.size());
    std::iota(order.begin(), order.end(), Offset{0});
    counting_sort(
        targets, size_, [](const Target& t) { return t.minor; }, order);
    counting_sort(
        targets, size_, [](const Target& t) { return t.major; }, order);
    slot_.assign(static_cast<std::size_t>(a.nonzeros()), -1);
    if (shape != Shape::lower_by_column && a.symmetric() && a.storage != Storage::symmetric_both)
      mirror_.assign(slot_.size(), -1);
    pointers.assign(static_cast<std::size_t>(size_) + 1, 0);
    Index last_major = -1, last_minor = -1;
    for (const Offset position : order) {
      const Target& t = targets[position];
      if (t.major != last_major || t.minor != last_minor) {
        indices.push_back(t.minor + base);
        ++pointers[t.major + 1];
        last_major = t.major, last_minor = t.minor;
      }
      const Offset place = nonzeros() - 1;
      if (t.source >= 0) slot_[t.source] = place;
      if (t.source < -1) mirror_[-2 - t.source] = place;
    }
    std::partial_sum(pointers.begin(), pointers.end(), pointers.begin());
    for (Offset& p : pointers) p += base;
    indices.shrink_to_fit();
  }
  values.assign(indices.size(), 0.0);
  if (!a.values.empty()) fill(a.values);
  reset_peak_memory();
}

void CompressedMatrix::fill(std::span<const double> source) {
  std::fill(values.begin(), values.end(), 0.0);
  for (std::size_t k = 0; k < slot_.size(); ++k) {
    if (slot_[k] >= 0) values[slot_[k]] += source[k];
    if (!mirror_.empty() && mirror_[k] >= 0) values[mirror_[k]] += source[k];
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
