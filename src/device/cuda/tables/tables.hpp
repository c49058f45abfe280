/// \file
/// What the kernels know of a plan: plain tables, the same on host and device. All offsets are in elements, 0-based.
///
/// A front is seen *padded*: its pivots fill rows 0 .. pivot_pad-1, its rows below pivot_pad .. total_pad-1, both
/// rounded up to whole groups of 16 (padding is zero, but for ones on the diagonal of pivot tiles). Columns are cut
/// into *tile columns* of `width`; the rows of the pivots and the rows below are each cut into *row blocks* of 128. A
/// task makes the part of one row block that lies in one tile column, or in two neighbouring ones.
///
/// Fronts belong to *regions* of memory, each of which is contiguous, on whatever device: the kernels get a table
/// of their bases, and the offsets in a Front count from the base of its region.
///
/// Factor array of a front: tile column j < pivot_tiles holds the rows from its first column's on, height
/// H_j = total_pad - j * width, as chunks of 16 columns; a chunk is a sequence of panels of 8 rows, a panel 128
/// elements in the order in which a warp's lanes hold the operands of a tensor-core product (see fragment_offset()).
/// The diagonal tile holds inverse(L) P (llt: inverse(L)); see Front::inverted, too.
///
/// Contribution array: tile column b of the rows below holds the rows from its first column's on, column-major, with
/// below_ld - b * width rows.
///
/// Several devices: region 0 is the top of the tree. Each device has a copy of it, laid out alike, with the factors of
/// the fronts that it is a member of: who makes a block of L stores it into the copies of the other members. Tile
/// columns of contributions of the top lie with their makers, where the readers fetch them.
#pragma once

#include <cstdint>

#ifdef __CUDACC__
#define ESPALIER_BOTH __host__ __device__
#else
#define ESPALIER_BOTH
#endif

namespace espalier::device::cuda {

inline constexpr int kThreads = 128;    ///< of every block of the persistent kernels
inline constexpr int kRowBlock = 128;   ///< rows of a row block
inline constexpr int kSmallRows = 512;  ///< most padded rows of a front that one block of the solve takes whole
inline constexpr int kChunk = 16;       ///< columns of a chunk, rows of a padding unit
inline constexpr int kPanel = 8;        ///< rows of a panel
inline constexpr int kMostDevices = 16;

/// Place of (row 0..7, column 0..15) in a panel: lane (row * 4 + column % 4) holds the columns that leave the same
/// remainder, two by two in one 16-byte word.
ESPALIER_BOTH constexpr int fragment_offset(int row, int col) {
  return (col >> 3) * 64 + (row * 4 + (col & 3)) * 2 + (col >> 2 & 1);
}

struct Front {
  std::int64_t factor = 0;           ///< L
  std::int64_t second = 0;           ///< U^T (lu) or L D (ldlt, tiled fronts)
  std::int64_t contribution = 0;     ///< lower part
  std::int64_t contribution_up = 0;  ///< transposed upper part (lu)
  std::int64_t rows = 0;             ///< place of the first row below in Tables::rows, relative and the solve's updates
  std::int64_t tile0 = 0;            ///< the front's first tile in Plan::entry_ptr
  std::int64_t flag0 = 0;            ///< the front's first flag
  std::int32_t pivots = 0;
  std::int32_t below = 0;
  std::int32_t width = 0;
  std::int32_t width_log2 = 0;
  std::int32_t pivot_pad = 0;
  std::int32_t total_pad = 0;
  std::int32_t below_ld = 0;
  std::int32_t position = 0;  ///< of the first pivot in the elimination order
  std::int32_t pivot_tiles = 0;
  std::int32_t tiles = 0;         ///< pivot_tiles + tile columns below
  std::int32_t pivot_blocks = 0;  ///< row blocks of the pivots
  std::int32_t blocks = 0;        ///< pivot_blocks + row blocks of the rows below
  std::int32_t link_begin = 0, link_end = 0;
  std::int32_t wait_begin = 0, wait_end = 0;
  std::int32_t tasks = 0;  ///< tasks of the front: it is finished when so many are done
  std::int32_t whole = 0;
  std::int32_t region = 0;    ///< the four arrays start at their offsets from the base of this region
  std::uint16_t members = 0;  ///< bit d: device d has the front's factor after the factorization
  std::uint16_t readers = 0;  ///< bit d: device d gathers from the front's contribution
  /// In the top of several devices: the front's first entry in the table of places of tile columns below, whose second
  /// half (lu) is for contribution_up; -1: contributions stand in the region.
  std::int32_t first_place = 0;
  /// Pivot columns whose inverse the solve finds joined: `width`, or kRowBlock where inverses of tiles were put
  /// together after the factorization (block_inverse.hpp).
  std::int32_t inverted = 0;

