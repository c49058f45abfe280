/// \file
/// Sums over sets: reactions, forces of joints, strain energy.
#pragma once

#include "dynamics/model/fields/sites.hpp"
#include "dynamics/model/output/quantities.hpp"

namespace espalier::dynamics::model {

/// The sum of what constraints (joints, supports) exert on the nodes of a place: - Phi_q^T lambda there. @param moment
/// about the global origin, with the couples that act on gradients of nodes
/// @throws std::invalid_argument for reduced bodies, which have no nodes, and for places that are none
[[nodiscard]] std::function<Vec3(const Sample&)> reaction_on(Mechanism& mechanism, const BuiltBody& body,
                                                             const Where& where, bool moment);
/// Over the joints that a pattern names (* for any letters): on the frame that is not the ground's, else on b. @param
/// moment  about the global origin @throws std::invalid_argument where there is none
[[nodiscard]] std::function<Vec3(const Sample&)> sum_of_joints(const Mechanism& mechanism, const std::string& pattern,
                                                               bool moment);
/// The energy of a body, an element or a set of elements. @throws std::invalid_argument for other places
[[nodiscard]] std::function<double(const Sample&)> strain_energy_of(Mechanism& mechanism, const BuiltBody& body,
                                                                    const Where& where);

}  // namespace espalier::dynamics::model
