// Mesh readers: files written here in every dialect, mistakes in them, and real meshes where they are present.
#include <cstdint>

#include "dynamics/elements/groups.hpp"
#include "dynamics/mesh/mesh_files.hpp"
#include "places.hpp"

namespace espalier::dynamics::test {
namespace mesh_read_test {

namespace fs = std::filesystem;

using MeshRead = MeshFiles;

/// Two tetrahedra on a square base with a named volume, a named face and a named point.
const char* const kNodes2 = "$Nodes\n5\n10 0 0 0\n20 1 0 0\n30 0 1 0\n40 0 0 1\n50 1 1 1\n$EndNodes\n";

std::string gmsh2(bool binary) {
  std::string s = fmt::format("$MeshFormat\n2.2 {} 8\n", binary ? 1 : 0);
  const auto append = [&](auto value) { s.append(reinterpret_cast<const char*>(&value), sizeof value); };
  if (binary) {
    append(std::int32_t{1});
    s += "\n";
  }
  s += "$EndMeshFormat\n$PhysicalNames\n3\n3 1 \"part one\"\n2 2 \"base\"\n0 3 \"tip\"\n$EndPhysicalNames\n";
  if (!binary)
    return s + kNodes2 +
           "$Elements\n4\n1 15 2 3 1 40\n2 2 2 2 1 10 30 20\n3 4 2 1 1 10 20 30 40\n4 4 2 1 1 20 50 30 "
           "40\n$EndElements\n";
  s += "$Nodes\n5\n";
  const double xyz[5][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}};
  for (int n = 0; n < 5; ++n) {
    append(std::int32_t{10 * (n + 1)});
    for (const double x : xyz[n]) append(x);
  }
  s += "\n$EndNodes\n$Elements\n4\n";
  for (const int v : {15, 1, 2, 1, 3, 1, 40}) append(std::int32_t{v});
  for (const int v : {2, 1, 2, 2, 2, 1, 10, 30, 20}) append(std::int32_t{v});
  for (const int v : {4, 2, 2, 3, 1, 1, 10, 20, 30, 40, 4, 1, 1, 20, 50, 30, 40}) append(std::int32_t{v});
  return s + "\n$EndElements\n";
}

std::string gmsh4(bool binary) {
  std::string s = fmt::format("$MeshFormat\n4.1 {} 8\n", binary ? 1 : 0);
  const auto word = [&](std::uint64_t v) {
    if (binary)
      s.append(reinterpret_cast<const char*>(&v), 8);
    else
      s += fmt::format("{} ", v);
  };
  const auto number = [&](std::int32_t v) {
    if (binary)
      s.append(reinterpret_cast<const char*>(&v), 4);
    else
      s += fmt::format("{} ", v);
  };
  const auto real = [&](double v) {
    if (binary)
      s.append(reinterpret_cast<const char*>(&v), 8);
    else
      s += fmt::format("{} ", v);
  };
  const auto end_line = [&] {
    if (!binary) s += "\n";
  };
  if (binary) {
    const std::int32_t one = 1;
    s.append(reinterpret_cast<const char*>(&one), 4);
    s += "\n";
  }
  s += "$EndMeshFormat\n$PhysicalNames\n3\n3 1 \"part one\"\n2 2 \"base\"\n0 3 \"tip\"\n$EndPhysicalNames\n$Entities\n";
  for (const int v : {1, 0, 1, 1}) word(v);
  end_line();
  number(7);
  for (int i = 0; i < 3; ++i) real(0);
  word(1), number(3), end_line();  // point 7: tip
  number(8);
  for (int i = 0; i < 6; ++i) real(i);
  word(1), number(2), word(2), number(5), number(-6), end_line();  // surface 8: base
  number(9);
  for (int i = 0; i < 6; ++i) real(i);
  word(1), number(1), word(1), number(8), end_line();  // volume 9
  s += binary ? "\n$EndEntities\n$Nodes\n" : "$EndEntities\n$Nodes\n";
  for (const int v : {2, 5, 10, 50}) word(v);
  end_line();
  const double xyz[5][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}};
  number(0), number(7), number(0), word(1), end_line();
  word(40), end_line();
  for (const double x : xyz[3]) real(x);
  end_line();
  number(3), number(9), number(0), word(4), end_line();
  for (const int n : {10, 20, 30, 50}) word(n), end_line();
  for (const int n : {0, 1, 2, 4}) {
    for (const double x : xyz[n]) real(x);
    end_line();
  }
  s += binary ? "\n$EndNodes\n$Elements\n" : "$EndNodes\n$Elements\n";
  for (const int v : {3, 4, 1, 4}) word(v);
  end_line();
  number(0), number(7), number(15), word(1), end_line();
  word(1), word(40), end_line();
  number(2), number(8), number(2), word(1), end_line();
  for (const int v : {2, 10, 30, 20}) word(v);
  end_line();
  number(3), number(9), number(4), word(2), end_line();
  for (const int v : {3, 10, 20, 30, 40}) word(v);
  end_line();
  for (const int v : {4, 20, 50, 30, 40}) word(v);
  end_line();
  return s + (binary ? "\n$EndElements\n" : "$EndElements\n");
}

