/// \file
/// Amplitudes and loads of an .inp deck.
#pragma once

#include <array>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/mesh/deck/inp_deck.hpp"

namespace espalier::dynamics {

/// Factors over time by name.
class InpAmplitudes {
 public:
  explicit InpAmplitudes(const InpTarget& target) : target_(target) {}
  void read(const InpCard& card);
  /// The curve of a card's AMPLITUDE: its place in Deck::curves, -1: none. One that cannot be taken is left, as `kind`.
  [[nodiscard]] int of(const InpCard& card, DeckKind kind) const;

 private:
  const InpTarget& target_;
  std::map<std::string, int> curves_;
  std::map<std::string, std::string> refused_;
};

/// Forces, pressures and loads on the material of one step after the other. In one step loads at the same place add up;
/// those of a step before are replaced, and OP=NEW takes all of a keyword away.
class InpLoads {
 public:
  InpLoads(const InpTarget& target, const InpAmplitudes& amplitudes) : target_(target), amplitudes_(amplitudes) {}
  void begin_step() { news_.clear(); }
  /// Whether OP=NEW is given, for the first time in a step.
  bool begins_anew(const InpCard& card);
  void cload(const InpCard& card);
  void dload(const InpCard& card);
  /// Writes what acts in the end into the deck.
  void finish();

 private:
  template <class Key, class Load>
  void add_or_replace(std::map<Key, Load>& loads, const Key& key, const Load& load, const InpCard& card);
  void line_load(const InpCard& card, const CardFields& f, std::size_t axis, int curve);
  void edge_load(const InpCard& card, const CardFields& f, int edge, int curve);
  void pressure(const InpCard& card, const CardFields& f, const std::string& label, int curve);
  void body_load(const InpCard& card, const CardFields& f, const std::string& label, int curve);

  const InpTarget& target_;
  const InpAmplitudes& amplitudes_;
  std::set<std::string> news_;  // keywords whose OP=NEW this step has seen
  std::map<std::pair<Index, int>, DeckForce> forces_;
  std::map<MeshFace, DeckPressure> pressures_;
  std::map<std::array<int, 3>, DeckLineLoad> line_loads_;  // by element, edge and axis (3: across an edge)
  std::vector<DeckBodyLoad> body_loads_;
};

}  // namespace espalier::dynamics
