/// \file
/// The long vectors of an integrator, which the host shares with the GPU that has the factor and the flexible bodies.
#pragma once

#include <initializer_list>

#include "dynamics/dae/equations.hpp"
#include "dynamics/dae/vectors.hpp"

namespace espalier::dynamics {

/// Vectors lie on the host, or those parts of them that belong to flexible bodies lie on a GPU. The host then has the
/// coordinates of its own components, and of the others those that its joints and forces look at (DeviceShare).
/// An integrator hands in its vectors of the host with each call (`here`); a copy stands for the same memory.
/// @throws Error(device_error) where the GPU has failed
class SharedVectors {
 public:
  explicit SharedVectors(Equations& equations) : equations_(equations) {}

  /// Whether bodies have theirs on a GPU.
  [[nodiscard]] bool on_device() const { return on_device_; }
  /// Whether what lay there is another integrator's now, or has gone with the factor.
  [[nodiscard]] bool lost() const { return on_device_ && memory() == nullptr; }
  /// Where they lie there; null: lost, or never there.
  [[nodiscard]] DeviceMotion* memory() const { return equations_.motion_of(ticket_); }
  /// They are on the GPU from now on; the caller fills them. @return false: they stay with the host
  [[nodiscard]] bool enter(const MotionDemand& demand);
  /// They are the host's; what the GPU had is lost.
  void leave() { on_device_ = false; }
  /// Whether the host can take up what has failed.
  [[nodiscard]] bool host_can_continue(const Error& error) const {
    return on_device_ && error.status().code == StatusCode::device_error;
  }
  /// leave() after such an error: for good, but where the factor has gone, which may come back.
  void give_up(const Error& error);

  // On a GPU
  [[nodiscard]] DeviceMotion& device_motion() const { return *memory(); }
  [[nodiscard]] const DeviceShare& share() const { return *equations_.device_share(); }
  [[nodiscard]] StateView state(const State& trial) const;
  /// Vectors of the host as a whole.
  void send(const MotionArrays& here, std::span<const MotionVector> vectors) const;
  /// The bodies' part of a configuration.
  void send_position(ConstSpan q, double* to) const;
  void fetch_position(const double* from, Span q) const;
  /// The bodies' part of a vector.
  void fetch(const double* from, Span x) const;
  /// The same of all of a state but for its multipliers.
  void fetch_state(State& trial) const;
  /// The largest |x_i| of bodies, of a vector of the host.
  [[nodiscard]] double largest_of_bodies(ConstSpan x) const;
  /// The host's coordinates and the m last numbers of a right-hand side.
  void put_right_side(const MotionArrays& here, MotionVector vector) const;
  /// The same of solutions, to the host.
  void take_right_sides(const MotionArrays& here, std::initializer_list<MotionVector> vectors) const;
  [[nodiscard]] MotionRecord measure(const MotionArrays& here, const MotionMeasure& what) const;

  // Wherever they are
  /// Brings what the host looks at; q to the trial state.
  void fetch_for_host(const MotionArrays& here, State& trial, std::initializer_list<MotionVector> vectors) const;
  /// loop(arrays, i) for each velocity coordinate, where it lies.
  template <class Loop>
  void run(const MotionArrays& here, const Loop& loop) const {
    if (!on_device_) return for_each_entry(equations_.pool(), size(), [&](std::size_t i) { loop(here, i); });
    device_motion().run(loop);
    for (const Index i : share().own) loop(here, at(i));
  }

 private:
  [[nodiscard]] std::size_t size() const { return at(equations_.sizes().velocity); }

  Equations& equations_;
  bool on_device_ = false;
  long ticket_ = 0;
};

}  // namespace espalier::dynamics
