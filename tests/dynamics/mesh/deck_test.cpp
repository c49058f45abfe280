// Decks of Abaqus, CalculiX and Nastran that are taken over: supports, loads, springs, couplings, steps. Truths are
// closed forms of bars; CalculiX itself: bench/dynamics/decks_beside_ccx.py, its numbers in tests/cli/deck_test.py.
#include "dynamics/mesh/deck/deck.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/mesh/deck_bar.hpp"

namespace espalier::dynamics {
namespace deck_test {

using test::kBar;
using test::kClamp;
using test::kStatic;
class Decks : public test::DeckBar {};

// u = F l / (E A) = 4 * 2 / 1000.
TEST_F(Decks, ForcesAndSupports) {
  for (const char* load :
       {"*CLOAD\nX2, 1, 1.\n", "*CLOAD\nx2, 1, 0.25\nX2, 1, 0.75\n",
        "*CLOAD\n3, 1, 1.\n13, 1, 1.\n23, 1, 1.\n33, 1, 1.\n", "*DLOAD\n2, P4, -4.\n", "*BOUNDARY\nX2, 1, 1, 8.e-3\n",
        "*AMPLITUDE, NAME=HALF\n0., 0., 1., 0.5\n*CLOAD, AMPLITUDE=HALF\nX2, 1, 2.\n"}) {
    const Simulation s = run(kBar + kClamp + kStatic + load + "*END STEP\n");
    for (const int node : {3, 13, 23, 33}) EXPECT_NEAR(moved(s, node).x(), 8e-3, 1e-15) << load;
    EXPECT_NEAR(moved(s, 2).x(), 4e-3, 1e-15) << load;
    EXPECT_NEAR(moved(s, 3).tail<2>().norm(), 0, 1e-15) << load;
  }
  // Words: XSYMM holds x alone of solids' nodes; the bar hangs free of strain across.
  const Simulation s = run(kBar + "*BOUNDARY\nX0, XSYMM\n1, PINNED\n11, 3\n21, 2\n" + kStatic + "*CLOAD\nX2, 1, 1.\n");
  EXPECT_NEAR(moved(s, 33).x(), 8e-3, 1e-14);
}

// Under its weight along x the end moves by rho g l^2 / (2 E) = 2 * 5 * 4 / 2000.
TEST_F(Decks, Gravity) {
  for (const char* set : {"BAR", "", "bar"}) {
    const Simulation s = run(kBar + kClamp + kStatic + "*DLOAD\n" + set + ", GRAV, 5., 2., 0., 0.\n");
    EXPECT_NEAR(moved(s, 3).x(), 0.02, 1e-14);
  }
}

// Masses have their weight where the set of the load has them: 4 * 0.5 kg at the end draw with 10 N, E A / l = 500; so
// much as the weight of the bar itself moves the end. As CalculiX has it.
TEST_F(Decks, WeightOfMasses) {
  const std::string masses =
      "*ELEMENT, TYPE=MASS, ELSET=M\n91,3\n92,13\n93,23\n94,33\n*MASS, ELSET=M\n0.5\n*ELSET, ELSET=BOTH\nBAR, M\n";
  for (const auto& [lines, end] :
       {std::pair(", GRAV, 5., 1., 0., 0.\n", 0.04), std::pair("BOTH, GRAV, 5., 1., 0., 0.\n", 0.04),
        std::pair("BAR, GRAV, 5., 1., 0., 0.\n", 0.02), std::pair("M, GRAV, 5., 1., 0., 0.\n", 0.02),
        std::pair("BAR, GRAV, 5., 1., 0., 0.\nm, GRAV, 5., 2., 0., 0.\n", 0.04)}) {
    const Simulation s = run(kBar + masses + kClamp + kStatic + "*DLOAD\n" + lines);
    EXPECT_NEAR(moved(s, 3).x(), end, 1e-13) << lines;
  }
}

// A step takes what those before it leave; OP=NEW takes it away.
TEST_F(Decks, Steps) {
  const std::string two = kBar + kClamp + kStatic + "*CLOAD\nX2, 1, 1.\n*END STEP\n" + kStatic;
  const auto at_step = [&](const std::string& deck, int step) {
    Simulation s;
    const std::string file = write("bar.inp", deck);
    Status status =
        s.load_text("bodies.part = { type = \"solid\", mesh = { file = \"bar.inp\", take = \"all\", step = " +
                        std::to_string(step) + " } }\n",
                    (folder_ / "model.toml").string());
    if (status.ok()) status = s.run();
    EXPECT_TRUE(status.ok()) << status.message;
    return s;
  };
  EXPECT_NEAR(moved(at_step(two + "*CLOAD\nX2, 1, 3.\n", 1), 3).x(), 8e-3, 1e-14);
  EXPECT_NEAR(moved(at_step(two + "*CLOAD\nX2, 1, 3.\n", 2), 3).x(), 24e-3, 1e-14);
  EXPECT_NEAR(moved(at_step(two, 2), 3).x(), 8e-3, 1e-14);
  EXPECT_NEAR(moved(at_step(two + "*CLOAD, OP=NEW\n3, 2, 0.\n", 2), 3).x(), 0, 1e-15);
}

// A cube whose far end hangs on springs: in series with its stiffness E A / l = 500.
TEST_F(Decks, Springs) {
  const std::string ends = "*ELEMENT, TYPE=SPRING1, ELSET=S\n51,3\n52,13\n53,23\n54,33\n";
  const std::string spring = "*SPRING, ELSET=S\n1\n25.\n";
  Simulation s = run(kBar + ends + spring + kClamp + kStatic + "*CLOAD\nX2, 1, 1.\n");
  EXPECT_NEAR(moved(s, 3).x(), 4.0 / 600, 1e-14);
  // Along lines, to nodes that are held; sets of sets.
  s = run(kBar +
          "*NODE\n103,5,0,0\n113,5,1,0\n123,5,0,1\n133,5,1,1\n*NSET,NSET=WALL\n103,113,123,133\n"
          "*ELEMENT, TYPE=SPRINGA, ELSET=A\n51,3,103\n52,113,13\n*ELEMENT, TYPE=SPRINGA, ELSET=B\n53,23,123\n"
          "54,33,133\n*ELSET,ELSET=S\nA,B\n*SPRING, ELSET=S\n\n25.\n" +
          kClamp + "*BOUNDARY\nWALL,1,3\n" + kStatic + "*CLOAD\nX2, 1, 1.\n");
  EXPECT_NEAR(moved(s, 3).x(), 4.0 / 600, 1e-14);
  // Between nodes: the two halves of the bar each draw by k (u_3 - u_2): 4 k (4e-3) resists like E A / l of one cube.
  s = run(kBar +
          "*ELEMENT, TYPE=SPRING2, ELSET=S\n51,2,3\n52,12,13\n53,22,23\n54,32,33\n*SPRING, ELSET=S\n1,1\n250.\n" +
          kClamp + kStatic + "*CLOAD\nX2, 1, 1.\n");
  EXPECT_NEAR(moved(s, 2).x(), 4e-3, 1e-14);
  EXPECT_NEAR(moved(s, 3).x(), 6e-3, 1e-14);
}

// u_3 = 2 u_2 along x for one corner at no load: another end displacement than without, and the equation holds.
TEST_F(Decks, Equations) {
  const Simulation s = run(kBar + "*EQUATION\n2\n3, 1, 1., 2, 1, -3.\n" + kClamp + kStatic + "*CLOAD\nX2, 1, 1.\n");
  EXPECT_NEAR(moved(s, 3).x(), 3 * moved(s, 2).x(), 1e-15);
  EXPECT_GT(std::abs(moved(s, 3).x() - moved(s, 13).x()), 1e-5);
}

// Two bars that share no node, welded: the tension passes as if they were one, with meshes that fit and that do not.
TEST_F(Decks, Ties) {
  const std::string other =
      "*NODE\n201,2,0,0\n202,4,0,0\n203,4,1,0\n204,2,1,0\n205,2,0,1\n206,4,0,1\n207,4,1,1\n208,2,1,1\n"
      "*ELEMENT, TYPE=C3D8, ELSET=BAR\n9, 201,202,203,204,205,206,207,208\n*NSET, NSET=X4\n202,203,206,207\n"
      "*SURFACE, NAME=HERE\n2, S4\n*SURFACE, NAME=THERE\n9, S6\n*TIE, NAME=T\nTHERE, HERE\n";
  Simulation s = run(kBar + other + kClamp + kStatic + "*CLOAD\nX4, 1, 1.\n");
  EXPECT_NEAR(moved(s, 202).x(), 16e-3, 1e-14);
  EXPECT_NEAR(moved(s, 3).x(), 8e-3, 1e-14);
}

// A rigid end: under a moment about z at its reference node the bar bends; the end stays plane.
TEST_F(Decks, RigidEnds) {
  const std::string ref = "*NODE\n99, 3., 0.5, 0.5\n";
  for (const char* coupling : {"*RIGID BODY, NSET=X2, REF NODE=99\n",
                               "*SURFACE, NAME=END, TYPE=NODE\nX2\n*COUPLING, REF NODE=99, SURFACE=END, "
                               "CONSTRAINT NAME=C\n*KINEMATIC\n1, 6\n",
                               "*KINEMATIC COUPLING, REF NODE=99\nX2, 1, 6\n"}) {
    const Simulation s = run(kBar + ref + coupling + kClamp + kStatic + "*CLOAD\n99, 1, 4.\n99, 6, 0.1\n");
    EXPECT_NEAR((moved(s, 3) + moved(s, 13)).x(), 16e-3, 1e-13) << coupling;
    EXPECT_GT(moved(s, 3).x(), moved(s, 13).x()) << coupling;
    EXPECT_NEAR(moved(s, 3).x(), moved(s, 23).x(), 1e-14) << coupling;
    EXPECT_NEAR(moved(s, 3).y(), moved(s, 13).y(), 1e-14) << coupling;  // keeps its length
  }
  // Its reference node is led, and held in other directions.
  const Simulation led =
      run(kBar + ref + "*RIGID BODY, NSET=X2, REF NODE=99\n" + kClamp + "*BOUNDARY\n99,1,1,8e-3\n99,2,2\n" + kStatic);
  for (const int node : {3, 13, 33}) EXPECT_NEAR(moved(led, node).x(), 8e-3, 1e-13);
  EXPECT_NEAR(moved(led, 2).x(), 4e-3, 1e-13);
  // In the mean a force through the middle spreads evenly.
  const Simulation s = run(kBar + ref +
                           "*SURFACE, NAME=END\n2, S4\n*COUPLING, REF NODE=99, SURFACE=END, CONSTRAINT NAME=C\n"
                           "*DISTRIBUTING\n" +
                           kClamp + kStatic + "*CLOAD\n99, 1, 4.\n");
  EXPECT_NEAR(moved(s, 23).x(), 8e-3, 1e-14);
}

// What cannot be taken is refused by name and line, and what follows from it is said.
TEST_F(Decks, WhatIsRefused) {
  const std::string held = kBar + kClamp;
  refused(held + "*STEP\n*BUCKLE\n3\n", {"bar.inp:", "*BUCKLE"});
  refused(held + "*STEP\n*MODAL DYNAMIC\n0.1, 1.\n", {"*MODALDYNAMIC (1)", "take = ["});
  refused(held + kStatic + "*DLOAD\nBAR, ROTA, 1., 0,0,0, 0,0,1.\n", {"*DLOAD ROTA", "\"boundary\", \"cload\""});
  refused(held + "*CONTACT PAIR, INTERACTION=I\nA, B\n" + kStatic, {"*CONTACTPAIR"});
  refused(held + "*NODE\n8,5,5,5\n9,6,6,6\n*ELEMENT, TYPE=T3D2, ELSET=T\n7,8,9\n" + kStatic,
          {"element 7 (a line2) has no section"});
  refused(held + kStatic + "*CLOAD\nNOWHERE, 1, 1.\n", {"bar.inp:32: *CLOAD: node set NOWHERE is not defined"});
  refused(held + kStatic + "*CLOAD\n77, 1, 1.\n", {"bar.inp:32: *CLOAD: node 77 is not defined"});
  refused(held + kStatic + "*CLOAD\n3, 8, 1.\n", {"degree of freedom 8"});
  refused(held + kStatic + "*CLOAD\n3, 5, 1.\n", {"a moment acts on node 3"});
  refused(held + kStatic + "*CLOAD\n3, 1, x\n", {"'x' is not a number"});
  refused(kBar + "*BOUNDARY\nX0, 1, 3\n1, 2, 2, 0.1\n" + kStatic,
          {"node 1 is to move by 0.1 along y, and by 0 in line 28"});
  refused(kBar + "*BOUNDARY\nX0, 3, 1\n" + kStatic, {"degrees of freedom 3 to 1"});
  refused(held + "*EQUATION\n2\n3,1,0.,2,1,1.\n" + kStatic, {"the first factor of the equation is 0"});
  refused(held + "*EQUATION\n3\n3,1,1.,2,1,1.\n" + kStatic, {"3 terms are announced, 2 are there"});
  refused(held + "*EQUATION\n2\n1,1,1.,2,1,1.\n" + kStatic, {"node 1 follows others by this equation, and is held"});
  refused(held + "*EQUATION\n2\n3,1,1.,2,1,1.\n2\n3,1,1.,12,1,1.\n" + kStatic, {"by an equation before this one"});
  refused(
      held + "*NODE\n99,3,0,0\n98,3,0,0\n*RIGID BODY,NSET=X2,REF NODE=99\n*RIGID BODY,NSET=X2,REF NODE=98\n" + kStatic,
      {"belongs to this rigid coupling and to that of line 32"});
  refused(held + "*NODE\n99,3,0,0\n*RIGID BODY,NSET=X2,REF NODE=99\n*BOUNDARY\n13,1\n" + kStatic,
          {"node 13 is held, and follows"});
  refused(held + "*ELEMENT, TYPE=SPRING1, ELSET=S\n51,3\n" + kStatic, {"elements SPRING1 (1)"});
  refused(held + "*ELEMENT, TYPE=SPRINGA, ELSET=S\n51,3,3\n*SPRING,ELSET=S\n\n1.\n" + kStatic, {"has one node twice"});
  refused(held + "*NODE\n99,3,0,0\n*ELEMENT, TYPE=SPRINGA, ELSET=S\n51,3,99\n*SPRING,ELSET=S\n\n1.\n" + kStatic,
          {"node 99 belongs to no solid"});
  refused(held + "*STEP\n*FREQUENCY\n0\n", {"*FREQUENCY needs a number of modes"});
  refused(held + kStatic + "*BOUNDARY, FIXED\n3, 1\n", {"*BOUNDARY FIXED"});
  refused(held + kStatic + "*BOUNDARY, TYPE=DISPLACEMENT, SUBMODEL\n3, 1\n", {"*BOUNDARY SUBMODEL"});
  refused(held + "*DAMPING, ALPHA=3.\n*STEP\n*DYNAMIC\n0.1, 1.\n", {"*DAMPING"});
  refused(held +
              "*ELEMENT,TYPE=MASS,ELSET=M\n91,99\n*NODE\n99,3,0,0\n*MASS,ELSET=M\n1.\n*NSET,NSET=N\n99\n"
              "*TRANSFORM,NSET=N\n0.,1.,0.,-1.,0.,0.\n*BOUNDARY\n99,1,2\n" +
              kStatic,
          {"node 99, which belongs to no solid, is held along axes of its own"});
}

// Frequencies under the stresses of the step before are not those without.
TEST_F(Decks, StressesOfTheStepBefore) {
  const std::string pulled = kBar + kClamp + "*STEP, NLGEOM\n*STATIC\n*CLOAD\nX2, 1, 1.\n*END STEP\n";
  for (const char* step : {"*STEP, PERTURBATION\n*STATIC\n", "*STEP\n*FREQUENCY\n3\n"}) {
    write("bar.inp", pulled + step);
    const Status status = Simulation().load_text(
        "bodies.part = { type = \"solid\", mesh = { file = \"bar.inp\", take = \"all\", step = 2 } }\n",
        (folder_ / "model.toml").string());
    EXPECT_NE(status.message.find("the answer would be another one without"), std::string::npos) << status.message;
    EXPECT_NE(status.message.find("stresses"), std::string::npos) << status.message;
  }
}

// The words of a model: words choose; what is left is a notice; the model's own run stays.
TEST_F(Decks, ChosenByWords) {
  write("bar.inp", kBar + kClamp + kStatic + "*CLOAD\nX2, 1, 1.\n*CONTACT PAIR\nA,B\n");
  const auto model = [&](const std::string& take, const std::string& more) {
    Simulation s;
    Status status =
        s.load_text("bodies.part = { type = \"solid\", mesh = { file = \"bar.inp\", take = " + take + " } }\n" + more,
                    (folder_ / "model.toml").string());
    if (status.ok()) status = s.run();
    return std::pair(status, std::move(s));
  };
  auto [status, s] = model("[\"boundary\", \"cload\"]", "statics = { linear = true, load = 2 }\n");
  ASSERT_TRUE(status.ok()) << status.message;
  EXPECT_NEAR(moved(s, 3).x(), 16e-3, 1e-14);
  std::string said;
  for (const std::string& notice : s.summary().notices) said += notice + "\n";
  EXPECT_NE(said.find("not taken: *CONTACTPAIR (1)"), std::string::npos) << said;
  EXPECT_NE(model("\"bondary\"", "").first.message.find("did you mean 'boundary'?"), std::string::npos);
  EXPECT_NE(model("7", "").first.message.find("must be \"all\" or a list"), std::string::npos);
  const Status scaled = Simulation().load_text(
      "bodies.part = { type = \"solid\", mesh = { file = \"bar.inp\", take = \"all\", scale = 2 } }\n",
      (folder_ / "model.toml").string());
  EXPECT_NE(scaled.message.find("does not go with 'take'"), std::string::npos) << scaled.message;
}

// A bar as Nastran states it: E A / l = 500 again.
TEST_F(Decks, Nastran) {
  const std::string grid =
      "GRID,1,,0.,0.,0.\nGRID,2,,2.,0.,0.\nGRID,3,,2.,1.,0.\nGRID,4,,0.,1.,0.\nGRID,5,,0.,0.,1.\nGRID,6,,2.,0.,1.\n"
      "GRID,7,,2.,1.,1.\nGRID,8,,0.,1.,1.\nGRID,9,,3.,.5,.5\nCHEXA,1,1,1,2,3,4,5,6\n,7,8\nPSOLID,1,1\n"
      "MAT1,1,1000.,,0.,2.\nSPC1,1,123,1,4,5,8\n";
  const auto run_nastran = [&](const std::string& control, const std::string& more) {
    Simulation s;
    Status status = s.load(write("bar.bdf", control + "BEGIN BULK\n" + grid + more + "ENDDATA\n"));
    if (status.ok()) status = s.run();
    return std::pair(status, std::move(s));
  };
  const auto end = [](const Simulation& s, std::size_t node) { return s.frame().displacement[3 * (node - 1)]; };
  const std::string control = "SOL 101\nCEND\nSPC = 1\nLOAD = 2\n";
  for (const char* load :
       {"FORCE,2,2,0,1.,1.,0.,0.\nFORCE,2,3,0,1.,1.,0.,0.\nFORCE,2,6,0,.5,2.,0.,0.\nFORCE,2,7,0,1.,1.,0.,0.\n",
        "PLOAD4,2,1,-4.,,,,2,7\n", "LOAD,2,2.,.5,5\nPLOAD4,5,1,-4.,,,,2,7\n",
        "RBE2,7,9,123456,2,3,6,7\nFORCE,2,9,0,4.,1.,0.,0.\n",
        "RBE3,7,,9,123456,1.,123,2,3\n,6,7\nFORCE,2,9,0,4.,1.,0.,0.\n"}) {
    const auto [status, s] = run_nastran(control, load);
    ASSERT_TRUE(status.ok()) << status.message;
    for (const std::size_t node : {2U, 3U, 6U, 7U}) EXPECT_NEAR(end(s, node), 8e-3, 1e-14) << load;
  }
  const auto [spring, s] = run_nastran(control,
                                       "PLOAD4,2,1,-4.,,,,2,7\nCELAS2,11,25.,2,1\nCELAS1,12,7,3,1\nPELAS,7,25.\nCELAS2,"
                                       "13,25.,6,1,0\nCBUSH,14,8,7\nPBUSH,8,K,25.\n");
  ASSERT_TRUE(spring.ok()) << spring.message;
  EXPECT_NEAR(end(s, 2), 4.0 / 600, 1e-14);
  const auto [weight, g] = run_nastran(control, "GRAV,2,0,5.,1.,0.,0.\n");
  ASSERT_TRUE(weight.ok()) << weight.message;
  EXPECT_NEAR(end(g, 2), 0.02, 1e-14);
  const auto [loaded, m] =
      run_nastran(control, "GRAV,2,0,5.,1.,0.,0.\nCONM2,51,2,,.5\nCONM2,52,3,,.5\nCONM2,53,6,,.5\nCONM2,54,7,,.5\n");
  ASSERT_TRUE(loaded.ok()) << loaded.message;
  EXPECT_NEAR(end(m, 2), 0.04, 1e-13);
  for (const auto& [solution, more, says] :
       {std::tuple(control, "PLOAD4,2,1,-4.,,,,2,7\nPARAM,WTMASS,.00259\n", "PARAM WTMASS"),
        std::tuple(control, "PLOAD4,2,1,-4.,,,,2,7\nPARAM,INREL,-2\n", "PARAM INREL"),
        std::tuple(std::string("SOL 103\nCEND\nSPC = 1\nSUBCASE 1\nLOAD = 2\nSUBCASE 2\nMETHOD = 4\nSTATSUB = 1\n"),
                   "EIGRL,4,,,3\nPLOAD4,2,1,-4.,,,,2,7\n", "STATSUB")}) {
    const std::string message = run_nastran(solution, more).first.message;
    EXPECT_NE(message.find(says), std::string::npos) << message;
  }
  ASSERT_TRUE(run_nastran(control, "PLOAD4,2,1,-4.,,,,2,7\nPARAM,POST,-1\nPARAM,WTMASS,1.\n").first.ok());
  const auto [overlap, o] = run_nastran(
      control, "RBE2,7,9,123456,2,3,6,7\nGRID,10,,3.,.5,.5\nRBE2,8,10,123456,2,3,6\nFORCE,2,9,0,4.,1.,0.,0.\n");
  EXPECT_NE(overlap.message.find("bar.bdf:"), std::string::npos);
  EXPECT_NE(overlap.message.find("belongs to this rigid coupling and to that of line"), std::string::npos)
      << overlap.message;
  const auto [beam, b] = run_nastran(control, "CBAR,5,5,1,2,0.,0.,1.\nPLOAD4,2,1,-4.,,,,2,7\n");
  EXPECT_NE(beam.message.find("element 5 (a line2) has no section"), std::string::npos) << beam.message;
}

}  // namespace deck_test
}  // namespace espalier::dynamics
