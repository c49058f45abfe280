/// \file
/// A flexible body whose parts lie on several GPUs. States and K are on the first of them, where integrators work and
/// which hands the factor's other GPUs what they need of K: what a part reads is brought to it, and what it writes is
/// taken back, by a carrier.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "base/thread_pool.hpp"
#include "dynamics/device/body_parts.hpp"

namespace espalier::dynamics {

/// Between the first GPU and that of a part, which may be the same. Calls return at once; finish() waits.
class PartCarrier {
 public:
  virtual ~PartCarrier() = default;
  /// The part's vertices of a state of the body, from the first GPU. @return in the part's memory, until the next call
  virtual BodyState bring(const BodyState& body) = 0;
  /// Where the part writes its forces, and f := those of its own vertices on the first GPU.
  [[nodiscard]] virtual double* forces() = 0;
  virtual void take_forces(double* f) = 0;
  /// The part's tangent is not written into K, but column by column with the rows of its pattern alone; then each
  /// column of each 3 x 3 block, in this order, is added to K at its position.
  virtual void bind(std::span<const Offset> positions) = 0;
  /// Where the part writes its tangent: zeros, or K itself where bind() was not called, when all is done that K and
  /// states on the first GPU wait for.
  /// @param k  the values of K
  [[nodiscard]] virtual double* values(double* k) = 0;
  virtual void take_values(double* k) = 0;
  virtual void finish() = 0;
};

/// What stands for a part.
struct SubdomainOnGpu {
  std::unique_ptr<DeviceBody> body;
  std::unique_ptr<PartCarrier> carrier;
  bool first;  ///< on the first GPU
};
using MakePart = std::function<SubdomainOnGpu(const BodySubdomain& part)>;

/// By the GPUs that eliminate the vertices' first coordinates.
/// @param fewest  elements; a body of fewer is not divided
/// @return null: the first GPU is to have all of it
[[nodiscard]] std::unique_ptr<DeviceBody> make_divided_body(const DeviceBodyTables& body, const GpuPlaces& places,
                                                            Index fewest, base::ThreadPool* pool, const MakePart& make);

}  // namespace espalier::dynamics
