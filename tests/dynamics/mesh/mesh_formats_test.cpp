// Legacy VTK and Nastran files: every dialect gives the same mesh, mistakes are named. Second-order elements and folds.
#include <Eigen/Eigenvalues>
#include <bit>

#include "base/output_file.hpp"
#include "dynamics/elements/groups.hpp"
#include "dynamics/mesh/mesh_files.hpp"

namespace espalier::dynamics::test {
namespace mesh_formats_test {

using MeshFormats = MeshFiles;

TEST_F(MeshFormats, PackedFilesThatBreakOffAreRefused) {
  const std::string path = (folder_ / "mesh.inp.gz").string();
  base::OutputFile file(path);
  file.write("*NODE\n");
  for (int k = 1; k <= 2000; ++k) file.write(fmt::format("{},{},{},0\n", k, k * k % 977, k * k % 1009));
  file.commit();
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  try {
    static_cast<void>(read_mesh(path));
    ADD_FAILURE() << "half of a file was taken for the whole";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("truncated"), std::string::npos) << error.what();
  }
}

// ---- VTK: two tetrahedra on a common face, the triangle below the first, a line; groups of cells and of points.

/// Writes numbers as text or as big-endian bytes.
class VtkText {
 public:
  explicit VtkText(bool binary) : binary_(binary) {}
  VtkText& line(const std::string& text) {
    text_ += text + "\n";
    return *this;
  }
  template <class T>
  VtkText& list(const std::vector<T>& values) {
    for (const T v : values) {
      if (!binary_) {
        text_ += fmt::format("{} ", v);
        continue;
      }
      char bytes[sizeof(T)];
      std::memcpy(bytes, &v, sizeof(T));
      if constexpr (std::endian::native == std::endian::little) std::reverse(bytes, bytes + sizeof(T));
      text_.append(bytes, sizeof(T));
    }
    text_ += "\n";
    return *this;
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  bool binary_;
  std::string text_;
};

std::string vtk(bool binary, bool version5) {
  VtkText t(binary);
  t.line(fmt::format("# vtk DataFile Version {}", version5 ? "5.1" : "3.0")).line("two tetrahedra");
  t.line(binary ? "BINARY" : "ASCII").line("DATASET UNSTRUCTURED_GRID");
  t.line("POINTS 5 double").list<double>({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1});
  if (version5) {
    t.line("METADATA").line("INFORMATION 0").line("");
    t.line("CELLS 5 13").line("OFFSETS vtktypeint64").list<std::int64_t>({0, 4, 8, 11, 13});
    t.line("CONNECTIVITY vtktypeint64").list<std::int64_t>({0, 1, 2, 3, 1, 4, 2, 3, 0, 2, 1, 0, 1});
  } else {
    t.line("CELLS 4 17").list<std::int32_t>({4, 0, 1, 2, 3, 4, 1, 4, 2, 3, 3, 0, 2, 1, 2, 0, 1});
  }
  t.line("CELL_TYPES 4").list<std::int32_t>({10, 10, 5, 3});
  t.line("CELL_DATA 4").line("SCALARS mat int 1").line("LOOKUP_TABLE default").list<std::int32_t>({7, -2, 5, 5});
  t.line("SCALARS weight float").line("LOOKUP_TABLE default").list<float>({1, 2, 3, 4});
  t.line("VECTORS flow double").list<double>({1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1});
  t.line("POINT_DATA 5").line("FIELD FieldData 2");
  t.line("Place 1 5 unsigned_char").list<std::uint8_t>({1, 1, 1, 3, 4});
  t.line("pair 2 5 int").list<std::int32_t>({1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
  return t.text();
}

TEST_F(MeshFormats, VtkDialectsGiveTheSameMesh) {
  for (const bool binary : {false, true})
    for (const bool version5 : {false, true}) {
      SCOPED_TRACE(fmt::format("binary {}, version 5 {}", binary, version5));
      const Mesh mesh = read_mesh(write("two.vtk", vtk(binary, version5)));
      ASSERT_EQ(mesh.nodes.size(), 5U);
      ASSERT_EQ(mesh.element_count(), 2);
      EXPECT_NEAR(mesh_volume(mesh), 1.0 / 6 + 1.0 / 3, 1e-15);
      EXPECT_EQ(mesh.element_set("mat-7"), (std::vector<Index>{0}));
      EXPECT_EQ(mesh.element_set("mat--2"), (std::vector<Index>{1}));
      EXPECT_EQ(mesh.face_set("mat-5"), (std::vector<MeshFace>{{0, 0}}));
      EXPECT_EQ(mesh.node_set("Place-1"), (std::vector<Index>{0, 1, 2}));
      EXPECT_EQ(mesh.face_set("Place-1"), (std::vector<MeshFace>{{0, 0}})) << "its nodes are those of a face";
      EXPECT_FALSE(mesh.node_sets.contains("pair-1"));
      EXPECT_TRUE(mesh.notices.empty());
    }
}

// Truth: a voxel counts its corners line by line; the volume of a hexahedron with swapped corners is not 6.
TEST_F(MeshFormats, VtkVoxel) {
  const Mesh mesh = read_mesh(write("v.vtk",
                                    "# vtk DataFile Version 2.0\nv\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 8 float\n"
                                    "0 0 0 1 0 0 0 2 0 1 2 0\n0 0 3 1 0 3 0 2 3 1 2 3\nCELLS 1 9\n8 0 1 2 3 4 5 6 7\n"
                                    "CELL_TYPES 1\n11\n"));
  EXPECT_NEAR(mesh_volume(mesh), 6, 1e-14);
}

TEST_F(MeshFormats, VtkManyValuesAreNoSets) {
  VtkText t(false);
  std::vector<double> x;
  std::vector<int> numbers;
  for (int k = 0; k < 300; ++k) {
    x.insert(x.end(), {1.0 * k, 0, 0});
    numbers.push_back(k);
  }
  t.line("# vtk DataFile Version 3.0").line("").line("ASCII").line("DATASET UNSTRUCTURED_GRID");
  t.line("POINTS 300 double").list(x).line("CELLS 1 3").line("2 0 1").line("CELL_TYPES 1").line("3");
  t.line("POINT_DATA 300").line("GLOBAL_IDS id int").list(numbers);
  t.line("SCALARS number int").line("LOOKUP_TABLE default").list(numbers);
  const Mesh mesh = read_mesh(write("many.vtk", t.text()));
  EXPECT_TRUE(mesh.node_sets.empty());
  ASSERT_EQ(mesh.notices.size(), 1U);
  EXPECT_NE(mesh.notices[0].find("'number' has 300 different values"), std::string::npos) << mesh.notices[0];
}

TEST_F(MeshFormats, VtkMistakesAreNamed) {
  const std::string good = vtk(false, false), five = vtk(false, true);
  expect_error(write("a.vtk", replaced(good, "# vtk", "#vtk")), 1, "starts with '# vtk DataFile Version'");
  expect_error(write("b.vtk", replaced(good, "ASCII", "TEXT")), 3, "ASCII or BINARY");
  expect_error(write("c.vtk", replaced(good, "UNSTRUCTURED_GRID", "POLYDATA")), 4, "UNSTRUCTURED_GRID");
  expect_error(write("d.vtk", replaced(good, "POINTS 5", "POINTS 99999999")), 5, "bytes are left");
  expect_error(write("e.vtk", replaced(good, "POINTS 5", "POINTS 4")), 6, "more numbers than announced");
  expect_error(write("f.vtk", replaced(good, "4 1 4 2 3", "4 1 9 2 3")), 7, "cell 1 uses point 9; there are 5");
  expect_error(write("g.vtk", replaced(good, "10 10 5 3", "10 42 5 3")), 7, "cell 1 is of VTK type 42");
  expect_error(write("h.vtk", replaced(good, "10 10 5 3", "10 12 5 3")), 7, "has 4 points, hex8 has 8");
  expect_error(write("i.vtk", replaced(good, "CELLS 4 17", "CELLS 5 17")), 8, "goes beyond");
  expect_error(write("j.vtk", replaced(five, "0 4 8 11 13", "0 9 8 11 13")), 14, "OFFSETS: entry 2 is 8");
  expect_error(write("k.vtk", replaced(good, "mat int", "mat string")), 12, "type 'string'");
  expect_error(write("l.vtk", replaced(good, "VECTORS", "ARROWS")), 18, "unknown keyword 'arrows'");
  const std::string binary = vtk(true, true);
  for (const std::size_t kept : {binary.size() / 4, binary.size() / 2, binary.size() - 20})
    EXPECT_THROW(static_cast<void>(read_mesh(write("m.vtk", binary.substr(0, kept)))), Error) << kept;
}

// ---- Nastran: the same two tetrahedra in fields of 8 and 16 columns and between commas.

const char* const kSmall =
    "SOL 101\nCEND\n  TITLE = not a card\nBEGIN BULK\n$ a comment\n"
    "GRID          10       0      0.      0.      0.\n"
    "GRID          20              1.      0.      0.\n"
    "GRID          30              0.     1.0      0.       $ behind\n"
    "GRID          40              0.      0. 10.00-1\n"
    "GRID          50              1.      1.      1.\n"
    "CTETRA         3       1      10      20      30      40\n"
    "CTETRA         4       1      20      50      30      40\n"
    "CTRIA3         9       2      10      30      20\n"
    "PSOLID         1       5\n"
    "MAT1           5  2.1+11             .3   7850.\n"
    "SPC1           1  123456      10    THRU      30\n"
    "SPC            2      40       3      0.      50       3      0.\n"
    "FORCE          3      50       0      1.      0.      0.      1.\n"
    "PARAM,POST,-1\n"
    "ENDDATA\nGRID          10       0      0.      0.      0.\n";

const char* const kLarge =
    "$ punch format: no BEGIN BULK\n"
    "GRID*                 10               0              0.              0.*A\n"
    "*A                    0.\n"
    "GRID*                 20                              1.              0.\n"
    "*                     0.\n"
    "grid,30,,0.,1.0,0.\n"
    "GRID*,40,,0.,0.\n*,1.0d0\n"
    "GRID,50,,1.,1.,1.E+0\n"
    "CTETRA,3,1,10,20,30,40\n"
    "CTETRA,4,1,20,50,30,40,,,+T4\n+T4,,,,\n"
    "CTRIA3,9,2,10,30,20\n"
    "PSOLID,1,5\n"
    "MAT1*                  5         2.1E+11                              .3\n"
    "*                   7850\n"
    "SPC1,1,123456,10,20,30\n"
    "SPC,2,40,3,0.,50,3,0.\n"
    "FORCE,3,50,0,1.,0.,0.,1.\n"
    "PARAM,POST,-1\n";

TEST_F(MeshFormats, NastranFieldsGiveTheSameMesh) {
  for (const char* text : {kSmall, kLarge}) {
    const Mesh mesh = read_mesh(write("two.bdf", text));
    ASSERT_EQ(mesh.nodes.size(), 5U);
    ASSERT_EQ(mesh.element_count(), 2);
    EXPECT_NEAR(mesh_volume(mesh), 1.0 / 6 + 1.0 / 3, 1e-15);
    EXPECT_EQ(mesh.element_label(1), 4);
    EXPECT_EQ(mesh.node_label(4), 50);
    EXPECT_EQ(mesh.element_set("property-1"), (std::vector<Index>{0, 1}));
    EXPECT_EQ(mesh.face_set("property-2"), (std::vector<MeshFace>{{0, 0}})) << "a shell on a face of a solid";
    EXPECT_EQ(mesh.node_set("SPC-1"), (std::vector<Index>{0, 1, 2}));
    EXPECT_EQ(mesh.face_set("SPC-1"), (std::vector<MeshFace>{{0, 0}}));
    EXPECT_EQ(mesh.node_set("SPC-2"), (std::vector<Index>{3, 4}));
    EXPECT_EQ(mesh.node_set("FORCE-3"), (std::vector<Index>{4}));
    ASSERT_EQ(mesh.materials.size(), 1U);
    EXPECT_EQ(mesh.materials[0].young, 2.1e11);
    EXPECT_EQ(mesh.materials[0].poisson, 0.3);
    EXPECT_EQ(mesh.materials[0].density, 7850);
    EXPECT_EQ(mesh.section_material.at("property-1"), "MAT1-5");
    ASSERT_EQ(mesh.notices.size(), 1U);
    EXPECT_NE(mesh.notices[0].find(": PARAM (1)"), std::string::npos) << mesh.notices[0];
  }
}

// Truth: the definition of the systems, by hand: cylinder about (1, 0, 0) + x axis, in it a sphere.
TEST_F(MeshFormats, NastranCoordinateSystems) {
  const Mesh mesh = read_mesh(write("c.nas",
                                    "CORD2C,1,0,1.,0.,0.,2.,0.,0.,+\n+,1.,1.,0.\n"  // z along x, theta = 0 along y
                                    "CORD2S,2,1,0.,0.,5.,0.,0.,6.,+\n+,1.,0.,5.\n"  // at z = 5 of system 1, same axes
                                    "CORD2R,3,0,0.,0.,0.,0.,0.,1.,+\n+,0.,1.,0.\n"  // turned by 90 degrees about z
                                    "GRID,1,1,2.,90.,3.\nGRID,2,2,2.,90.,90.\nGRID,3,3,1.,2.,3.\nGRID,4,,0.,0.,0.\n"
                                    "CTETRA,1,1,1,2,3,4\n"));
  const Point expected[3] = {{4, 0, 2}, {6, 0, 2}, {-2, 1, 3}};
  for (std::size_t n = 0; n < 3; ++n)
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(mesh.nodes[n][i], expected[n][i], 1e-14) << n << " " << i;
}

// Truth: the edges that Nastran's mid-side points lie on (Quick Reference Guide, CHEXA, CTETRA).
TEST_F(MeshFormats, NastranSecondOrderNodeOrder) {
  const MidSideEdges edges{
      {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}},
      {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 5}, {2, 6}, {3, 7}, {4, 5}, {5, 6}, {6, 7}, {7, 4}}};
  for (const bool is_tet : {true, false}) {
    const std::vector<Point> nodes = second_order_nodes(is_tet, edges);
    std::string grids, element = is_tet ? "CTETRA,1,1" : "CHEXA,1,1";
    for (std::size_t a = 0; a < nodes.size(); ++a) {
      grids += fmt::format("GRID,{},,{:.1f},{:.1f},{:.1f}\n", a + 1, nodes[a][0], nodes[a][1], nodes[a][2]);
      if ((a + 2) % 8 == 0) element += ",+\n+";
      element += fmt::format(",{}", a + 1);
    }
    expect_second_order(read_mesh(write("second.bdf", grids + element + "\n")), is_tet);
  }
}

TEST_F(MeshFormats, NastranMistakesAreNamed) {
  const std::string good = kSmall;
  expect_error(write("a.bdf", replaced(good, "20      50      30", "20      99      30")), 12, "grid point 99 is not");
  expect_error(write("b.bdf", replaced(good, "10.00-1", "10.0x-1")), 9,
               "field 6 (coordinate): '10.0x-1' is not a number");
  expect_error(write("c.bdf", replaced(good, "GRID          20", "GRID          10")), 7, "defined twice");
  expect_error(write("d.bdf", replaced(good, "GRID          20        ", "GRID          20       7")), 7,
               "coordinate system 7 is not defined");
  expect_error(write("e.bdf", replaced(good, "20      30      40", "20      30")), 11, "number 4 is empty");
  expect_error(write("f.bdf", replaced(good, "$ a comment", "+       1")), 5, "continuation line without a card");
  expect_error(write("g.bdf", replaced(good, "PARAM,POST,-1", "INCLUDE 'more.bdf'")), 19,
               "there is no file 'more.bdf'");
  expect_error(write("h.bdf", "GRDSET,,3\nGRID,1,,0.,0.,0.\n"), 1, "coordinate system 3 is not defined");
  expect_error(write("i.bdf",
                     "CORD2R,1,2,0.,0.,0.,0.,0.,1.,\n,1.,0.,0.\nCORD2R,2,1,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
                     "GRID,1,1,0.,0.,0.\n"),
               3, "in a circle");
  expect_error(write("j.bdf", "CORD2R,1,,0.,0.,0.,0.,0.,1.,\n,0.,0.,2.\nGRID,1,1,0.,0.,0.\n"), 1, "on one line");
  EXPECT_THROW(static_cast<void>(read_mesh(write("k.bdf", "PARAM,POST,-1\n"))), Error);
}

// ---- Folded corners

/// A tetrahedron of second order whose mid-side node on edge 0-1 stands at the share `t` of the edge: in volume
/// coordinates L its Jacobian determinant is 4 L1 - 1 + 4 t (L0 - L1) + 2 L2 + 2 L3.
Mesh with_moved_node(double t) {
  Mesh mesh;
  mesh.name = "moved";
  const double corner[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const int edges[6][2] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
  for (const auto& c : corner) mesh.nodes.push_back({c[0], c[1], c[2]});
  for (const auto& e : edges) {
    Point p{};
    for (std::size_t i = 0; i < 3; ++i) p[i] = 0.5 * (corner[e[0]][i] + corner[e[1]][i]);
    mesh.nodes.push_back(p);
  }
  mesh.nodes[4] = {t, 0, 0};
  const Index nodes[10] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
  static_cast<void>(mesh.add_element(ElementType::tet10, nodes));
  return mesh;
}

// Truth: the formula above. At corner 0 it is 4 t - 1: negative below 0.25 (notice). At the first point of the mass
// rule (L1 = L2 = L3 = 0.0927) it is negative below 0.1025; the mass matrix must not become indefinite by that, and its
// sum stays the exact volume 1/6. At the first point of the stress rule (0.138) it is negative below -0.059: refused.
TEST_F(MeshFormats, FoldsAtCornersAreNoticedFoldsAtPointsRefused) {
  const Material material{SolidLaw::st_venant_kirchhoff, 1, 0.3, 1};
  EXPECT_EQ(corner_folds(with_moved_node(0.26), {}), "");
  for (const double t : {0.22, 0.05}) {
    const Mesh mesh = with_moved_node(t);
    EXPECT_NO_THROW(static_cast<void>(make_solid_groups(mesh, {}, material)));
    const std::string notice = corner_folds(mesh, {});
    EXPECT_NE(notice.find("one element of second order folded at a corner, the first is element 1"), std::string::npos)
        << notice;
    Eigen::Matrix<double, 10, 10> mass;
    solid_mass(ElementType::tet10, 1, coordinates(mesh, 0).data(), mass.data());
    const double eps = std::numeric_limits<double>::epsilon();
    EXPECT_NEAR(mass.sum(), 1.0 / 6, 100 * eps) << t;
    const auto eigenvalues = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 10, 10>>(mass).eigenvalues();
    EXPECT_GT(eigenvalues.minCoeff(), -100 * eps * eigenvalues.maxCoeff()) << t;
  }
  try {
    static_cast<void>(make_solid_groups(with_moved_node(-0.1), {}, material));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("element 1 (tet10) is inverted or folded"), std::string::npos)
        << error.what();
  }
}

}  // namespace mesh_formats_test
}  // namespace espalier::dynamics::test
