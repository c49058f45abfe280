/// \file
/// Mesh files written for a test, and what is asked of the meshes read from them.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "dynamics/elements/groups.hpp"
#include "dynamics/elements/solid.hpp"
#include "dynamics/elements/solid_measures.hpp"
#include "dynamics/mesh/read.hpp"

namespace espalier::dynamics::test {

/// A folder of its own for every test.
class MeshFiles : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() /
        fmt::format("espalier_mesh_{}_{}", ::getpid(), testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string write(const std::string& name, const std::string& content) {
    const std::string path = (folder_ / name).string();
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }
  /// Truth: the message starts with file:line and contains what the reader must say.
  static void expect_error(const std::string& path, int line, const std::string& text) {
    try {
      static_cast<void>(read_mesh(path));
      ADD_FAILURE() << "no error for " << path;
    } catch (const Error& error) {
      const std::string message = error.what();
      EXPECT_EQ(message.rfind(fmt::format("{}:{}:", path, line), 0), 0U) << message;
      EXPECT_NE(message.find(text), std::string::npos) << message;
    }
  }
  std::filesystem::path folder_;
};

/// Coordinates of the nodes of one element, three each.
inline std::vector<double> coordinates(const Mesh& mesh, Index element) {
  std::vector<double> x;
  for (const Index n : mesh.element(element)) {
    const Point& p = mesh.nodes[static_cast<std::size_t>(n)];
    x.insert(x.end(), p.begin(), p.end());
  }
  return x;
}

inline double mesh_volume(const Mesh& mesh) {
  double sum = 0;
  for (Index e = 0; e < mesh.element_count(); ++e)
    if (is_simulated_solid(mesh.type(e))) sum += solid_volume(mesh.type(e), coordinates(mesh, e).data());
  return sum;
}

/// Edges on which the mid-side nodes of a format's second-order elements lie, in its order.
struct MidSideEdges {
  int tet[6][2];
  int hex[12][2];
};

/// A tetrahedron (volume 8/6, Jacobian 8) or a cube (volume 8, Jacobian 1) of edge 2: corners, then middles of edges.
inline std::vector<Point> second_order_nodes(bool is_tet, const MidSideEdges& edges) {
  std::vector<Point> nodes;
  if (is_tet)
    nodes = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}};
  else
    nodes = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 0, 2}, {2, 0, 2}, {2, 2, 2}, {0, 2, 2}};
  for (int k = 0; k < (is_tet ? 6 : 12); ++k) {
    const int* edge = is_tet ? edges.tet[k] : edges.hex[k];
    const Point a = nodes[static_cast<std::size_t>(edge[0])], b = nodes[static_cast<std::size_t>(edge[1])];
    nodes.push_back({0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])});
  }
  return nodes;
}

/// Truth: nodes in the right order give the exact volume and a constant Jacobian.
inline void expect_second_order(const Mesh& mesh, bool is_tet) {
  ASSERT_EQ(mesh.type(0), is_tet ? ElementType::tet10 : ElementType::hex20);
  EXPECT_NEAR(mesh_volume(mesh), is_tet ? 8.0 / 6 : 8, 1e-13);
  EXPECT_NEAR(smallest_jacobian(mesh.type(0), coordinates(mesh, 0).data()).corners, is_tet ? 8 : 1, 1e-13);
}

/// `text` with one occurrence of `from` replaced.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("the text does not contain " + from);
  return text.replace(at, from.size(), to);
}

}  // namespace espalier::dynamics::test
