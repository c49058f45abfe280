#include "dynamics/mesh/names.hpp"

#include <algorithm>

namespace espalier::dynamics {
namespace {

/// "PART-1-2." for a node or element that a whole instance holds, or "".
std::string instance_prefix(const std::map<std::string, std::vector<Index>>& sets, Index member) {
  for (const auto& [name, members] : sets)
    if (name.ends_with(kWholeInstance) && std::binary_search(members.begin(), members.end(), member))
      return name.substr(0, name.size() - 1);
  return "";
}

}  // namespace

bool same_word(const std::string& a, const std::string& b) {
  const auto small = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  return a.size() == b.size() &&
         std::equal(a.begin(), a.end(), b.begin(), [&](char x, char y) { return small(x) == small(y); });
}

std::string node_name(const Mesh& mesh, Index node) {
  return instance_prefix(mesh.node_sets, node) + std::to_string(mesh.node_label(node));
}
std::string element_name(const Mesh& mesh, Index element) {
  return instance_prefix(mesh.element_sets, element) + std::to_string(mesh.element_label(element));
}

void keep_elements(Mesh& mesh, std::span<const Index> elements) {
  std::vector<Index> became(at(mesh.element_count()), -1);
  Mesh kept;
  for (const Index e : elements) {
    became[at(e)] = kept.add_element(mesh.type(e), mesh.element(e));
    if (!mesh.element_labels.empty()) kept.element_labels.push_back(mesh.element_label(e));
  }
  for (auto& [set, members] : mesh.element_sets) {
    for (Index& e : members) e = became[at(e)];
    std::erase(members, -1);
  }
  for (auto& [set, faces] : mesh.face_sets) {
    for (MeshFace& face : faces) face.element = became[at(face.element)];
    std::erase_if(faces, [](const MeshFace& face) { return face.element < 0; });
  }
  const auto is_empty = [](const auto& set) { return set.second.empty(); };
  std::erase_if(mesh.element_sets, is_empty);
  std::erase_if(mesh.face_sets, is_empty);
  kept.name = std::move(mesh.name);
  kept.nodes = std::move(mesh.nodes);
  kept.node_labels = std::move(mesh.node_labels);
  kept.node_sets = std::move(mesh.node_sets);
  kept.element_sets = std::move(mesh.element_sets);
  kept.face_sets = std::move(mesh.face_sets);
  kept.materials = std::move(mesh.materials);
  kept.notices = std::move(mesh.notices);
  kept.section_material = std::move(mesh.section_material);
  mesh = std::move(kept);
}

}  // namespace espalier::dynamics
