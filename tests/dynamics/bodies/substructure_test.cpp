// Substructures: bodies of mass and stiffness matrices alone, beside the meshes that the matrices come from.
#include "dynamics/substructure/substructure.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "dynamics/bodies/reduced_body.hpp"
#include "dynamics/integrators/vibrations.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"
#include "dynamics/reference/free_flight.hpp"

namespace espalier::dynamics {
namespace substructure_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

void write_matrix(const std::string& path, const MatrixXd& a) {
  std::ofstream out(path);
  out << "%%MatrixMarket matrix array real general\n" << a.rows() << ' ' << a.cols() << '\n';
  out.precision(17);
  for (Eigen::Index k = 0; k < a.size(); ++k) out << a.data()[k] << '\n';
}

/// "[{ label = 1, position = [...], components = 3 }, ...]"
std::string node_list(const std::vector<Vec3>& places, int components) {
  std::ostringstream out;
  out.precision(17);
  for (std::size_t k = 0; k < places.size(); ++k)
    out << (k == 0 ? "[" : ", ") << "{ label = " << k + 1 << ", position = [" << places[k].x() << ", " << places[k].y()
        << ", " << places[k].z() << "], components = " << components << " }";
  return out.str() + "]";
}

struct Matrices {
  std::vector<Vec3> places;
  MatrixXd mass, stiffness;
};

/// All nodes of a block of solid elements.
Matrices block_matrices(const std::string& text) {
  const auto mechanism = built(text);
  const FlexibleBody& body = *mechanism->bodies[0].flexible;
  const SparsePattern& p = mechanism->system.tangent_pattern();
  Matrices out;
  for (Index k = 0; k < body.nodes(); ++k) out.places.emplace_back(Eigen::Map<const Vec3>(&body.reference()[3 * k]));
  const std::vector<double> rest(body.reference().size(), 0.0), q(body.reference().begin(), body.reference().end());
  const auto dense = [&](const TangentWeights& weights) {
    std::vector<double> values(static_cast<std::size_t>(p.nonzeros()));
    mechanism->system.tangent({0, q, rest, rest, {}}, weights, values);
    MatrixXd a = MatrixXd::Zero(p.cols, p.cols);
    for (Index c = 0; c < p.cols; ++c)
      for (Offset k = p.ptr[static_cast<std::size_t>(c)]; k < p.ptr[static_cast<std::size_t>(c) + 1]; ++k)
        a(p.ind[static_cast<std::size_t>(k)], c) = values[static_cast<std::size_t>(k)];
    return a;
  };
  out.mass = dense({1, 0, 0});
  out.stiffness = dense({0, 0, 1});
  return out;
}

const char* const kBlock = R"(
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.4, lz = 0.3, divisions = [3, 1, 1] }
material = { young = 3000, poisson = 0.3, density = 7 }
)";

std::string block_as_substructure(const std::string& folder, const Matrices& m, int components = 3) {
  write_matrix(folder + "/k.mtx", m.stiffness);
  write_matrix(folder + "/m.mtx", m.mass);
  return "[bodies.block]\ntype = \"substructure\"\nstiffness = { file = \"" + folder +
         "/k.mtx\" }\nmass = { file = \"" + folder + "/m.mtx\" }\nnodes = " + node_list(m.places, components) + "\n";
}

// A spinning block held at a corner by a spring, a weight on it.
const char* const kAround = R"(
rotation = { axis = [1, 2, 3], angle = 0.7 }
position = [0.3, 0.2, 0.1]
angular_velocity = [1, 2, 3]
velocity = [0.1, 0.2, 0.3]
damping = { stiffness = 0.002 }
%s
[bodies.weight]
type = "point"
mass = 0.5
position = [0.3, 0.2, 0.1]
[initial]
velocities = "project"
[joints]
hook = { type = "spherical", a = { body = "block", node = 1 }, b = { body = "weight" } }
[forces]
pull = { type = "load", a = { body = "block", node = 5 }, force = [1, 2, 3] }
[integrator]
end = 0.3
relative = 1e-7
absolute = 1e-8
[output]
quantities = ["hook.force.x", "hook.force.y", "hook.force.z", "block.position.x", "block.velocity.z"]
)";

std::string around(const std::string& reduce) {
  std::string text = kAround;
  return text.replace(text.find("%s"), 2, reduce);
}

std::vector<double> last_row(const std::string& text) {
  SimulationOptions options;
  options.keep_series = true;
  const Simulation run = simulated(text, options);
  const SimulationSeries& series = run.series();
  return {series.values.end() - static_cast<std::ptrdiff_t>(series.names.size()), series.values.end()};
}

