/// \file
/// Kinds of forces by rows: what a kind is called, reads and asks of its frames, and what it makes.
#pragma once

#include <functional>

#include "dynamics/forces/frame_force.hpp"
#include "dynamics/joints/relative.hpp"
#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {

/// What a force may know of the model when it is made.
struct ForceStart {
  std::function<double(Relative kind, int axis)> measure;  ///< a coordinate of its frames in the initial state
  bool driven = false;                                     ///< a load of [harmonic] drives it
};

struct ForceKind {
  ForceType type = ForceType::spring;
  const char* name = nullptr;  ///< in models
  void (*read)(Section& s, ForceSpec& f, const std::string& units) = nullptr;
  /// Null: what acts on material, and cables, which the builder adds.
  std::unique_ptr<FrameForce> (*make)(const ForceSpec& f, FramePtr a, FramePtr b, const ForceStart& start) = nullptr;
  /// a and b; the list `through`; or none, or what `read` reads.
  enum class Frames { none, two, through } frames = Frames::two;
  bool has_axis = false;    ///< one of its frames must say where its axis points; the other takes the same
  bool turns = true;        ///< uses the axes of its frames
  bool moments = false;     ///< acts with a moment, whatever its numbers are
  bool directions = false;  ///< acts along axes of its first frame
  bool driven = true;       ///< a load of [harmonic] may drive it
  double factor = 0;        ///< what drives it where the text says nothing
};

// The rows, in files of this folder. A new kind is a file with its row, its name in these two lists, and its type.
extern const ForceKind kSpring, kAxialSpring, kRotationalSpring, kBushing, kLoad, kPressure, kGuide, kTorqueMotor,
    kForceMotor, kCableForce, kLineLoad;
/// In the order in which messages name them.
inline constexpr const ForceKind* kForceKinds[] = {
    &kSpring, &kAxialSpring, &kRotationalSpring, &kBushing,    &kLoad,    &kPressure,
    &kGuide,  &kTorqueMotor, &kForceMotor,       &kCableForce, &kLineLoad};

[[nodiscard]] const ForceKind& force_kind(ForceType type);

}  // namespace espalier::dynamics::model
