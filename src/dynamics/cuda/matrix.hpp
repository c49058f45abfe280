/// \file
/// The matrix K of Newton's steps on a GPU. For this folder alone: needs the CUDA runtime.
#pragma once

#include "dynamics/cuda/arrays.hpp"
#include "dynamics/device/device_assembly.hpp"

namespace espalier::dynamics::cuda {

class CudaMatrix final : public DeviceMatrix {
 public:
  CudaMatrix(const DeviceMatrixLayout& layout, Gpu& gpu);
  double* clear() override;
  void add_from_host(const Fill& fill) override;
  void column_sizes(Span diagonal, Span largest) override;
  const double* complete(ConstSpan scale, ConstSpan rest) override;
  void set_scale(ConstSpan scale) override;
  void fetch_w(Span values) const override;
  void sum_rows(ConstSpan x, Span out) const override;
  std::unique_ptr<DeviceVectors> make_vectors() override;
  [[nodiscard]] void* stream() const override { return gpu_.stream.get(); }

 private:
  Gpu& gpu_;
  Offset columns_, size_;              // of W and K
  Offset unknowns_;                    // of K
  Offset room_;                        // numbers of from_host_
  DeviceArray<Offset> k_ptr_, w_ptr_;  // by columns of W
  DeviceArray<Index> w_ind_;
  DeviceArray<Offset> w_of_host_, rest_;
  DeviceArray<double> values_, sizes_, scale_, from_host_;
};

}  // namespace espalier::dynamics::cuda