// Truth: the reduced body of the same mesh with all of its shapes. With every node listed the interpolated fields are
// those of the mesh, so inertia and motion are the same.
TEST(Substructure, AllNodesOfAMeshMoveAsItsReducedBody) {
  const ScratchFolder folder;
  const Matrices m = block_matrices(std::string(kBlock) + "[integrator]\nend = 1\n");
  const std::string end = "[integrator]\nend = 1\n";
  const auto whole = built(std::string(kBlock) + "reduce = { modes = 1000 }\n" + end);
  const auto given = built(block_as_substructure(folder.path(), m) + end);
  const ReducedBody &a = *whole->bodies[0].reduced, &b = *given->bodies[0].reduced;
  ASSERT_EQ(a.modes(), b.modes());
  EXPECT_NEAR(a.mass(), b.mass(), 1e-13 * a.mass());
  EXPECT_LT((a.shapes().centre - b.shapes().centre).norm(), 1e-13);
  const VectorXd one = a.shapes().stiffness.cwiseQuotient(a.shapes().mass);
  const VectorXd two = b.shapes().stiffness.cwiseQuotient(b.shapes().mass);
  EXPECT_LT((one - two).cwiseAbs().maxCoeff(), 1e-11 * one.maxCoeff());
  const std::vector<double> mesh = last_row(kBlock + around("reduce = { modes = 1000 }"));
  const std::vector<double> own = last_row(block_as_substructure(folder.path(), m) + around(""));
  ASSERT_EQ(mesh.size(), own.size());
  ASSERT_GE(mesh.size(), 5U);
  for (std::size_t k = 0; k < mesh.size(); ++k) EXPECT_NEAR(own[k], mesh[k], 2e-5 * (1 + std::abs(mesh[k]))) << k;
}

// Truth: sums over the points. Where the mass stands at the nodes, inertia is exact.
TEST(Substructure, PointMassesHaveTheirInertia) {
  const std::vector<Vec3> places = {{0, 0, 0}, {1, 0.2, 0}, {0.3, 1, 0.1}, {0.2, 0.3, 0.9}, {-0.4, 0.5, 0.3}};
  const double masses[] = {1, 2, 0.5, 1.5, 0.7};
  const auto n = static_cast<Eigen::Index>(3 * places.size());
  Substructure s{"points", {}, MatrixXd::Zero(n, n), MatrixXd::Zero(n, n)};
  for (std::size_t a = 0; a < places.size(); ++a) {
    s.nodes.push_back({static_cast<std::int64_t>(a), places[a], 3});
    const auto i = static_cast<Eigen::Index>(3 * a);
    s.mass.block<3, 3>(i, i) = masses[a] * Mat3::Identity();
    for (std::size_t b = 0; b < a; ++b) {  // a bar between each pair
      const auto j = static_cast<Eigen::Index>(3 * b);
      const Vec3 d = (places[a] - places[b]).normalized();
      const Mat3 k = (100.0 + static_cast<double>(a + b)) * d * d.transpose();
      s.stiffness.block<3, 3>(i, i) += k;
      s.stiffness.block<3, 3>(j, j) += k;
      s.stiffness.block<3, 3>(i, j) -= k;
      s.stiffness.block<3, 3>(j, i) -= k;
    }
  }
  const SubstructureBody body = make_substructure(s, {});
  const MatrixXd& phi = body.shapes.shapes;
  ASSERT_EQ(phi.cols(), n - 6);
  Mat3 rest = Mat3::Zero();
  for (std::size_t a = 0; a < places.size(); ++a) {
    const Vec3 x = places[a] - body.shapes.centre;
    rest += masses[a] * x * x.transpose();
  }
  EXPECT_LT((rest - body.inertia.rest).norm(), 1e-13);
  for (Eigen::Index k = 0; k < phi.cols(); ++k) {
    Mat3 first = Mat3::Zero();
    for (std::size_t a = 0; a < places.size(); ++a)
      first += masses[a] * phi.block<3, 1>(static_cast<Eigen::Index>(12 * a), k) *
               (places[a] - body.shapes.centre).transpose();
    EXPECT_LT((first - Eigen::Map<const Mat3>(body.inertia.first.data() + 9 * k)).norm(), 1e-12);
    for (Eigen::Index l = 0; l < phi.cols(); ++l) {
      Mat3 pair = Mat3::Zero();
      for (std::size_t a = 0; a < places.size(); ++a)
        pair += masses[a] * phi.block<3, 1>(static_cast<Eigen::Index>(12 * a), k) *
                phi.block<3, 1>(static_cast<Eigen::Index>(12 * a), l).transpose();
      EXPECT_LT((pair - Eigen::Map<const Mat3>(body.inertia.pairs.col(l).data() + 9 * k)).norm(), 1e-12);
    }
  }
}

