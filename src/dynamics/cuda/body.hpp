/// \file
/// A flexible body on a GPU. For this folder alone: needs the CUDA runtime.
#pragma once

#include <vector>

#include "dynamics/cuda/arrays.hpp"
#include "dynamics/cuda/elements.hpp"
#include "dynamics/device/device_assembly.hpp"

namespace espalier::dynamics::cuda {

/// Elements write what they give to places of their own, and every number of a result is summed up by one thread in the
/// order of the elements: the same bits in every run.
class CudaBody final : public DeviceBody {
 public:
  CudaBody(const DeviceBodyTables& tables, Gpu& gpu);
  void bind(std::span<const Offset> column_start, std::span<const std::int32_t> shift) override;
  void start_forces(const BodyState& state) override;
  Offset finish_forces(double load, const double* weight, double* f) override;
  void start_tangent(const BodyState& state, const TangentWeights& weights, double* values) override;
  void put_forces(double load, double* f) override;
  Offset finish() override;

 private:
  struct Group {
    DeviceLaw law;
    int nodes;
    Index elements, slots;              // slots: with the gaps in the last row
    std::int32_t first;                 // number among all elements
    Offset force_start, tangent_start;  // in the arrays of all groups
    DeviceArray<Index> vertices;        // in rows
    DeviceArray<double> table;
  };
  /// What is summed up to one number: from[ptr[p]] .. from[ptr[p + 1]] of place p, a vertex or an entry of the pattern.
  struct Contributions {
    DeviceArray<std::int64_t> ptr, from;
  };
  Contributions sorted_contributions(bool of_pairs);
  void begin();
  void end();
  void send(const BodyState& state, bool with_velocity, bool with_acceleration);
  void evaluate(bool tangent, double position_weight, double velocity_weight);
  void spread(const double* from, double* to);
  [[nodiscard]] Offset inverted() const;

  Gpu& gpu_;
  Offset vertices_, entries_, force_numbers_ = 0, tangent_numbers_ = 0;
  double mass_damping_, stiffness_damping_;
  std::vector<Group> groups_;
  DeviceArray<double> mass_, weight_;
  DeviceArray<Offset> ptr_;          // of the vertex pattern
  DeviceArray<Index> ind_, column_;  // rows; the column of each entry
  Contributions to_vertices_, to_pairs_;
  DeviceArray<Offset> column_start_;
  DeviceArray<std::int32_t> shift_;
  DeviceArray<double> state_;  // position, velocity, acceleration: 3 per vertex each
  DeviceArray<double> force_;
  DeviceArray<double> element_reference_, element_position_, element_velocity_, element_force_, element_tangent_;
  DeviceArray<std::int32_t> inverted_;
  PinnedArray<double> staged_state_, staged_force_;
  PinnedArray<std::int32_t> staged_inverted_;
  bool has_velocity_ = false, has_acceleration_ = false;
  bool busy_ = false;  // something was started and not finished
};

}  // namespace espalier::dynamics::cuda
