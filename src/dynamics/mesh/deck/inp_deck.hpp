/// \file
/// What the pieces of the reader of .inp decks share.
#pragma once

#include <initializer_list>
#include <string>
#include <vector>

#include "dynamics/mesh/deck/deck.hpp"
#include "dynamics/mesh/inp_model.hpp"

namespace espalier::dynamics {

/// Finds what a card names, and fills a deck.
class InpTarget {
 public:
  InpTarget(const InpModel& model, const InpLookup& lookup, Deck& deck) : model_(model), lookup_(lookup), deck_(deck) {}
  /// Nodes of field `k`: a label or a set. @throws Error where it is not defined
  [[nodiscard]] std::vector<Index> nodes(const InpCard& card, const CardFields& f, std::size_t k) const;
  /// The only one of them.
  [[nodiscard]] Index node(const InpCard& card, const CardFields& f, std::size_t k) const;
  /// Elements of the first field: a label or a set; empty: all.
  [[nodiscard]] std::vector<Index> elements(const InpCard& card, const CardFields& f) const;
  /// The faces of the surface in field `k`.
  [[nodiscard]] std::vector<MeshFace> faces(const InpCard& card, const CardFields& f, std::size_t k = 0) const;
  /// The nodes of a surface of elements or nodes, or of a set of nodes.
  /// @param faces  where it is one of elements, its faces are added
  [[nodiscard]] std::vector<Index> surface_nodes(const InpCard& card, const CardFields& f, std::size_t k,
                                                 std::vector<MeshFace>* faces = nullptr) const;
  /// Whether a parameter is given that changes what the card means. @return then it is left
  [[nodiscard]] bool leaves_parameter(const InpCard& card, DeckKind kind,
                                      std::initializer_list<const char*> taken) const;
  /// What nobody takes.
  void leave(DeckKind kind, const std::string& what, const DeckPlace& place) const;
  [[nodiscard]] const InpLookup& lookup() const { return lookup_; }
  [[nodiscard]] Deck& deck() const { return deck_; }

 private:
  template <class Find>
  void in_homes(const InpCard& card, const CardFields& f, std::size_t k, const Find& find) const;

  const InpModel& model_;
  const InpLookup& lookup_;
  Deck& deck_;
};

/// Springs, dashpots, masses, equations, couplings, ties.
[[nodiscard]] bool is_inp_part_keyword(const std::string& name);
void read_inp_mpc(const InpCard& card, const InpTarget& target);
/// @param step  the one that is taken
void read_inp_connectors(const InpModel& model, const InpTarget& target, int step);
void read_inp_parts(const InpModel& model, const InpTarget& target);

}  // namespace espalier::dynamics
