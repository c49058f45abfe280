/// \file
/// Right-hand sides and solutions of K on a GPU. For this folder alone: needs the CUDA runtime.
#pragma once

#include "dynamics/cuda/arrays.hpp"
#include "dynamics/device/device_vectors.hpp"

namespace espalier::dynamics::cuda {

class CudaVectors final : public DeviceVectors {
 public:
  /// @param scale  the s_i, `size` of them, in the GPU's memory; outlives the object
  CudaVectors(Offset size, const double* scale, Gpu& gpu) : gpu_(gpu), size_(size), scale_(scale) {}
  void solve(Span b, const Solve& solve) override;
  void solve_there(double* b, const Solve& solve) override;
  [[nodiscard]] const double* scale() const override { return scale_; }
  void put_lower(ConstSpan r, double* b) override;
  void make_columns(std::span<const Index> rows, const Solve& solve) override;
  void combine_columns(ConstSpan factors, Span x) override;
  void combine_columns_there(ConstSpan factors, double* x) override;
  void fetch_columns(Span to) override;
  [[nodiscard]] void* stream() const override { return gpu_.stream.get(); }

 private:
  double* room_for(DeviceArray<double>& array, Offset numbers);
  void scale_columns(double* columns, Offset count);

  Gpu& gpu_;
  Offset size_;
  const double* scale_;
  DeviceArray<double> work_;     // right-hand sides on their way, or the sum of the columns
  DeviceArray<double> columns_;  // kept; room for the most that there were
  DeviceArray<double> factors_;
  DeviceArray<Index> rows_;
  Offset kept_ = 0;
};

}  // namespace espalier::dynamics::cuda
