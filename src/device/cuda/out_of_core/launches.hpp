/// \file
/// What a GPU computes out of core: the kernels of every operation, with their arguments. Needs the CUDA runtime.
#pragma once

#include <cuda_runtime_api.h>

#include "device/cuda/kernels/factor/factor_kernel.cuh"
#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "device/cuda/out_of_core/group_kernels.cuh"
#include "device/cuda/out_of_core/layout.hpp"

namespace espalier::device::cuda {

/// Bytes from OutOfCorePlan::shared_at; the arena's address stands before.
inline constexpr Offset kLimitsAt = 64;

/// Operations are enqueued on the CUDA stream that is named; launches on one device are asked for by one thread.
template <class T>
class Launches {
 public:
  /// Chooses launch shapes for the current device.
  /// @param layout, plan, arena  must outlive this
  Launches(const CudaOutOfCoreLayout<T>& layout, const OutOfCoreTables& tables, Kind kind,
           const out_of_core::OutOfCorePlan& plan, std::byte* arena, double patience_seconds);

  /// @param unit  the tables of the operation's unit
  void run(const out_of_core::Operation& op, const UnitTables& unit, cudaStream_t stream);

 private:
  template <class Use>
  void dispatch(const char* name, Use&& use) const;
  void choose_shapes(const OutOfCoreTables& tables);
  template <class Unit>
  [[nodiscard]] FactorState<T> state(const Unit& places) const;
  void clear_scratch(Offset scratch_at);
  void zero(Offset at, Offset elements);
  void launch(const FactorState<T>& s, bool narrow);
  void eliminate(const out_of_core::InCoreStep& step);
  void begin_group(const out_of_core::ColumnGroup& g);
  void add(const out_of_core::ColumnGroup& g, const AddedColumns<T>& part);
  void add_child(const out_of_core::ColumnGroup& g, const out_of_core::Operation& op);
  void update(const out_of_core::ColumnGroup& g, const out_of_core::Operation& op);
  [[nodiscard]] const Front& front(Index f) const { return tables_.device_plan().fronts[static_cast<std::size_t>(f)]; }

  const CudaOutOfCoreLayout<T>& layout_;
  const OutOfCoreTables& tables_;
  Kind kind_;
  const out_of_core::OutOfCorePlan& plan_;
  std::byte* arena_;
  std::uint64_t patience_;            // nanoseconds
  LaunchConfiguration shape_[2];      // narrow, wide
  const UnitTables* unit_ = nullptr;  // of the operation at hand
  cudaStream_t stream_ = nullptr;     // likewise
};

}  // namespace espalier::device::cuda
