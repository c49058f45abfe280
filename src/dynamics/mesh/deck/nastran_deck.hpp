/// \file
/// The cards of a Nastran deck that say more than its mesh.
#pragma once

#include <vector>

#include "dynamics/mesh/deck/nastran_control.hpp"
#include "dynamics/mesh/nastran_cards.hpp"
#include "dynamics/mesh/read/nastran_systems.hpp"

namespace espalier::dynamics {

/// @param cards  those that the reader of the mesh passes over, SPC, SPC1, FORCE, and GRID and GRDSET with a system for
/// displacements or permanent supports @param deck  its mesh stands @param wanted  subcase from 1; 0: the first
void read_nastran_deck(const std::vector<NastranCard>& cards, const NastranControl& control, NastranSystems& systems,
                       int wanted, Deck& deck);

}  // namespace espalier::dynamics
