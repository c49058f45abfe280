/// \file
/// What the fuzz targets of the readers of decks share.
#pragma once

#include "dynamics/mesh/deck/deck.hpp"
#include "dynamics/model/decks/taken.hpp"
#include "fuzz/fuzz_mesh.hpp"

namespace espalier::dynamics {

/// Arbitrary bytes as a deck, and all of it as entries of a model: an error that names the file, or entries with the
/// sets that they name.
inline int fuzz_deck(Deck (*parse)(std::string, const std::string&, int), const std::uint8_t* data, std::size_t size) {
  try {
    const Deck deck = parse(std::string(reinterpret_cast<const char*>(data), size), "fuzz", 0);
    const model::TakenDeck taken = model::take_deck(deck, model::choice_of({"all"}), "part");
    const auto nodes = static_cast<Index>(deck.mesh.nodes.size());
    for (const auto& [name, set] : taken.node_sets)
      for (const Index n : set)
        if (n < 0 || n >= nodes) std::abort();
    for (const auto& [name, set] : taken.face_sets)
      for (const MeshFace& face : set)
        if (face.element < 0 || face.element >= deck.mesh.element_count()) std::abort();
  } catch (const Error& error) {
    if (error.status().code != StatusCode::invalid_input || std::string(error.what()).find("fuzz") != 0) std::abort();
  }
  return 0;
}

}  // namespace espalier::dynamics
