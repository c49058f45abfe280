/// \file
/// Kinds of joints by rows: what a kind is called, reads and asks of its frames, and what it makes.
#pragma once

#include <functional>
#include <string>

#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/joint_kinds/freedom.hpp"

namespace espalier::dynamics::model {

/// What a joint may know of the model when it is made.
struct JointStart {
  std::vector<FrameMotion> frames;  ///< in the initial state
  /// The function of `motion`; where that counts from the initial value, this one is added.
  std::function<TimeFunction(double initial)> motion;
};

/// What of frame b must fit frame a where both are brought together (`pull`): places along the axes of a, and turns.
struct JointHold {
  enum class Turn { free, axis, cross, all };
  bool any = false, x = false, y = false, z = false;
  Turn turn = Turn::free;
};

struct JointKind {
  JointType type = JointType::screw;
  const char* name = nullptr;  ///< in models
  /// Reads its own keys, beside those of all joints. Null: there are none.
  void (*read)(Section& s, JointSpec& j, Description& model) = nullptr;
  std::unique_ptr<Joint> (*make)(const JointSpec& j, std::vector<FramePtr> frames, const JointStart& start) = nullptr;
  /// a and b; a to d; or any number, the list `through`.
  enum class Frames { two, four, through } frames = Frames::two;
  /// Which of its frames must say where its axis points: none, one of a pair (the other takes the same), or both.
  enum class Axes { none, one, both } axes = Axes::none;
  bool turns_a = true, turns_b = true;  ///< needs the axes of its first frame, of the others
  bool couples = false;                 ///< keeps the value that it finds where an event switches it on
  bool starts = true;                   ///< wants JointStart::frames also where nothing counts from the start
  JointFreedom freedom{};               ///< for limits and friction
  JointHold hold{};
  /// Changes what the text leaves open, or refuses frames that do not fit it. Null: nothing.
  void (*complete)(JointSpec& j, const FrameBuilder& frames) = nullptr;
};
[[nodiscard]] JointStart start_of(const std::vector<MarkerSpec>& markers, const FrameBuilder& frames,
                                  std::function<TimeFunction(double)> motion = {});

// The rows, in files of this folder. A new kind is a file with its row, its name in these two lists, and its type.
extern const JointKind kFixed, kRevolute, kSpherical, kUniversal, kCylindrical, kPrismatic, kPlanar, kPointOnLine,
    kDistance, kRevoluteSpherical, kRotationMotor, kTranslationMotor, kPrescribed, kGear, kRackAndPinion,
    kCoupledSlides, kRolling, kSkate, kScrew, kConstantVelocity, kParallelAxes, kInPlane, kInLine, kPointOnCurve,
    kPointOnSurface, kGearPair, kRackPair, kWorm, kCable;
/// In the order in which messages name them.
inline constexpr const JointKind* kJointKinds[] = {
    &kFixed,         &kRevolute,         &kSpherical,   &kUniversal,    &kCylindrical,
    &kPrismatic,     &kPlanar,           &kPointOnLine, &kDistance,     &kRevoluteSpherical,
    &kRotationMotor, &kTranslationMotor, &kPrescribed,  &kGear,         &kRackAndPinion,
    &kCoupledSlides, &kRolling,          &kSkate,       &kScrew,        &kConstantVelocity,
    &kParallelAxes,  &kInPlane,          &kInLine,      &kPointOnCurve, &kPointOnSurface,
    &kGearPair,      &kRackPair,         &kWorm,        &kCable};

[[nodiscard]] const JointKind& joint_kind(JointType type);
/// The names of the rows that have something: "fixed, revolute and gear".
[[nodiscard]] std::string joints_that(bool (*have)(const JointKind& kind));

/// A coordinate of frame b to frame a.
[[nodiscard]] double measure(Relative kind, int axis, const FrameMotion& a, const FrameMotion& b);

/// The force of that name, with the frames of its cable.
[[nodiscard]] std::unique_ptr<CableForce> make_cable_force(const ForceSpec& f, const FrameBuilder& frames);

/// A number, or "initial".
[[nodiscard]] double read_measure(Section& s, const std::string& key, bool& measured);

}  // namespace espalier::dynamics::model