  /// What its tasks would gather stands in their places already (link_begin is negative then).
  [[nodiscard]] ESPALIER_BOTH bool in_place() const { return link_begin < 0; }
  /// First padded row of tile column j.
  [[nodiscard]] ESPALIER_BOTH int column_begin(int j) const {
    return j < pivot_tiles ? j * width : pivot_pad + (j - pivot_tiles) * width;
  }
  /// Padded row after the last of tile column j.
  [[nodiscard]] ESPALIER_BOTH int column_end(int j) const {
    const int end = column_begin(j) + width;
    const int limit = j < pivot_tiles ? pivot_pad : total_pad;
    return end < limit ? end : limit;
  }
  [[nodiscard]] ESPALIER_BOTH int block_begin(int a) const {
    return a < pivot_blocks ? a * kRowBlock : pivot_pad + (a - pivot_blocks) * kRowBlock;
  }
  [[nodiscard]] ESPALIER_BOTH int block_end(int a) const {
    const int end = block_begin(a) + kRowBlock;
    const int limit = a < pivot_blocks ? pivot_pad : total_pad;
    return end < limit ? end : limit;
  }
  [[nodiscard]] ESPALIER_BOTH int block_of_column(int j) const {
    return j < pivot_tiles ? j * width / kRowBlock : pivot_blocks + (j - pivot_tiles) * width / kRowBlock;
  }
  /// Start of pivot tile column j in the factor array.
  [[nodiscard]] ESPALIER_BOTH std::int64_t column_offset(int j) const {
    return static_cast<std::int64_t>(width) *
           (static_cast<std::int64_t>(j) * total_pad - static_cast<std::int64_t>(width) * j * (j - 1) / 2);
  }
  /// Element (padded row r, column 16 * chunk) of the factor array; r a multiple of 8, in tile column j or below.
  [[nodiscard]] ESPALIER_BOTH std::int64_t chunk_offset(int chunk, int r) const {
    const int per_tile = width / kChunk;
    const int j = pivot_tiles == 1 ? 0 : chunk / per_tile;
    const std::int64_t height = total_pad - j * width;
    return column_offset(j) + (chunk - j * per_tile) * height * kChunk +
           static_cast<std::int64_t>(r - j * width) * kChunk;
  }
  /// Element (r, c) of the contribution, 0-based among the rows below, r >= first column of c's tile column.
  [[nodiscard]] ESPALIER_BOTH std::int64_t contribution_offset(int r, int c) const {
    const int b = c / width;
    const std::int64_t first = static_cast<std::int64_t>(b) * width;
    return width * (static_cast<std::int64_t>(b) * below_ld - static_cast<std::int64_t>(width) * b * (b - 1) / 2) +
           (c - first) * (below_ld - first) + (r - first);
  }
  [[nodiscard]] ESPALIER_BOTH std::int64_t factor_size() const {
    if (pivot_tiles == 0) return 0;
    const int j = pivot_tiles - 1;
    return column_offset(j) + static_cast<std::int64_t>(pivot_pad - j * width) * (total_pad - j * width);
  }
  [[nodiscard]] ESPALIER_BOTH std::int64_t contribution_size() const {
    const int b = tiles - pivot_tiles - 1;
    if (b < 0) return 0;
    const std::int64_t first = static_cast<std::int64_t>(b) * width;
    return width * (static_cast<std::int64_t>(b) * below_ld - static_cast<std::int64_t>(width) * b * (b - 1) / 2) +
           (below - first) * (below_ld - first);
  }
  /// Place of tile column b of the rows below (part 1: of the transposed upper part) in the table of places.
  [[nodiscard]] ESPALIER_BOTH std::int64_t place(int b, int part) const {
    return static_cast<std::int64_t>(first_place) + part * (tiles - pivot_tiles) + b;
  }
  /// Flag of (row block a, tile column j): set when its task is done.
  [[nodiscard]] ESPALIER_BOTH std::int64_t flag(int a, int j) const {
    return flag0 + static_cast<std::int64_t>(j) * blocks + a;
  }
  /// Flag of the diagonal tile of pivot column j.
  [[nodiscard]] ESPALIER_BOTH std::int64_t diagonal_flag(int j) const {
    return flag0 + static_cast<std::int64_t>(tiles) * blocks + j;
  }
  [[nodiscard]] ESPALIER_BOTH std::int64_t flags() const {
    return static_cast<std::int64_t>(tiles) * blocks + pivot_tiles;
  }
};

/// A child as its parent sees it: bounds[bound + i], i = 0 .. parent's tiles, is the first of the child's rows below
/// (0-based) that falls into the parent's tile row i or a later one.
struct ChildRows {
  std::int32_t child = 0;
  std::int32_t pad = 0;
  std::int64_t bound = 0;
};

enum class Work : std::int8_t {
  whole,       ///< a small front
  diagonal,    ///< the diagonal tile of a pivot column
  block,       ///< a row block's part of a tile column
  two_columns  ///< a row block's parts of tile columns `column` and `column` + 1, both of which end above it
};

/// One unit of work of the factorization. `part` 1: the block of U^T (lu).
struct FactorTask {
  std::int32_t front = 0;
  Work work = Work::whole;
  std::int8_t part = 0;
  std::uint16_t region = 0;  ///< of the front
  std::int32_t block = 0;
  std::int32_t column = 0;
};

/// One unit of work of a solve: row block `block` of a front going up the tree (-1: all rows of a front that fit into
/// one), pivot row block `block` coming down (-1 - block where nothing has gone up there: see PathTasks).
struct SolveTask {
  std::int32_t front = 0;
  std::int32_t block = 0;
};

/// What a front is to a solve that passes some fronts alone.
enum PathMark : unsigned char {
  kPathUp = 1,   ///< entries that are not zero reach it
  kPathDown = 2  ///< it leads to a wanted unknown
};

}  // namespace espalier::device::cuda
