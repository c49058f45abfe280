/// \file
/// What only some components can do, each an interface of its own. A component that can derives from it beside
/// Component; AssembledSystem asks for it once, when the component is added. Every function gets global arrays, as
/// those of Component do. One more capability stands in switching.hpp: forces that change their law within a step.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynamics/dae/component.hpp"

namespace espalier::dynamics {

class DeviceAssembly;

/// Owns constraint equations: sizes().constraints of them.
class Constrains {
 public:
  /// Writes its own rows, with all their entries of Phi_q (they still hold those of the last call).
  virtual void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) = 0;
  /// Name of one of its equations for people, for instance: revolute "hinge-3", rotation about y.
  [[nodiscard]] virtual std::string constraint_name(Index local_row) const = 0;
  /// Whether an equation holds for velocities alone; see System::non_holonomic().
  [[nodiscard]] virtual bool non_holonomic(Index /*local_row*/) const { return false; }

 protected:
  ~Constrains() = default;
};

/// Knows the magnitude of each of its coordinates for relative tolerances; without it, that is |q_i|.
class Scaled {
 public:
  virtual void magnitude(ConstSpan q, Span out) const = 0;

 protected:
  ~Scaled() = default;
};

/// Has coordinates that form no vector space: rotations. The functions are those of System, on its own ranges.
class Curved : public Scaled {
 public:
  virtual void retract(ConstSpan q, ConstSpan dq, Span q_out) const = 0;
  virtual void local(ConstSpan base, ConstSpan q, Span theta) const = 0;
  virtual void velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const = 0;
  virtual void rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const = 0;
  virtual void carry(ConstSpan theta, std::span<const Span> vectors) const = 0;

 protected:
  ~Curved() = default;
};

/// Remembers something beside the state: turns of an angle, offsets of a touch, settings. For restart files, events
/// that go back, and derivatives.
class Remembers {
 public:
  /// Called with every accepted state.
  virtual void accept(const StateView& /*s*/) {}
  /// Appends what it remembers.
  virtual void save(std::vector<double>& out) const = 0;
  /// Takes as many numbers from the front as save() appends.
  virtual void restore(ConstSpan& in) = 0;

 protected:
  ~Remembers() = default;
};

/// What a component remembers; empty where it is not one that Remembers.
[[nodiscard]] std::vector<double> memory_of(const Component& component);

/// Declares more entries as bodies come near each other. Since it looks for that, it may read more of bodies than the
/// coordinates of its entries: whole surfaces.
class ChangesPattern {
 public:
  /// Whether the entries at a configuration are not all declared; declare() then declares them as well, and all others
  /// that are likely to follow. The system makes its patterns anew.
  virtual bool update_pattern(ConstSpan q) = 0;

 protected:
  ~ChangesPattern() = default;
};

/// Keeps multipliers to itself, which follow where the equations hold (augmented Lagrangian).
class Augmented {
 public:
  /// See System::augment().
  virtual bool augment(const StateView& s) = 0;

 protected:
  ~Augmented() = default;
};

/// Has forces that depend on multipliers: friction that grows with a joint's reaction. The same three as for W, for
/// F_lambda (rows: velocity coordinates, columns: constraints).
class ReadsMultipliers {
 public:
  virtual void declare_multipliers(PatternBuilder& f_lambda) const = 0;
  virtual void bind_multipliers(const SparsePattern& f_lambda) = 0;
  /// Adds its part.
  virtual void multiplier_tangent(const StateView& s, Span values) = 0;

 protected:
  ~ReadsMultipliers() = default;
};

/// A body whose tangent turns with it.
class Turns {
 public:
  /// See System::turns(). None: it does not.
  [[nodiscard]] virtual std::optional<BodyTurn> turn(ConstSpan from, ConstSpan to) const = 0;

 protected:
  ~Turns() = default;
};

/// Has so much to do for F that it leaves it to tasks, which run on all threads beside those of other components.
class HasTasks {
 public:
  /// Numbers of tasks, some 20 microseconds each, of two stages. Tasks of a stage run at the same time.
  struct Stages {
    std::int64_t first = 0, second = 0;
  };
  /// Leaves residual() to tasks, in part or as a whole. The residual() with the same state that follows does the rest.
  virtual Stages plan_residual(const StateView& s) = 0;
  /// Task `task` of stage 0 or 1; may add to f in its own coordinates.
  virtual void residual_task(int stage, std::int64_t task, Span f) = 0;

 protected:
  ~HasTasks() = default;
};

/// A body that a GPU can take; see SystemOnDevice. What start_*() begins there runs beside the other components, and
/// the call of Component of the same name that follows with the same state takes what it gave. Each does nothing where
/// the body is not there.
class OnDevice {
 public:
  [[nodiscard]] virtual bool fits_device() const = 0;
  virtual void use_device(DeviceAssembly& device, std::span<const Offset> k_ptr) = 0;
  virtual void leave_device() = 0;
  virtual void start_residual(const StateView& s) = 0;
  virtual void start_tangent(const StateView& s, const TangentWeights& weights, double* device_values) = 0;
  /// The same where the state lies there; see SystemOnDevice::tangent_on_device(). Forces stay there, too: the
  /// residual() that follows only waits.
  virtual void start_residual_there(const StateView& there, double* f_there) = 0;
  virtual void start_tangent_there(const StateView& there, const TangentWeights& weights, double* device_values) = 0;

 protected:
  ~OnDevice() = default;
};

/// Coordinates that a component owns: what it says of their manifold, else that of a vector space.
class OwnCoordinates {
 public:
  /// @param component  placed; outlives the object
  explicit OwnCoordinates(const Component& component);
  [[nodiscard]] const Component& component() const { return *component_; }
  [[nodiscard]] bool is_vector_space() const { return curved_ == nullptr; }
  [[nodiscard]] bool has_magnitudes() const { return scaled_ != nullptr; }
  [[nodiscard]] std::size_t q() const { return q_; }          ///< first configuration number
  [[nodiscard]] std::size_t v() const { return v_; }          ///< first velocity coordinate
  [[nodiscard]] std::size_t count() const { return count_; }  ///< velocity coordinates
  void retract(ConstSpan q, ConstSpan dq, Span q_out) const;
  void local(ConstSpan base, ConstSpan q, Span theta) const;
  void velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const;
  void rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const;
  void carry(ConstSpan theta, std::span<const Span> vectors) const;
  void magnitude(ConstSpan q, Span out) const;

 private:
  const Component* component_;
  const Curved* curved_;
  const Scaled* scaled_;
  std::size_t q_, v_, count_;
};

}  // namespace espalier::dynamics
