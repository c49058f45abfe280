/// \file
/// The long vectors of an integrator in the memory of the GPU that has the factor and the bodies.
#pragma once

#include <span>
#include <variant>

#include "dynamics/dae/system.hpp"
#include "dynamics/device/alpha_loops.hpp"
#include "dynamics/device/bdf_loops.hpp"

namespace espalier::dynamics {

using MotionLoop = std::variant<AddTo, CopyOf,
                                // BDF's
                                FormulaRates, StageChanges, RightSides, PassChanges, FormulaAcceleration,
                                VelocityWeights, PastSums, PositionInChart, ChartOfPosition, WayFromFactor, NewPoint,
                                // generalized-alpha's
                                StepBases, PredictedAcceleration, StateReached, PositionReached, ForcesOfPass,
                                ScaledChange, ChangedAcceleration, ScaledAcceleration, LastChanges, NextStep>;

/// Vectors of n numbers, one for each velocity coordinate; those that components of the host own stand in them but are
/// used by right-hand sides alone. Work is enqueued on the stream of the bodies and of K.
/// @throws Error(device_error)
class DeviceMotion {
 public:
  virtual ~DeviceMotion() = default;
  /// Where they lie.
  [[nodiscard]] virtual const MotionArrays& arrays() const = 0;
  /// The scales of K, n + m numbers in this memory, which stay where they are from one factor to the next.
  virtual void use_scale(const double* scale) = 0;
  /// The place of the oldest past point becomes that of the newest, and all others move on.
  virtual void turn_past() = 0;
  /// For all coordinates of bodies.
  virtual void run(const MotionLoop& loop) = 0;
  /// Over them. Waits.
  [[nodiscard]] virtual MotionRecord measure(const MotionMeasure& what) = 0;
  /// Copies of `count` numbers to and from this memory; send() lets `from` change on return, fetch() waits.
  virtual void send(ConstSpan from, double* to) = 0;
  virtual void fetch(const double* from, Span to) = 0;
  /// Coordinates of DeviceShare.
  enum class List {
    seen,        ///< `seen`
    right_side,  ///< `own`, and behind them the m rows of the constraints
  };
  /// Their numbers in each of the vectors, one vector after the other; to be read until the next call. Waits.
  [[nodiscard]] virtual ConstSpan gather(List list, std::span<const double* const> from) = 0;
  /// to_i := or += one of `values` for each of the list.
  virtual void set(List list, ConstSpan values, double* to) = 0;
  virtual void add(List list, ConstSpan values, double* to) = 0;
};

}  // namespace espalier::dynamics
