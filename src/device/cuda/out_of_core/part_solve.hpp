/// \file
/// A GPU's part in a solve with a factor out of core: the fronts whose factors stay in its memory, and sub-trees below
/// them whose factors it reads from the host's store. Needs the CUDA runtime.
#pragma once

#include <cuda_runtime_api.h>

#include <optional>
#include <vector>

#include "base/thread_pool.hpp"
#include "device/cuda/kernels/solve/solve_kernel.cuh"
#include "device/cuda/out_of_core/part_tables.hpp"
#include "device/cuda/out_of_core/store_solve.hpp"
#include "device/cuda/runtime/device_memory.hpp"
#include "device/cuda/runtime/table_upload.hpp"
#include "out_of_core/plan.hpp"

namespace espalier::device::cuda {

/// What PartSolve works with; all outlive it.
struct PartContext {
  const plan::Plan& plan;
  const OutOfCoreTables& tables;
  const out_of_core::OutOfCorePlan& places;
  Kind kind;
  std::byte* arena;
  cudaStream_t stream;
  base::ThreadPool& pool;  ///< its threads fill what is sent, and take what comes
  double patience_seconds;
};

/// The kernels of the solve in core, on parts of their lists: the streamed fronts' way up beside the host's, then the
/// resident ones' ways up and down, then the streamed ones' way down beside the host's.
template <class T>
class PartSolve final : public Companion<T> {
 public:
  /// @pre the device is current, as for all that follows
  explicit PartSolve(const PartContext& context);

  /// After a factorization: the memory of the solve holds nothing.
  void forget() { ready_ = false; }
  /// Before a solve. Sends the tables where they are not there.
  /// @param store  pinned memory that the device reads by this address: the streamed fronts are done, too; null: they
  ///               are left to the host
  /// @param inverse_d, inverse_e  n (ldlt)
  /// @returns the fronts that it does
  const std::vector<Index>& prepare(const T* store, const std::vector<T>& inverse_d, const std::vector<T>& inverse_e);

  void start(const T* x, Index columns, bool transpose) override;
  void turn(T* x, const T* updates, Index columns) override;
  void finish(T* x, Index columns) override;
  [[nodiscard]] Index most_columns() const override { return context_.places.solve_columns; }

 private:
  void make_tables(bool with_store);
  void send_tables(const T* store, const std::vector<T>& inverse_d, const std::vector<T>& inverse_e);
  [[nodiscard]] std::byte* memory() const { return context_.arena + context_.places.solve_at; }
  void copy(void* to, const void* from, Offset bytes, cudaMemcpyKind kind);
  void fill(Offset at, int byte, Offset bytes);
  void launch(const PartTables::Tasks& tasks, bool up, bool down);
  void wait();
  /// use(front, its first row of x) for each front of the part, by all threads.
  template <class Use>
  void over_fronts(Use&& use) const;
  /// Pinned memory for so many rows of vectors, whatever is in it. Nothing is being copied there.
  T* stage(Offset rows);
  void fetch(T* x, Index columns, bool resident);

  PartContext context_;
  SolveLaunches shape_;
  std::optional<PartTables> tables_;  // made as they will be needed when the store is pinned
  bool with_store_ = false;           // of tables_
  bool ready_ = false;
  PartPlaces at_;
  Index columns_ = 0;  // of a row of the vectors: 1, or a multiple of kSlab
  bool transpose_ = false;
  TableUpload uploads_;
  PinnedArray<T> staged_;
};

}  // namespace espalier::device::cuda