/// A straight beam along x of `count` Euler-Bernoulli elements, six unknowns a node.
Matrices beam_matrices(int count, double length, double radius, double young, double density) {
  const double l = length / count, area = std::numbers::pi * radius * radius, second = 0.25 * area * radius * radius;
  const double shear = young / 2.6;
  Matrices out;
  for (int k = 0; k <= count; ++k) out.places.emplace_back(k * l, 0, 0);
  out.mass = out.stiffness = MatrixXd::Zero(6 * (count + 1), 6 * (count + 1));
  MatrixXd k = MatrixXd::Zero(12, 12), m = MatrixXd::Zero(12, 12);
  const auto bar = [&](int i, double stiff, double inertia) {
    for (const int a : {i, i + 6})
      for (const int b : {i, i + 6}) {
        k(a, b) = (a == b ? 1 : -1) * stiff / l;
        m(a, b) = (a == b ? 2 : 1) * inertia * l / 6;
      }
  };
  bar(0, young * area, density * area);
  bar(3, shear * 2 * second, density * 2 * second);
  const double ks[4][4] = {{12, 6 * l, -12, 6 * l},
                           {6 * l, 4 * l * l, -6 * l, 2 * l * l},
                           {-12, -6 * l, 12, -6 * l},
                           {6 * l, 2 * l * l, -6 * l, 4 * l * l}};
  const double ms[4][4] = {{156, 22 * l, 54, -13 * l},
                           {22 * l, 4 * l * l, 13 * l, -3 * l * l},
                           {54, 13 * l, 156, -22 * l},
                           {-13 * l, -3 * l * l, -22 * l, 4 * l * l}};
  for (const int plane : {0, 1}) {  // y with rotation z, z with rotation -y
    const int at[4] = {1 + plane, 5 - plane, 7 + plane, 11 - plane};
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < 4; ++b) {
        const double sign = plane == 1 && (a + b) % 2 == 1 ? -1 : 1;
        k(at[a], at[b]) = sign * ks[a][b] * young * second / (l * l * l);
        m(at[a], at[b]) = sign * ms[a][b] * density * area * l / 420;
      }
  }
  for (int e = 0; e < count; ++e) {
    out.stiffness.block(6 * e, 6 * e, 12, 12) += k;
    out.mass.block(6 * e, 6 * e, 12, 12) += m;
  }
  return out;
}

/// Craig and Bampton: the two ends stay, and `modes` shapes with the ends held.
Matrices condensed(const Matrices& full, int modes) {
  const Eigen::Index n = full.mass.rows(), inner = n - 12;
  const MatrixXd kii = full.stiffness.block(6, 6, inner, inner), mii = full.mass.block(6, 6, inner, inner);
  MatrixXd kib(inner, 12);
  kib << full.stiffness.block(6, 0, inner, 6), full.stiffness.block(6, n - 6, inner, 6);
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> eigen(kii, mii);
  MatrixXd t = MatrixXd::Zero(n, 12 + modes);
  t.topLeftCorner(6, 6).setIdentity();
  t.block(n - 6, 6, 6, 6).setIdentity();
  t.block(6, 0, inner, 12) = -kii.llt().solve(kib);
  t.block(6, 12, inner, modes) = eigen.eigenvectors().leftCols(modes);
  return {{full.places.front(), full.places.back()}, t.transpose() * full.mass * t, t.transpose() * full.stiffness * t};
}