TEST_F(MeshRead, GmshDialectsGiveTheSameMesh) {
  for (const std::string& content : {gmsh2(false), gmsh2(true), gmsh4(false), gmsh4(true)}) {
    const Mesh mesh = read_gmsh(write("two.msh", content));
    ASSERT_EQ(mesh.nodes.size(), 5U);
    ASSERT_EQ(mesh.element_count(), 2);
    EXPECT_EQ(mesh.type(0), ElementType::tet4);
    EXPECT_EQ(mesh.element_label(1), 4);
    EXPECT_NEAR(mesh_volume(mesh), 1.0 / 6 + 1.0 / 3, 1e-15);
    EXPECT_EQ(mesh.element_set("part one"), (std::vector<Index>{0, 1}));
    ASSERT_EQ(mesh.node_set("tip").size(), 1U);
    EXPECT_EQ(mesh.node_label(mesh.node_set("tip")[0]), 40);
    EXPECT_EQ(mesh.node_set("base").size(), 3U);
    ASSERT_EQ(mesh.face_set("base").size(), 1U);
    EXPECT_EQ(mesh.face_set("base")[0].element, 0);
    const auto face = mesh.face_nodes(mesh.face_set("base")[0]);
    EXPECT_EQ(mesh.node_label(face[0]), 10);
  }
}

// Truth: the edges that mid-side nodes of Gmsh lie on.
TEST_F(MeshRead, GmshSecondOrderNodeOrder) {
  const MidSideEdges edges{
      {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {2, 3}, {1, 3}},
      {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3}, {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7}}};
  for (const bool is_tet : {true, false}) {
    const std::vector<Point> nodes = second_order_nodes(is_tet, edges);
    std::string s = fmt::format("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", nodes.size()), element;
    for (std::size_t a = 0; a < nodes.size(); ++a) {
      s += fmt::format("{} {} {} {}\n", a + 1, nodes[a][0], nodes[a][1], nodes[a][2]);
      element += fmt::format(" {}", a + 1);
    }
    s += fmt::format("$EndNodes\n$Elements\n1\n1 {} 2 1 1{}\n$EndElements\n", is_tet ? 11 : 17, element);
    expect_second_order(read_gmsh(write("second.msh", s)), is_tet);
  }
}

TEST_F(MeshRead, GmshMistakesAreNamed) {
  std::string bad = gmsh2(false);
  bad.replace(bad.find("4 4 2 1 1 20 50"), 15, "4 4 2 1 1 20 99");
  expect_error(write("a.msh", bad), 23, "node 99, which is not defined");
  bad = gmsh2(false);
  bad.replace(bad.find("30 0 1 0"), 8, "30 0 x 0");
  expect_error(write("b.msh", bad), 14, "'x' is not a number");
  bad = gmsh2(false);
  bad.replace(bad.find("2.2"), 3, "3.0");
  expect_error(write("c.msh", bad), 2, "version 3 is not read");
  bad = gmsh2(false);
  bad.replace(bad.find("3 4 2 1 1"), 9, "3 92 2 1 1");
  expect_error(write("d.msh", bad), 22, "element type 92");
  expect_error(write("e.msh", "$NOD\n1\n"), 1, "MSH version 1, which is not read");
  const std::string cut = gmsh2(true);
  EXPECT_THROW(static_cast<void>(read_gmsh(write("f.msh", cut.substr(0, cut.size() - 60)))), Error);
  EXPECT_THROW(static_cast<void>(read_mesh((folder_ / "absent.msh").string())), Error);
  EXPECT_THROW(static_cast<void>(read_mesh(write("g.stl", "solid"))), Error);
}

