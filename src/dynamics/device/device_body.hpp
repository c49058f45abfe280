/// \file
/// A flexible body in the memory of a GPU, or of several.
#pragma once

#include <span>
#include <vector>

#include "dynamics/dae/system.hpp"
#include "dynamics/elements/assembly.hpp"
#include "dynamics/elements/device_law.hpp"

namespace espalier::dynamics {

/// Elements of one law.
struct DeviceElements {
  DeviceLaw law;
  int nodes;
  std::vector<Index> vertices;  ///< `nodes` of each element, of the body
  [[nodiscard]] Index elements() const { return static_cast<Index>(vertices.size()) / nodes; }
};

/// A flexible body as a GPU takes it. Lent for the call that makes a DeviceBody.
struct DeviceBodyTables {
  std::vector<DeviceElements> groups;
  Index first = 0;                         ///< unknown of K that its first coordinate is; the others follow
  std::span<const double> reference;       ///< 3 per vertex
  const VertexPattern* pattern = nullptr;  ///< columns without entries are somebody else's
  std::span<const double> mass;            ///< per entry of the pattern
  std::span<const double> weight;          ///< M g, 3 per vertex
  double mass_damping = 0;                 ///< alpha in 1/s
  double stiffness_damping = 0;            ///< beta in s

  [[nodiscard]] Index vertices() const { return static_cast<Index>(reference.size()) / 3; }
  [[nodiscard]] Index elements() const {
    Index all = 0;
    for (const DeviceElements& g : groups) all += g.elements();
    return all;
  }
};

/// A body's own coordinates at some time, 3 per vertex. v and a may be null: zero.
struct BodyState {
  const double* q = nullptr;
  const double* v = nullptr;
  const double* a = nullptr;
  bool there = false;  ///< they lie in the memory of the body's GPU
};

/// The elements of one body in the memory of a GPU. start_*() returns at once; what it began is taken by the finish_*()
/// of the same name, or by put_forces() and finish().
class DeviceBody {
 public:
  virtual ~DeviceBody() = default;
  /// Where 3 x 3 blocks go; see BlockTarget. Lent for the call.
  virtual void bind(std::span<const Offset> column_start, std::span<const std::int32_t> shift) = 0;
  /// Internal forces and M (a + alpha v).
  virtual void start_forces(const BodyState& state) = 0;
  /// f += forces - load * weight, 3 per vertex. @return the first inverted element, counted over all groups, whose
  /// forces are NaN; -1: none
  virtual Offset finish_forces(double load, const double* weight, double* f) = 0;
  /// f := forces - load M g in the GPU's memory. Does not wait; finish() does. @pre start_forces() with a state there
  virtual void put_forces(double load, double* f) = 0;
  /// Writes (weights.a + alpha weights.v) M + weights.q df/dq + weights.v df/dv.
  /// @param values  in the GPU's memory, where bind() counts from
  virtual void start_tangent(const BodyState& state, const TangentWeights& weights, double* values) = 0;
  /// Waits for put_forces() or start_tangent(). @return as finish_forces()
  virtual Offset finish() = 0;
};

}  // namespace espalier::dynamics
