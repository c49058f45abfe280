/// \file
/// What goes between GPUs that share a body. For this folder alone: needs the CUDA runtime.
#pragma once

#include <optional>

#include "dynamics/cuda/arrays.hpp"
#include "dynamics/device/divided_body.hpp"

namespace espalier::dynamics::cuda {

/// States leave in the order of the first GPU's stream. What comes back lands by a stream of its own, so that no state
/// waits for the forces of another body.
class CudaCarrier final : public PartCarrier {
 public:
  /// @param first  where states and K are @param own  of the part; another object even on the same GPU
  CudaCarrier(const BodySubdomain& part, Gpu& first, Gpu& own);
  BodyState bring(const BodyState& body) override;
  [[nodiscard]] double* forces() override { return forces_.data(); }
  void take_forces(double* f) override;
  void bind(std::span<const Offset> positions) override;
  [[nodiscard]] double* values(double* k) override;
  void take_values(double* k) override;
  void finish() override { landing_->wait(); }

 private:
  [[nodiscard]] bool in_place() const { return positions_.size() == 0; }
  void follow_first();
  void land(double* to, const double* from, Offset count);

  Gpu &first_, &own_;
  Offset vertices_;  // of the part
  // On the first GPU
  std::optional<device::cuda::Stream> landing_;
  std::optional<device::cuda::Event> ready_;          // states and K
  DeviceArray<Index> of_body_, owned_;                // vertices of the part, in the body; its own, in the part
  DeviceArray<Offset> positions_;                     // in K, of 3 numbers each
  DeviceArray<double> leaving_, forces_back_, back_;  // what comes and goes; back_: of K
  // On the part's
  std::optional<device::cuda::Event> made_;
  DeviceArray<double> state_, forces_, values_;
};

}  // namespace espalier::dynamics::cuda
