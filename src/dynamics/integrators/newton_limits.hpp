/// \file
/// When Newton's iterations of the integrators end: the limits that generalized-alpha and BDF share.
#pragma once

namespace espalier::dynamics {

/// With a new factor a slower rate asks for a better one within the step: the predictor stretches what turns, so that W
/// at its state lacks the right geometric stiffness; after two passes the state is good enough for a better W.
inline constexpr double kSlow = 0.25;
/// Changes that fall by less than this from pass to pass stand still.
inline constexpr double kStill = 0.5;
/// Changes of q below this part of its largest number may be rounding, which solutions with K magnify.
inline constexpr double kRounding = 1e-11;
/// An old factor is taken to have met rounding where the changes stand still at most so many times above the level at
/// which they did with a new one.
inline constexpr double kAboveFloor = 4;
/// What is remembered of the method's own error from step to step: second differences pass through zero.
inline constexpr double kMemory = 0.5;

/// Rounds of augmented Lagrangian (System::augment()) in one step.
inline constexpr int kMostAugmentations = 60;

}  // namespace espalier::dynamics
