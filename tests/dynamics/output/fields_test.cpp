// Stresses, strains, forces in sections, reactions and energies as quantities, against closed forms.
#include "dynamics/model/model_common.hpp"
#include "dynamics/model/model_harmonic_common.hpp"

namespace espalier::dynamics {
namespace fields_test {

constexpr double kPull = 1e5;  // tensile stress on the end

std::string bar(const std::string& element, const std::string& options) {
  return fmt::format(R"(
[bodies.bar]
type = "solid"
mesh = {{ part = "block", lx = 1.0, ly = 0.1, lz = 0.2, divisions = [4, 1, 2], element = "{}" }}
material = {{ young = 1e9, poisson = 0.0, density = 1000 }}
{}
[joints.wall]
type = "fixed"
a = {{ body = "ground" }}
b = {{ body = "bar", face = "x0" }}
[forces.pull]
type = "pressure"
body = "bar"
face = "x1"
pressure = {}
[statics]
[output]
quantities = ["bar[node 5].strain"]
envelopes = ["bar.stress.xx", "wall.force.x"]
)",
                     element, options, -kPull);
}

struct Formulation {
  const char *element, *options;
  friend void PrintTo(const Formulation& p, std::ostream* out) { *out << p.element << p.options; }
};

class FieldsOfABar : public testing::TestWithParam<Formulation> {};

// The patch test, in tension: one stress everywhere, P = (1 + u') S, S = E (u' + u'^2 / 2).
TEST_P(FieldsOfABar, HaveOneStressEverywhere) {
  const Simulation s = simulated(bar(GetParam().element, GetParam().options));
  double slope = 0;
  for (int k = 0; k < 20; ++k) slope = kPull / (1e9 * (1 + slope) * (1 + slope / 2));
  const double strain = slope + slope * slope / 2, near = 1e-8 * kPull;
  for (const char* quantity :
       {"bar.stress.xx.max", "bar.stress.xx.min", "bar.stress.xx.mean", "bar.stress.von_mises.max",
        "bar[x1].stress.xx.mean", "bar[x1].stress.principal_1.min", "bar[0.3 0.02 0.11].stress.xx",
        "bar[element 3].stress.tresca", "bar[node 7].stress.von_mises"})
    EXPECT_NEAR(s.value(quantity), kPull, near) << quantity;
  for (const char* quantity : {"bar.stress.yy.maxabs", "bar.stress.xz.maxabs", "bar.stress.principal_3.maxabs"})
    EXPECT_NEAR(s.value(quantity), 0, near) << quantity;
  EXPECT_NEAR(s.value("bar[0.3 0.02 0.11].stress.direction_1.x"), 1, 1e-12);
  EXPECT_NEAR(s.value("bar[node 5].strain.xx"), strain, 1e-8 * strain);
  EXPECT_NEAR(s.value("bar.strain.yy.maxabs"), 0, 1e-8 * strain);
  EXPECT_NEAR(s.value("bar.strain_energy"), 0.02 * 0.5e9 * strain * strain, 1e-7);
  // The wall holds what pulls.
  for (const char* quantity : {"bar.reaction.x", "bar[x0].reaction.x", "joints[wa*].force.x"})
    EXPECT_NEAR(s.value(quantity), -0.02 * kPull, 1e-7 * kPull) << quantity;
  EXPECT_NEAR(s.value("bar[x0].reaction_moment.y"), -0.1 * 0.02 * kPull, 1e-7 * kPull);
  EXPECT_NEAR(s.value("joints[*].moment.z"), 0.05 * 0.02 * kPull, 1e-7 * kPull);
}

INSTANTIATE_TEST_SUITE_P(Elements, FieldsOfABar,
                         testing::Values(Formulation{"hex8", ""}, Formulation{"hex8", "hex8 = \"full\""},
                                         Formulation{"hex8", "hex8 = \"mean-dilatation\""},
                                         Formulation{"hex8", "hex8 = \"shell\""}, Formulation{"hex20", ""},
                                         Formulation{"hex20", "reduced_hex20 = true"}));

std::string cantilever_of(const std::string& body, const std::string& rest) {
  return fmt::format(R"(
[bodies.beam]
{}
[joints.wall]
type = "fixed"
a = {{ body = "ground" }}
{}
)",
                     body, rest);
}

