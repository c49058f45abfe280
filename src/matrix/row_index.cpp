#include "matrix/row_index.hpp"

#include <algorithm>
#include <utility>

namespace espalier::matrix {

namespace {

constexpr std::int64_t kMostBlocks = 32;  // of columns that are indexed side by side: four bytes a row each
constexpr std::int64_t kRowsPerRange = 16384;

bool is_indexed(Storage storage, Index row, Index col) {
  if (storage == Storage::general) return true;
  return storage == Storage::symmetric_both ? row > col : row != col;
}

}  // namespace

// Each worker indexes a block of columns; within a row the blocks follow each other, so that the index is the same for
// any number of workers.
RowIndex index_rows(const MatrixView& a, base::ThreadPool& pool) {
  // The counters of all blocks together stay below half of the index.
  const Offset affordable = std::max<Offset>(1, a.nonzeros() * Offset{3} / (2 * std::max<Offset>(1, a.rows)));
  const std::int64_t blocks = std::min({std::int64_t{pool.size()}, kMostBlocks, affordable});
  const auto n = static_cast<std::size_t>(a.rows);
  std::vector<std::vector<Index>> next(static_cast<std::size_t>(blocks));  // entries of each row in the block
  const auto begin_of = [&](std::int64_t block) {  // the first column that begins in its part of the entries
    if (block == blocks) return a.cols;
    const auto at = std::lower_bound(a.col_ptr.begin(), a.col_ptr.end() - 1, a.nonzeros() * block / blocks);
    return static_cast<Index>(at - a.col_ptr.begin());
  };
  const auto visit = [&](std::int64_t block, auto&& ask, auto&& use) {
    constexpr Offset kAhead = 16;  // entries between asking for what a row needs and using it
    const Index end = begin_of(block + 1);
    const Offset last = a.nonzeros() - 1;
    for (Index c = begin_of(block); c < end; ++c)
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
        ask(a.row_ind[std::min(q + kAhead, last)]);
        if (is_indexed(a.storage, a.row_ind[q], c)) use(a.row_ind[q], c, q);
      }
  };
  pool.for_each(blocks, [&](std::int64_t block) {
    auto& count = next[static_cast<std::size_t>(block)];
    count.assign(n, 0);
    visit(
        block, [&](Index r) { __builtin_prefetch(&count[static_cast<std::size_t>(r)], 1); },
        [&](Index r, Index, Offset) { ++count[static_cast<std::size_t>(r)]; });
  });
  RowIndex index;
  index.ptr.assign(n + 1, 0);
  pool.for_each_range(a.rows, kRowsPerRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto r = static_cast<std::size_t>(begin); r < static_cast<std::size_t>(end); ++r) {
      Index in_row = 0;
      for (auto& count : next) in_row += std::exchange(count[r], in_row);
      index.ptr[r + 1] = in_row;
    }
  });
  for (std::size_t r = 0; r < n; ++r) index.ptr[r + 1] += index.ptr[r];
  index.col = base::Buffer<Index>(index.ptr.back(), nullptr);
  index.source = base::Buffer<Offset>(index.ptr.back(), nullptr);
  pool.for_each(blocks, [&](std::int64_t block) {
    auto& place = next[static_cast<std::size_t>(block)];
    const auto ask = [&](Index r) {
      __builtin_prefetch(&place[static_cast<std::size_t>(r)], 1);
      __builtin_prefetch(&index.ptr[static_cast<std::size_t>(r)]);
    };
    visit(block, ask, [&](Index r, Index c, Offset q) {
      const Offset at = index.ptr[static_cast<std::size_t>(r)] + place[static_cast<std::size_t>(r)]++;
      index.col[at] = c;
      index.source[at] = q;
    });
  });
  return index;
}

RowIndex rows_of_index(const RowIndex& whole, Index first, Index end) {
  RowIndex part;
  if (whole.ptr.empty()) return part;
  const Offset begin = whole.ptr[static_cast<std::size_t>(first)];
  const Offset count = whole.ptr[static_cast<std::size_t>(end)] - begin;
  for (const Offset at : whole.ptr) part.ptr.push_back(std::clamp<Offset>(at - begin, 0, count));
  part.col = base::Buffer<Index>(count, nullptr);
  part.source = base::Buffer<Offset>(count, nullptr);
  std::copy_n(whole.col.data() + begin, count, part.col.data());
  std::copy_n(whole.source.data() + begin, count, part.source.data());
  return part;
}

}  // namespace espalier::matrix
