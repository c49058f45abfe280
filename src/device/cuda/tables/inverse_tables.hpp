/// \file
/// Entries of an inverse on a GPU: which fronts are made together, where their inverses stand meanwhile, and the tasks
/// of each launch. What a task reads and writes is told here, so that kernels and tests agree.
///
/// The inverse Z of a front is a full square of padded rows and columns: chunks of 16 columns, each a sequence of
/// panels as in the factor array (tables.hpp). With it, of lu, goes its transpose, `across`. A *block* is the pivots
/// whose inverse the factor holds in one piece (Front::inverted). For block J with the rows I after it,
///
///   G = L_IJ M (J),  H = V^T U_JI,  Z_IJ = -Z_II G,  Z_JI = -H Z_II,  Z_JJ = V^T M - H Z_IJ,
///
/// where M is what stands in the diagonal of the first factor array, and V in that of the second one (lu); of symmetric
/// matrices V = D^-1 M, and H = G^T. See device/host/inverse_front.hpp.
#pragma once

#include <span>
#include <vector>

#include "device/cuda/tables/tables.hpp"
#include "espalier/types.hpp"
#include "plan/plan.hpp"

namespace espalier::device::cuda {

enum class InverseWork : std::int8_t {
  bring,     ///< the factors of fronts; has fronts for tasks
  gather,    ///< rows and columns below the pivots, from the parent
  begin,     ///< transposed inverses of a block
  solve,     ///< G, H
  multiply,  ///< Z_IJ and Z_JI
  diagonal,  ///< Z_JJ
  read       ///< entries that are asked for; has fronts for tasks
};

/// Rows and columns of what a task of a product makes, by InverseLaunch::shape.
inline constexpr int kInverseRows[] = {32, 64, 128};
inline constexpr int kInverseCols[] = {32, 64, 64};
inline constexpr int kInverseShapes = 3;
inline constexpr int kGatherRows = 256;  ///< of a chunk that a task gathers

/// One block of threads. row, col: first ones, in the front (gather, and what runs over I) or in the block.
struct InverseTask {
  std::int32_t front = 0;  ///< place among the fronts that are made
  std::int32_t block = 0;
  std::int32_t row = 0, col = 0;
  std::int32_t part = 0;  ///< lu: 1 for H and Z_JI
};

struct InverseLaunch {
  InverseWork work = InverseWork::gather;
  int shape = 0;
  Offset begin = 0, end = 0;  ///< of the tasks
};

/// A front that is made. Arrays of the factor lie where the factorization has left them; all others in the stack.
template <class T>
struct InverseFrontOf {
  Front front;
  std::int32_t parent = -1;  ///< place among the fronts that are made
  const T* factor = nullptr;
  const T* second = nullptr;  ///< lu
  T* z = nullptr;
  T* across = nullptr;  ///< of symmetric matrices: z
  T* g = nullptr;       ///< by blocks: G^T, a row for each pivot of the block
  T* h = nullptr;       ///< H likewise; of symmetric matrices: g
  T* m = nullptr;       ///< by blocks: M^T
  T* v = nullptr;       ///< V^T; of llt: m

  [[nodiscard]] ESPALIER_BOTH int begin_of(int block) const { return block * front.inverted; }
  [[nodiscard]] ESPALIER_BOTH int end_of(int block) const {
    const int end = begin_of(block) + front.inverted;
    return end < front.pivot_pad ? end : front.pivot_pad;
  }
  [[nodiscard]] ESPALIER_BOTH int widest() const {
    return front.inverted < front.pivot_pad ? front.inverted : front.pivot_pad;
  }
};

/// Element of an array in chunks of `rows` rows; all begin with row and column 0.
ESPALIER_BOTH inline std::int64_t chunked(int rows, int row, int col) {
  return static_cast<std::int64_t>(col >> 4) * rows * kChunk + static_cast<std::int64_t>(row >> 3) * 128 +
         fragment_offset(row & 7, col & 15);
}

/// A B^T, a sum over chunks of both. Rows of A and rows of B are those of the task's part of the product.
template <class T>
struct InverseProduct {
  const T* a = nullptr;
  std::int64_t stride_a = 0;
  const T* b = nullptr;
  std::int64_t stride_b = 0;
  const Front* tiled = nullptr;  ///< B is rows from `row_b` on of a factor array at b, from chunk first_b on
  int first_b = 0, row_b = 0;
  int rows = 0, cols = 0, chunks = 0;

