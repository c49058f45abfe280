/// \file
/// Kinds of joints by rows: what a kind reads, what it asks of its frames, and what it makes.
#pragma once

#include <functional>

#include "dynamics/model/build/builders.hpp"

namespace espalier::dynamics::model {

/// What a joint may know of the model when it is made.
struct JointStart {
  std::vector<FrameMotion> frames;  ///< in the initial state
  /// The function of `motion`; where that counts from the initial value, this one is added.
  std::function<TimeFunction(double initial)> motion;
};

struct JointKind {
  JointType type = JointType::screw;
  /// Reads its own keys, beside those of all joints.
  void (*read)(Section& s, JointSpec& j, Description& model) = nullptr;
  std::unique_ptr<Joint> (*make)(const JointSpec& j, std::vector<FramePtr> frames, const JointStart& start) = nullptr;
  /// Which of its frames must say where its axis points: none, one of the two (the other takes the same), or both.
  enum class Axes { none, one, both } axes = Axes::none;
  bool turns_b = true;   ///< needs the axes of frame b, too
  bool couples = false;  ///< keeps the value that it finds where an event switches it on
  /// Changes what the text leaves open, or refuses frames that do not fit it. Null: nothing.
  void (*complete)(JointSpec& j, const FrameBuilder& frames) = nullptr;
};
[[nodiscard]] JointStart start_of(const std::vector<MarkerSpec>& markers, const FrameBuilder& frames,
                                  std::function<TimeFunction(double)> motion = {});

/// Null: a type without a row.
[[nodiscard]] const JointKind* joint_kind(JointType type);

// The rows, each in a file of its name.
extern const JointKind kScrew, kConstantVelocity, kParallelAxes, kInPlane, kInLine, kPointOnCurve, kPointOnSurface,
    kGearPair, kRackPair, kWorm, kCable;

/// The force of that name, with the frames of its cable.
[[nodiscard]] std::unique_ptr<CableForce> make_cable_force(const ForceSpec& f, const FrameBuilder& frames);

/// A number, or "initial".
[[nodiscard]] double read_measure(Section& s, const std::string& key, bool& measured);

}  // namespace espalier::dynamics::model
