/// \file
/// What may change from outside during a run: inputs that a program sets, joints and forces that are switched, and what
/// events remember.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "dynamics/contact/contact.hpp"
#include "dynamics/dae/capabilities.hpp"
#include "dynamics/forces/cable_force.hpp"
#include "dynamics/forces/face_pressure.hpp"
#include "dynamics/forces/frame_force.hpp"

namespace espalier::dynamics::model {

/// A joint, force or contact that can be switched. A joint takes its friction and stops with it.
struct Switch {
  std::string name;
  Joint* joint = nullptr;
  std::vector<FrameForce*> forces;
  FacePressure* pressure = nullptr;
  bool on = true;
  std::vector<contact::Contact*> contacts = {};
  CableForce* cable = nullptr;
};

/// A component without unknowns that keeps all of this, so that it goes into restart files.
class Controls final : public Component, public Remembers {
 public:
  /// An event's memory.
  struct Event {
    bool held = false;   ///< its condition, at the last accepted state
    bool spent = false;  ///< it happened and happens only once
  };

  Controls() : Component("controls") {}
  std::vector<std::pair<std::string, double>> inputs;  ///< names and present values
  std::vector<Switch> switches;
  std::vector<Event> events;  ///< in the order of the description
  /// Constraint rows left out since joints were last switched (m marks); empty: not switched yet.
  std::vector<char> dropped;

  [[nodiscard]] double* input(const std::string& name);
  /// Switches by name. @return whether anything changed
  bool set(const std::string& name, bool on);
  /// Lets forces know whether they are on.
  void apply();
  /// Marks the constraint rows (of m) of joints that are off.
  [[nodiscard]] std::vector<char> absent_rows(std::size_t m) const;

  [[nodiscard]] Sizes sizes() const override { return {}; }
  void declare(PatternBuilder& /*w*/, PatternBuilder& /*phi_q*/) const override {}
  void bind(const SparsePattern& /*w*/, const SparsePattern& /*phi_q*/) override {}
  void residual(const StateView& /*s*/, Span /*f*/) override {}
  void tangent(const StateView& /*s*/, const TangentWeights& /*weights*/, Span /*w_values*/) override {}
  void save(std::vector<double>& out) const override;
  /// Applies what it restores to the forces.
  void restore(ConstSpan& in) override;
};

}  // namespace espalier::dynamics::model
