/// \file
/// What limits and friction of a joint act on.
#pragma once

namespace espalier::dynamics::model {

struct JointFreedom {
  bool turns = false;        ///< about z: friction on a pin
  bool slides = false;       ///< along z or a curve
  bool surface = false;      ///< on a surface, in all directions
  bool limits = false;       ///< of its displacement, else of its angle
  bool moments = false;      ///< its reaction has moments, which may press as well
  bool whole_force = false;  ///< the force presses whatever direction it has
  [[nodiscard]] bool rubs() const { return turns || slides || surface; }
};
}  // namespace espalier::dynamics::model
