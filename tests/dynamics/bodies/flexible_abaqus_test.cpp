// Stiffness and mass of whole meshes against the matrices that Abaqus printed for them (*MATRIX GENERATE).
#include <filesystem>
#include <fstream>
#include <sstream>

#include "dynamics/bodies/flexible_statics.hpp"
#include "dynamics/elements/solid.hpp"
#include "dynamics/elements/solid_measures.hpp"
#include "dynamics/mesh/read.hpp"
#include "places.hpp"

namespace espalier::dynamics::test {
namespace {

namespace fs = std::filesystem;

fs::path data_folder() { return espalier::test::shared_data(); }

/// A symmetric MatrixMarket file as a full matrix.
Eigen::MatrixXd read_matrix(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line) && line.starts_with('%')) {
  }
  long rows = 0, cols = 0, entries = 0;
  std::istringstream(line) >> rows >> cols >> entries;
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(rows, cols);
  for (long k = 0; k < entries; ++k) {
    long i = 0, j = 0;
    double value = 0;
    file >> i >> j >> value;
    m(i - 1, j - 1) = m(j - 1, i - 1) = value;
  }
  return m;
}

struct Pair {
  const char* mesh;
  const char* matrix;
  SolidOptions options;
};
std::ostream& operator<<(std::ostream& out, const Pair& p) { return out << p.matrix; }

std::unique_ptr<FlexibleBody> body_of(const Mesh& mesh, const SolidOptions& options) {
  const MeshMaterial& m = mesh.materials.at(0);
  return make_solid_body("block", mesh, {SolidLaw::st_venant_kirchhoff, m.young, m.poisson, m.density}, options);
}

/// The files print 16 digits; sums over up to 27 points and 8 elements add a few more round-offs.
constexpr double kPrinted = 200 * 2.220446049250313e-16;

double difference(const Eigen::MatrixXd& ours, const Eigen::MatrixXd& theirs) {
  if (ours.rows() != theirs.rows()) return 1e300;
  return (ours - theirs).cwiseAbs().maxCoeff() / theirs.cwiseAbs().maxCoeff();
}

class AbaqusStiffness : public testing::TestWithParam<Pair> {};

// Truth: Abaqus. C3D8 is the mean-dilatation element, C3D20 and C3D20R are the full and the reduced hex20.
TEST_P(AbaqusStiffness, EqualsOurs) {
  if (!fs::exists(data_folder())) GTEST_SKIP() << data_folder() << " is not there";
  const Mesh mesh = read_mesh((data_folder() / "mesh" / GetParam().mesh).string());
  Statics s(body_of(mesh, GetParam().options));
  EXPECT_LT(difference(s.tangent(), read_matrix(data_folder() / "spd" / GetParam().matrix)), kPrinted);
}
INSTANTIATE_TEST_SUITE_P(
    All, AbaqusStiffness,
    testing::Values(
        Pair{"exudyn_blockC3D8.inp", "exudyn_blockC3D8_STIF1.mtx", {Hex8Formulation::mean_dilatation, false}},
        Pair{"exudyn_rotorDisc.inp", "exudyn_rotorDisc_STIF1.mtx", {Hex8Formulation::mean_dilatation, false}},
        Pair{"exudyn_blockC3D20.inp", "exudyn_blockC3D20_STIF1.mtx", {}},
        Pair{"exudyn_blockC3D20.inp", "exudyn_blockC3D20R_STIF1.mtx", {Hex8Formulation::full, true}}));

// Truth: Abaqus, whose quadratic elements have consistent mass.
TEST(AbaqusMass, ConsistentEqualsOurs) {
  if (!fs::exists(data_folder())) GTEST_SKIP() << data_folder() << " is not there";
  const std::pair<const char*, const char*> pairs[] = {{"exudyn_blockC3D10.inp", "exudyn_blockC3D10_MASS1.mtx"},
                                                       {"exudyn_blockC3D20.inp", "exudyn_blockC3D20R_MASS1.mtx"}};
  for (const auto& [mesh_name, matrix] : pairs) {
    const Mesh mesh = read_mesh((data_folder() / "mesh" / mesh_name).string());
    Statics s(body_of(mesh, {}));
    EXPECT_LT(difference(s.tangent({1, 0, 0}), read_matrix(data_folder() / "spd" / matrix)), kPrinted) << matrix;
  }
}

// Truth: Abaqus, which lumps the mass of linear elements.
TEST(AbaqusMass, LumpedEqualsOurs) {
  if (!fs::exists(data_folder())) GTEST_SKIP() << data_folder() << " is not there";
  const std::pair<const char*, const char*> pairs[] = {{"exudyn_blockC3D4.inp", "exudyn_blockC3D4_MASS1.mtx"},
                                                       {"exudyn_blockC3D8.inp", "exudyn_blockC3D8_MASS1.mtx"}};
  for (const auto& [mesh_name, matrix] : pairs) {
    const Mesh mesh = read_mesh((data_folder() / "mesh" / mesh_name).string());
    Eigen::VectorXd lumped = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(mesh.nodes.size()));
    for (Index e = 0; e < mesh.element_count(); ++e) {
      std::vector<double> x;
      for (const Index n : mesh.element(e)) x.insert(x.end(), mesh.nodes[n].begin(), mesh.nodes[n].end());
      const std::vector<double> m = lumped_mass(mesh.type(e), mesh.materials.at(0).density, x.data());
      for (std::size_t a = 0; a < mesh.element(e).size(); ++a)
        lumped.segment<3>(3 * mesh.element(e)[a]).array() += m[a];
    }
    EXPECT_LT(difference(lumped.asDiagonal(), read_matrix(data_folder() / "spd" / matrix)), kPrinted) << matrix;
  }
}

}  // namespace
}  // namespace espalier::dynamics::test
