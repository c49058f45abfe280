/// \file
/// Forces and tangents of elements on a GPU, one element a thread. For this folder alone: needs the CUDA runtime.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "dynamics/cuda/arrays.hpp"
#include "dynamics/elements/device_law.hpp"

namespace espalier::dynamics::cuda {

/// Elements stand side by side in rows of so many: number k of `numbers` of element e is at [(e / kRow * numbers + k) *
/// kRow + e % kRow].
inline constexpr Index kRow = 32;

/// Elements of one law. All arrays in the GPU's memory; elements that are missing in the last row repeat the last one.
struct ElementsJob {
  DeviceLaw law;
  Index elements;           ///< whole rows
  const double* table;      ///< what upload_table() made
  const double* reference;  ///< 3 of each vertex of an element, in rows; so are position and velocity
  const double* position;
  const double* velocity;  ///< null: zero
  double damping, position_weight, velocity_weight;
  std::int32_t first;      ///< number of the first one among all of the body
  double* force;           ///< like position
  double* tangent;         ///< column by column, in rows; without damping the blocks a <= b alone; null: not wanted
  std::int32_t* inverted;  ///< made the least number of an element that is turned inside out; its results are NaN
};

[[nodiscard]] DeviceArray<double> upload_table(const DeviceLaw& law, Gpu& gpu);
/// Enqueues the kernel.
void launch_elements(const ElementsJob& job, cudaStream_t stream);

}  // namespace espalier::dynamics::cuda