const char* const kInp = R"(** a comment
*Heading
 two hexahedra
*NODE, NSET=NALL
1, 0., 0., 0.
2, 1.0, 0, 0
3, 1, 1, 0
4, 0, 1d0, 0
5, 0, 0, 1
6, 1, 0, 1
7, 1, 1, 1
8, 0, 1, 1
9, 0, 0, 2
10, 1, 0, 2
11, 1, 1, 2
12, 0, 1, 2
*Element, type=C3D8R, ELSET=Eall
7, 1,2,3,4,
 5,6,7,8
9, 5,6,7,8,9,10,11,12
*NSET, nset=Bottom, GENERATE
1, 4, 1
*nset, NSET = Both
Bottom, 12,
*ELSET, ELSET=Top
9
*Surface, name=Lid, type=ELEMENT
Top, S2
*Solid Section, elset=EALL,
 material=Steel
*Material, name=steel
*Elastic
2.1e11, 0.3
*Density
 7850.,
*STEP
*STATIC
1., 1.
*END STEP
)";

TEST_F(MeshRead, InpSubset) {
  const Mesh mesh = read_inp(write("two.inp", kInp));
  ASSERT_EQ(mesh.nodes.size(), 12U);
  ASSERT_EQ(mesh.element_count(), 2);
  EXPECT_EQ(mesh.type(1), ElementType::hex8);
  EXPECT_EQ(mesh.element_label(0), 7);
  EXPECT_NEAR(mesh_volume(mesh), 2, 1e-15);
  EXPECT_EQ(mesh.node_set("Bottom"), (std::vector<Index>{0, 1, 2, 3}));
  EXPECT_EQ(mesh.node_set("Both"), (std::vector<Index>{0, 1, 2, 3, 11}));
  EXPECT_EQ(mesh.node_set("NALL").size(), 12U);
  EXPECT_EQ(mesh.element_set("Eall").size(), 2U);
  ASSERT_EQ(mesh.face_set("Lid").size(), 1U);
  EXPECT_EQ(mesh.face_set("Lid")[0], (MeshFace{1, 1}));
  ASSERT_EQ(mesh.materials.size(), 1U);
  EXPECT_EQ(mesh.materials[0].name, "steel");
  EXPECT_EQ(mesh.materials[0].young, 2.1e11);
  EXPECT_EQ(mesh.materials[0].poisson, 0.3);
  EXPECT_EQ(mesh.materials[0].density, 7850);
  EXPECT_EQ(mesh.section_material.at("Eall"), "steel");  // as *Material spells it
  EXPECT_EQ(mesh.boundary_faces().size(), 10U);
  EXPECT_THROW(static_cast<void>(mesh.node_set("bottom ")), Error);
}

TEST_F(MeshRead, InpIncludesPartsAndInstances) {
  write("part.inc",
        "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=E\n1,1,2,3,4\n*NSET,NSET=Foot\n1\n");
  const std::string text =
      "*PART, NAME=P\n*INCLUDE, INPUT=part.inc\n*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME=I-1, PART=P\n*END "
      "INSTANCE\n"
      "*INSTANCE, NAME=I-2, PART=P\n5., 0., 0.\n5., 0., 0., 5., 0., 1., 90.\n*END INSTANCE\n"
      "*NSET, NSET=Tops, INSTANCE=I-2\n4\n*NSET, NSET=Mixed\nI-1.2, I-2.Foot\n*END ASSEMBLY\n";
  const Mesh mesh = read_inp(write("assembly.inp", text));
  ASSERT_EQ(mesh.nodes.size(), 8U);
  ASSERT_EQ(mesh.element_count(), 2);
  EXPECT_NEAR(mesh_volume(mesh), 2.0 / 6, 1e-15);
  EXPECT_NEAR(mesh.nodes[5][0], 5, 1e-14);  // node 2 of the second: (1,0,0) -> (6,0,0) -> turned about (5,0,z)
  EXPECT_NEAR(mesh.nodes[5][1], 1, 1e-14);
  EXPECT_EQ(mesh.node_set("Tops"), (std::vector<Index>{7}));
  EXPECT_EQ(mesh.node_set("Mixed"), (std::vector<Index>{1, 4}));
  EXPECT_EQ(mesh.node_set("Foot"), (std::vector<Index>{0, 4}));
  EXPECT_EQ(mesh.node_set("I-2.Foot"), (std::vector<Index>{4}));
}

