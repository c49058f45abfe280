// Dialects of Gmsh and Nastran, and the readers of .vtu, .cdb, MEDIT and MFEM. Truth: volumes by hand, and the same
// mesh in another format.
#include <zlib.h>

#include <cmath>
#include <cstring>

#include "dynamics/mesh/mesh_files.hpp"
#include "dynamics/mesh/read/formats.hpp"
#include "dynamics/mesh/read/orientation.hpp"
#include "places.hpp"

namespace espalier::dynamics::test {
namespace mesh_other_formats_test {

using MeshOther = MeshFiles;

std::string all_notices(const Mesh& mesh) {
  std::string text;
  for (const std::string& notice : mesh.notices) text += notice + "\n";
  return text;
}

constexpr MidSideEdges kGmshEdges = {
    {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {2, 3}, {1, 3}},
    {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3}, {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7}}};

TEST_F(MeshOther, Gmsh40InTextAndBytes) {
  const std::string text =
      "$MeshFormat\n4 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 5 \"all\"\n$EndPhysicalNames\n$Entities\n1 0 0 1\n"
      "7 0 0 0 0 0 0 0\n1 0 0 0 1 1 1 1 5 0\n$EndEntities\n$Nodes\n2 8\n7 0 0 1\n1 0 0 0\n1 3 0 7\n2 1 0 0\n3 1 1 0\n"
      "4 0 1 0\n5 0 0 1\n6 1 0 1\n7 1 1 1\n8 0 1 1\n$EndNodes\n$Elements\n1 1\n1 3 5 1\n1 1 2 3 4 5 6 7 "
      "8\n$EndElements\n";
  const Mesh mesh = read_mesh(write("a.msh", text));
  EXPECT_NEAR(mesh_volume(mesh), 1, 1e-15);
  EXPECT_EQ(mesh.element_set("all").size(), 1U);
  std::string binary = "$MeshFormat\n4 1 8\n";
  const auto append = [&](auto value) {
    char bytes[sizeof(value)];
    std::memcpy(bytes, &value, sizeof(value));
    binary.append(bytes, sizeof(value));
  };
  append(std::int32_t{1});
  binary += "\n$EndMeshFormat\n$Nodes\n";
  append(std::uint64_t{1});
  append(std::uint64_t{8});
  for (const std::int32_t i : {1, 3, 0}) append(i);
  append(std::uint64_t{8});
  for (std::size_t n = 0; n < 8; ++n) {
    append(static_cast<std::int32_t>(n + 1));
    for (const double x : mesh.nodes[n]) append(x);
  }
  binary += "\n$EndNodes\n$Elements\n";
  append(std::uint64_t{1});
  append(std::uint64_t{1});
  for (const std::int32_t i : {1, 3, 5}) append(i);
  append(std::uint64_t{1});
  for (const std::int32_t i : {9, 1, 2, 3, 4, 5, 6, 7, 8}) append(i);
  binary += "\n$EndElements\n";
  const Mesh bytes = read_mesh(write("b.msh", binary));
  EXPECT_NEAR(mesh_volume(bytes), 1, 1e-15);
  EXPECT_EQ(bytes.element_label(0), 9);
}

// hex27, quad9: the nodes in the middle go, the others stay in their order; sets hold what is left.
TEST_F(MeshOther, CompleteKindsOfGmsh) {
  std::vector<Point> nodes = second_order_nodes(false, kGmshEdges);
  for (int k = 0; k < 7; ++k) nodes.push_back({1, 1, 0.3 * k});  // faces and centre
  std::string text =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 3 \"foot\"\n$EndPhysicalNames\n$Nodes\n27\n";
  for (std::size_t n = 0; n < nodes.size(); ++n)
    text += fmt::format("{} {} {} {}\n", n + 1, nodes[n][0], nodes[n][1], nodes[n][2]);
  text += "$EndNodes\n$Elements\n2\n1 12 2 1 1";
  for (int n = 1; n <= 27; ++n) text += " " + std::to_string(n);
  const Mesh mesh = read_mesh(write("h.msh", text + "\n2 10 2 3 3 1 4 3 2 10 14 12 9 21\n$EndElements\n"));
  expect_second_order(mesh, false);
  EXPECT_EQ(mesh.node_set("foot").size(), 8U);
  EXPECT_EQ(mesh.face_set("foot").size(), 1U);
  EXPECT_NE(all_notices(mesh).find("1 hex27, 1 quad9 are read as elements of second order without"), std::string::npos)
      << all_notices(mesh);
  Mesh small = mesh;
  EXPECT_EQ(small.drop_unused_nodes(), 7);
  expect_error(write("p.msh", replaced(text, "1 12 2 1 1", "1 14 2 1 1")), 40, "(pyramid14)");
}

std::string card_cube(const std::string& element) {
  return "GRID,1,,0,0,0\nGRID,2,,1,0,0\nGRID,3,,1,1,0\nGRID,4,,0,1,0\nGRID,5,,0,0,1\nGRID,6,,1,0,1\nGRID,7,,1,1,1\n"
         "GRID,8,,0,1,1\n" +
         element;
}

TEST_F(MeshOther, NastranIncludesOneAnother) {
  std::filesystem::create_directories(folder_ / "sub/deep");
  write("sub/grids.inc",
        "$ a comment\nINCLUDE 'deep/lower.inc'\nGRID,5,,0,0,1\nGRID,6,,1,0,1\nGRID,7,,1,1,1\nGRID,8,,0,1,1\n");
  write("sub/deep/lower.inc", "GRID,1,,0,0,0\nGRID,2,,1,0,0\nGRID,3,,1,1,0\nGRID,4,,0,1,0\n");
  write("sub/element.inc", "CHEXA,1,1,1,2,3,4,5,6\n,7,8\n");
  const std::string path =
      write("main.bdf", "SOL 101\nCEND\nBEGIN BULK\nINCLUDE 'sub/\ngrids.inc'\ninclude \"sub/element.inc\"\nENDDATA\n");
  EXPECT_NEAR(mesh_volume(read_mesh(path)), 1, 1e-15);
  write("sub/element.inc", "CHEXA,1,1,1,2,3,4,5,6\n,7,88\n");
  try {
    static_cast<void>(read_mesh(path));
    ADD_FAILURE();
  } catch (const Error& error) {  // the file and its line are those of the card
    EXPECT_NE(std::string(error.what()).find("sub/element.inc:1: CHEXA: grid point 88"), std::string::npos)
        << error.what();
  }
  write("sub/deep/lower.inc", "INCLUDE 'back.inc'\n");
  write("sub/deep/back.inc", "INCLUDE '../grids.inc'\n");
  EXPECT_THROW(
      {
        try {
          static_cast<void>(read_mesh(path));
        } catch (const Error& error) {
          EXPECT_NE(std::string(error.what()).find("back.inc:1: INCLUDE: '../grids.inc' includes itself"),
                    std::string::npos)
              << error.what();
          throw;
        }
      },
      Error);
  expect_error(write("lost.bdf", "BEGIN BULK\nINCLUDE 'absent.inc'\n"), 2, "there is no file 'absent.inc'");
}

TEST_F(MeshOther, NastranContinuationsAnywhere) {
  const std::string parts[] = {"CHEXA   1       1       1       2       3       4       5       6       +HEX\n",
                               "+HEX    7       8\n", "MAT1    1       2.+11           .3      7850.\n"};
  int orders[] = {0, 1, 2};
  do {
    std::string text;
    for (const int k : orders) text += parts[k];
    if (text.front() == '+') text.insert(0, "PARAM,POST,-1\n");  // a deck does not begin in the middle of a card
    const Mesh mesh = read_mesh(write("c.bdf", card_cube(text)));
    EXPECT_NEAR(mesh_volume(mesh), 1, 1e-15) << text;
    EXPECT_EQ(mesh.materials.at(0).density, 7850) << text;
  } while (std::next_permutation(std::begin(orders), std::end(orders)));
  EXPECT_NEAR(mesh_volume(read_mesh(write("d.bdf", card_cube("+B,7,8\nMAT1,1,1.,,.3\nCHEXA,1,1,1,2,3,4,5,6,+B\n")))), 1,
              1e-15);
}

// Truth: a bar of three cubes, its grid points and elements made by steps.
TEST_F(MeshOther, NastranCardsThatRepeat) {
  const std::string text =
      "GRID,1,,0.,0.,0.\n=,*1,=,*1.,==\n=(2)\nGRID,11,,0.,1.,0.\n=,*1,=,*1.,==\n=2\nGRID,21,,0.,0.,1.\n=,*1,=,*1.,==\n="
      "(2)\n"
      "GRID,31,,0.,1.,1.\n=,*1,=,*1.,==\n=(2)\nCHEXA,1,7,1,2,12,11,21,22\n,32,31\n=,*(1),=,*1,*1,*1,*1,*1,*1\n,*1,*1\n="
      "(1)\n";
  const Mesh mesh = read_mesh(write("r.bdf", text));
  EXPECT_EQ(mesh.nodes.size(), 16U);
  EXPECT_EQ(mesh.element_count(), 3);
  EXPECT_NEAR(mesh_volume(mesh), 3, 1e-14);
  EXPECT_EQ(mesh.element_set("property-7").size(), 3U);
  EXPECT_EQ(mesh.nodes[3], (Point{3, 0, 0}));
  expect_error(write("s.bdf", "=,*1,==\n"), 1, "no card before it");
  expect_error(write("t.bdf", "GRID,1,,0.,0.,0.\n=9999999\n"), 2, "number of repetitions");
}

// Truth: points by hand. CORD1 by grid points that are themselves in another system; GRDSET behind the points.
TEST_F(MeshOther, NastranSystems) {
  const Mesh mesh = read_mesh(
      write("s.bdf",
            "CORD2R,5,0,10.,0.,0.,10.,0.,1.,+\n+,10.,1.,0.\nGRID,1,5,0.,0.,0.\nGRID,2,5,0.,0.,1.\nGRID,3,5,1.,0.,0.\n"
            "CORD1C,6,1,2,3\nGRID,4,6,2.,90.,3.\nCORD1S,7,1,2,3,8,1,2,3\nGRID,5,7,2.,90.,90.\nGRID,6,8,2.,0.,0.\nGRID,"
            "7,,1.,2.,3.\n"
            "GRDSET,,5\nGRID,8,0,1.,2.,3.\nCTETRA,1,1,1,2,3,4\n"));
  // System 5: origin (10, 0, 0), x along y, y along -x.
  const Point right[] = {{10, 0, 0}, {10, 0, 1}, {10, 1, 0}, {8, 0, 3}, {8, 0, 0}, {10, 0, 2}, {8, 1, 3}, {1, 2, 3}};
  for (std::size_t n = 0; n < std::size(right); ++n)
    for (std::size_t d = 0; d < 3; ++d) EXPECT_NEAR(mesh.nodes[n][d], right[n][d], 1e-14) << n << " " << d;
  EXPECT_EQ(all_notices(mesh).find("GRDSET"), std::string::npos) << "it is read";
  // A point that is wanted before its own card is turned once.
  const Mesh before = read_mesh(
      write("b.bdf",
            "CORD2R,5,0,10.,0.,0.,10.,0.,1.,+\n+,10.,1.,0.\nCORD1C,6,1,2,3\nGRID,4,6,2.,90.,3.\nGRID,1,5,0.,0.,0.\n"
            "GRID,2,5,0.,0.,1.\nGRID,3,5,1.,0.,0.\nCTETRA,1,1,1,2,3,4\n"));
  const Point wanted[] = {{8, 0, 3}, {10, 0, 0}, {10, 0, 1}, {10, 1, 0}};
  for (std::size_t n = 0; n < std::size(wanted); ++n)
    for (std::size_t d = 0; d < 3; ++d) EXPECT_NEAR(before.nodes[n][d], wanted[n][d], 1e-14) << n << " " << d;
  expect_error(write("loop.bdf", "CORD1R,1,1,2,3\nGRID,1,1,0.,0.,0.\nGRID,2,1,0.,0.,1.\nGRID,3,1,1.,0.,0.\n"), 1,
               "in a circle");
  expect_error(write("none.bdf", "GRID,1,,0.,0.,0.\nGRDSET,,9\n"), 2, "coordinate system 9");
}

// Truth: every solid of the mirror image has the volume of the solid, with the same nodes.
TEST_F(MeshOther, LeftHandedSolids) {
  for (const bool tet : {true, false}) {
    constexpr MidSideEdges kCard = {
        {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}},
        {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 5}, {2, 6}, {3, 7}, {4, 5}, {5, 6}, {6, 7}, {7, 4}}};
    for (const double side : {1.0, -1.0})
      for (const bool second : {false, true}) {
        std::vector<Point> nodes = second_order_nodes(tet, kCard);
        if (!second) nodes.resize(tet ? 4 : 8);
        std::string text, element = tet ? "CTETRA,1,1" : "CHEXA,1,1";
        for (std::size_t n = 0; n < nodes.size(); ++n)
          text += fmt::format("GRID,{},,{:.1f},{:.1f},{:.1f}\n", n + 1, side * nodes[n][0], nodes[n][1], nodes[n][2]);
        for (std::size_t n = 1; n <= nodes.size(); ++n) element += (n % 8 == 7 ? "\n," : ",") + std::to_string(n);
        const Mesh mesh = read_mesh(write("l.bdf", text + element + "\n"));
        EXPECT_NEAR(mesh_volume(mesh), tet ? 8.0 / 6 : 8, 1e-13) << tet << side << second;
        EXPECT_GT(smallest_jacobian(mesh.type(0), coordinates(mesh, 0).data()).corners, 0.99) << tet << side << second;
        EXPECT_EQ(mesh.notices.size(), side < 0 ? 1U : 0U);
      }
  }
  std::vector<Index> wedge = {0, 1, 2, 3, 4, 5};
  const std::vector<Point> places = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  EXPECT_GT(corner_volume(ElementType::wedge6, places, wedge), 0);
  turn_round(ElementType::wedge6, wedge);
  EXPECT_LT(corner_volume(ElementType::wedge6, places, wedge), 0);
}

