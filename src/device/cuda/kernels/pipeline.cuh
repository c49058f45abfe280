/// \file
/// Operands stream through shared memory by bulk copies: a ring of stages, and the warp that fills it.
#pragma once

#include "device/cuda/kernels/fragments.cuh"

namespace espalier::device::cuda {

/// Front::chunk_offset() for tile columns of a width that the compiler knows.
template <int Width>
__device__ inline std::int64_t chunk_offset(int total_pad, int chunk, int row) {
  constexpr int kPerTile = Width / kChunk;
  const int j = chunk / kPerTile, height = total_pad - j * Width;
  return (static_cast<std::int64_t>(j) * total_pad - static_cast<std::int64_t>(Width) * j * (j - 1) / 2) * Width +
         (static_cast<std::int64_t>(chunk % kPerTile) * height + (row - j * Width)) * kChunk;
}

/// Where one operand comes from: chunk q starts at base + front.chunk_offset(q, row).
template <class T>
struct Operand {
  const T* base;
  int row;   ///< padded row of the front, a multiple of 16
  int rows;  ///< a multiple of 16
};

/// The pipeline of stages in shared memory. `phases` holds one parity bit per barrier and lives across tasks.
template <class T>
struct Pipeline {
  T* stages;
  std::uint64_t* barriers;
  int depth;  ///< stages
  unsigned phases;
  unsigned* waited = nullptr;  ///< nanoseconds that the task has waited so far; written by one lane

  __device__ void wait(int stage) {
    barrier_wait(barriers + stage, phases >> stage & 1);
    phases ^= 1u << stage;
  }
};

/// A sum of products of chunks of two operands, and when they may be read.
template <class T>
struct ChunkSum {
  const Front* front;
  Operand<T> a, b;
  bool same;   ///< A and B are the same rows of the same array
  int chunks;  ///< of the sum
  /// Flags of (row block of A, column 0) and (row block of B, column 0); those of the next tile column follow
  /// `flag_stride` later.
  const int* flag_a;
  const int* flag_b;
  int flag_stride;
  int first = 0;  ///< chunk of both operands with which the sum begins, the first one of a tile column
};

/// Copies chunks into the stages, each as soon as the flags of its tile column are set. One warp has it.
template <class T, class S>
class ChunkLoader {
 public:
  __device__ ChunkLoader(const ChunkSum<T>& sum, const Pipeline<T>& pipe, int* control, std::uint64_t patience)
      : sum_(sum),
        pipe_(pipe),
        control_(control),
        patience_(patience),
        columns_((sum.chunks + kPerTile - 1) / kPerTile),
        lane_(static_cast<int>(threadIdx.x) & 31),
        bytes_(bytes_of_a() + bytes_of_b()),
        a_(sum.a.base + static_cast<std::int64_t>(sum.a.row) * kChunk + chunk_offset<S::kWidth>(pad(), sum.first, 0)),
        b_(sum.b.base + static_cast<std::int64_t>(sum.b.row) * kChunk + chunk_offset<S::kWidth>(pad(), sum.first, 0)),
        height_(pad() - sum.first / kPerTile * S::kWidth) {}

  /// Has chunk `wanted` on its way, and as many more as there is room for when those before `done` have been used.
  __device__ void issue(int wanted, int done) {
    while (issued_ < sum_.chunks && issued_ < done + pipe_.depth && finished(issued_ / kPerTile, issued_ <= wanted)) {
      if (lane_ == 0) {
        barrier_expect(pipe_.barriers + stage_, bytes_);
        copy(0, stage_, pipe_.barriers + stage_);
      }
      advance<1>();
      ++issued_;
      stage_ = stage_ + 1 == pipe_.depth ? 0 : stage_ + 1;
    }
  }
  /// The same for groups of `Together` chunks, of which the ring has room for `rounds`; each completes on the barrier
  /// of its first chunk.
  template <int Together>
  __device__ void issue_groups(int wanted, int done, int rounds) {
    static_assert(kPerTile % Together == 0);
    const int groups = (sum_.chunks + Together - 1) / Together;
    while (issued_ < groups && issued_ < done + rounds && finished(issued_ * Together / kPerTile, issued_ <= wanted)) {
      const int count = min(Together, sum_.chunks - issued_ * Together), stage = stage_ * Together;
      if (lane_ == 0) barrier_expect(pipe_.barriers + stage, count * bytes_);
      __syncwarp();
      if (lane_ < count) copy(lane_, stage + lane_, pipe_.barriers + stage);
      advance<Together>();
      ++issued_;
      stage_ = stage_ + 1 == rounds ? 0 : stage_ + 1;
    }
  }