TEST_F(MeshRead, InpMistakesAreNamed) {
  expect_error(write("a.inp", replaced(kInp, "9, 5,6,7,8,9", "9, 5,6,7,8,77")), 20, "node 77, which is not defined");
  expect_error(write("b.inp", replaced(kInp, "type=C3D8R", "type=C3D99")), 17, "element type C3D99");
  expect_error(write("c.inp", replaced(kInp, "Bottom, 12", "Botom, 12")), 24, "set BOTOM is not defined");
  expect_error(write("d.inp", replaced(kInp, "3, 1, 1, 0", "3, 1, one, 0")), 7, "'one' is not a number");
  expect_error(write("e.inp", replaced(kInp, "1, 4, 1\n", "4, 1, 1\n")), 22, "makes no set");
  expect_error(write("f.inp", replaced(kInp, "*Heading", "*NMAP")), 2, "*NMAP is not read");
  expect_error(write("g.inp", "*NODE\n1,0,0,0\n*ELEMENT,TYPE=C3D4\n1,1,1,1\n"), 4, "4 are needed");
  expect_error(write("h.inp", "1,2,3\n"), 1, "expected a keyword");
  EXPECT_THROW(static_cast<void>(read_inp(write("i.inp", "*HEADING\nnothing\n"))), Error);
}

// Truth: an element listed the wrong way round is refused with its number in the file.
TEST_F(MeshRead, InvertedElementIsNamed) {
  const std::string s = replaced(kInp, "9, 5,6,7,8,9,10,11,12", "9, 9,10,11,12,5,6,7,8");
  const Mesh mesh = read_inp(write("inverted.inp", s));
  try {
    static_cast<void>(make_solid_groups(mesh, {}, {SolidLaw::st_venant_kirchhoff, 1, 0.3, 1}));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("element 9"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("inverted"), std::string::npos) << error.what();
  }
}

struct RealMesh {
  const char* file;
  std::size_t nodes;
  Index elements;  // of the first solid type
  ElementType type;
};