const char* const kLineBeam = R"(type = "beam"
start = [0, 0, 0]
end = [1, 0, 0]
elements = 4
material = { young = 2e11, poisson = 0.3, density = 7800 }
)";

// M c / I, F / A and T, whatever the number of elements.
TEST(Fields, SectionsOfACantilever) {
  const Simulation s = simulated(cantilever_of(std::string(kLineBeam) + "height = 0.02\nwidth = 0.01\n", R"(
b = { body = "beam", node = 1 }
[forces.tip]
type = "load"
a = { body = "beam", node = -1 }
force = [3, 0.2, 0.1]
moment = [0.5, 0, 0]
[statics]
)"));
  const double near = 2e-5;  // what the deflection changes
  EXPECT_NEAR(s.value("beam[node 1].section.N"), 3, near);
  EXPECT_NEAR(s.value("beam[node 1].section.Qy"), 0.2, near);
  EXPECT_NEAR(s.value("beam[node 1].section.Qz"), 0.1, near);
  EXPECT_NEAR(s.value("beam[node 3].section.T"), 0.5, near);
  EXPECT_NEAR(s.value("beam[node 1].section.Mz"), 0.2, 2e-4);
  EXPECT_NEAR(s.value("beam[node 1].section.My"), -0.1, 5e-4);
  EXPECT_NEAR(s.value("beam[0.3 0 0].section.Mz"), 0.2 * 0.7, 2e-4);
  EXPECT_NEAR(s.value("beam.section.Mz.maxabs"), s.value("beam[node 1].section.Mz"), 1e-12);
  const double area = 2e-4, iy = 0.02 * 1e-6 / 12, iz = 0.01 * 8e-6 / 12;
  const double n = s.value("beam[node 3].section.N"), my = s.value("beam[node 3].section.My"),
               mz = s.value("beam[node 3].section.Mz");
  EXPECT_NEAR(s.value("beam[0.5 0.01 0.005].stress.xx"), n / area - mz * 0.01 / iz + my * 0.005 / iy, 1);
  EXPECT_NEAR(s.value("beam[node 3].stress.xx.max"), n / area + mz * 0.01 / iz - my * 0.005 / iy, 1);
  EXPECT_NEAR(s.value("beam[node 3].stress.xx.min"), n / area - mz * 0.01 / iz + my * 0.005 / iy, 1);
  EXPECT_NEAR(s.value("beam.reaction.y"), -0.2, 1e-9);
}

// A shaft: tau = T r / J, sigma = M r / I.
TEST(Fields, VonMisesOfAShaft) {
  const Simulation s = simulated(cantilever_of(std::string(kLineBeam) + "radius = 0.01\n", R"(
b = { body = "beam", node = 1 }
[forces.tip]
type = "load"
a = { body = "beam", node = -1 }
force = [0, 3, 4]
moment = [7, 0, 0]
[statics]
)"));
  const double i = std::numbers::pi * 1e-8 / 4, sigma = 5 * 0.01 / i, tau = 7 * 0.01 / (2 * i);
  EXPECT_NEAR(s.value("beam.stress.xx.max"), sigma, 2e-3 * sigma);
  EXPECT_NEAR(s.value("beam[node 1].stress.von_mises"), std::sqrt(sigma * sigma + 3 * tau * tau), 2e-3 * sigma);
}

// Bending of solids: the surface has M c / I, though elements are sampled inside.
TEST(Fields, BendingStressOnTheSurface) {
  for (const char* element : {"hex8", "hex20"}) {
    const Simulation s = simulated(cantilever_of(fmt::format(R"(type = "solid"
mesh = {{ part = "block", lx = 1.0, ly = 0.1, lz = 0.05, divisions = [10, 2, 1], element = "{}" }}
material = {{ young = 2e11, poisson = 0.0, density = 7800 }})",
                                                             element),
                                                 R"(
b = { body = "beam", face = "x0" }
[forces.tip]
type = "load"
a = { body = "beam", face = "x1" }
force = [0, 100, 0]
[statics]
)"));
    const double stress = -100 * 0.5 * 0.05 / (0.05 * 1e-3 / 12);
    EXPECT_NEAR(s.value("beam[0.5, 0.1, 0.025].stress.xx"), stress, 2e-3 * std::abs(stress)) << element;
    EXPECT_NEAR(s.value("beam[0.5, 0, 0.025].stress.xx"), -stress, 2e-3 * std::abs(stress)) << element;
    EXPECT_NEAR(s.value("beam[x0].reaction_moment.z"), -100 * 1.0, 0.1) << element;
  }
}

// A strip of shells: moments per width, and stress 6 m / h^2 on the surfaces.
TEST(Fields, SectionsOfShells) {
  const Simulation s = simulated(R"(
[bodies.strip]
type = "shell"
origin = [0, 0, 0]
x = [1, 0, 0]
y = [0, 0.1, 0]
nx = 10
ny = 1
thickness = 0.01
material = { young = 7e10, poisson = 0, density = 2700 }
[joints.left]
type = "spherical"
a = { body = "ground", point = [0, 0, 0] }
b = { body = "strip", node = 1 }
[joints.right]
type = "point-on-line"
a = { body = "ground", point = [1, 0, 0], axis = [1, 0, 0] }
b = { body = "strip", node = 11 }
[joints.left2]
type = "prescribed"
a = { body = "ground", point = [0, 0.1, 0] }
b = { body = "strip", node = 12 }
direction = "z"
motion = "0"
[joints.right2]
type = "prescribed"
a = { body = "ground", point = [1, 0.1, 0] }
b = { body = "strip", node = 22 }
direction = "z"
motion = "0"
[forces.middle]
type = "load"
a = { body = "strip", node = 6 }
force = [0, 0, -5]
[forces.middle2]
type = "load"
a = { body = "strip", node = 17 }
force = [0, 0, -5]
[statics]
)");
  // 10 N in the middle of a span of 1: M = 2.5 at most, 25 per width; positive: tension on the side of the directors.
  const double m = -25.0 / 2;  // at a quarter
  EXPECT_NEAR(s.value("strip[0.25 0.05 0].section.mxx"), m, 0.01);
  EXPECT_NEAR(s.value("strip[0.25 0.05 0].section.qx"), -50, 0.5);
  EXPECT_NEAR(s.value("strip[0.25 0.05 0.005].stress.xx"), 6 * m / 1e-4, 1e-3 * 6 * 12.5 / 1e-4);
  EXPECT_NEAR(s.value("strip[0.25 0.05 -0.005].stress.xx"), -6 * m / 1e-4, 1e-3 * 6 * 12.5 / 1e-4);
  EXPECT_NEAR(s.value("strip[element 3].section.mxx"), m, 0.01);
}

const char* const kCantilever = R"(
[joints.wall]
type = "fixed"
a = { body = "ground" }
b = { body = "beam", node = 1 }
)";

// The root of a clamped beam: shape phi with integral of rho A phi^2 = 1 has M = E I phi''(0) = 2 E I b^2 / sqrt(rho A
// L), cosh(b L) cos(b L) = -1.
TEST(Fields, OfModesWithModalMassOne) {
  const std::string beam = "[bodies.beam]\n" + std::string(kLineBeam) + "height = 0.02\nwidth = 0.01\n" + kCantilever;
  const Simulation s = simulated(beam + R"(
[initial]
modes = 2
[statics]
[output]
quantities = ["beam[node 1].section.My", "beam.section.My.maxabs", "beam.strain_energy", "wall.force.x"]
)");
  const double ei = 2e11 * 0.02 * 1e-6 / 12, mass = 7800 * 2e-4;
  const auto& mode = s.summary().modes[0];
  ASSERT_EQ(mode.values.size(), 3U);
  EXPECT_NEAR(std::abs(mode.values[0].second), 2 * ei * 1.8751041 * 1.8751041 / std::sqrt(mass), 0.01 * 2 * ei * 3.516);
  EXPECT_NEAR(mode.values[1].second, std::abs(mode.values[0].second), 1e-6 * mode.values[1].second);
  EXPECT_NEAR(mode.displacement, 2 / std::sqrt(mass), 1e-3);
  const double w = 2 * std::numbers::pi * mode.frequency;
  EXPECT_NEAR(mode.values[2].second, 0.5 * w * w, 1e-5 * w * w);
}

// Two loads a quarter of a period apart: von Mises stress over the period, by its phases from the six amplitudes.
TEST(Fields, VonMisesInFrequencyResponsesIsTheLargestOverAPeriod) {
  const ModelHarmonicResult r = test::responded(R"(
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 0.4, ly = 0.1, lz = 0.1, divisions = [4, 1, 1] }
material = { young = 2e11, poisson = 0.3, density = 7800 }
damping = { stiffness = 1e-5 }
[joints.wall]
type = "fixed"
a = { body = "ground" }
b = { body = "block", face = "x0" }
[forces.side]
type = "load"
a = { body = "block", face = "x1" }
force = [0, 1000, 0]
factor = 0
[forces.twist]
type = "load"
a = { body = "block", face = "x1" }
moment = [100, 0, 50]
factor = 0
[harmonic]
frequencies = [100, 480]
quantities = ["block[0.1 0.1 0.1].stress", "block[0.1 0.1 0.1].stress.von_mises", "block.stress.von_mises.max", "block[0.1 0.1 0.1].stress.principal_1", "block[0.1 0.1 0.1].stress.xx"]
[harmonic.loads]
both = { side = 1, twist = { amplitude = 1, phase = 90 } }
)");
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  for (std::size_t point = 0; point < 2; ++point) {
    const char* const names[6] = {"xx", "yy", "zz", "xy", "yz", "xz"};
    double largest = 0, first = 0;
    for (int k = 0; k < 100000; ++k) {
      const test::Complex turn = std::polar(1.0, test::kTwoPi * k / 100000);
      double x[6];
      for (std::size_t i = 0; i < 6; ++i)
        x[i] = (turn * test::value_of(r, point, fmt::format("block[0.1 0.1 0.1].stress.{}", names[i]))).real();
      Eigen::Matrix3d t;
      t << x[0], x[3], x[5], x[3], x[1], x[4], x[5], x[4], x[2];
      const Eigen::Matrix3d deviator = t - t.trace() / 3 * Eigen::Matrix3d::Identity();
      largest = std::max(largest, std::sqrt(1.5) * deviator.norm());
      if (k % 100 == 0) first = std::max(first, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(t).eigenvalues()[2]);
    }
    const test::Complex given = test::value_of(r, point, "block[0.1 0.1 0.1].stress.von_mises");
    EXPECT_NEAR(given.real(), largest, 1e-7 * largest);
    EXPECT_EQ(given.imag(), 0);
    EXPECT_NEAR(test::value_of(r, point, "block[0.1 0.1 0.1].stress.principal_1").real(), first, 1e-4 * first);
    EXPECT_GE(test::value_of(r, point, "block.stress.von_mises.max").real(), largest);
  }
}

