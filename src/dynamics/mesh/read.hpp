/// \file
/// Readers of mesh files. All throw espalier::Error(invalid_input) with "file:line: what, and what to do".
#pragma once

#include <string>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// Reads a mesh by the ending of its name, in small or capital letters, which .gz may follow (read/formats.hpp).
/// A node set is a face set too, where outer faces have all their nodes in it (see add_faces_of_node_sets).
Mesh read_mesh(const std::string& path);
/// The sets that read_mesh() adds to those of the file.
void complete_sets(Mesh& mesh);

/// Gmsh .msh, versions 2.0 to 2.2, 4.0 and 4.1, ASCII and binary (both byte orders are told apart, only the machine's
/// own is read). Kept: nodes, elements of the shapes of ElementType (complete ones of second order lose the nodes in
/// the middle of faces and volumes, with a notice; higher-order and unknown shapes are errors that name the shape),
/// physical groups. A physical group of dimension 3 becomes an element set; of dimension 2 a node set and, where its
/// elements are faces of solids, a face set; of dimensions 1 and 0 a node set. Where solids are present, surface, line
/// and point elements are not kept as elements. Groups without a name are called "dim-tag", for instance "2-7". Not
/// read: periodic data, post-processing data, partitions.
Mesh read_gmsh(const std::string& path);
/// The same of a text; `name` stands for the file in messages. So with the other formats.
Mesh parse_gmsh(std::string content, const std::string& name);

/// Abaqus/CalculiX .inp, the subset
///   *NODE [NSET], *ELEMENT TYPE= [ELSET], *NSET / *ELSET [GENERATE] [INSTANCE], *SURFACE TYPE=ELEMENT with S1..S6 or a
///   plain node list (TYPE=NODE), *MATERIAL, *DENSITY, *ELASTIC (isotropic, first line), *SOLID SECTION, *PART,
///   *ASSEMBLY, *INSTANCE (with translation and rotation lines), *INCLUDE INPUT=, continuation lines, comments,
///   *SYSTEM, *NODE SYSTEM=C and S, *NGEN, *NFILL, *NCOPY, *ELGEN, *ELCOPY.
/// Keywords and names are not case-sensitive; sets and materials keep the spelling of their first appearance.
/// Element types: C3D4, C3D10(M), C3D8(R, I), C3D20(R), C3D6, C3D15, CSS8, SC8R, SC6R, and shells, membranes
/// and surfaces with 3, 4, 6, 8 nodes, two- and three-node beams and trusses.
/// Elements of other types are passed over, also in sets, and counted in a notice; C3D elements of unknown shape are
/// errors. Other keywords (steps, loads, supports) are skipped with their data lines and counted in a notice.
/// A set that is defined more than once is the union. Node and element labels are kept.
Mesh read_inp(const std::string& path);
Mesh parse_inp(std::string content, const std::string& name);

/// Legacy .vtk, unstructured grids, versions 1 to 5 (from 5 on with OFFSETS and CONNECTIVITY), ASCII and binary.
/// Cells of the shapes of ElementType and pixels and voxels; others are errors. Whole numbers of one component in
/// CELL_DATA and POINT_DATA become sets "name-value" (not if there are more than 256 different values: notice); where
/// solids are present, cells of lower dimension become sets only. There are no labels: nodes and elements count from 1.
/// In binary files the line of a message counts text lines and those parts of binary data that look like lines.
Mesh read_vtk(const std::string& path);
Mesh parse_vtk(std::string content, const std::string& name);

/// XML .vtu, unstructured grids: text, base64 and raw arrays, in place and appended, plain and packed by zlib, of both
/// byte orders. Cells, sets and labels as read_vtk().
Mesh read_vtu(const std::string& path);
Mesh parse_vtu(std::string content, const std::string& name);

/// Ansys .cdb: NBLOCK, EBLOCK (SOLID), ET, CMBLOCK, MPDATA, MP. Degenerate hexahedra become the tetrahedra, wedges and
/// pyramids that they are. Element sets "material-N" and "type-N".
Mesh read_cdb(const std::string& path);
Mesh parse_cdb(std::string content, const std::string& name);

/// .mesh of MEDIT or MFEM, told apart by their first line. Sets "ref-N", "surface-N", "edge-N", "vertex-N"; of MFEM
/// "attribute-N" and "boundary-N".
Mesh read_dot_mesh(const std::string& path);
Mesh parse_dot_mesh(std::string content, const std::string& name);
Mesh parse_medit(std::string content, const std::string& name);

/// Nastran bulk data (small, large and free fields; continuation lines anywhere, by their marks; INCLUDE; cards
/// repeated by "="): GRID in the basic system or those of CORD1R, CORD1C, CORD1S, CORD2R, CORD2C, CORD2S, by themselves
/// or by GRDSET; CTETRA (4, 10), CHEXA (8, 20), CPENTA (6, 15), CPYRAM (5), also left-handed, and the shells
/// CTRIA3/6/R, CQUAD4/8/R; PSOLID and MAT1; SPC, SPC1, FORCE. Elements of a property become the set
/// "property-<number>"; grid points that are held or loaded become the node sets "SPC-<number>" and "FORCE-<number>".
/// Where solids are present, shells become sets only. Other cards are passed over and counted in a notice. Without
/// BEGIN BULK the whole file is bulk data.
Mesh read_nastran(const std::string& path);
Mesh parse_nastran(std::string content, const std::string& name);

}  // namespace espalier::dynamics
