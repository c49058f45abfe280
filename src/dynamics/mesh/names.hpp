/// \file
/// Names of sets, nodes and elements of meshes, as people write and read them.
#pragma once

#include <span>
#include <string>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// Equal but for capital letters.
[[nodiscard]] bool same_word(const std::string& a, const std::string& b);

/// The entry of this name; without one, the only entry whose name differs by capitals alone.
template <class Map>
[[nodiscard]] typename Map::const_iterator find_named(const Map& map, const std::string& name) {
  if (const auto exact = map.find(name); exact != map.end()) return exact;
  auto found = map.end();
  for (auto it = map.begin(); it != map.end(); ++it) {
    if (!same_word(it->first, name)) continue;
    if (found != map.end()) return map.end();
    found = it;
  }
  return found;
}

/// The sets of all nodes and elements of an instance are called so: "PART-1-1.*".
inline constexpr const char* kWholeInstance = ".*";

/// The label for messages, with the instance where a file has several: "12", "PART-1-2.12".
[[nodiscard]] std::string node_name(const Mesh& mesh, Index node);
[[nodiscard]] std::string element_name(const Mesh& mesh, Index element);

/// Drops all other elements; sets and labels follow, and sets that become empty are dropped.
/// @param elements  rising, no repeats
void keep_elements(Mesh& mesh, std::span<const Index> elements);

}  // namespace espalier::dynamics
