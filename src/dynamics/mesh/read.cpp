#include "dynamics/mesh/read.hpp"

#include <fmt/format.h>

#include "dynamics/mesh/file_elements.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {
namespace {

struct Format {
  const char* ending;  // upper case
  Mesh (*read)(const std::string& path);
};
constexpr Format kFormats[] = {{".MSH", read_gmsh},    {".INP", read_inp},     {".VTK", read_vtk},
                               {".BDF", read_nastran}, {".NAS", read_nastran}, {".DAT", read_nastran}};

}  // namespace

Mesh read_mesh(const std::string& path) {
  std::string name = upper(path);
  if (name.ends_with(".GZ")) name.resize(name.size() - 3);
  for (const Format& format : kFormats)
    if (name.ends_with(format.ending)) {
      Mesh mesh = format.read(path);
      add_faces_of_surface_elements(mesh);
      add_faces_of_node_sets(mesh);
      return mesh;
    }
  throw Error(StatusCode::invalid_input,
              fmt::format("{}: unknown kind of mesh file; .msh (Gmsh), .inp (Abaqus, CalculiX), .vtk (legacy VTK) and "
                          ".bdf, .nas, .dat (Nastran) are read",
                          path));
}

}  // namespace espalier::dynamics
