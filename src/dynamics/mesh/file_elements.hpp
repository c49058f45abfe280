/// \file
/// Elements and sets as mesh files list them, before it is known which of them become elements and which sets.
#pragma once

#include <array>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// Collects what a file lists and makes a mesh of it: where solids are present they alone become elements, and what
/// lies below them becomes sets; without solids everything becomes elements.
class FileElements {
 public:
  /// Adds an element and returns its number here. @param nodes indices of mesh nodes, as many as the shape has
  std::size_t add(ElementType type, std::int64_t label, std::span<const Index> nodes);
  /// Puts an element into a set of the file.
  void add_to_set(std::size_t element, const std::string& set) { sets_[set].push_back(element); }
  [[nodiscard]] std::size_t count() const { return elements_.size(); }

  /// Elements and sets go to `mesh`, whose nodes stand. A set becomes an element set of its elements, a node set of the
  /// nodes of those below dimension 3, and, where surfaces in it are faces of solids, a face set.
  /// @param all  surfaces and lines stay elements beside solids, too, as in decks
  void finish(Mesh& mesh, bool all = false) const;

 private:
  struct Element {
    ElementType type;
    std::int64_t label;
    std::array<Index, kMaxElementNodes> nodes;
    [[nodiscard]] std::span<const Index> list() const;
  };
  void add_face_sets(Mesh& mesh) const;

  std::vector<Element> elements_;
  std::map<std::string, std::vector<std::size_t>> sets_;
};

/// A notice for elements that have nodes in the middle of faces or of the volume, which are dropped: how many of each
/// kind ("hex27") there are. None where there are none.
void note_complete_kinds(Mesh& mesh, const std::map<std::string, long>& kinds);

/// Adds to every node set a face set of the same name, of the outer faces all of whose nodes belong to it. Sets without
/// such faces and names that are face sets already are passed over.
void add_faces_of_node_sets(Mesh& mesh);

/// Adds to every element set a face set of the same name, of the outer faces of solids that its surface elements lie on
/// (Gmsh's .inp files mark faces so). Sets without such elements and names that are face sets already are passed over.
void add_faces_of_surface_elements(Mesh& mesh);

}  // namespace espalier::dynamics
