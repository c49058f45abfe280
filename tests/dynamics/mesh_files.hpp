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

#include "dynamics/elements/solid.hpp"
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

/// `text` with one occurrence of `from` replaced.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("the text does not contain " + from);
  return text.replace(at, from.size(), to);
}

}  // namespace espalier::dynamics::test