// A load that comes at once stretches twice as far: N up to 2 F at the end of half a period of the mass on its wire.
TEST(Fields, EnvelopesSayWhenAndWhere) {
  const Simulation s = simulated(R"(
[bodies.beam]
type = "beam"
start = [0, 0, 0]
end = [1, 0, 0]
elements = 2
material = { young = 1e9, poisson = 0.3, density = 1e-3 }
radius = 0.01
[bodies.mass]
type = "rigid"
mass = 10
box = [0.1, 0.1, 0.1]
position = [1, 0, 0]
[joints.weld]
type = "fixed"
a = { body = "beam", node = -1 }
b = { body = "mass" }
)" + std::string(kCantilever) + R"(
[forces.pull]
type = "load"
a = { body = "mass" }
force = [100, 0, 0]
[integrator]
method = "generalized-alpha"
spectral_radius = 0.9
step = 1e-4
end = 0.05
[output]
envelopes = ["beam.section.N", "beam.stress.xx", "wall.force.x", "beam[node 2].section.N"]
)");
  const double half = std::numbers::pi * std::sqrt(10 / (1e9 * std::numbers::pi * 1e-4));
  const std::vector<SimulationEnvelope>& found = s.summary().envelopes;
  ASSERT_EQ(found.size(), 4U);
  EXPECT_EQ(found[0].quantity, "beam.section.N");
  EXPECT_NEAR(found[0].largest.value, 200, 0.5);
  EXPECT_NEAR(found[0].largest.t, half, 2e-3);
  EXPECT_EQ(found[0].largest.body, "beam");
  EXPECT_GE(found[0].largest.node, 1);
  EXPECT_NEAR(found[0].least.value, 0, 0.5);
  EXPECT_NEAR(found[1].largest.value, 200 / (std::numbers::pi * 1e-4), 0.01 * 200 / (std::numbers::pi * 1e-4));
  EXPECT_NEAR(found[2].least.value, -200, 0.5);
  EXPECT_TRUE(found[2].least.body.empty());
  EXPECT_EQ(found[3].largest.node, 2);
}

