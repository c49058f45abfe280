/// \file
/// What the consistent start of a run did to the configuration that the text gives.
#pragma once

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

}  // namespace espalier::dynamics::model
