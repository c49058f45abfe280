/// \file
/// Which bodies nothing holds, and in which directions.
#pragma once

#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

struct FreeMotions {
  std::vector<std::string> texts;  ///< of bodies, in their order
  std::size_t unseen = 0;          ///< bodies that were not looked at: more than 200 hang together with them
};

/// Stiffness that the elements of shells have summed away before W sees it, of each coordinate; empty without shells. A
/// shell is a hexahedron with its nodes in pairs, whose stretch, E area / thickness, is added up and taken away again:
/// its rounding stays. Of a director half the thickness of that.
[[nodiscard]] std::vector<double> stretch_of_shells(const Mechanism& mechanism, std::size_t coordinates);

/// A text for every body that can move as a whole without a joint, a spring or another body's stiffness against it, for
/// instance "'bob' can turn about z through (0, 0, 1)": the null space of [F_q; Phi_q], at a state and the present load
/// factor, in motions of whole bodies, for each group of bodies that rows join. A spring counts from 1e-12 of the
/// stiffness of what it acts on (of a shell with stretch_of_shells()). No texts where every body is held.
/// @param dropped constraints that are left out (redundant, switched off): one mark each, or empty
[[nodiscard]] FreeMotions free_motions(Mechanism& mechanism, const std::vector<char>& dropped, const State& state);

}  // namespace espalier::dynamics::model