 private:
  static constexpr int kPerTile = S::kWidth / kChunk;  // f.width == S::kWidth

  // How many tile columns are finished from the left.
  __device__ void poll() {
    int now = ready_ + lane_ < columns_;
    if (now) {
      const std::int64_t k = static_cast<std::int64_t>(ready_ + lane_) * sum_.flag_stride;
      now = load_acquire(sum_.flag_a + k) != 0 && (sum_.flag_a == sum_.flag_b || load_acquire(sum_.flag_b + k) != 0);
    }
    const unsigned mask = __ballot_sync(0xffffffffu, now);
    ready_ += mask == 0xffffffffu ? 32 : __ffs(~mask) - 1;
    __syncwarp();
    fence_global();
  }
  // Whether the tile column is finished; waits for one that it `must` have.
  __device__ bool finished(int column, bool must) {
    std::uint64_t start = 0;
    while (column >= ready_) {
      poll();
      if (column < ready_) break;
      if (!must) return false;
      const std::uint64_t now = global_nanoseconds();
      if (start == 0) start = now;
      if (now - start > patience_) atomicExch(control_ + kAborted, 1);
      if (now - start > 20000 && aborted(control_)) ready_ = columns_;
    }
    if (start != 0 && lane_ == 0 && pipe_.waited != nullptr)
      *pipe_.waited += static_cast<unsigned>(global_nanoseconds() - start);
    return true;
  }
  [[nodiscard]] __device__ unsigned bytes_of_a() const { return sum_.a.rows * kChunk * sizeof(T); }
  [[nodiscard]] __device__ unsigned bytes_of_b() const { return sum_.same ? 0 : sum_.b.rows * kChunk * sizeof(T); }
  [[nodiscard]] __device__ int pad() const { return sum_.front->total_pad; }
  // Chunk `ahead` of those that come next, in one tile column.
  __device__ void copy(int ahead, int stage, std::uint64_t* bar) {
    T* to = pipe_.stages + stage * S::kStage;
    const int from = ahead * height_ * kChunk;
    bulk_copy(to, a_ + from, bytes_of_a(), bar);
    if (!sum_.same) bulk_copy(to + S::kRows * kChunk, b_ + from, bytes_of_b(), bar);
  }
  // Tile columns become shorter by their width, and so does the way from their first row to any other one. Step by
  // step: everybody waits for the warp that computes where to read.
  template <int Chunks>
  __device__ void advance() {
    std::int64_t step = static_cast<std::int64_t>(Chunks * kChunk) * height_;
    in_tile_ += Chunks;
    if (in_tile_ == kPerTile) {
      in_tile_ = 0;
      height_ -= S::kWidth;
      step -= S::kWidth * kChunk;
    }
    a_ += step;
    b_ += step;
  }

  const ChunkSum<T>& sum_;
  const Pipeline<T>& pipe_;
  int* control_;
  std::uint64_t patience_;
  int columns_, lane_;
  unsigned bytes_;              // of a chunk
  const T *a_, *b_;             // the next chunk's rows
  int height_;                  // of its tile column
  int in_tile_ = 0;             // chunks of that tile column before it
  int issued_ = 0, stage_ = 0;  // chunks and their stages, or groups
  int ready_ = 0;               // tile columns, from the left
};

}  // namespace espalier::device::cuda