// ---- .vtu

std::string base64(const std::string& bytes) {
  static const char* const kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    unsigned bits = 0;
    for (std::size_t i = 0; i < 3; ++i)
      bits = bits << 8U | (k + i < bytes.size() ? static_cast<std::uint8_t>(bytes[k + i]) : 0U);
    for (unsigned i = 0; i < 4; ++i) out += k + i <= bytes.size() ? kDigits[bits >> (18U - 6U * i) & 63U] : '=';
  }
  return out;
}

struct VtuForm {
  bool big = false, wide = false, packed = false, appended = false, raw = false;
};

/// A cube of two tetrahedra's nodes as a .vtu in one of its forms.
class VtuText {
 public:
  explicit VtuText(VtuForm form) : form_(form) {}
  std::string text() {
    std::string body = "<UnstructuredGrid>\n<Piece NumberOfPoints=\"5\" NumberOfCells='2'>\n<Points>\n";
    body += array<double>("Float64", "Points", {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1}, 3);
    body += "</Points>\n<Cells>\n" + array<std::int64_t>("Int64", "connectivity", {0, 1, 2, 3, 1, 2, 3, 4}, 1);
    body += array<std::int32_t>("Int32", "offsets", {4, 8}, 1) + array<std::uint8_t>("UInt8", "types", {10, 10}, 1);
    body += "</Cells>\n<CellData>\n" + array<std::int16_t>("Int16", "part", {3, -7}, 1) +
            array<float>("Float32", "T", {1, 2}, 1);
    body += "</CellData>\n</Piece>\n</UnstructuredGrid>\n";
    std::string head =
        fmt::format("<?xml version=\"1.0\"?>\n<!-- > -->\n<VTKFile type=\"UnstructuredGrid\" byte_order=\"{}\"{}{}>\n",
                    form_.big ? "BigEndian" : "LittleEndian", form_.wide ? " header_type=\"UInt64\"" : "",
                    form_.packed ? " compressor=\"vtkZLibDataCompressor\"" : "");
    if (form_.appended)
      body += fmt::format("<AppendedData encoding=\"{}\">\n_{}\n</AppendedData>\n", form_.raw ? "raw" : "base64",
                          appended_);
    return head + body + "</VTKFile>\n";
  }

