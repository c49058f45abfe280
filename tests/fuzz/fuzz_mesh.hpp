/// \file
/// What the fuzz targets of the mesh readers share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "dynamics/mesh/file_elements.hpp"
#include "dynamics/mesh/read.hpp"

namespace espalier::dynamics {

/// Arbitrary bytes as a mesh file: an error that names the file, or a mesh whose elements and sets lie within it.
inline int fuzz_mesh(Mesh (*parse)(std::string, const std::string&), const std::uint8_t* data, std::size_t size) {
  try {
    Mesh mesh = parse(std::string(reinterpret_cast<const char*>(data), size), "fuzz");
    add_faces_of_node_sets(mesh);
    mesh.drop_unused_nodes();
    const auto inside = [&](Index n, Index count) {
      if (n < 0 || n >= count) std::abort();
    };
    const auto nodes = static_cast<Index>(mesh.nodes.size());
    for (Index e = 0; e < mesh.element_count(); ++e)
      for (const Index n : mesh.element(e)) inside(n, nodes);
    for (const auto& [name, set] : mesh.node_sets)
      for (const Index n : set) inside(n, nodes);
    for (const auto& [name, set] : mesh.element_sets)
      for (const Index e : set) inside(e, mesh.element_count());
    for (const auto& [name, set] : mesh.face_sets)
      for (const MeshFace& face : set) inside(face.element, mesh.element_count());
  } catch (const Error& error) {
    if (error.status().code != StatusCode::invalid_input || std::string(error.what()).find("fuzz") != 0) std::abort();
  }
  return 0;
}

}  // namespace espalier::dynamics
