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

/// The loads of a set, with those that LOAD adds up. @param place  of the case that takes it
void read_nastran_loads(const std::vector<NastranCard>& cards, std::int64_t set, const DeckPlace& place,
                        NastranSystems& systems, Deck& deck);

/// An RBE3.
void read_nastran_mean(const NastranCard& card, const NastranSystems& systems, Deck& deck);

// What the pieces of the reader share.
[[nodiscard]] inline DeckPlace place_of(const NastranCard& card) { return {card.path, card.line}; }
/// Cards of loads that are refused where they act: PLOAD2, TEMP, SPCD ...
[[nodiscard]] bool is_load_not_read(const std::string& name);
/// The node of field `k`. @throws Error where the grid point is not defined
[[nodiscard]] Index grid_point(const NastranSystems& systems, const NastranCard& card, std::size_t k);
/// Degrees of freedom, from 0, of a field such as "123".
[[nodiscard]] std::vector<int> directions_of(const NastranCard& card, std::size_t k);
/// x, y and z are among them.
[[nodiscard]] bool has_displacements(const std::vector<int>& directions);
/// @throws Error where it has no nodes, or its reference is one of them
void add_nastran_coupling(const NastranCard& card, DeckCoupling coupling, Deck& deck);
/// What nobody takes.
void leave_card(Deck& deck, DeckKind kind, const std::string& what, const DeckPlace& place);

}  // namespace espalier::dynamics