// Truth: counts of ../shared/data/INDEX.md, made by another program.
TEST(RealMeshes, CountsAndJacobians) {
  const fs::path folder = espalier::test::shared_data() / "mesh";
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const RealMesh meshes[] = {{"exudyn_blockC3D4.inp", 214, 767, ElementType::tet4},
                             {"exudyn_blockC3D8.inp", 176, 90, ElementType::hex8},
                             {"exudyn_blockC3D10.inp", 257, 122, ElementType::tet10},
                             {"exudyn_blockC3D20.inp", 171, 20, ElementType::hex20},
                             {"exudyn_conrod.inp", 935, 136, ElementType::hex20},
                             {"exudyn_crank.inp", 665, 104, ElementType::hex20},
                             {"exudyn_rotorDisc.inp", 115, 48, ElementType::hex8},
                             {"abaqus_test_bracket.inp", 306, 793, ElementType::tet4},
                             {"ccx_ball.inp", 1025, 768, ElementType::hex8},
                             {"ccx_crackIIinta.inp", 10072, 2048, ElementType::hex20},
                             {"ccx_cubef2f1.inp", 2961, 512, ElementType::hex20},
                             {"ccx_impdyn.inp", 2658, 368, ElementType::hex20},
                             {"ccx_segmenttet.inp", 2756, 1489, ElementType::tet10},
                             {"ccx_scheibejc.inp", 2052, 904, ElementType::hex8},
                             {"yafe_BeamHex.inp", 980, 116, ElementType::hex20},
                             {"sfepy_wheelset.vtk", 5457, 21934, ElementType::tet4},
                             {"sfepy_bridge3d.vtk", 881, 576, ElementType::hex8},
                             {"sfepy_cut-cylinder.vtk", 1147, 3279, ElementType::tet4},
                             {"sfepy_hsphere8.vtk", 889, 648, ElementType::hex8},
                             {"sfepy_multi_material_cylinder_plate.vtk", 2101, 10440, ElementType::tet4},
                             {"sofa_cylinderPDMS12724Vol.vtk", 3668, 12724, ElementType::tet4},
                             {"dealii_impeller.vtk", 4169, 4167, ElementType::quad4},
                             {"tacs_slot.bdf.gz", 25142, 15359, ElementType::tet10},
                             {"tacs_fixed_motor.bdf", 3238, 1681, ElementType::tet10},
                             {"tacs_rbe3.bdf", 1633, 1600, ElementType::quad4},
                             {"nastran_nx_contact_model.bdf", 1080, 675, ElementType::hex8},
                             {"nastran_bend_A1_105.bdf", 3655, 3534, ElementType::quad4},
                             {"sofa_cylinder_Hexa.msh", 5740, 4920, ElementType::hex8},
                             {"dealii_hole8170.msh", 8449, 8170, ElementType::quad4}};
  for (const RealMesh& m : meshes) {
    SCOPED_TRACE(m.file);
    const Mesh mesh = read_mesh((folder / m.file).string());
    EXPECT_EQ(mesh.nodes.size(), m.nodes);
    Index count = 0;
    for (Index e = 0; e < mesh.element_count(); ++e) {
      count += mesh.type(e) == m.type;
      if (!is_simulated_solid(mesh.type(e))) continue;
      const std::vector<double> x = coordinates(mesh, e);
      ASSERT_GT(smallest_jacobian(mesh.type(e), x.data()).corners, 0) << "element " << mesh.element_label(e);
    }
    EXPECT_EQ(count, m.elements);
  }
  const Mesh wheel = read_mesh((folder / "chrono_tractor_wheel_coarse.inp.gz").string());
  EXPECT_EQ(wheel.element_count(), 32538 - 21367);
  EXPECT_NEAR(wheel.materials.at(0).young, 6.1e6, 1e-3);
  EXPECT_FALSE(wheel.node_set("BC_RIMTIRE").empty());
  EXPECT_EQ(wheel.face_set("BC_SURF").size(), 548U);  // counted by another program (numpy)
  EXPECT_NE(corner_folds(wheel, {}).find("96 elements of second order folded at a corner, the first is element 427"),
            std::string::npos)
      << corner_folds(wheel, {});
  EXPECT_NO_THROW(static_cast<void>(make_solid_groups(wheel, {}, {SolidLaw::st_venant_kirchhoff, 1, 0.3, 1})));
  const Mesh slot = read_mesh((folder / "tacs_slot.bdf.gz").string());
  EXPECT_EQ(slot.node_set("FORCE-1").size(), 72U);
  EXPECT_EQ(slot.node_set("SPC-1").size(), 400U);
  EXPECT_EQ(slot.materials.at(0).young, 2.9e7);
  const Mesh furnace = read_mesh((folder / "ccx_furnace.inp").string());  // with five network elements
  EXPECT_EQ(furnace.element_count(), 300);
  EXPECT_NE(furnace.notices.at(0).find("passed over: D (5)"), std::string::npos) << furnace.notices[0];
  const std::pair<const char*, const char*> refused[] = {
      {"nastran_contact_model1.bdf", "element 646 has 9 grid points, but number 10 is empty"}};
  for (const auto& [file, reason] : refused) try {
      static_cast<void>(read_mesh((folder / file).string()));
      ADD_FAILURE() << file << " cannot be read";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(reason), std::string::npos) << error.what();
    }
}

}  // namespace mesh_read_test
}  // namespace espalier::dynamics::test
