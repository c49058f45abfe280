// What the cards of an .inp deck name.
#include <fmt/format.h>

#include <algorithm>

#include "dynamics/mesh/deck/inp_deck.hpp"

namespace espalier::dynamics {

namespace {

/// The nodes of faces of solids, and of sides of shells.
std::vector<Index> nodes_of_sides(const Mesh& mesh, const std::vector<MeshFace>& faces) {
  std::vector<Index> all;
  for (const MeshFace& face : faces) {
    const bool shell = shape_of(mesh.type(face.element)).dimension == 2;
    const auto own = mesh.element(face.element);
    const std::vector<Index> nodes = shell ? std::vector(own.begin(), own.end()) : mesh.face_nodes(face);
    all.insert(all.end(), nodes.begin(), nodes.end());
  }
  sort_unique(all);
  return all;
}

}  // namespace

/// Calls find(member, home) in each name space that the card speaks for; errors get the place of the line, which may be
/// in another file than the mesh.
template <class Find>
void InpTarget::in_homes(const InpCard& card, const CardFields& f, std::size_t k, const Find& find) const {
  if (!f.has(k)) fail(f.place(), fmt::format("{}: field {} is missing", card.keyword.name, k + 1));
  const InpMember member = inp_member(f.text(k), "", f.place().line);
  for (const std::string& home : lookup_.homes(card.scope)) {
    try {
      find(member, home);
    } catch (const Error& error) {
      const std::string prefix = fmt::format("{}:{}: ", model_.path, f.place().line), text = error.what();
      if (!text.starts_with(prefix) || text.starts_with(prefix + card.keyword.name)) throw;
      fail(f.place(), fmt::format("{}: {}", card.keyword.name, text.substr(prefix.size())));
    }
  }
}

std::vector<Index> InpTarget::nodes(const InpCard& card, const CardFields& f, std::size_t k) const {
  std::vector<Index> all;
  in_homes(card, f, k, [&](const InpMember& member, const std::string& home) {
    const std::vector<Index> found = lookup_.nodes(member, home);
    if (found.empty())
      fail(f.place(), member.name.empty() ? fmt::format("{}: node {} is not defined", card.keyword.name, f.text(k))
                                          : fmt::format("{}: node set {} has no nodes", card.keyword.name, f.text(k)));
    all.insert(all.end(), found.begin(), found.end());
  });
  return all;
}

Index InpTarget::node(const InpCard& card, const CardFields& f, std::size_t k) const {
  const std::vector<Index> all = nodes(card, f, k);
  if (all.size() != 1)
    fail(f.place(), fmt::format("{}: '{}' must be one node, not {}", card.keyword.name, f.text(k), all.size()));
  return all.front();
}

std::vector<Index> InpTarget::elements(const InpCard& card, const CardFields& f) const {
  std::vector<Index> all;
  if (!f.has(0)) {
    for (Index e = 0; e < lookup_.mesh().element_count(); ++e) all.push_back(e);
    return all;
  }
  in_homes(card, f, 0, [&](const InpMember& member, const std::string& home) {
    const std::vector<Index> found = lookup_.elements(member, home);
    all.insert(all.end(), found.begin(), found.end());
  });
  return all;
}

std::vector<MeshFace> InpTarget::faces(const InpCard& card, const CardFields& f, std::size_t k) const {
  std::vector<MeshFace> all;
  in_homes(card, f, k, [&](const InpMember& member, const std::string& home) {
    if (member.name.empty() || !lookup_.faces(member, home, all))
      fail(f.place(), fmt::format("{}: there is no surface '{}' of elements", card.keyword.name, f.text(k)));
  });
  return all;
}

std::vector<Index> InpTarget::surface_nodes(const InpCard& card, const CardFields& f, std::size_t k,
                                            std::vector<MeshFace>* faces) const {
  std::vector<Index> all;
  in_homes(card, f, k, [&](const InpMember& named, const std::string& home) {
    InpMember member = named;
    member.of_surface = true;
    std::vector<MeshFace> found;
    const std::vector<Index> nodes = !member.name.empty() && lookup_.faces(member, home, found)
                                         ? nodes_of_sides(lookup_.mesh(), found)
                                         : lookup_.nodes(member, home);
    all.insert(all.end(), nodes.begin(), nodes.end());
    if (faces != nullptr) faces->insert(faces->end(), found.begin(), found.end());
  });
  sort_unique(all);
  if (all.empty()) fail(f.place(), fmt::format("{}: '{}' has no nodes", card.keyword.name, f.text(k)));
  return all;
}

bool InpTarget::leaves_parameter(const InpCard& card, DeckKind kind, std::initializer_list<const char*> taken) const {
  for (const auto& [key, value] : card.keyword.parameters) {
    const auto is = [&key = key](const char* word) { return key == word; };
    if (std::any_of(taken.begin(), taken.end(), is)) continue;
    leave(kind, fmt::format("{} {}{}{}", card.keyword.name, key, value.empty() ? "" : "=", value), card.place);
    return true;
  }
  return false;
}

void InpTarget::leave(DeckKind kind, const std::string& what, const DeckPlace& place) const {
  DeckLeft& left = deck_.left[{kind, what}];
  if (left.count++ == 0) left.place = place;
}

}  // namespace espalier::dynamics
