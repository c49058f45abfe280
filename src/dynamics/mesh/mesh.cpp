#include "dynamics/mesh/mesh.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "base/at.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

template <class Sets>
const auto& find_set(const Sets& sets, const std::string& set, const char* kind, const std::string& mesh) {
  if (const auto found = find_named(sets, set); found != sets.end()) return found->second;
  std::vector<std::string> names;
  for (const auto& entry : sets) names.push_back(entry.first);
  throw Error(StatusCode::invalid_input,
              fmt::format("mesh '{}' has no {} set '{}'; it has: {}", mesh, kind, set,
                          names.empty() ? std::string("none") : fmt::format("{}", fmt::join(names, ", "))));
}

/// A face as its sorted corner nodes, with -1 for the missing fourth of a triangle.
struct FaceKey {
  std::array<Index, 4> corners;
  MeshFace face;
};

FaceKey key_of(const Mesh& mesh, MeshFace face) {
  FaceKey key{{-1, -1, -1, -1}, face};
  const auto nodes = mesh.element(face.element);
  const auto& shape = shape_of(mesh.type(face.element)).faces[at(face.face)];
  const int corners = shape_of(shape.type).corners;
  for (int c = 0; c < corners; ++c) key.corners[c] = nodes[at(shape.nodes[c])];
  std::sort(key.corners.begin(), key.corners.end());
  return key;
}

}  // namespace

void sort_unique(std::vector<Index>& list) {
  std::sort(list.begin(), list.end());
  list.erase(std::unique(list.begin(), list.end()), list.end());
}

Index Mesh::add_element(ElementType element_type, std::span<const Index> element_nodes) {
  if (element_nodes.size() != at(shape_of(element_type).nodes))
    throw std::invalid_argument(fmt::format("Mesh::add_element: {} nodes given, {} has {}", element_nodes.size(),
                                            shape_of(element_type).name, shape_of(element_type).nodes));
  types_.push_back(element_type);
  connectivity_.insert(connectivity_.end(), element_nodes.begin(), element_nodes.end());
  start_.push_back(static_cast<Offset>(connectivity_.size()));
  return element_count() - 1;
}

std::span<const Index> Mesh::element(Index e) const {
  const auto i = at(e);
  return {connectivity_.data() + start_[i], at(start_[i + 1] - start_[i])};
}

std::vector<Index> Mesh::face_nodes(MeshFace face) const {
  const auto& faces = shape_of(type(face.element)).faces;
  if (face.face < 0 || at(face.face) >= faces.size())
    throw std::invalid_argument(fmt::format("Mesh::face_nodes: element {} ({}) has no face {}",
                                            element_label(face.element), shape_of(type(face.element)).name,
                                            face.face + 1));
  const auto nodes_of_element = element(face.element);
  std::vector<Index> result;
  for (const int n : faces[at(face.face)].nodes) result.push_back(nodes_of_element[at(n)]);
  return result;
}

std::int64_t Mesh::node_label(Index node) const { return node_labels.empty() ? node + 1 : node_labels[at(node)]; }
std::int64_t Mesh::element_label(Index e) const { return element_labels.empty() ? e + 1 : element_labels[at(e)]; }

const std::vector<Index>& Mesh::node_set(const std::string& set) const {
  return find_set(node_sets, set, "node", name);
}
const std::vector<Index>& Mesh::element_set(const std::string& set) const {
  return find_set(element_sets, set, "element", name);
}
const std::vector<MeshFace>& Mesh::face_set(const std::string& set) const {
  return find_set(face_sets, set, "face", name);
}

std::vector<Index> Mesh::nodes_of_faces(std::span<const MeshFace> faces) const {
  std::vector<Index> result;
  for (const MeshFace& face : faces)
    for (const Index n : face_nodes(face)) result.push_back(n);
  sort_unique(result);
  return result;
}

std::vector<MeshFace> Mesh::boundary_faces() const {
  std::vector<FaceKey> keys;
  for (Index e = 0; e < element_count(); ++e)
    for (int f = 0; f < static_cast<int>(shape_of(type(e)).faces.size()); ++f) keys.push_back(key_of(*this, {e, f}));
  std::sort(keys.begin(), keys.end(), [](const FaceKey& a, const FaceKey& b) {
    return a.corners != b.corners ? a.corners < b.corners : a.face < b.face;
  });
  std::vector<MeshFace> result;
  for (std::size_t i = 0; i < keys.size();) {
    std::size_t j = i + 1;
    while (j < keys.size() && keys[j].corners == keys[i].corners) ++j;
    if (j == i + 1) result.push_back(keys[i].face);
    i = j;
  }
  std::sort(result.begin(), result.end());
  return result;
}

std::vector<Index> Mesh::pieces(std::span<const Index> elements) const {
  std::vector<Index> lower(nodes.size(), -1);  // of a node: one of the same piece, or itself; -1: not met yet
  const auto lowest = [&](Index n) {
    while (lower[at(n)] != n) {
      Index& next = lower[at(n)];
      next = lower[at(next)];
      n = next;
    }
    return n;
  };
  const auto join = [&](Index e) {
    for (const Index n : element(e)) {
      if (lower[at(n)] < 0) lower[at(n)] = n;
      const Index a = lowest(n), b = lowest(element(e).front());
      lower[at(std::max(a, b))] = std::min(a, b);
    }
  };
  for (const Index e : elements) join(e);
  for (Index e = 0; elements.empty() && e < element_count(); ++e) join(e);
  std::vector<Index> found;
  for (Index n = 0; n < static_cast<Index>(nodes.size()); ++n)
    if (lower[at(n)] == n) found.push_back(n);
  return found;
}

Index Mesh::drop_unused_nodes() {
  std::vector<Index> renumbered(nodes.size(), -1);
  for (const Index n : connectivity_) renumbered[at(n)] = 0;
  if (node_labels.empty() && std::find(renumbered.begin(), renumbered.end(), -1) != renumbered.end()) {
    node_labels.resize(nodes.size());  // those that stay keep the number that they have
    std::iota(node_labels.begin(), node_labels.end(), std::int64_t{1});
  }
  Index kept = 0;
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    if (renumbered[n] < 0) continue;
    renumbered[n] = kept;
    nodes[at(kept)] = nodes[n];
    if (!node_labels.empty()) node_labels[at(kept)] = node_labels[n];
    ++kept;
  }
  const Index dropped = static_cast<Index>(nodes.size()) - kept;
  nodes.resize(at(kept));
  if (!node_labels.empty()) node_labels.resize(at(kept));
  for (Index& n : connectivity_) n = renumbered[at(n)];
  for (auto& entry : node_sets) {
    for (Index& n : entry.second) n = renumbered[at(n)];
    std::erase(entry.second, -1);
  }
  return dropped;
}

}  // namespace espalier::dynamics
