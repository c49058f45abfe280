#include "dynamics/mesh/read.hpp"

#include <fmt/format.h>

#include "dynamics/mesh/file_elements.hpp"
#include "dynamics/mesh/read/formats.hpp"

namespace espalier::dynamics {

Mesh read_mesh(const std::string& path) {
  if (const MeshFormat* format = mesh_format_of(path); format != nullptr) {
    Mesh mesh = format->read(path);
    add_faces_of_surface_elements(mesh);
    add_faces_of_node_sets(mesh);
    return mesh;
  }
  std::string known;
  for (const MeshFormat& format : mesh_formats())
    known += fmt::format("{}{} ({})", known.empty() ? "" : ", ", format.endings, format.program);
  throw Error(
      StatusCode::invalid_input,
      fmt::format("{}: unknown kind of mesh file; read are {}. Closed surfaces (.stl, .obj) are bodies of type rigid",
                  path, known));
}

}  // namespace espalier::dynamics
