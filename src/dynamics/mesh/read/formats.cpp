#include "dynamics/mesh/read/formats.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {
namespace {

constexpr MeshFormat kFormats[] = {
    {".inp", "Abaqus, CalculiX, Gmsh", read_inp,
     "C3D4, C3D10, C3D8, C3D20, C3D6, C3D15 with letters behind them; CSS8, SC8R, SC6R as solids; shells, membranes, "
     "beams, trusses",
     "node sets, element sets, surfaces by name, in any case; of several instances `PART-1-1.SET`, and all of one as "
     "`PART-1-1.*`",
     "*MATERIAL with *ELASTIC and *DENSITY, *SOLID SECTION, also several; *PART, *INSTANCE; *INCLUDE of keywords and "
     "of data lines, "
     "INPUT=; *NSET, ELSET=; surfaces without face labels; *NGEN, *NFILL, *NCOPY, *ELGEN, *ELCOPY; *SYSTEM, *NODE in "
     "cylindrical and spherical coordinates",
     "masses, springs, dashpots, connectors, rigid faces, couplings and other elements; supports, loads, steps: "
     "counted "
     "in notices, or taken over by `take`. *NMAP is refused",
     parse_inp_deck},
    {".msh", "Gmsh", read_gmsh,
     "points, lines, triangles, quadrilaterals, tetrahedra, hexahedra, wedges of order 1 and 2, pyramid5",
     "physical groups by name, or `2-7` (dimension and tag)", "versions 2.0 to 2.2, 4.0 and 4.1, text and binary",
     "nodes in the middle of faces and volumes (quad9, hex27, wedge18): notice. Version 1, order 3 and above, "
     "pyramid13 "
     "and pyramid14 are refused"},
    {".bdf .nas .dat", "Nastran", read_nastran,
     "CTETRA, CHEXA, CPENTA of order 1 and 2, CPYRAM of order 1, also left-handed; CTRIA3, CTRIA6, CTRIAR, CQUAD4, "
     "CQUAD8, CQUADR; CBAR, CBEAM, CROD",
     "`property-N`; grid points held or loaded: `SPC-N`, `FORCE-N`",
     "PSOLID, PSHELL, PCOMP and MAT1; CORD1R, CORD1C, CORD1S, CORD2R, CORD2C, CORD2S, GRDSET; INCLUDE; fields of 8, of "
     "16 columns and "
     "between commas, continuation lines anywhere, cards repeated by `=`",
     "other cards: counted in a notice, or taken over by `take`", parse_nastran_deck},
    {".cdb", "Ansys (CDWRITE)", read_cdb,
     "SOLID185, 186, 187, 285, 45, 95, 92, 190 with their tetrahedra, wedges and pyramid5; SHELL181, 281, 63, 93; "
     "LINK180, "
     "BEAM188",
     "components (CMBLOCK) by name; `material-N`, `type-N`", "EX, NUXY or PRXY, DENS of MPDATA and MP",
     "other element types: counted in a notice. SOLID186 as a pyramid or without some mid-side nodes is refused"},
    {".vtk", "VTK, ParaView (legacy)", read_vtk,
     "vertices, lines, triangles, quadrilaterals, pixels, tetrahedra, hexahedra, voxels, wedges of order 1 and 2, "
     "pyramids of order 1",
     "`NAME-VALUE` for every value of whole-number data of cells and points",
     "versions 1 to 5, text and binary, unstructured grids",
     "nodes in the middle of faces and volumes; data with more than 256 values: notice"},
    {".vtu", "VTK, ParaView (XML), and what `simulate` writes", read_vtu, "as .vtk", "as .vtk",
     "text, base64 and raw data, in place and appended, plain and compressed by zlib; both byte orders; several pieces",
     "as .vtk; compression by LZ4 and LZMA is refused"},
    {".mesh", "MEDIT (sfepy, FreeFEM, mmg) and MFEM", read_dot_mesh,
     "tetrahedra, hexahedra, prisms, pyramids, triangles, quadrilaterals, edges; of MFEM also curved ones of order 2 "
     "and "
     "3 (as order 2)",
     "MEDIT: `ref-N` of solids, `surface-N`, `edge-N`, `vertex-N`; MFEM: `attribute-N`, `boundary-N`", "text",
     "other sections of MEDIT: notice. MEDIT's second order, MFEM's NURBS, non-conforming and discontinuous meshes are "
     "refused"},
};

}  // namespace

std::span<const MeshFormat> mesh_formats() { return kFormats; }

const MeshFormat* mesh_format_of(const std::string& path) {
  std::string name = lower(path);
  if (name.ends_with(".gz")) name.resize(name.size() - 3);
  for (const MeshFormat& format : kFormats) {
    std::string_view endings = format.endings;
    while (!endings.empty()) {
      const std::string_view ending = endings.substr(0, endings.find(' '));
      if (name.ends_with(ending)) return &format;
      endings.remove_prefix(std::min(ending.size() + 1, endings.size()));
    }
  }
  return nullptr;
}

bool is_deck(const std::string& path) {
  const MeshFormat* format = mesh_format_of(path);
  return format != nullptr && format->deck != nullptr;
}

std::string mesh_formats_table() {
  std::string text =
      "| ending | files of | elements | sets | further | passed over or refused |\n|---|---|---|---|---|---|\n";
  for (const MeshFormat& f : kFormats) {
    std::string endings = "`";
    for (const char* c = f.endings; *c != 0; ++c) endings += *c == ' ' ? std::string("`, `") : std::string(1, *c);
    std::string row = fmt::format("| {}` | {} | {} | {} | {} | {} |\n", endings, f.program, f.elements, f.sets, f.more,
                                  f.passed_over);
    for (std::size_t at = 0; (at = row.find('*', at)) != std::string::npos;) {
      const bool keyword = row[at - 1] != '.';  // `PART-1-1.*` is code
      if (keyword) row.insert(at, "\\");
      at += keyword ? 2 : 1;
    }
    text += row;
  }
  return text;
}

std::string mesh_is_no_model(const std::string& path) {
  const MeshFormat* format = mesh_format_of(path);
  if (format == nullptr) return "";
  const std::string file = std::filesystem::path(path).filename().string();
  return fmt::format(
      "'{}' is a mesh ({}), no model. See what it holds: 'espalier mesh {}'; have a first model written: 'espalier "
      "mesh "
      "{} --model part.toml'. A model says what is done with it and begins so:\n"
      "  [bodies.part]\n  type = \"solid\"\n  mesh = {{ file = \"{}\" }}\n"
      "  material = {{ young = 210e9, poisson = 0.3, density = 7850 }}",
      path, format->program, path, path, file);
}

}  // namespace espalier::dynamics