// Truth: J. P. Den Hartog, "Mechanical Vibrations": a clamped beam, (1.8751, 4.6941)^2 sqrt(E I / (rho A)) / L^2.
TEST(Substructure, CondensedBeamHasItsFrequencies) {
  const ScratchFolder folder;
  const Matrices m = condensed(beam_matrices(12, 1, 0.01, 2e11, 7800), 10);
  const std::string text = block_as_substructure(folder.path(), m, 6) + R"(
[joints]
clamp = { type = "fixed", a = { body = "ground" }, b = { body = "block", node = 1 } }
[integrator]
end = 1
)";
  const auto mechanism = built(text);
  Equations equations(mechanism->system);
  State s(mechanism->system.sizes());
  mechanism->system.initial(s.q, s.v);
  Options solver;
  solver.threads = 1;
  const auto modes = small_vibrations(equations, s, 4, solver).modes;
  ASSERT_EQ(modes.size(), 4U);
  const double unit = std::sqrt(2e11 * 0.25 * 0.01 * 0.01 / 7800) / (2 * std::numbers::pi);
  EXPECT_NEAR(modes[0].frequency, 1.875104 * 1.875104 * unit, 2e-4 * modes[0].frequency);
  EXPECT_NEAR(modes[1].frequency, 1.875104 * 1.875104 * unit, 2e-4 * modes[0].frequency);
  EXPECT_NEAR(modes[2].frequency, 4.694091 * 4.694091 * unit, 5e-4 * modes[2].frequency);
}

// Truth: our own beam of many elements. A pendulum of a soft rod that swings through large angles.
TEST(Substructure, PendulumSwingsAsTheNodalBeam) {
  const ScratchFolder folder;
  const auto rest = [](const char* last) {
    return std::string(R"(
[markers]
top = { body = "block", node = 1, axis = [0, 1, 0] }
tip = { body = "block", node = )") +
           last + R"( }
[joints]
hinge = { type = "revolute", a = { body = "ground", axis = [0, 1, 0] }, b = "top" }
[integrator]
end = 0.3
relative = 1e-5
absolute = 1e-6
[output]
quantities = ["tip.position.x", "tip.position.z", "hinge.force.x", "hinge.force.z"]
)";
  };
  const std::string gravity = "gravity = [0, 0, -9.81]\n";
  const std::vector<double> nodal = last_row(gravity + R"(
[bodies.block]
type = "beam"
start = [0, 0, 0]
end = [1, 0, 0]
elements = 8
radius = 0.01
material = { young = 2e10, poisson = 0.3, density = 7800 }
damping = { stiffness = 1e-3 }
)" + rest("-1"));
  const Matrices full = beam_matrices(8, 1, 0.01, 2e10, 7800);
  double before = 1;
  for (const bool condense : {true, false}) {
    const Matrices m = condense ? condensed(full, 4) : full;
    const std::vector<double> own = last_row(gravity + block_as_substructure(folder.path(), m, 6) +
                                             "damping = { stiffness = 1e-3 }\n" + rest(condense ? "2" : "9"));
    ASSERT_EQ(own.size(), nodal.size());
    double worst = 0;
    for (std::size_t k = 0; k < 2; ++k) worst = std::max(worst, std::abs(own[k] - nodal[k]));
    EXPECT_LT(worst, 1e-3) << condense;
    EXPECT_LT(worst, before);
    before = 1.1 * worst;
  }
}

// Truth: central differences.
TEST(Substructure, DerivativesAgreeWithDifferences) {
  const ScratchFolder folder;
  const Matrices m = condensed(beam_matrices(6, 1, 0.05, 2e4, 780), 4);
  const auto mechanism = built(block_as_substructure(folder.path(), m, 6) + R"(
damping = { mass = 0.2, stiffness = 0.01 }
reduce = { damping = 0.03 }
rotation = { axis = [1, 2, 3], angle = 0.7 }
[bodies.weight]
type = "rigid"
mass = 2
box = [0.3, 0.2, 0.1]
position = [1.5, 0.2, 0.3]
[joints]
pin = { type = "revolute", a = { body = "block", axis = [0, 0, 1], node = 2 }, b = { body = "weight" } }
[forces]
bushing = { type = "bushing", a = { body = "block", node = 1 }, b = { body = "ground" }, stiffness = [1, 2, 3], angular_stiffness = [2, 1, 3], angular_damping = [0.1, 0.2, 0.3] }
push = { type = "load", a = { body = "block", node = 2 }, force = [1, 2, 3], moment = [0.3, 0.2, 0.1], follower = true }
[integrator]
end = 1
)");
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const JacobianCheck found = check_jacobians(mechanism->system, anywhere(*mechanism, seed, 0.1));
    EXPECT_LT(found.largest(), 2e-7) << found.worst << ", seed " << seed;
  }
}

