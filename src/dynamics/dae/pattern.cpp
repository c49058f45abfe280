#include "dynamics/dae/pattern.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>

#include "base/at.hpp"
#include "base/parallel.hpp"

namespace espalier::dynamics {

Offset find_entry(const SparsePattern& pattern, Index major, Index minor) {
  const auto first = pattern.ind.begin() + pattern.ptr[at(major)];
  const auto last = pattern.ind.begin() + pattern.ptr[at(major) + 1];
  const auto it = std::lower_bound(first, last, minor);
  if (it == last || *it != minor) {
    throw std::logic_error("entry (" + std::to_string(major) + ", " + std::to_string(minor) +
                           ") was not declared in the pattern");
  }
  return it - pattern.ind.begin();
}

PatternBuilder::PatternBuilder(Index rows, Index cols, bool by_columns)
    : rows_(rows), cols_(cols), by_columns_(by_columns), lists_(at(by_columns ? cols : rows)) {}

void PatternBuilder::add(Index row, Index col) {
  if (row < 0 || col < 0) return;
  if (row >= rows_ || col >= cols_) throw std::logic_error("pattern entry outside of the matrix");
  auto& list = lists_[at(by_columns_ ? col : row)];
  // Duplicates are dropped when the list is about to grow, so memory stays within twice the final pattern.
  if (list.size() == list.capacity() && list.size() >= 32) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    if (list.size() * 2 > list.capacity()) list.reserve(list.capacity() * 2);
  }
  ++declared_;
  list.push_back(by_columns_ ? row : col);
}

void PatternBuilder::add_block(std::span<const Index> rows, std::span<const Index> cols) {
  constexpr std::size_t kLong = 32;
  if (!by_columns_ || rows.size() < kLong) {
    for (const Index c : cols) {
      for (const Index r : rows) add(r, c);
    }
    return;
  }
  std::vector<Index> sorted;
  std::copy_if(rows.begin(), rows.end(), std::back_inserter(sorted), [](Index r) { return r >= 0; });
  const auto own = static_cast<Offset>(sorted.size());
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  if (sorted.empty()) return;
  if (sorted.back() >= rows_) throw std::logic_error("pattern entry outside of the matrix");
  for (const Index c : cols) {
    if (c < 0) continue;
    if (c >= cols_) throw std::logic_error("pattern entry outside of the matrix");
    block_columns_.push_back({c, static_cast<Index>(blocks_.size())});
    declared_ += own;
  }
  blocks_.push_back(std::move(sorted));
}

void PatternBuilder::add_vertex_pairs(Index first, std::span<const Offset> ptr, std::span<const Index> ind) {
  if (ptr.size() < 2) return;
  if (!pairs_.empty() && first < pairs_.back().first + 3 * static_cast<Index>(pairs_.back().ptr.size() - 1))
    throw std::logic_error("columns of vertices were declared out of order");
  if (!by_columns_ || first < 0 || first + 3 * static_cast<Index>(ptr.size() - 1) > cols_)
    throw std::logic_error("pattern entry outside of the matrix");
  declared_ += 9 * static_cast<Offset>(ind.size());
  pairs_.push_back({first, ptr, ind});
}

// The vertices whose rows add_vertex_pairs() has declared in a column; they count from the first of its range.
std::span<const Index> PatternBuilder::vertices_of(Index major) const {
  const auto after = std::upper_bound(pairs_.begin(), pairs_.end(), major,
                                      [](Index column, const VertexPairs& p) { return column < p.first; });
  if (after == pairs_.begin()) return {};
  const VertexPairs& p = *(after - 1);
  const auto vertex = at(major - p.first) / 3;
  if (vertex + 1 >= p.ptr.size()) return {};
  return p.ind.subspan(at(p.ptr[vertex]), at(p.ptr[vertex + 1] - p.ptr[vertex]));
}

// out := the minor indices of a major one, sorted and unique. @param blocks  all, by their columns
void PatternBuilder::collect(Index major, std::span<const BlockColumn> blocks, std::vector<Index>& out) const {
  const std::vector<Index>& list = lists_[at(major)];
  const std::span<const Index> vertices = vertices_of(major);
  out.clear();
  if (!vertices.empty()) {
    const Index first =
        std::prev(std::upper_bound(pairs_.begin(), pairs_.end(), major, [](Index column, const VertexPairs& p) {
          return column < p.first;
        }))->first;
    for (const Index v : vertices)
      for (Index i = 0; i < 3; ++i) out.push_back(first + 3 * v + i);
  }
  std::vector<Index> before;
  for (auto it = std::lower_bound(blocks.begin(), blocks.end(), BlockColumn{major, 0});
       it != blocks.end() && it->column == major; ++it) {
    const std::vector<Index>& rows = blocks_[at(it->block)];
    before.swap(out);
    out.clear();
    std::set_union(before.begin(), before.end(), rows.begin(), rows.end(), std::back_inserter(out));
  }
  const auto sorted = static_cast<std::ptrdiff_t>(out.size());
  out.insert(out.end(), list.begin(), list.end());
  if (diagonal_ && !std::binary_search(out.begin(), out.begin() + sorted, major)) out.push_back(major);
  if (sorted == static_cast<std::ptrdiff_t>(out.size())) return;
  std::sort(out.begin() + sorted, out.end());
  std::inplace_merge(out.begin(), out.begin() + sorted, out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
}

// Counted first and then written where they stay: memory that is touched for the first time is what takes time here.
SparsePattern PatternBuilder::build(base::ThreadPool* pool) const {
  constexpr std::int64_t kLines = 1024;
  const auto lines = static_cast<std::int64_t>(lists_.size());
  std::vector<BlockColumn> blocks(block_columns_);
  std::sort(blocks.begin(), blocks.end());
  const auto for_lines = [&](const auto& body) {
    base::for_each_range(pool, lines, kLines, [&](std::int64_t begin, std::int64_t end) {
      std::vector<Index> line;
      for (std::int64_t k = begin; k < end; ++k) {
        collect(static_cast<Index>(k), blocks, line);
        body(at(k), line);
      }
    });
  };
  SparsePattern p{rows_, cols_, std::vector<Offset>(lists_.size() + 1, 0), {}};
  for_lines([&](std::size_t k, const std::vector<Index>& line) { p.ptr[k + 1] = static_cast<Offset>(line.size()); });
  for (std::size_t k = 0; k < lists_.size(); ++k) p.ptr[k + 1] += p.ptr[k];
  p.ind.resize(at(p.ptr.back()));
  for_lines([&](std::size_t k, const std::vector<Index>& line) {
    std::copy(line.begin(), line.end(), p.ind.begin() + p.ptr[k]);
  });
  return p;
}

}  // namespace espalier::dynamics