 private:
  template <class T>
  void append(std::string& to, T value) const {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    if (form_.big) std::reverse(bytes, bytes + sizeof(T));
    to.append(bytes, sizeof(T));
  }
  void put_header(std::string& to, std::size_t value) const {
    if (form_.wide)
      append(to, static_cast<std::uint64_t>(value));
    else
      append(to, static_cast<std::uint32_t>(value));
  }
  template <class T>
  std::string array(const char* type, const char* name, const std::vector<T>& values, int components) {
    std::string bytes, header, data;
    for (const T v : values) append(bytes, v);
    if (form_.packed) {  // in blocks of 16 bytes
      const std::size_t blocks = (bytes.size() + 15) / 16;
      put_header(header, blocks);
      put_header(header, 16);
      put_header(header, bytes.size() % 16);
      for (std::size_t b = 0; b < blocks; ++b) {
        const std::string block = bytes.substr(16 * b, 16);
        uLongf size = compressBound(block.size());
        std::string out(size, 0);
        compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(block.data()),
                 block.size());
        put_header(header, size);
        data += out.substr(0, size);
      }
    } else {
      put_header(header, bytes.size());
      data = bytes;
    }
    const bool raw = form_.appended && form_.raw;
    std::string coded = raw ? header + data : form_.packed ? base64(header) + base64(data) : base64(header + data);
    const std::string tag =
        fmt::format("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" ", type, name, components);
    for (std::size_t k = 24; !form_.appended && !form_.packed && k < coded.size(); k += 26) coded.insert(k, "\r\n");
    if (!form_.appended) return tag + "format=\"binary\">\n  " + coded + "\n</DataArray>\n";
    const std::size_t offset = appended_.size();
    appended_ += coded;
    return tag + fmt::format("format=\"appended\" offset=\"{}\"/>\n", offset);
  }
  VtuForm form_;
  std::string appended_;
};

