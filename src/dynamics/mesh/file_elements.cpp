#include "dynamics/mesh/file_elements.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/at.hpp"

namespace espalier::dynamics {
namespace {

using Corners = std::vector<Index>;

Corners sorted_corners(std::span<const Index> nodes, int corners) {
  Corners key(nodes.begin(), nodes.begin() + corners);
  std::sort(key.begin(), key.end());
  return key;
}

std::map<Corners, MeshFace> faces_by_corners(const Mesh& mesh) {
  std::map<Corners, MeshFace> faces;
  for (const MeshFace& face : mesh.boundary_faces()) {
    const auto& shape = shape_of(mesh.type(face.element)).faces[at(face.face)];
    faces[sorted_corners(mesh.face_nodes(face), shape_of(shape.type).corners)] = face;
  }
  return faces;
}

}  // namespace

std::span<const Index> FileElements::Element::list() const { return {nodes.data(), at(shape_of(type).nodes)}; }

std::size_t FileElements::add(ElementType type, std::int64_t label, std::span<const Index> nodes) {
  Element& e = elements_.emplace_back(Element{type, label, {}});
  std::copy(nodes.begin(), nodes.end(), e.nodes.begin());
  return elements_.size() - 1;
}

void FileElements::finish(Mesh& mesh, bool all) const {
  const bool solids =
      std::any_of(elements_.begin(), elements_.end(), [](const Element& e) { return shape_of(e.type).dimension == 3; });
  std::vector<Index> became(elements_.size(), -1);
  for (std::size_t k = 0; k < elements_.size(); ++k) {
    const Element& e = elements_[k];
    if (solids && !all && shape_of(e.type).dimension < 3) continue;
    became[k] = mesh.add_element(e.type, e.list());
    mesh.element_labels.push_back(e.label);
  }
  for (const auto& [name, members] : sets_)
    for (const std::size_t k : members) {
      if (became[k] >= 0) mesh.element_sets[name].push_back(became[k]);
      if (shape_of(elements_[k].type).dimension == 3) continue;
      const auto nodes = elements_[k].list();
      auto& set = mesh.node_sets[name];
      set.insert(set.end(), nodes.begin(), nodes.end());
    }
  for (auto& [name, set] : mesh.node_sets) sort_unique(set);
  for (auto& [name, set] : mesh.element_sets) sort_unique(set);
  if (solids) add_face_sets(mesh);
}

void FileElements::add_face_sets(Mesh& mesh) const {
  const std::map<Corners, MeshFace> faces = faces_by_corners(mesh);
  for (const auto& [name, members] : sets_)
    for (const std::size_t k : members) {
      const auto& shape = shape_of(elements_[k].type);
      if (shape.dimension != 2) continue;
      const auto found = faces.find(sorted_corners(elements_[k].list(), shape.corners));
      if (found != faces.end()) mesh.face_sets[name].push_back(found->second);
    }
}

void note_complete_kinds(Mesh& mesh, const std::map<std::string, long>& kinds) {
  if (kinds.empty()) return;
  std::string list;
  for (const auto& [name, count] : kinds) list += fmt::format("{}{} {}", list.empty() ? "" : ", ", count, name);
  mesh.notices.push_back(
      fmt::format("{}: {} are read as elements of second order without nodes in the middle of faces and volumes "
                  "(tri6, quad8, hex20, wedge15); those nodes are dropped",
                  mesh.name, list));
}

void add_faces_of_surface_elements(Mesh& mesh) {
  std::map<Corners, MeshFace> faces;
  for (const auto& [name, elements] : mesh.element_sets) {
    if (mesh.face_sets.contains(name)) continue;
    std::vector<MeshFace> found;
    for (const Index e : elements) {
      const auto& shape = shape_of(mesh.type(e));
      if (shape.dimension != 2) continue;
      if (faces.empty()) faces = faces_by_corners(mesh);
      if (const auto it = faces.find(sorted_corners(mesh.element(e), shape.corners)); it != faces.end())
        found.push_back(it->second);
    }
    if (!found.empty()) mesh.face_sets[name] = std::move(found);
  }
}

void add_faces_of_node_sets(Mesh& mesh) {
  if (mesh.node_sets.empty()) return;
  const std::vector<MeshFace> outer = mesh.boundary_faces();
  std::vector<char> member(mesh.nodes.size());
  for (const auto& [name, nodes] : mesh.node_sets) {
    if (mesh.face_sets.contains(name)) continue;
    std::fill(member.begin(), member.end(), 0);
    for (const Index n : nodes) member[at(n)] = 1;
    std::vector<MeshFace> faces;
    for (const MeshFace& face : outer) {
      const auto of_face = mesh.face_nodes(face);
      if (std::all_of(of_face.begin(), of_face.end(), [&](Index n) { return member[at(n)] != 0; }))
        faces.push_back(face);
    }
    if (!faces.empty()) mesh.face_sets[name] = std::move(faces);
  }
}

}  // namespace espalier::dynamics
