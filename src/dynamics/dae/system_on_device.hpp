/// \file
/// A system of which a GPU may take a part of F and W; see device/device_assembly.hpp.
#pragma once

#include <span>
#include <vector>

#include "dynamics/dae/capabilities.hpp"

namespace espalier::dynamics {

/// Which coordinates belong to bodies on a GPU, and what of them the rest of the system, on the host, has to do with.
struct DeviceShare {
  /// Velocity coordinates v .. v + count of bodies; their configuration has as many numbers, from q on.
  struct Range {
    Index q, v, count;
  };
  std::vector<Range> ranges;             ///< ascending, with gaps between them
  std::vector<Index> seen;               ///< velocity coordinates among them that others read or act on, ascending
  std::vector<Index> seen_q;             ///< where their configuration stands
  std::vector<Index> own;                ///< all other velocity coordinates, ascending
  std::vector<OwnCoordinates> owners{};  ///< whose these are
};

/// What a System is as well that has bodies for a GPU. residual() uses the GPU without being asked once use_device()
/// has moved something there.
class SystemOnDevice {
 public:
  /// Moves what it can there, unless most of W would have to follow over the link each time. @param k_ptr where the
  /// columns of W begin in the GPU's matrix. @return false: nothing
  virtual bool use_device(DeviceAssembly& device, std::span<const Offset> k_ptr) = 0;
  virtual void leave_device() = 0;
  /// Positions in W of the entries that components on the host add to, ascending.
  [[nodiscard]] virtual std::vector<Offset> host_entries() const = 0;
  /// tangent() in two parts: those on the GPU write theirs there, the others add theirs to w_values, of which
  /// host_entries() alone are set to zero first.
  /// @param there  the state of the bodies on the GPU, in its memory, as StateView but for a configuration in the order
  ///   of the velocity coordinates; s then holds what DeviceShare says is seen or not theirs. Null: s holds all
  virtual void tangent_on_device(const StateView& s, const TangentWeights& weights, double* device_values,
                                 Span w_values, const StateView* there) = 0;
  /// What of it can stay there from step to step; null: nothing, as integrators have to see all of it.
  [[nodiscard]] virtual const DeviceShare* device_share() const = 0;
  /// residual() in two parts: bodies write theirs to f_there, which like `there` lies in the GPU's memory; the others
  /// add theirs to f, of which only what is seen, or not the bodies', is set to zero first. Waits for both.
  virtual void residual_on_device(const StateView& s, const StateView& there, Span f, double* f_there) = 0;

 protected:
  ~SystemOnDevice() = default;
};

}  // namespace espalier::dynamics