// Truth: volumes 1/6 and 1/3 in every form.
TEST_F(MeshOther, VtuForms) {
  for (int k = 0; k < 32; ++k) {
    const VtuForm form{(k & 1) != 0, (k & 2) != 0, (k & 4) != 0, (k & 8) != 0, (k & 16) != 0};
    const std::string text = VtuText(form).text();
    const Mesh mesh = read_mesh(write("f.vtu", text));
    EXPECT_NEAR(mesh_volume(mesh), 0.5, 1e-15) << k;
    EXPECT_EQ(mesh.element_set("part-3"), std::vector<Index>{0}) << k;
    EXPECT_EQ(mesh.element_set("part--7"), std::vector<Index>{1}) << k;
    for (std::size_t kept = 0; kept < text.size() - 30; kept += 101) {  // cut off anywhere: an error, or the whole mesh
      try {
        EXPECT_NEAR(mesh_volume(read_mesh(write("cut.vtu", text.substr(0, kept)))), 0.5, 1e-15) << k << " " << kept;
      } catch (const Error&) {
      }
    }
  }
}

TEST_F(MeshOther, VtuTextAndMistakes) {
  const std::string piece =
      "<Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" "
      "format=\"ascii\">0 0 0 1 0 0\n0 1 0 0 0 1</DataArray></Points><Cells><DataArray type=\"Int32\" "
      "Name=\"connectivity\" "
      "format=\"ascii\">0 1 2 3</DataArray><DataArray type=\"Int32\" Name=\"offsets\" "
      "format=\"ascii\">4</DataArray><DataArray "
      "type=\"UInt8\" Name=\"types\" format=\"ascii\">10</DataArray></Cells></Piece>";
  const std::string head = "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid>",
                    tail = "</UnstructuredGrid></VTKFile>";
  const Mesh two = read_mesh(write("two.vtu", head + piece + piece + tail));  // pieces count their points from 0
  EXPECT_EQ(two.element_count(), 2);
  EXPECT_EQ(two.element(1)[0], 4);
  EXPECT_NEAR(mesh_volume(two), 2.0 / 6, 1e-15);
  const auto wrong = [&](const std::string& from, const std::string& to, int line, const std::string& says) {
    expect_error(write("w.vtu", replaced(head + piece + tail, from, to)), line, says);
  };
  wrong(">0 1 2 3<", ">0 1 2 4<", 2, "uses point 4");
  wrong(">4<", ">5<", 2, "offset 0 is 5");
  wrong("NumberOfCells=\"1\"", "NumberOfCells=\"1x\"", 1, "NumberOfCells is '1x', which is no whole number");
  wrong("NumberOfCells=\"1\"", "NumberOfCells=\"/1\"", 1, "NumberOfCells is '/1', which is no whole number");
  wrong("type=\"UInt8\"", "type=UInt8", 2, "the value of type has no quotation marks");
  wrong(">10<", ">71<", 1, "VTK type 71");
  wrong("NumberOfPoints=\"4\"", "NumberOfPoints=\"400000000000\"", 2, "announces 400000000000 points");
  wrong("</Piece>", "</Piece></Piece>", 2, "</Piece> without <Piece>");
  wrong("</Points><Cells>", "</Points></Piece><Cells>", 2, "announces 1 cells; 0 offsets");
  wrong("<Piece ", "<Points><DataArray type=\"Float32\"/></Points><Piece ", 1, "Points outside <Piece>");
  wrong("<Piece ", "<Piece NumberOfPoints=\"0\"><Piece ", 1, "<Piece> within another");
  wrong("UnstructuredGrid\">", "PolyData\">", 1, "'PolyData' is not read");
  wrong("<VTKFile ", "<VTKFile compressor=\"vtkLZ4DataCompressor\" ", 1, "vtkLZ4DataCompressor");
}