// A reduced body is linear: what it says is what the nodal one says of small strain.
TEST(Fields, OfReducedBodies) {
  const std::string text = R"(
[bodies.block]
type = "solid"
rotation = [0, 0, 0.5]
mesh = { part = "block", lx = 0.4, ly = 0.1, lz = 0.1, divisions = [4, 1, 1] }
material = { young = 2e11, poisson = 0.3, density = 7800 }
REDUCE
[joints.wall]
type = "fixed"
a = { body = "ground" }
b = { body = "block", face = "x0", attach = "mean" }
[forces.side]
type = "load"
a = { body = "block", face = "x1" }
force = [100, 200, 300]
[statics]
)";
  const Simulation nodal = simulated(replaced(text, "REDUCE", "")),
                   reduced = simulated(replaced(text, "REDUCE", "reduce = { modes = 0 }"));
  for (const char* quantity : {"block[0.1 0.1 0.1].stress.xx", "block.stress.von_mises.max", "block.strain_energy",
                               "block.strain.principal_1.max", "joints[*].force.y", "block.stress.xx.mean"}) {
    const double truth = nodal.value(quantity);
    EXPECT_NEAR(reduced.value(quantity), truth, 1e-4 * std::abs(truth)) << quantity;
  }
  EXPECT_THROW(static_cast<void>(reduced.value("block[x0].reaction.x")), std::invalid_argument);
}

