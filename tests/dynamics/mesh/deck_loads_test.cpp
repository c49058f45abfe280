// Materials and loads on volumes of decks. Truths are closed forms of bars; CalculiX itself is in
// tests/cli/deck_test.py.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/mesh/deck_bar.hpp"

namespace espalier::dynamics {
namespace deck_loads_test {

using test::kBar;
using test::kClamp;
using test::kStatic;

/// The bar with its second cube of another material: E = 250, density 6.
class DeckLoads : public test::DeckBar {
 protected:
  static std::string two(const std::string& second = "*ELASTIC\n250., 0.\n*DENSITY\n6.\n") {
    std::string deck = kBar;
    const std::string section = "*SOLID SECTION, ELSET=BAR, MATERIAL=M\n";
    deck.replace(deck.find(section), section.size(),
                 "*MATERIAL, NAME=SOFT\n" + second +
                     "*ELSET, ELSET=ONE\n1\n*ELSET, ELSET=TWO\n2\n*SOLID SECTION, ELSET=ONE, MATERIAL=M\n"
                     "*SOLID SECTION, ELSET=TWO, MATERIAL=soft\n");
    return deck;
  }
  std::string notices(const Simulation& s) {
    std::string all;
    for (const std::string& notice : s.summary().notices) all += notice + "\n";
    return all;
  }
};

// F = 4 stretches the cubes by 4 / 1000 and 4 / 250; the weights 2 g and 6 g of g = 5 do so in series:
// u_2 = 40 / 1000 - 5 / 1000, u_3 = u_2 + 15 / 250.
TEST_F(DeckLoads, SeveralMaterials) {
  Simulation s = run(two() + kClamp + kStatic + "*CLOAD\nX2, 1, 1.\n");
  EXPECT_NEAR(moved(s, 2).x(), 4e-3, 1e-12);
  EXPECT_NEAR(moved(s, 3).x(), 20e-3, 1e-12);
  s = run(two() + kClamp + kStatic + "*DLOAD\n, GRAV, 5., 1., 0., 0.\n");
  EXPECT_NEAR(moved(s, 2).x(), 0.035, 1e-12);
  EXPECT_NEAR(moved(s, 3).x(), 0.095, 1e-12);
  // Stresses are those of each element's material: sigma = F / A = 4 in both, energy densities sigma^2 / (2 E).
  const auto model = [&](const std::string& more) {
    Simulation out;
    Status status =
        out.load_text(more + "[output]\nquantities = [\"part[element 1].stress.xx\", \"part[element 2].stress.xx\"]\n",
                      (folder_ / "model.toml").string());
    if (status.ok()) status = out.run();
    EXPECT_TRUE(status.ok()) << status.message;
    return out;
  };
  write("bar.inp", two() + kClamp + kStatic + "*CLOAD\nX2, 1, 1.\n");
  const Simulation stressed =
      model("bodies.part = { type = \"solid\", mesh = { file = \"bar.inp\", take = \"all\" } }\n");
  EXPECT_NEAR(stressed.value("part[element 1].stress.xx"), 4, 1e-10);
  EXPECT_NEAR(stressed.value("part[element 2].stress.xx"), 4, 1e-10);
}

// The lowest frequency along x of two cubes in series, each with a consistent mass of linear shape functions: the
// determinant of K - w^2 M with K = [1250, -250; -250, 250], M = [(2 + 6) / 3, 1; 1, 2].
TEST_F(DeckLoads, ModesOfSeveralMaterials) {
  const double a = 8.0 / 3 * 2 - 1, b = -(1250 * 2 + 250 * 8.0 / 3 + 2 * 250), c = 1250 * 250 - 250 * 250;
  const double square = (-b - std::sqrt(b * b - 4 * a * c)) / (2 * a);
  const std::string deck = two() + kClamp + "*NSET, NSET=REST\n2,3,12,13,22,23,32,33\n*BOUNDARY\nREST, 2, 3\n";
  const std::string rigid =
      "*EQUATION\n2\n12,1,1.,2,1,-1.\n2\n22,1,1.,2,1,-1.\n2\n32,1,1.,2,1,-1.\n"
      "2\n13,1,1.,3,1,-1.\n2\n23,1,1.,3,1,-1.\n2\n33,1,1.,3,1,-1.\n";
  const Simulation s = run(deck + rigid + "*STEP\n*FREQUENCY\n2\n");
  ASSERT_EQ(s.summary().modes.size(), 2U);
  EXPECT_NEAR(s.summary().modes[0].frequency, std::sqrt(square) / (2 * std::numbers::pi), 1e-9);
}

// What a material has beside constant isotropic elasticity is an error where elements are of it.
TEST_F(DeckLoads, LawsOfMaterials) {
  const std::string load = kClamp + kStatic + "*CLOAD\nX2, 1, 1.\n";
  refused(two("*ELASTIC\n250., 0.\n*PLASTIC\n1., 0.\n") + load, {"bar.inp:29: ", "*PLASTIC of material SOFT (1)"});
  refused(two("*ELASTIC, TYPE=ENGINEERING CONSTANTS\n1.,1.,1.,.1,.1,.1,1.,1.\n1.\n") + load,
          {"bar.inp:27: ", "*ELASTIC TYPE=ENGINEERING CONSTANTS of material SOFT"});
  refused(two("*HYPERELASTIC, NEO HOOKE\n1., 0.\n") + load, {"*HYPERELASTIC of material SOFT"});
  refused(two("*USER MATERIAL, CONSTANTS=1\n1.\n") + load, {"*USERMATERIAL of material SOFT"});
  // A material of no element, and one with a table of temperatures: the first are taken, as CalculiX does.
  EXPECT_NEAR(moved(run("*MATERIAL, NAME=IDLE\n*ELASTIC\n1., 0.\n*PLASTIC\n1., 0.\n" + kBar + load), 3).x(), 8e-3,
              1e-12);
  const Simulation s = run(two("*ELASTIC\n250., 0., -20.\n125., 0., 100.\n") + load);
  EXPECT_NEAR(moved(s, 3).x(), 20e-3, 1e-12);
  EXPECT_NE(
      notices(s).find("bar.inp:27: material SOFT: *ELASTIC has values for 2 temperatures; those of the first, -20, are "
                      "taken"),
      std::string::npos)
      << notices(s);
  refused(two() + "*SOLID SECTION, ELSET=BAR, MATERIAL=M\n" + load,
          {"element 2 lies in the sets 'BAR' and 'TWO', which are of different materials"});
}

// Without `take`, too, each element has the material of its section, element_set picks the elements of one, and the
// text's material is that of all.
TEST_F(DeckLoads, MaterialsWithoutTheDeck) {
  write("bar.inp", two());
  const auto end = [&](const std::string& body, const std::string& held) {
    Simulation s;
    Status status = s.load_text("bodies.bar = { type = \"solid\", mesh = { file = \"bar.inp\" }, " + body +
                                    " }\nsupports.x = { body = \"bar\", nodes = " + held +
                                    ", hold = \"all\" }\nforces.f = { type = \"pressure\", body = \"bar\", face = "
                                    "\"X2\", pressure = -4 }\nmarkers.end = { body = \"bar\", face = \"X2\" }\n"
                                    "statics = { linear = true }\noutput = { quantities = [\"end.position.x\"] }\n",
                                (folder_ / "model.toml").string());
    if (status.ok()) status = s.run();
    EXPECT_TRUE(status.ok()) << status.message;
    return s.value("end.position.x") - 2;
  };
  EXPECT_NEAR(end("hex8 = \"full\"", "\"X0\""), 20e-3, 1e-12);
  EXPECT_NEAR(end("element_set = \"TWO\"", "[2, 12, 22, 32]"), 16e-3, 1e-12);
  EXPECT_NEAR(end("material = { young = 500, density = 1 }", "\"X0\""), 16e-3, 1e-12);
}

// Forces per volume: 3 on both cubes, then on the second alone, for E A = 1000: u_2 = 6 / 1000 - 3 / 2000.
TEST_F(DeckLoads, ForcesOnVolumes) {
  const std::string sets = "*ELSET, ELSET=TWO\n2\n";
  Simulation s = run(kBar + kClamp + kStatic + "*DLOAD\nBAR, BX, 3.\n");
  EXPECT_NEAR(moved(s, 2).x(), 4.5e-3, 1e-12);
  EXPECT_NEAR(moved(s, 3).x(), 6e-3, 1e-12);
  s = run(kBar + sets + kClamp + kStatic + "*DLOAD\nTWO, BX, 3.\n");
  EXPECT_NEAR(moved(s, 3).x(), 4.5e-3, 1e-12);
  // Gravity of the second cube alone, and another one of both.
  s = run(kBar + sets + kClamp + kStatic + "*DLOAD\nTWO, GRAV, 5., 1., 0., 0.\nBAR, GRAV, 1., 1., 0., 0.\n");
  EXPECT_NEAR(moved(s, 3).x(), 15e-3 + 4e-3, 1e-12);
  // Factors when the step ends; a step replaces the loads of the same set and adds those of others.
  const std::string half = "*AMPLITUDE, NAME=HALF\n0., 0., 1., 0.5\n";
  s = run(kBar + half + kClamp + kStatic + "*DLOAD, AMPLITUDE=HALF\nBAR, GRAV, 5., 1., 0., 0.\n");
  EXPECT_NEAR(moved(s, 3).x(), 10e-3, 1e-12);
  const std::string steps = kBar + sets + kClamp + kStatic +
                            "*DLOAD\nBAR, GRAV, 5., 1., 0., 0.\n2, P4, -4.\n*END STEP\n" + kStatic +
                            "*DLOAD%\nTWO, BX, 6.\n";
  const auto at_two = [&](const char* op) {
    std::string deck = steps;
    write("bar.inp", deck.replace(deck.find('%'), 1, op));
    Simulation out;
    Status status =
        out.load_text("bodies.part = { type = \"solid\", mesh = { file = \"bar.inp\", take = \"all\", step = 2 } }\n",
                      (folder_ / "model.toml").string());
    if (status.ok()) status = out.run();
    EXPECT_TRUE(status.ok()) << status.message;
    return moved(out, 3).x();
  };
  EXPECT_NEAR(at_two(""), 20e-3 + 8e-3 + 9e-3, 1e-12);
  EXPECT_NEAR(at_two(", OP=NEW"), 9e-3, 1e-12);
}

// A bar that turns about z through the middle of its clamped end: u = rho w^2 (L^2 x / 2 - x^3 / 6) / E at its nodes,
// which linear elements have exactly; and masses 4 * 0.5 at the end of it, u = m w^2 L / 500.
TEST_F(DeckLoads, CentrifugalForces) {
  const std::string load = "*DLOAD\nBAR, CENTRIF, 9., 0., .5, .5, 0., 0., 2.\n";
  Simulation s = run(kBar + kClamp + kStatic + load);
  const auto closed = [](double x) { return 2.0 * 9 / 1000 * (4 * x / 2 - x * x * x / 6); };
  for (const auto& [node, x] : {std::pair(2, 1.0), std::pair(3, 2.0)}) {
    double mean = 0;
    for (const int corner : {0, 10, 20, 30}) mean += moved(s, node + corner).x() / 4;
    EXPECT_NEAR(mean, closed(x), 1e-12);
  }
  const std::string masses =
      "*ELEMENT, TYPE=MASS, ELSET=M\n91,3\n92,13\n93,23\n94,33\n*MASS, ELSET=M\n0.5\n*ELSET, ELSET=BOTH\nBAR, M\n";
  s = run(kBar + masses + kClamp + kStatic + "*DLOAD\nM, CENTRIF, 9., 0., .5, .5, 0., 0., 1.\n");
  EXPECT_NEAR((moved(s, 3) + moved(s, 13)).x() / 2, 2 * 9 * 2 / 500.0, 1e-13);
  // With large displacements the force grows with the way out: the numbers of CalculiX 2.20 with NLGEOM, 1e-5
  // beside: its load lags by an iteration (of gravity and forces all its digits are the same).
  s = run(kBar + kClamp + "*STEP, NLGEOM\n*STATIC\n" + load);
  EXPECT_NEAR(moved(s, 3).x(), 0.0473674, 2e-6);
  EXPECT_NEAR(moved(s, 2).x(), 0.0323270, 2e-6);
  refused(kBar + kClamp + kStatic + load + "1, CENTRIF, 9., 0., .5, .5, 0., 0., 2.\n",
          {"element 1 turns by this CENTRIF and by that of line 32"});
  refused(kBar + masses + kClamp + "*STEP, NLGEOM\n*STATIC\n*DLOAD\nM, CENTRIF, 9., 0., .5, .5, 0., 0., 1.\n",
          {"CENTRIF acts on the mass of node 3: that is taken in linear statics"});
}

// In a model: a spinning bar whose load grows with time.
TEST_F(DeckLoads, BodyLoadsOfTheText) {
  write("bar.inp", kBar);
  const auto loaded = [&](const std::string& load) {
    Simulation s;
    Status status = s.load_text(
        "bodies.bar = { type = \"solid\", mesh = { file = \"bar.inp\" }, hex8 = \"full\" }\n"
        "supports.x = { body = \"bar\", face = \"X0\", hold = \"all\" }\nforces.f = { type = "
        "\"load\", body = \"bar\", " +
            load +
            " }\nmarkers.end = { body = \"bar\", face = \"X2\" }\nstatics = { linear = true, "
            "time = 2 }\noutput = { quantities = [\"end.position.x\", \"f.factor\"] }\n",
        (folder_ / "model.toml").string());
    if (status.ok()) status = s.run();
    return std::pair(status, std::move(s));
  };
  auto [spins, s] = loaded("angular_velocity = [0, 0, 3], point = [0, 0.5, 0.5], factor = \"t/4\"");
  ASSERT_TRUE(spins.ok()) << spins.message;
  EXPECT_NEAR(s.value("end.position.x"), 2 + 0.024, 1e-12);
  EXPECT_EQ(s.value("f.factor"), 0.5);
  EXPECT_NEAR(loaded("force_density = [3, 0, 0]").second.value("end.position.x"), 2 + 6e-3, 1e-12);
  EXPECT_NEAR(loaded("acceleration = [5, 0, 0], element_set = \"BAR\"").second.value("end.position.x"), 2.02, 1e-12);
  EXPECT_NE(loaded("element_set = \"BAR\"").first.message.find("needs 'acceleration', 'force_density'"),
            std::string::npos);
  EXPECT_NE(loaded("force_density = [3, 0, 0], element_set = \"BAT\"").first.message.find("BAR"), std::string::npos);
}

// Nastran: two properties of two materials; RFORCE states the speed in turns.
TEST_F(DeckLoads, OfNastran) {
  const std::string grid =
      "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\nGRID,4,,0.,1.,0.\nGRID,5,,0.,0.,1.\nGRID,6,,1.,0.,1.\n"
      "GRID,7,,1.,1.,1.\nGRID,8,,0.,1.,1.\nGRID,12,,2.,0.,0.\nGRID,13,,2.,1.,0.\nGRID,16,,2.,0.,1.\nGRID,17,,2.,1.,1.\n"
      "CHEXA,1,1,1,2,3,4,5,6\n,7,8\nCHEXA,2,2,2,12,13,3,6,16\n,17,7\nPSOLID,1,1\nPSOLID,2,2\nMAT1,1,1000.,,0.,2.\n"
      "GRID,99,,0.,.5,.5\nSPC1,1,123,1,4,5,8\n";
  const auto run_nastran = [&](const std::string& more) {
    Simulation s;
    Status status =
        s.load(write("bar.bdf", "SOL 101\nCEND\nSPC = 1\nLOAD = 2\nBEGIN BULK\n" + grid + more + "ENDDATA\n"));
    if (status.ok()) status = s.run();
    return std::pair(status, std::move(s));
  };
  const auto end = [](const Simulation& s) {
    double mean = 0;
    for (const std::size_t node : {8U, 9U, 10U, 11U}) mean += s.frame().displacement[3 * node] / 4;
    return mean;
  };
  auto [pulled, s] = run_nastran("MAT1,2,250.,,0.,6.\nPLOAD4,2,2,-4.,,,,12,17\n");
  ASSERT_TRUE(pulled.ok()) << pulled.message;
  EXPECT_NEAR(end(s), 20e-3, 1e-12);
  auto [spun, t] = run_nastran("MAT1,2,1000.,,0.,2.\nLOAD,2,4.,1.,7\nRFORCE,7,99,0,.2387324146378430,0.,0.,1.\n");
  ASSERT_TRUE(spun.ok()) << spun.message;  // 1.5 / (2 pi) turns, and 4 times the force: w = 3
  EXPECT_NEAR(end(t), 0.048, 1e-12);
  const std::string anisotropic = run_nastran("MAT9,2,1.,0.,0.,0.,0.,0.,1.\nPLOAD4,2,2,-4.,,,,12,17\n").first.message;
  EXPECT_NE(anisotropic.find("MAT9 (1)"), std::string::npos) << anisotropic;
}

}  // namespace deck_loads_test
}  // namespace espalier::dynamics
