/// \file
/// Systems made of groups of unknowns (the coordinates of a node, the multipliers of a joint), assembled into columns
/// directly, without a list of triplets.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// Which entries of a block between two groups are stored.
enum class BlockShape { full, diagonal };

/// A group that a group is coupled to.
struct Neighbour {
  Index group = 0;
  BlockShape shape = BlockShape::full;
};

/// At most 3 x 3 values; entry (i, k) stands at 3 i + k.
using BlockValues = std::array<double, 9>;

/// A system with a symmetric pattern of blocks. Implementations must allow concurrent calls.
class GroupModel {
 public:
  virtual ~GroupModel() = default;
  /// Unknowns of a group: 1 or 3, the same for all.
  [[nodiscard]] virtual Index group_size() const { return 3; }
  [[nodiscard]] virtual Index groups() const = 0;
  /// Appends all groups coupled to `group`, itself included where its diagonal block is stored, each once.
  virtual void neighbours(Index group, std::vector<Neighbour>& out) const = 0;
  /// Values of the block in the rows of `row` and the columns of `col`, a pair that neighbours() named.
  virtual void block(Index row, Index col, BlockValues& values) const = 0;
};

/// Assembles the system in a new numbering: the unknowns of group g become group_size() place[g] and the following.
/// @param place permutation of 0..groups-1
/// @param storage symmetric_lower or general; rows rise within each column
/// Memory: the result and 8 bytes per group.
SparseMatrix assemble_groups(const GroupModel& model, std::span<const Index> place, Storage storage,
                             base::ThreadPool* pool = nullptr);

}  // namespace espalier::matrix