  [[nodiscard]] ESPALIER_BOTH const T* chunk_a(int q) const { return a + q * stride_a; }
  [[nodiscard]] ESPALIER_BOTH const T* chunk_b(int q) const {
    return tiled != nullptr ? b + tiled->chunk_offset(first_b + q, row_b) : b + q * stride_b;
  }
};

ESPALIER_BOTH inline int inverse_least(int a, int b) { return a < b ? a : b; }

/// G^T = M^T L_IJ^T, or H = V^T U_JI. rows, cols: what the shape has room for
template <class T>
ESPALIER_BOTH InverseProduct<T> product_of_solve(const InverseFrontOf<T>& x, const InverseTask& task, int rows,
                                                 int cols) {
  const int col = x.begin_of(task.block), w = x.end_of(task.block) - col;
  InverseProduct<T> p;
  p.a = (task.part == 0 ? x.m : x.v) + static_cast<std::int64_t>(col) * x.widest() + task.row * kChunk;
  p.stride_a = static_cast<std::int64_t>(w) * kChunk;
  p.b = task.part == 0 ? x.factor : x.second;
  p.tiled = &x.front;
  p.first_b = col / kChunk;
  p.row_b = task.col;
  p.rows = inverse_least(rows, w - task.row);
  p.cols = inverse_least(cols, x.front.total_pad - task.col);
  p.chunks = w / kChunk;
  return p;
}
/// Where it goes: G^T or H of a block, with stride w * kChunk from chunk to chunk.
template <class T>
ESPALIER_BOTH T* rows_of_block(const InverseFrontOf<T>& x, int block, int part) {
  return (part == 0 ? x.g : x.h) + static_cast<std::int64_t>(x.begin_of(block)) * x.front.total_pad;
}

/// Z_II G, or Z_II^T H^T.
template <class T>
ESPALIER_BOTH InverseProduct<T> product_of_multiply(const InverseFrontOf<T>& x, const InverseTask& task, int rows,
                                                    int cols) {
  const int end = x.end_of(task.block), w = end - x.begin_of(task.block), pad = x.front.total_pad;
  InverseProduct<T> p;
  p.stride_a = static_cast<std::int64_t>(pad) * kChunk;
  p.a = (task.part == 0 ? x.z : x.across) + end / kChunk * p.stride_a + static_cast<std::int64_t>(task.row) * kChunk;
  p.stride_b = static_cast<std::int64_t>(w) * kChunk;
  p.b = rows_of_block(x, task.block, task.part) + task.col * kChunk;
  p.rows = inverse_least(rows, pad - task.row);
  p.cols = inverse_least(cols, w - task.col);
  p.chunks = (pad - end) / kChunk;
  return p;
}

/// H Z_IJ, to be subtracted.
template <class T>
ESPALIER_BOTH InverseProduct<T> product_of_diagonal(const InverseFrontOf<T>& x, const InverseTask& task, int rows,
                                                    int cols) {
  const int col = x.begin_of(task.block), end = x.end_of(task.block), w = end - col, pad = x.front.total_pad;
  InverseProduct<T> p;
  p.stride_a = static_cast<std::int64_t>(w) * kChunk;
  p.a = rows_of_block(x, task.block, 1) + task.row * kChunk;
  p.stride_b = static_cast<std::int64_t>(pad) * kChunk;
  p.b = x.across + end / kChunk * p.stride_b + static_cast<std::int64_t>(col + task.col) * kChunk;
  p.rows = inverse_least(rows, w - task.row);
  p.cols = inverse_least(cols, w - task.col);
  p.chunks = (pad - end) / kChunk;
  return p;
}
/// V^T M.
template <class T>
ESPALIER_BOTH InverseProduct<T> product_of_inverses(const InverseFrontOf<T>& x, const InverseTask& task, int rows,
                                                    int cols) {
  const int col = x.begin_of(task.block), w = x.end_of(task.block) - col;
  InverseProduct<T> p;
  p.stride_a = p.stride_b = static_cast<std::int64_t>(w) * kChunk;
  p.a = x.v + static_cast<std::int64_t>(col) * x.widest() + task.row * kChunk;
  p.b = x.m + static_cast<std::int64_t>(col) * x.widest() + task.col * kChunk;
  p.rows = inverse_least(rows, w - task.row);
  p.cols = inverse_least(cols, w - task.col);
  p.chunks = w / kChunk;
  return p;
}

/// Element (row, col) of M or V of a block as a factor array holds it, 0-based in the block; zero where nothing stands,
/// and in the padding.
template <class T>
ESPALIER_BOTH T inverse_element(const InverseFrontOf<T>& x, const T* array, int block, int row, int col,
                                bool triangular) {
  const Front& f = x.front;
  const int r = x.begin_of(block) + row, c = x.begin_of(block) + col;
  if (r >= f.pivots || c >= f.pivots || (triangular && r < c)) return T(0);
  if (f.pivot_tiles > 1 && r < c / f.width * f.width) return T(0);
  return array[f.chunk_offset(c / kChunk, r / kPanel * kPanel) + fragment_offset(r % kPanel, c % kChunk)];
}

/// The same tables of V. d, e: FactorState::inverse_d and inverse_e (ldlt)
template <class T>
ESPALIER_BOTH T second_element(const InverseFrontOf<T>& x, Kind kind, const T* d, const T* e, int block, int row,
                               int col) {
  if (kind == Kind::llt) return inverse_element(x, x.factor, block, row, col, true);
  if (kind == Kind::lu) return inverse_element(x, x.second, block, row, col, true);
  const Front& f = x.front;
  const int r = x.begin_of(block) + row;
  if (r >= f.pivots) return T(0);
  const std::int64_t k = static_cast<std::int64_t>(f.position) + r;
  T v = d[k] * inverse_element(x, x.factor, block, row, col, false);
  const T next = r + 1 < x.end_of(block) ? e[k] : T(0), before = row > 0 ? e[k - 1] : T(0);
  if (next != T(0)) v += next * inverse_element(x, x.factor, block, row + 1, col, false);
  if (before != T(0)) v += before * inverse_element(x, x.factor, block, row - 1, col, false);
  return v;
}

/// Row of the parent, padded, in which row r (padded) below the pivots of a front stands; -1: padding.
/// @param relative  Plan::relative
ESPALIER_BOTH inline int row_of_parent(const Front& f, const Front& parent, const std::int32_t* relative, int r) {
  if (r - f.pivot_pad >= f.below) return -1;
  const int row = relative[f.rows + r - f.pivot_pad];
  return row < parent.pivots ? row : row - parent.pivots + parent.pivot_pad;
}

/// Which arrays there are.
struct InverseKind {
  Kind kind = Kind::llt;
  std::span<const char> staged = {};  ///< fronts; not 0: its factor is brought to the stack. Empty: none is
};

/// All launches, in their order, and where they work: places in a stack of elements that holds the way from the roots.
struct InverseTables {
  struct Spot {
    Index front = 0;
    std::int32_t parent = -1;  ///< place in the list
    Offset z = 0, across = 0, g = 0, h = 0, m = 0, v = 0, factor = 0, second = 0;
  };
  std::vector<Spot> spots;  ///< in the order in which they are made
  std::vector<InverseTask> tasks;
  std::vector<InverseLaunch> launches;
  Offset stack = 0;  ///< elements
};

/// @param needed  fronts; not 0: it is made. With a front those above it
/// @param room  elements that the stack may take. The less there is, the fewer fronts are made together
/// @throws Error(out_of_memory) naming the elements that are needed, times `element` bytes
InverseTables make_inverse_tables(const plan::Plan& plan, std::span<const Front> fronts, InverseKind kind,
                                  std::span<const char> needed, Offset room, Offset element);

}  // namespace espalier::device::cuda
