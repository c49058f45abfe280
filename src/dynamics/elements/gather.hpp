/// \file
/// Assembly by position. Elements write their forces and tangents into buffers of their own; then every sum is made
/// at its place, over the elements that it names, in the order of the mesh. Nobody writes where another one does, so
/// there are no colours and no atomics, and any number of threads gives the same bits. Lists are plain arrays.
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "base/at.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics {

/// Where results of elements of one kind with n vertices stand in their buffers.
///  - Forces: `lanes` (a power of two) elements side by side, as BlockOutput says.
///  - Tangents: one element after the other, each 3n x 3n column by column, so that a block is read from three lines of
///    cache and not from nine.
class ResultLayout {
 public:
  ResultLayout(int vertices, int lanes)
      : vertices_(vertices), lanes_(lanes), shift_(std::countr_zero(static_cast<unsigned>(lanes))) {}
  [[nodiscard]] int vertices() const { return vertices_; }
  [[nodiscard]] int lanes() const { return lanes_; }
  [[nodiscard]] int forces() const { return 3 * vertices_; }  ///< numbers of an element; also rows of its tangent
  [[nodiscard]] int tangents() const { return 9 * vertices_ * vertices_; }
  /// Force on local vertex a of element e: three numbers, lanes() apart.
  [[nodiscard]] std::int64_t force(std::int64_t e, int a) const {
    return ((e >> shift_) * forces() + 3 * a) * lanes_ + (e & (lanes_ - 1));
  }
  /// Block (a, b) of the tangent of element e: number (i, j) at i + j * forces() from here.
  [[nodiscard]] std::int64_t block(std::int64_t e, int a, int b) const {
    return e * tangents() + 3 * b * forces() + 3 * a;
  }

 private:
  int vertices_, lanes_, shift_;
};

/// Elements of one kind by the vertices of the body: vertex [e * n + a] is the a-th of element e.
struct Connectivity {
  int vertices = 0;  ///< n
  std::span<const Index> vertex;
  [[nodiscard]] Index elements() const { return static_cast<Index>(vertex.size()) / vertices; }
};

/// The force on vertex v is the sum over from[ptr[v] .. ptr[v + 1]), each e * n + a.
struct ForceList {
  std::vector<std::int32_t> ptr, from;
};
/// @param failed  a mark for each element: those that have one are left out; empty: none has. Here and below
/// @pre elements * n < 2^31; vertices in range
ForceList make_force_list(const Connectivity& c, Index vertices, std::span<const char> failed = {});

/// Pairs of vertices that share an element, by columns: rows of column b are ind[ptr[b] .. ptr[b + 1]), sorted.
/// The pattern is symmetric and holds the diagonal.
struct VertexPattern {
  std::vector<Offset> ptr;
  std::vector<Index> ind;
  [[nodiscard]] Index columns() const { return static_cast<Index>(ptr.size()) - 1; }
  /// Position of (row, column) in ind. @throws std::logic_error when the pair shares no element
  [[nodiscard]] Offset entry(Index row, Index column) const;
};

/// An unordered pair of vertices: row <= column. Its block of a matrix stands at `entry` of the VertexPattern, the
/// block of (column, row) at `mirror`; both are the same where row is column.
struct VertexPair {
  Index row, column;
  std::int32_t entry, mirror;
};

/// Which blocks of the elements first .. last - 1 add up to the blocks of a matrix. Pair p is the sum over from[ptr[p]
/// .. ptr[p + 1]), each (e - first) << 10 | a << 5 | b: block (a, b) of element e.
struct PairList {
  Index first = 0, last = 0;
  std::vector<VertexPair> pair;
  std::vector<std::int32_t> ptr, from;
};
inline constexpr Index kMostElementsOfList = Index{1} << 21;
/// @pre last - first <= kMostElementsOfList, n <= 32
PairList make_pair_list(const Connectivity& c, const VertexPattern& pattern, Index first, Index last,
                        std::span<const char> failed = {});

/// Element and local vertices of a number of PairList::from.
struct BlockSource {
  std::int32_t element;
  int a, b;
  explicit BlockSource(std::int32_t code) : element(code >> 10), a(code >> 5 & 31), b(code & 31) {}
};

/// sum += the forces on vertex v in the order of the list; `buffer` as `layout` says.
inline void sum_forces(const ForceList& list, const ResultLayout& layout, const double* buffer, Index v, double* sum) {
  const auto n = static_cast<std::int32_t>(layout.vertices());
  for (std::int32_t k = list.ptr[at(v)]; k < list.ptr[at(v) + 1]; ++k) {
    const std::int32_t from = list.from[at(k)];
    const double* f = buffer + layout.force(from / n, from % n);
    for (int i = 0; i < 3; ++i) sum[i] += f[i * layout.lanes()];
  }
}

/// block[j][i] += entry (i, j) of the block of pair p, transposed[i][j] += entry (j, i) of the block of (column, row).
/// A symmetric buffer holds the blocks a <= b of each element alone.
inline void sum_blocks(const PairList& list, const ResultLayout& layout, const double* buffer, bool symmetric,
                       std::int32_t p, double (&block)[3][3], double (&transposed)[3][3]) {
  const std::int64_t down = 1, right = layout.forces();
  for (std::int32_t k = list.ptr[at(p)]; k < list.ptr[at(p) + 1]; ++k) {
    const BlockSource s(list.from[at(k)]);
    const bool turned = symmetric && s.a > s.b;
    const double* x = buffer + (turned ? layout.block(s.element, s.b, s.a) : layout.block(s.element, s.a, s.b));
    const double* y = symmetric ? x : buffer + layout.block(s.element, s.b, s.a);
    const std::int64_t i_step = turned ? right : down, j_step = turned ? down : right;        // in x
    const std::int64_t row = symmetric ? j_step : down, column = symmetric ? i_step : right;  // in y
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) {
        block[j][i] += x[i * i_step + j * j_step];
        transposed[i][j] += y[j * row + i * column];
      }
  }
}

}  // namespace espalier::dynamics