// Whatever the interpolated inertia, energy and angular momentum stay, and better with smaller steps.
TEST(Substructure, KeepsMomentaAndEnergyInFreeFlight) {
  const ScratchFolder folder;
  const Matrices m = condensed(beam_matrices(6, 1, 0.05, 2e7, 780), 4);
  const auto drift = [&](double tolerance) {
    const auto mechanism = built(block_as_substructure(folder.path(), m, 6) + R"(
velocity = [1, -2, 0.5]
angular_velocity = [10, 12, 13]
[integrator]
end = 1
)");
    const Drift found = free_flight(*mechanism, tolerance, 0.1);
    EXPECT_GT(found.strain, 1e-4);  // it does deform
    EXPECT_LT(found.momentum, 1e-11);
    return std::max(found.energy, found.angular);
  };
  const double coarse = drift(1e-5), fine = drift(1e-7);
  EXPECT_LT(fine, 1e-5);
  EXPECT_LT(fine, 0.2 * coarse);
}

// Labels say where rows belong; what is not listed is a scalar; one triangle is enough.
TEST(Substructure, LabelsAndCountedRowsAreTheSame) {
  const Matrices m = condensed(beam_matrices(6, 1, 0.05, 2e7, 780), 2);
  const auto labelled = [](const MatrixXd& a, bool whole) {
    FileMatrix file;
    file.rows = file.columns = static_cast<Index>(a.rows());
    for (Index i = 0; i < 6; ++i) file.unknowns.push_back({7, i + 1});  // the second node, the first, two scalars
    for (Index i = 0; i < 6; ++i) file.unknowns.push_back({9, i + 1});
    file.unknowns.push_back({100, 0});
    file.unknowns.push_back({101, 0});
    const auto from = [](Index k) { return k < 6 ? k + 6 : k < 12 ? k - 6 : k; };
    for (Index j = 0; j < file.rows; ++j)
      for (Index i = whole ? 0 : j; i < file.rows; ++i) file.entries.push_back({i, j, a(from(i), from(j))});
    return file;
  };
  const std::vector<SubstructureNode> nodes = {{9, m.places[0], 0}, {7, m.places[1], 0}};
  for (const bool whole : {true, false}) {
    const Substructure s = arrange("s", labelled(m.mass, whole), labelled(m.stiffness, !whole), nodes);
    EXPECT_EQ(s.nodes[0].components, 6);
    EXPECT_LT((s.mass - m.mass).cwiseAbs().maxCoeff(), 1e-15 * m.mass.maxCoeff());
    EXPECT_LT((s.stiffness - m.stiffness).cwiseAbs().maxCoeff(), 1e-9 * m.stiffness.maxCoeff());
  }
}

TEST(Substructure, MistakesAreNamed) {
  const ScratchFolder folder;
  const Matrices good = condensed(beam_matrices(6, 1, 0.05, 2e7, 780), 2);
  const auto said = [&](const Matrices& m, int components = 6, const std::string& more = "") {
    Simulation simulation;
    const Status status = simulation.load_text(
        block_as_substructure(folder.path(), m, components) + more + "[integrator]\nend = 1\n", "model.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    return status.message;
  };
  const auto expect_in = [](const std::string& part, const std::string& text) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  Matrices m = good;
  m.places[1] = Vec3(0, 0, 2);
  expect_in("its stiffness resists rotation about", said(m));
  m = good;
  m.stiffness(0, 0) *= 2;
  expect_in("its stiffness resists displacement along x", said(m));
  m = good;
  m.mass(3, 3) = 0;
  expect_in("row 4 of the mass matrix has no inertia", said(m));
  m = good;
  m.mass(13, 13) *= 1e-3;  // less than its coupling to the ends asks for
  expect_in("gives 1 motions no inertia or a negative one", said(m));
  m = good;
  m.mass *= -1;
  expect_in("has no inertia", said(m));
  m = good;
  m.stiffness(0, 6) *= 1.5;
  expect_in("the stiffness matrix is not symmetric: rows 1 and 7", said(m));
  m = good;
  m.mass.conservativeResize(13, 13);
  expect_in("the mass matrix has 13 rows and 13 columns; the stiffness has 14", said(m));
  m = good;
  m.mass(0, 0) *= 1.5;
  expect_in("its mass differs by direction", said(m));
  expect_in("must be 6", said(good, 4));
  expect_in("has no node 3", said(good, 6,
                                  "[joints]\na = { type = \"fixed\", a = { body = \"ground\" }, b = { body = "
                                  "\"block\", node = 3 } }\n"));
  expect_in("there is no node 5", said(good, 6, "lines = [1, 5]\n"));
  expect_in("model.toml", said(good, 6, "lines = [1, 2, 1]\n"));
}

}  // namespace substructure_test
}  // namespace espalier::dynamics
