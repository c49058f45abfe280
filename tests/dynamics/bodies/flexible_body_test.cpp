// FlexibleBody as a component: patch tests, derivatives, threads, gravity, pressure, momenta, thin parts, order.
#include "dynamics/bodies/flexible_body.hpp"

#include <cmath>
#include <random>

#include "dynamics/bodies/flexible_statics.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/equations.hpp"
#include "dynamics/elements/time_pressure.hpp"
#include "dynamics/meshers/parts.hpp"

namespace espalier::dynamics::test {
namespace {

constexpr double kEps = 2.220446049250313e-16;
const Material kSteel{SolidLaw::st_venant_kirchhoff, 2.1e11, 0.3, 7850};

/// A block whose inner nodes are moved at random: `size` of the smallest edge.
Mesh distorted_block(int n, ElementType type, double size) {
  Mesh mesh = make_block({3, 2, 1}, n, n, n, type);
  std::mt19937 generator(5);
  std::uniform_real_distribution<double> uniform(-size / n, size / n);
  const auto boundary = mesh.nodes_of_faces(mesh.boundary_faces());
  if (type != ElementType::hex8) return mesh;
  for (Index k = 0; k < static_cast<Index>(mesh.nodes.size()); ++k)
    if (!std::binary_search(boundary.begin(), boundary.end(), k))
      for (double& x : mesh.nodes[static_cast<std::size_t>(k)]) x += uniform(generator);
  return mesh;
}

/// Every hexahedron cut into six tetrahedra around its diagonal 0-6 (conforming on structured blocks).
Mesh tetrahedra(const Mesh& hexes) {
  static const int cut[6][4] = {{0, 1, 2, 6}, {0, 2, 3, 6}, {0, 3, 7, 6}, {0, 7, 4, 6}, {0, 4, 5, 6}, {0, 5, 1, 6}};
  Mesh mesh;
  mesh.nodes = hexes.nodes;
  for (Index e = 0; e < hexes.element_count(); ++e)
    for (const auto& c : cut) {
      std::array<Index, 4> nodes{};
      for (std::size_t a = 0; a < 4; ++a) nodes[a] = hexes.element(e)[static_cast<std::size_t>(c[a])];
      mesh.add_element(ElementType::tet4, nodes);
    }
  mesh.face_sets = {};
  return mesh;
}

struct Patch {
  std::string name;
  Mesh mesh;
  SolidOptions options;
};

std::vector<Patch> patches() {
  const Mesh hex = distorted_block(3, ElementType::hex8, 0.6);
  return {{"tet4", tetrahedra(hex), {}},
          {"hex8_full", hex, {Hex8Formulation::full, false}},
          {"hex8_mean", hex, {Hex8Formulation::mean_dilatation, false}},
          {"hex8_enhanced", hex, {Hex8Formulation::enhanced, false}},
          {"hex20", distorted_block(2, ElementType::hex20, 0), {}},
          {"hex20_reduced", distorted_block(2, ElementType::hex20, 0), {Hex8Formulation::full, true}}};
}

// Truth: with the boundary moved by a linear map (finite strain), the inner nodes follow the map, to round-off.
TEST(PatchTest, LinearMapIsReproduced) {
  Eigen::Matrix3d f;
  f << 1.1, 0.2, -0.1, 0.05, 0.9, 0.15, -0.1, 0.1, 1.05;
  for (const Patch& patch : patches())
    for (const SolidLaw law : {SolidLaw::st_venant_kirchhoff, SolidLaw::neo_hookean}) {
      Material material = kSteel;
      material.law = law;
      Statics s(make_solid_body("patch", patch.mesh, material, patch.options));
      const auto boundary = patch.mesh.nodes_of_faces(patch.mesh.boundary_faces());
      ASSERT_LT(boundary.size(), patch.mesh.nodes.size());
      for (Index n = 0; n < static_cast<Index>(patch.mesh.nodes.size()); ++n) {
        const bool fixed = std::binary_search(boundary.begin(), boundary.end(), n);
        if (fixed) s.fix(n);
        s.q().segment<3>(3 * n) = f * s.q().segment<3>(3 * n);
        if (!fixed) s.q().segment<3>(3 * n).array() += 0.02 * std::sin(n);  // a start that is not the answer
      }
      s.solve();
      for (Index n = 0; n < static_cast<Index>(patch.mesh.nodes.size()); ++n) {
        const Eigen::Map<const Eigen::Vector3d> reference(patch.mesh.nodes[static_cast<std::size_t>(n)].data());
        EXPECT_LT((s.position(n) - f * reference).norm(), 300 * kEps * 3) << patch.name << " node " << n;
      }
    }
}

/// The state of a body that moves: every span filled.
struct Moving {
  AssembledSystem system;
  FlexibleBody* body;
  std::vector<double> q, v, a, none;
  explicit Moving(std::unique_ptr<FlexibleBody> b, double amplitude = 0.01) : body(&system.add(std::move(b))) {
    finish(amplitude);
  }
  /// With a pressure of 40 t on the faces z1 of its mesh.
  Moving(std::unique_ptr<FlexibleBody> b, const Mesh& mesh) : body(&system.add(std::move(b))) {
    test::press(system, *body, mesh, mesh.face_set("z1"), [](double t) { return 40 * t; });
    finish(0.01);
  }
  void finish(double amplitude) {
    system.finish();
    const auto n = static_cast<std::size_t>(system.sizes().velocity);
    q.resize(n);
    v.resize(n);
    a.resize(n);
    system.initial(q, v);
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (std::size_t i = 0; i < n; ++i) {
      q[i] += amplitude * uniform(generator);
      v[i] += uniform(generator);
      a[i] = uniform(generator);
    }
  }
  StateView state(double t = 0) const { return {t, q, v, a, none}; }
  std::vector<double> residual(double t = 0) {
    std::vector<double> f(q.size());
    system.residual(state(t), f);
    return f;
  }
  std::vector<double> tangent(const TangentWeights& weights, double t = 0) {
    std::vector<double> w(static_cast<std::size_t>(system.tangent_pattern().nonzeros()));
    system.tangent(state(t), weights, w);
    return w;
  }
};

std::unique_ptr<FlexibleBody> loaded_block(const Mesh& mesh, const Material& material) {
  auto body = make_solid_body("block", mesh, material);
  body->set_damping({0.3, 0.02});
  body->set_gravity({0.5, -9.81, 0.2});
  return body;
}

// Truth: finite differences of the residual by q, v and a, with damping, gravity and follower pressure acting.
TEST(FlexibleBody, TangentMatchesFiniteDifferences) {
  for (const SolidLaw law : {SolidLaw::st_venant_kirchhoff, SolidLaw::neo_hookean}) {
    const Mesh mesh = make_block({3, 2, 1}, 2, 2, 1, ElementType::hex8);
    Moving m(loaded_block(mesh, {law, 200, 0.3, 7}), mesh);
    const TangentWeights weights{0.8, 0.6, 0.9};
    const auto w = m.tangent(weights, 1.0);
    const SparsePattern& p = m.system.tangent_pattern();
    const double h = std::cbrt(kEps);
    double largest = 0, worst = 0;
    for (Index c = 0; c < p.cols; ++c) {
      std::vector<double> column(m.q.size(), 0.0);
      const std::pair<std::vector<double>*, double> parts[] = {{&m.a, weights.a}, {&m.v, weights.v}, {&m.q, weights.q}};
      for (const auto& [array, weight] : parts) {
        double& x = (*array)[static_cast<std::size_t>(c)];
        const double keep = x;
        x = keep + h;
        const auto high = m.residual(1.0);
        x = keep - h;
        const auto low = m.residual(1.0);
        x = keep;
        for (std::size_t r = 0; r < column.size(); ++r) column[r] += weight * (high[r] - low[r]) / (2 * h);
      }
      for (Offset k = p.ptr[c]; k < p.ptr[c + 1]; ++k) {
        const double value = w[static_cast<std::size_t>(k)];
        largest = std::max(largest, std::abs(value));
        worst = std::max(worst, std::abs(value - column[static_cast<std::size_t>(p.ind[static_cast<std::size_t>(k)])]));
        column[static_cast<std::size_t>(p.ind[static_cast<std::size_t>(k)])] = 0;
      }
      for (const double left : column) worst = std::max(worst, std::abs(left));  // nothing outside of the pattern
    }
    EXPECT_GT(largest, 0);
    EXPECT_LT(worst, 300 * std::pow(kEps, 2.0 / 3) * largest);
  }
}

// Truth: the same bits for any number of threads.
TEST(FlexibleBody, ThreadsDoNotChangeABit) {
  const Mesh mesh = make_crank({}, {6e3, ElementType::hex20});
  std::vector<double> force, tangent;
  for (const int threads : {1, 2, 3, 7}) {
    base::ThreadPool pool(threads);
    auto body = make_solid_body("crank", mesh, kSteel);
    body->set_pool(&pool);
    body->set_damping({0.1, 1e-5});
    Moving m(std::move(body), 1e-5);
    for (double& x : m.v) x *= 1e-3;
    ASSERT_TRUE(std::isfinite(m.residual()[0]));
    const auto f = m.residual();
    const auto w = m.tangent({1, 1e3, 1e6});
    if (threads == 1) {
      force = f;
      tangent = w;
      EXPECT_GT(m.body->assembly().batches(), 1);
    }
    EXPECT_EQ(f, force) << threads;
    EXPECT_EQ(w, tangent) << threads;
    EXPECT_EQ(m.body->times().forces, 2);
    EXPECT_GT(m.body->times().tangent_seconds, 0);
  }
}

// Truth: the bodies one by one, each by itself.
TEST(FlexibleBody, SystemsRunTheirTasksTogether) {
  const Mesh small = make_block({3, 2, 1}, 3, 2, 2), large = make_crank({}, {6e3, ElementType::hex8});
  std::vector<double> alone;
  for (const int threads : {0, 1, 2, 3}) {
    std::unique_ptr<base::ThreadPool> pool;
    if (threads > 0) pool = std::make_unique<base::ThreadPool>(threads);
    AssembledSystem system;
    system.set_pool(pool.get());
    std::vector<FlexibleBody*> bodies;
    for (const Mesh* mesh : {&small, &large, &small}) {
      bodies.push_back(&system.add(make_solid_body("body", *mesh, kSteel)));
      bodies.back()->set_damping({0.1, 1e-5});
      bodies.back()->set_gravity({1, -2, -10});
    }
    system.finish();
    State s(system.sizes());
    system.initial(s.q, s.v);
    for (std::size_t i = 0; i < s.q.size(); ++i) {
      s.q[i] += 1e-5 * std::sin(static_cast<double>(7 * i));
      s.v[i] = std::cos(static_cast<double>(3 * i));
      s.a[i] = std::sin(static_cast<double>(5 * i));
    }
    std::vector<double> f(s.v.size(), 1.0), single(f.size(), 0.0);
    system.residual(s.view(), f);
    for (FlexibleBody* body : bodies) body->residual(s.view(), single);
    if (threads == 0) alone = f;
    EXPECT_EQ(f, single) << threads;
    EXPECT_EQ(f, alone) << threads;
    EXPECT_TRUE(std::isfinite(f[0]) && f[0] != 0);
    // An element of the second body inside out: its own forces are no numbers, and it says which one it is.
    const auto node = static_cast<std::size_t>(bodies[1]->configuration(0));
    for (std::size_t i = 0; i < 3; ++i) s.q[node + i] += 10;
    system.residual(s.view(), f);
    EXPECT_EQ(bodies[0]->inverted_element(), -1);
    EXPECT_GE(bodies[1]->inverted_element(), 0);
    EXPECT_EQ(bodies[2]->inverted_element(), -1);
    EXPECT_TRUE(std::isnan(f[static_cast<std::size_t>(bodies[1]->coordinate(0))]));
    EXPECT_FALSE(std::isnan(f[static_cast<std::size_t>(bodies[2]->coordinate(0))]));
  }
}

// Truth: gravity pulls with mass * g, a rigid motion has momentum m v and angular momentum of the box's inertia.
TEST(FlexibleBody, MassGravityAndMomenta) {
  const Mesh mesh = make_block({3, 2, 1}, 3, 2, 2, ElementType::hex20);
  auto owned = make_solid_body("block", mesh, kSteel);
  owned->set_gravity({0, 0, -10});
  const Point w{0.3, -0.2, 0.5}, v{1, 2, 3};
  owned->set_initial_motion({1, 0, 0, 0, 1, 0, 0, 0, 1}, {-1.5, -1, -0.5}, v, w);
  AssembledSystem system;
  FlexibleBody& body = system.add(std::move(owned));
  system.finish();
  std::vector<double> q(3 * mesh.nodes.size()), rate(q.size()), f(q.size());
  system.initial(q, rate);
  const MassProperties p = body.mass_properties(q, rate);
  const double mass = 6 * 7850;
  EXPECT_NEAR(p.mass, mass, 1e3 * kEps * mass);
  const double inertia[3] = {mass * (4 + 1) / 12, mass * (9 + 1) / 12, mass * (9 + 4) / 12};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(p.centre[i], 0, 1e3 * kEps);
    EXPECT_NEAR(p.momentum[i], mass * v[i], 1e4 * kEps * mass);
    EXPECT_NEAR(p.angular_momentum[i], inertia[i] * w[i], 1e4 * kEps * mass);
  }
  StateView s;
  s.q = q;
  s.v = rate;
  system.residual(s, f);
  double sum = 0;
  for (std::size_t k = 2; k < f.size(); k += 3) sum += f[k];
  EXPECT_NEAR(sum, mass * 10, 1e-9 * mass * 10);  // round-off of the elastic forces, which are zero, times stiffness
  const Energy energy = system.energy(s);
  double kinetic = 0.5 * mass * (1 + 4 + 9);
  for (std::size_t i = 0; i < 3; ++i) kinetic += 0.5 * inertia[i] * w[i] * w[i];
  EXPECT_NEAR(energy.kinetic, kinetic, 1e4 * kEps * kinetic);
}

// Truth: pressure on a closed surface has no resultant and no moment, whatever the shape; uniform pressure compresses
// by p (1 - 2 nu) / E in every direction at small strain.
TEST(FlexibleBody, UniformPressure) {
  for (const ElementType type : {ElementType::hex8, ElementType::hex20}) {
    const Mesh mesh = make_block({3, 2, 1}, 3, 3, 3, type);
    const double p = 1e-6 * kSteel.young;
    auto body = make_solid_body("block", mesh, kSteel);
    Statics s(std::move(body), [&](AssembledSystem& system, const FlexibleBody& block) {
      test::press(system, block, mesh, mesh.boundary_faces(), [=](double) { return p; });
    });
    const Eigen::VectorXd f = s.residual();
    for (int i = 0; i < 3; ++i) {
      double sum = 0;
      for (Eigen::Index k = i; k < f.size(); k += 3) sum += f[k];
      EXPECT_NEAR(sum, 0, 1e3 * kEps * p * 6);
    }
    Index far = 0;  // the corner (3, 2, 1)
    for (Index n = 0; n < static_cast<Index>(mesh.nodes.size()); ++n) {
      const Point& x = mesh.nodes[static_cast<std::size_t>(n)];
      for (int i = 0; i < 3; ++i)
        if (x[static_cast<std::size_t>(i)] == 0) s.fix(n, i);
      if (x == Point{3, 2, 1}) far = n;
    }
    s.solve();
    const double strain = -p * (1 - 2 * kSteel.poisson) / kSteel.young;
    EXPECT_LT((s.displacement(far) - strain * Eigen::Vector3d(3, 2, 1)).norm(), 1e-5 * std::abs(strain) * 3);
  }
}

/// Tip deflection of a cantilever of hexahedra over the Timoshenko deflection.
double cantilever_ratio(const SolidOptions& options, double thickness, int n, ElementType type) {
  const double length = 1, width = 0.1;
  const Mesh mesh = make_block({length, width, thickness}, n, 1, 1, type);
  const Material material{SolidLaw::st_venant_kirchhoff, 2.1e11, 0, 7850};
  Statics s(make_solid_body("cantilever", mesh, material, options));
  for (const Index k : mesh.node_set("x0")) s.fix(k);
  const double ei = material.young * width * std::pow(thickness, 3) / 12, force = 1e-5 * ei;
  const auto& tip = mesh.node_set("x1");
  for (const Index k : tip) s.set_load(k, {0, 0, force / static_cast<double>(tip.size())});
  s.solve();
  double mean = 0;
  for (const Index k : tip) mean += s.displacement(k)[2] / static_cast<double>(tip.size());
  return mean / (force / (3 * ei) + force / (5.0 / 6 * material.mu() * width * thickness));
}

// Truth: Timoshenko's beam. The enhanced hex8 does not lock at any thickness; the plain one does, which shows that
// the test can fail.
TEST(ThinSolids, EnhancedHexahedraDoNotLock) {
  for (const double thickness : {0.1, 0.01, 0.001}) {
    for (const Hex8Formulation f : {Hex8Formulation::enhanced, Hex8Formulation::shell})
      EXPECT_NEAR(cantilever_ratio({f, false}, thickness, 10, ElementType::hex8), 1, 0.01) << thickness;
    EXPECT_NEAR(cantilever_ratio({}, thickness, 5, ElementType::hex20), 1, 0.01) << thickness;
  }
  EXPECT_LT(cantilever_ratio({Hex8Formulation::full, false}, 0.01, 10, ElementType::hex8), 0.1);
}

/// Largest displacement error of a manufactured solution u = c sin(x) exp(y) ... small, body force by finite load:
/// strain energy of a body whose whole boundary is moved by a smooth field, against a fine mesh.
double boundary_driven_energy(int n, ElementType type) {
  const Mesh mesh = make_block({1, 1, 1}, n, n, n, type);
  Statics s(make_solid_body("cube", mesh, {SolidLaw::neo_hookean, 100, 0.3, 1}, {Hex8Formulation::enhanced, false}));
  for (const Index k : mesh.nodes_of_faces(mesh.boundary_faces())) s.fix(k);
  for (Index k = 0; k < static_cast<Index>(mesh.nodes.size()); ++k) {
    const Point& x = mesh.nodes[static_cast<std::size_t>(k)];
    s.q().segment<3>(3 * k) +=
        0.1 * Eigen::Vector3d(std::sin(3 * x[1]) * x[2], x[0] * x[2] * x[2], std::sin(2 * x[0]) * x[1]);
  }
  s.solve();
  StateView state;
  state.q = {s.q().data(), static_cast<std::size_t>(s.q().size())};
  return s.body().energy(state).potential;
}

// Truth: theory. The energy converges with h^2 for hex8 and h^4 for hex20 (twice the order of the strains).
TEST(Convergence, EnergyOrders) {
  const double fine = boundary_driven_energy(4, ElementType::hex20);
  const auto order = [&](ElementType type, int coarse, int twice) {
    return std::log2(std::abs(boundary_driven_energy(coarse, type) - fine) /
                     std::abs(boundary_driven_energy(twice, type) - fine));
  };
  EXPECT_NEAR(order(ElementType::hex8, 2, 4), 2, 0.35);
  EXPECT_GT(order(ElementType::hex20, 1, 2), 3.3);
}

// Truth: an element pushed inside out is named, and its forces are not numbers.
TEST(FlexibleBody, InvertedElementIsReported) {
  Moving m(make_solid_body("block", make_block({3, 1, 1}, 3, 1, 1), kSteel));
  EXPECT_TRUE(std::isfinite(m.residual()[0]));
  EXPECT_EQ(m.body->inverted_element(), -1);
  for (std::size_t k = 0; k < m.q.size(); k += 3)
    if (m.q[k] > 2.5) m.q[k] = 1.5;  // the last layer of nodes beyond the one before
  const auto f = m.residual();
  EXPECT_EQ(m.body->inverted_element(), 3);
  EXPECT_TRUE(std::any_of(f.begin(), f.end(), [](double x) { return std::isnan(x); }));
}

TEST(FlexibleBody, WrongInputIsRefused) {
  Mesh mesh = make_block({1, 1, 1}, 1, 1, 1);
  mesh.nodes.push_back({9, 9, 9});
  EXPECT_THROW(static_cast<void>(make_solid_body("loose node", mesh, kSteel)), Error);
  EXPECT_EQ(mesh.drop_unused_nodes(), 1);
  EXPECT_NO_THROW(static_cast<void>(make_solid_body("fine", mesh, kSteel)));
  EXPECT_THROW(static_cast<void>(make_solid_body("nu", mesh, {SolidLaw::neo_hookean, 1, 0.5, 1})),
               std::invalid_argument);
  EXPECT_THROW(static_cast<void>(make_solid_body("rho", mesh, {SolidLaw::neo_hookean, 1, 0.3, 0})),
               std::invalid_argument);
}

}  // namespace
}  // namespace espalier::dynamics::test