// ---- .cdb

// Truth: volumes by hand of SOLID185 as a hexahedron and as what it degenerates to, and of SOLID186 as a tet10.
TEST_F(MeshOther, AnsysSolids) {
  const std::string head = "/PREP7\nET,1,185\nET,2,SOLID186\nET,3,154\nNBLOCK,6,SOLID\n(3i8,6e20.13)\n";
  std::vector<Point> places = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  const int edges[6][2] = {{1, 2}, {2, 3}, {3, 1}, {1, 5}, {2, 5}, {3, 5}};
  for (const auto& e : edges) {
    const Point a = places[static_cast<std::size_t>(e[0] - 1)], b = places[static_cast<std::size_t>(e[1] - 1)];
    places.push_back({(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2});  // 9 to 14
  }
  std::string nodes;
  for (std::size_t n = 0; n < places.size(); ++n)
    nodes +=
        fmt::format("{:8}{:8}{:8}{:20.13E}{:20.13E}{:20.13E}\n", n + 1, 0, 0, places[n][0], places[n][1], places[n][2]);
  const auto element = [](int material, int type, int label, const std::vector<int>& list) {
    std::string text = fmt::format("{:9}{:9}{:9}{:9}{:9}{:9}{:9}{:9}{:9}{:9}{:9}", material, type, 1, 1, 0, 0, 0, 0,
                                   list.size(), 0, label);
    for (std::size_t k = 0; k < list.size(); ++k) text += (k == 8 ? "\n" : "") + fmt::format("{:9}", list[k]);
    return text + "\n";
  };
  const std::string text =
      head + nodes + "N,R5.3,LOC,       -1,\nEBLOCK,19,SOLID,5,5\n(19i9)\n" +
      element(1, 1, 11, {1, 2, 3, 4, 5, 6, 7, 8}) + element(1, 1, 12, {1, 2, 3, 3, 5, 5, 5, 5}) +
      element(1, 1, 13, {1, 2, 3, 3, 5, 6, 7, 7}) + element(1, 1, 14, {1, 2, 3, 4, 5, 5, 5, 5}) +
      element(2, 2, 15, {1, 2, 3, 3, 5, 5, 5, 5, 9, 10, 3, 11, 5, 5, 5, 5, 12, 13, 14, 14}) +
      element(1, 3, 16, {1, 2, 3, 4}) +
      "       -1\nCMBLOCK,SOME    ,ELEM,       3\n(8i10)\n        11        12       -14\n"
      "CMBLOCK,FOOT,NODE,2  ! comment\n(8i10)\n         1        -4\nMPDATA,R5.0, 1,EX  , 1, 1, 7.0E+10,\n"
      "MPDATA,R5.0, 1,PRXY, 1, 1, 0.35,\nMPDATA,R5.0, 1,DENS, 1, 1, 2700.,\nMPDATA\nFINISH\n";
  const Mesh mesh = read_mesh(write("a.cdb", text));
  ASSERT_EQ(mesh.element_count(), 5);
  const ElementType types[] = {ElementType::hex8, ElementType::tet4, ElementType::wedge6, ElementType::pyramid5,
                               ElementType::tet10};
  for (Index e = 0; e < 5; ++e) {
    EXPECT_EQ(mesh.type(e), types[e]);
    EXPECT_GT(corner_volume(mesh.type(e), mesh.nodes, mesh.element(e)), 0) << e;
  }
  EXPECT_NEAR(mesh_volume(mesh), 1 + 2.0 / 6 + 0.5, 1e-15);
  EXPECT_NEAR(smallest_jacobian(mesh.type(4), coordinates(mesh, 4).data()).corners, 1, 1e-14);
  EXPECT_EQ(mesh.element_set("SOME"), (std::vector<Index>{0, 1, 2, 3}));
  EXPECT_EQ(mesh.node_set("FOOT"), (std::vector<Index>{0, 1, 2, 3}));
  EXPECT_EQ(mesh.element_set("material-2"), std::vector<Index>{4});
  EXPECT_EQ(mesh.section_material.at("material-1"), "MP-1");
  EXPECT_EQ(mesh.materials.at(0).young, 7e10);
  EXPECT_EQ(mesh.materials.at(0).poisson, 0.35);
  EXPECT_EQ(mesh.materials.at(0).density, 2700);
  EXPECT_NE(all_notices(mesh).find("type 154 of Ansys (1)"), std::string::npos) << all_notices(mesh);
  const Mesh block = read_mesh(
      write("t.cdb", replaced(text, "ET,1,185\nET,2,SOLID186\nET,3,154\n",
                              "ETBLOCK,        3,        3\n(2i9,19a9)\n        1      185\n        2      186\n"
                              "        3      154\n       -1\n")));
  ASSERT_EQ(block.element_count(), 5);
  for (Index e = 0; e < 5; ++e) EXPECT_EQ(block.type(e), types[e]);
  expect_error(write("b.cdb", replaced(text, "(19i9)", "(19x9)")), 23, "expected a format");
  expect_error(write("e.cdb", replaced(text, "(3i8,6e20.13)", "(3i8,6e0.13)")), 6, "expected a format");
  EXPECT_THROW(static_cast<void>(read_mesh(write("d.cdb", replaced(text, "1        -4\n", "4        -1\n")))), Error);
  EXPECT_THROW(static_cast<void>(read_mesh(write("c.cdb", text.substr(0, 900)))), Error);
}

// ---- MEDIT and MFEM

TEST_F(MeshOther, Medit) {
  const std::string text =
      "MeshVersionFormatted 2\nDimension\n3\n# comment\nVertices\n8\n0 0 0 1\n1 0 0 1\n1 1 0 1\n0 1 0 1\n0 0 1 2\n1 0 "
      "1 2\n"
      "1 1 1 2\n0 1 1 2\nHexahedra 1\n1 2 3 4 5 6 7 8 4\nQuadrilaterals\n1\n1 2 3 4 9\nCorners\n2\n1\n2\nEnd\n";
  const Mesh mesh = read_mesh(write("m.mesh", text));
  EXPECT_NEAR(mesh_volume(mesh), 1, 1e-15);
  EXPECT_EQ(mesh.element_set("ref-4").size(), 1U);
  EXPECT_EQ(mesh.face_set("surface-9").size(), 1U);
  EXPECT_EQ(mesh.node_set("vertex-2").size(), 4U);
  EXPECT_NE(all_notices(mesh).find("Corners"), std::string::npos);
  expect_error(write("a.mesh", replaced(text, "6 7 8 4", "6 7 9 4")), 16, "uses vertex 9");
  expect_error(write("b.mesh", replaced(text, "Vertices\n8", "Vertices\n80000")), 6, "are announced");
  expect_error(write("c.mesh", replaced(text, "Hexahedra 1", "TetrahedraP2 1")), 15, "second order");
}

// Truth: a quarter of a ring whose order-2 edges bulge: the hex20's volume by our own quadrature against the sum of the
// same with straight edges plus the bulges; here: coordinates of each mid-side node by name.
TEST_F(MeshOther, MfemStraightAndCurved) {
  const std::string head =
      "MFEM mesh v1.0\n\n# comment\n\ndimension\n3\n\nelements\n1\n4 5 0 1 2 3 4 5 6 7\n\nboundary\n1\n9 3 0 3 2 "
      "1\n\nvertices\n8\n";
  const std::string corners = "0 0 0\n2 0 0\n2 2 0\n0 2 0\n0 0 2\n2 0 2\n2 2 2\n0 2 2\n";
  const Mesh straight = read_mesh(write("s.mesh", head + "3\n" + corners));
  EXPECT_NEAR(mesh_volume(straight), 8, 1e-14);
  EXPECT_EQ(straight.element_set("attribute-4").size(), 1U);
  EXPECT_EQ(straight.face_set("boundary-9").size(), 1U);
  // Edges in the order of MFEM; of order 3 two nodes each.
  const int edges[12][2] = {{0, 1}, {1, 2}, {3, 2}, {0, 3}, {4, 5}, {5, 6},
                            {7, 6}, {4, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
  const auto corner = [](int n) {
    return Point{n % 4 == 1 || n % 4 == 2 ? 2.0 : 0.0, n % 4 >= 2 ? 2.0 : 0.0, n >= 4 ? 2.0 : 0.0};
  };
  for (const int order : {2, 3})
    for (const int interleaved : {0, 1}) {
      std::vector<Point> places;
      for (int n = 0; n < 8; ++n) places.push_back(corner(n));
      for (const auto& e : edges)
        for (int k = 1; k < order; ++k) {
          const double t = order == 2 ? 0.5 : 0.5 + (k == 1 ? -1 : 1) * 0.5 / std::sqrt(5.0);
          Point p{};
          for (std::size_t d = 0; d < 3; ++d) p[d] = (1 - t) * corner(e[0])[d] + t * corner(e[1])[d];
          places.push_back(p);
        }
      const int faces = (order - 1) * (order - 1) * 6 + (order - 1) * (order - 1) * (order - 1);
      for (int k = 0; k < faces; ++k) places.push_back({77, 77, 77});
      std::string text =
          head +
          fmt::format("\nnodes\nFiniteElementSpace\nFiniteElementCollection: H1_3D_P{}\nVDim: 3\nOrdering: {}\n\n",
                      order, interleaved);
      if (interleaved == 1)
        for (const Point& p : places) text += fmt::format("{} {} {}\n", p[0], p[1], p[2]);
      for (std::size_t d = 0; interleaved == 0 && d < 3; ++d)
        for (const Point& p : places) text += fmt::format("{}\n", p[d]);
      const Mesh mesh = read_mesh(write("c.mesh", text));
      ASSERT_EQ(mesh.nodes.size(), 20U);
      expect_second_order(mesh, false);
      EXPECT_EQ(mesh.face_set("boundary-9").size(), 1U);
      EXPECT_EQ(mesh.notices.size(), 1U);
    }
  expect_error(
      write("n.mesh",
            head + "nodes\nFiniteElementSpace\nFiniteElementCollection: L2_T1_3D_P2\nVDim: 3\nOrdering: 1\n1 2 3\n"),
      20, "L2_T1_3D_P2");
  const auto space = [&](const std::string& name, const std::string& dimension) {
    return write("s.mesh", head + "nodes\nFiniteElementSpace\nFiniteElementCollection: " + name +
                               "\nVDim: " + dimension + "\nOrdering: 1\n1 2 3\n");
  };
  for (const char* name : {"H1_3DXP2", "XXX3D_P2", "H1_3D_P4", "H1_3D_P"}) expect_error(space(name, "3"), 20, name);
  for (const char* dimension : {"7", "-", "33"}) expect_error(space("H1_3D_P2", dimension), 21, "VDim");
  expect_error(write("o.mesh", replaced(head, "MFEM mesh", "MFEM NURBS mesh") + "3\n" + corners), 1, "NURBS");
}

// The page of the guide shows the rows of the readers.
TEST(MeshFormatsTable, StandsInTheGuide) {
  std::ifstream in(espalier::test::source_folder() / "docs/guide/your_files.md");
  const std::string page((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  EXPECT_NE(page.find(mesh_formats_table()), std::string::npos) << "the page should hold:\n" << mesh_formats_table();
  for (const char* name : {"a.INP", "b.msh.gz", "c.Nas", "d.vtu", "e.mesh.GZ", "f.cdb"})
    EXPECT_NE(mesh_format_of(name), nullptr) << name;
  for (const char* name : {"a.toml", "inp", "b.stl", "model"}) {
    EXPECT_EQ(mesh_format_of(name), nullptr) << name;
    EXPECT_EQ(mesh_is_no_model(name), "") << name;
  }
}

}  // namespace mesh_other_formats_test
}  // namespace espalier::dynamics::test
