#include "dynamics/mesh/read.hpp"

#include <fmt/format.h>

#include "dynamics/mesh/deck/deck.hpp"
#include "dynamics/mesh/file_elements.hpp"
#include "dynamics/mesh/file_source.hpp"
#include "dynamics/mesh/read/formats.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {

void complete_sets(Mesh& mesh) {
  add_faces_of_surface_elements(mesh);
  add_faces_of_node_sets(mesh);
}

Deck read_deck(const std::string& path, int step) {
  const MeshFormat* format = mesh_format_of(path);
  if (format == nullptr || format->deck == nullptr)
    throw Error(
        StatusCode::invalid_input,
        fmt::format("'{}' is no deck; 'take' is for files of Abaqus, CalculiX (.inp) and Nastran (.bdf, .nas, .dat)",
                    path));
  if (!file_exists(path))
    throw Error(StatusCode::invalid_input,
                fmt::format("there is no mesh file '{}'; paths are relative to the folder of the model", path));
  Deck deck = format->deck(read_whole_file(path), path, step);
  bool has[4] = {};
  for (Index e = 0; e < deck.mesh.element_count(); ++e) has[shape_of(deck.mesh.type(e)).dimension] = true;
  if (has[2]) deck.shell_sections = read_shell_sections(path).list;
  if (has[1]) deck.line_sections = read_line_sections(path, deck.mesh);
  return deck;
}

Mesh read_mesh(const std::string& path) {
  if (const MeshFormat* format = mesh_format_of(path); format != nullptr) {
    Mesh mesh = format->read(path);
    complete_sets(mesh);
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