TEST(Fields, RefusalsSayWhatToDo) {
  Simulation s = simulated(bar("hex8", ""));
  const auto refused = [&](const std::string& quantity, const std::vector<std::string>& words) {
    try {
      static_cast<void>(s.value(quantity));
      ADD_FAILURE() << quantity << " was not refused";
    } catch (const std::invalid_argument& error) {
      for (const std::string& word : words)
        EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << quantity << ": " << error.what();
    }
  };
  refused("bar.stress.xx", {"many places", ".max", "BODY[node 12]"});
  refused("bar[node 3].stress.xx.max", {"one place has one value"});
  refused("bar[node 99].stress.xx", {"no node 99"});
  refused("bar[element 99].stress.xx", {"no element 99"});
  refused("bar[2 0 0].stress.xx", {"no element of 'bar' has the point", "nodes lie between"});
  refused("bar[x9].stress.xx.max", {"no set 'x9'", "x0"});
  refused("bar[node].stress.xx", {"no set 'node'"});
  refused("bar[1 2].stress.xx", {"is no place on a body"});
  refused("bar[x0 top].stress.xx.max", {"no shell"});
  refused("bar[x0].section.N", {"is a solid"});
  refused("bar[x0].stress.von_miss.max", {"von_mises"});
  refused("bar[x0].stres.xx.max", {"stress"});
  refused("barr[x0].stress.xx.max", {"no body 'barr'", "bar"});
  refused("bar[node 3].strain_energy", {"elements"});
  refused("joints[b*].force.x", {"no joint fits 'b*'", "wall"});
  refused("bar[node 3].reaction.q", {"x, y, z, norm"});
  refused("bar[node 3", {"BODY[PLACE]"});
}

}  // namespace fields_test
}  // namespace espalier::dynamics
