/// \file
/// What the consistent start of a run did to the configuration that the text gives.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// A line for every joint that is open in a configuration by more than round-off (1e-9 of the largest body), with the
/// equation and by how much.
[[nodiscard]] std::vector<std::string> open_joints(Mechanism& mechanism, const State& given);

/// A line for every body that was moved, with distance and angle; of flexible bodies the largest way of a node and the
/// strain energy that it cost.
[[nodiscard]] std::vector<std::string> moved_bodies(Mechanism& mechanism, const State& given, const State& now);

/// A line for every two surfaces of a contact that overlap a little in a configuration.
/// @throws std::invalid_argument where they overlap by more than the contact allows: what does would fly apart
[[nodiscard]] std::vector<std::string> overlap_lines(const ContactSpec& spec, const BuiltContact& built, ConstSpan q);

/// The same of all contacts, where joints have moved bodies. @throws Error(invalid_input) with the place of the contact
void check_overlaps(const Description& model, const Mechanism& mechanism, const State& now);

/// Marks of the velocity coordinates that the text gives: of rigid, reduced and point bodies by `velocity` and
/// `angular_velocity`, each for itself; all of a flexible body where one of them is given. Empty: none.
[[nodiscard]] std::vector<char> given_velocities(const Mechanism& mechanism);

struct MovedVelocity {
  const BuiltBody* body = nullptr;
  Index coordinate = 0;
  double given = 0, found = 0;
};
/// The largest change above `least` of a velocity that is given (or of one that is not); none: there is no such.
[[nodiscard]] std::optional<MovedVelocity> changed_velocity(const Mechanism& mechanism, const State& given,
                                                            const State& found, double least, bool of_given);
/// What became of velocities at the start, where the text gives any: those that were changed, and those that follow.
[[nodiscard]] std::vector<std::string> velocity_notices(const Mechanism& mechanism, const State& given,
                                                        const State& found, double least);

}  // namespace espalier::dynamics::model
