#include "matrix/generators/group_model.hpp"

#include <algorithm>

#include "base/parallel.hpp"
#include "matrix/transform.hpp"

namespace espalier::matrix {

namespace {

constexpr Index kGroupsPerTask = 512;

// A block of the group column at hand.
struct Block {
  Index place;  // group row in the new numbering
  Neighbour neighbour;
};

class Assembler {
 public:
  Assembler(const GroupModel& model, std::span<const Index> place, bool lower)
      : model_(model), place_(place), order_(invert_permutation(place)), size_(model.group_size()), lower_(lower) {}

  // The stored blocks of group column `column`, rows rising.
  void blocks(Index column, std::vector<Neighbour>& neighbours, std::vector<Block>& blocks) const {
    neighbours.clear();
    blocks.clear();
    model_.neighbours(order_[static_cast<std::size_t>(column)], neighbours);
    for (const auto& n : neighbours) {
      const Index row = place_[static_cast<std::size_t>(n.group)];
      if (!lower_ || row >= column) blocks.push_back({row, n});
    }
    std::sort(blocks.begin(), blocks.end(), [](const Block& a, const Block& b) { return a.place < b.place; });
  }

  // First row of `block` that is stored in column k of the group column, and the end of its rows.
  [[nodiscard]] std::pair<Index, Index> rows(const Block& block, Index column, Index k) const {
    if (block.neighbour.shape == BlockShape::diagonal) return {k, k + 1};
    return {lower_ && block.place == column ? k : 0, size_};
  }

  void count(Index column, const std::vector<Block>& list, SparseMatrix& a) const {
    for (Index k = 0; k < size_; ++k) {
      Offset entries = 0;
      for (const auto& b : list) {
        const auto [begin, end] = rows(b, column, k);
        entries += end - begin;
      }
      a.col_ptr[static_cast<std::size_t>(size_) * static_cast<std::size_t>(column) + static_cast<std::size_t>(k) + 1] =
          entries;
    }
  }

  void fill(Index column, const std::vector<Block>& list, SparseMatrix& a) const {
    std::array<Offset, 3> next{};
    const auto first = static_cast<std::size_t>(size_) * static_cast<std::size_t>(column);
    for (Index k = 0; k < size_; ++k)
      next[static_cast<std::size_t>(k)] = a.col_ptr[first + static_cast<std::size_t>(k)];
    BlockValues values{};
    for (const auto& b : list) {
      model_.block(b.neighbour.group, order_[static_cast<std::size_t>(column)], values);
      for (Index k = 0; k < size_; ++k) {
        const auto [begin, end] = rows(b, column, k);
        for (Index i = begin; i < end; ++i) {
          const auto at = static_cast<std::size_t>(next[static_cast<std::size_t>(k)]++);
          a.row_ind[at] = size_ * b.place + i;
          a.values[at] = values[3 * static_cast<std::size_t>(i) + static_cast<std::size_t>(k)];
        }
      }
    }
  }

 private:
  const GroupModel& model_;
  std::span<const Index> place_;
  std::vector<Index> order_;
  Index size_;
  bool lower_;
};

}  // namespace

SparseMatrix assemble_groups(const GroupModel& model, std::span<const Index> place, Storage storage,
                             base::ThreadPool* pool) {
  const Assembler assembler(model, place, storage == Storage::symmetric_lower);
  const Index groups = model.groups();
  const Index n = groups * model.group_size();
  SparseMatrix a{n, n, std::vector<Offset>(static_cast<std::size_t>(n) + 1, 0), {}, {}, storage};
  const auto for_each_column = [&](const auto& body) {
    base::for_each_range(pool, groups, kGroupsPerTask, [&](std::int64_t begin, std::int64_t end) {
      std::vector<Neighbour> neighbours;
      std::vector<Block> blocks;
      for (auto column = static_cast<Index>(begin); column < static_cast<Index>(end); ++column) {
        assembler.blocks(column, neighbours, blocks);
        body(column, blocks);
      }
    });
  };
  for_each_column([&](Index column, const std::vector<Block>& blocks) { assembler.count(column, blocks, a); });
  for (std::size_t j = 1; j < a.col_ptr.size(); ++j) a.col_ptr[j] += a.col_ptr[j - 1];
  a.row_ind.resize(static_cast<std::size_t>(a.col_ptr.back()));
  a.values.resize(static_cast<std::size_t>(a.col_ptr.back()));
  for_each_column([&](Index column, const std::vector<Block>& blocks) { assembler.fill(column, blocks, a); });
  return a;
}

}  // namespace espalier::matrix
