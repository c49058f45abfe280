/// \file
/// Long vectors of an integrator on a GPU. For this folder alone: needs the CUDA runtime.
#pragma once

#include <array>
#include <vector>

#include "dynamics/cuda/arrays.hpp"
#include "dynamics/dae/system_on_device.hpp"
#include "dynamics/device/device_motion.hpp"

namespace espalier::dynamics::cuda {

class CudaMotion final : public DeviceMotion {
 public:
  CudaMotion(const Sizes& sizes, const MotionDemand& demand, const DeviceShare& share, Gpu& gpu);
  [[nodiscard]] const MotionArrays& arrays() const override { return arrays_; }
  void use_scale(const double* scale) override { arrays_.scale = scale; }
  void turn_past() override;
  void run(const MotionLoop& loop) override;
  [[nodiscard]] MotionRecord measure(const MotionMeasure& what) override;
  void send(ConstSpan from, double* to) override;
  void fetch(const double* from, Span to) override;
  [[nodiscard]] ConstSpan gather(List list, std::span<const double* const> from) override;
  void set(List list, ConstSpan values, double* to) override { scatter(list, values, to, false); }
  void add(List list, ConstSpan values, double* to) override { scatter(list, values, to, true); }

 private:
  static constexpr int kMostGathered = 4;  // vectors that gather() takes at a time
  [[nodiscard]] const DeviceArray<Index>& of(List list) const { return list == List::seen ? seen_ : right_side_; }
  void scatter(List list, ConstSpan values, double* to, bool add);

  Gpu& gpu_;
  int points_;
  std::vector<DeviceShare::Range> ranges_;
  MotionArrays arrays_;
  DeviceArray<double> vectors_;  // all of them
  DeviceArray<Index> seen_, right_side_;
  DeviceArray<double> gathered_;  // numbers of a list, on their way
  PinnedArray<double> gathered_on_host_;
  DeviceArray<MotionRecord> records_;  // of blocks, and the last one of all
  PinnedArray<MotionRecord> record_;
  Offset blocks_;
};

}  // namespace espalier::dynamics::cuda
