/// \file
/// A finite element mesh: nodes, elements of any shapes in the order of their file, named sets, materials.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "base/at.hpp"
#include "dynamics/mesh/element_type.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics {

using Point = std::array<double, 3>;

/// Face `face` (order of shape_of(type).faces) of element `element` of a mesh.
struct MeshFace {
  Index element = 0;
  int face = 0;
  bool operator==(const MeshFace&) const = default;
  auto operator<=>(const MeshFace&) const = default;
};

/// A material as the mesh file states it; a value that the file does not state is 0.
struct MeshMaterial {
  std::string name;
  double young = 0;    ///< Young's modulus in the file's units
  double poisson = 0;  ///< Poisson's ratio
  double density = 0;  ///< mass per volume in the file's units
};

/// Nodes and elements are numbered from 0; labels keep the numbers of the file for messages and output.
class Mesh {
 public:
  std::string name;                          ///< file name or the mesher's name, for messages
  std::vector<Point> nodes;                  ///< coordinates in the file's length unit
  std::vector<std::int64_t> node_labels;     ///< number in the file of each node; empty: index + 1
  std::vector<std::int64_t> element_labels;  ///< number in the file of each element; empty: index + 1

  std::map<std::string, std::vector<Index>> node_sets;     ///< node indices, rising, no repeats
  std::map<std::string, std::vector<Index>> element_sets;  ///< element indices, rising, no repeats
  std::map<std::string, std::vector<MeshFace>> face_sets;  ///< faces of solids
  std::vector<MeshMaterial> materials;
  std::vector<std::string> notices;                     ///< what a reader passed over, for people
  std::map<std::string, std::string> section_material;  ///< element set -> name of its material (*SOLID SECTION)

  /// Adds an element and returns its index. @pre element_nodes.size() == shape_of(type).nodes
  Index add_element(ElementType type, std::span<const Index> element_nodes);
  [[nodiscard]] Index element_count() const { return static_cast<Index>(types_.size()); }
  [[nodiscard]] ElementType type(Index element) const { return types_[at(element)]; }
  /// The node indices of one element in the order of ElementType.
  [[nodiscard]] std::span<const Index> element(Index element) const;
  /// The node indices of one face. @throws std::invalid_argument when the element has no such face
  [[nodiscard]] std::vector<Index> face_nodes(MeshFace face) const;
  [[nodiscard]] std::int64_t node_label(Index node) const;
  [[nodiscard]] std::int64_t element_label(Index element) const;

  /// The set of this name. @throws Error(invalid_input) that lists the names that exist
  [[nodiscard]] const std::vector<Index>& node_set(const std::string& set) const;
  [[nodiscard]] const std::vector<Index>& element_set(const std::string& set) const;
  [[nodiscard]] const std::vector<MeshFace>& face_set(const std::string& set) const;
  /// The nodes of all faces of a face set, rising, no repeats.
  [[nodiscard]] std::vector<Index> nodes_of_faces(std::span<const MeshFace> faces) const;

  /// All faces of solids that belong to one element only, in order of element and face.
  [[nodiscard]] std::vector<MeshFace> boundary_faces() const;

  /// The lowest node of each piece that shares no node with the others, rising. @param elements  those that count;
  /// empty: all
  [[nodiscard]] std::vector<Index> pieces(std::span<const Index> elements) const;

  /// Drops nodes that no element uses and renumbers (sets and labels follow). Reference nodes of couplings and the
  /// like would otherwise be masses without stiffness. @return the number of nodes dropped
  Index drop_unused_nodes();

 private:
  std::vector<ElementType> types_;
  std::vector<Offset> start_{0};
  std::vector<Index> connectivity_;
};

/// One regular copy of a sorted list: sorts and removes repeats.
void sort_unique(std::vector<Index>& list);

}  // namespace espalier::dynamics
