// Connectors and multi-point constraints of decks. Truths are closed forms of bars, rigid levers and springs.
#include <gtest/gtest.h>

#include <cmath>

#include "base/strtod.hpp"
#include "dynamics/mesh/deck_bar.hpp"

namespace espalier::dynamics {
namespace deck_connectors_test {

using test::kBar;
using test::kClamp;
using test::kStatic;

/// The bar, its far end one rigid piece with node 99 at (2, .5, .5), and node 98 at the same place, held.
const std::string kEnds = "*NODE\n99,2.,.5,.5\n98,2.,.5,.5\n97,5.,.5,.5\n*RIGID BODY, NSET=X2, REF NODE=99\n";

class DeckConnectors : public test::DeckBar {
 protected:
  static std::string connector(const std::string& type, const std::string& nodes, const std::string& behavior = "",
                               const std::string& axes = "") {
    return "*ELEMENT, TYPE=CONN3D2, ELSET=C\n501, " + nodes + "\n" +
           (behavior.empty() ? "" : "*CONNECTOR BEHAVIOR, NAME=B\n" + behavior) + "*CONNECTOR SECTION, ELSET=C" +
           (behavior.empty() ? "" : ", BEHAVIOR=B") + "\n" + type + "\n" + (axes.empty() ? "" : axes + ",\n");
  }
  /// Displacement of the middle of the end and how its nodes turn: from four corners.
  struct EndMotion {
    Vec3 way, turn;
  };
  EndMotion end(const Simulation& s) const {
    const Vec3 a = moved(s, 3), b = moved(s, 13), c = moved(s, 23), d = moved(s, 33);
    return {(a + b + c + d) / 4, {(d - b).y() * -1, (c - a).x(), (a - b).x()}};
  }
};

// In series with E A / l = 500: a spring of 100 from the end to the ground takes a sixth of 6 along x. Rotations of the
// rigid end: E I / l = 1000 / 12 / 2 against a spring of 125 / 3 about z shares a moment in halves.
TEST_F(DeckConnectors, ElasticityAndDamping) {
  const std::string held = kBar + kEnds + kClamp;
  const std::string along = "*CONNECTOR ELASTICITY, COMPONENT=1\n100.\n";
  for (const auto& [type, nodes] :
       {std::pair("AXIAL", "99, 97"), std::pair("AXIAL", "97, 99"), std::pair("CARTESIAN", "99, 98"),
        std::pair("CARTESIAN", ", 99"), std::pair("TRANSLATOR", "98, 99"), std::pair("SLOT", "98, 99"),
        std::pair("CYLINDRICAL", "99, 98")}) {
    const Simulation s =
        run(held + "*BOUNDARY\n98, 1, 6\n97, 1, 6\n" + connector(type, nodes, along) + kStatic + "*CLOAD\n99, 1, 6.\n");
    EXPECT_NEAR(end(s).way.x(), 0.01, 1e-12) << type << " " << nodes;
  }
  // Between nodes of the solid alone: with four springs of 250 the second cube is twice as stiff.
  const Simulation between = run(kBar + kClamp +
                                 "*ELEMENT, TYPE=CONN3D2, ELSET=C\n51,2,3\n52,12,13\n53,22,23\n54,32,33\n*CONNECTOR "
                                 "BEHAVIOR, NAME=B\n*CONNECTOR ELASTICITY, COMPONENT=1\n250.\n*CONNECTOR SECTION, "
                                 "ELSET=C, BEHAVIOR=B\nAXIAL\n" +
                                 kStatic + "*CLOAD\nX2, 1, 1.\n");
  EXPECT_NEAR(moved(between, 3).x(), 6e-3, 1e-12);
  // A spring about axis 1 of the orientation, which is z.
  const std::string axes = "*ORIENTATION, NAME=UP\n0.,0.,1., 1.,0.,0.\n";
  double free = 0;
  for (const char* stiffness : {"", "4.", "8."}) {
    const std::string behavior =
        *stiffness == 0 ? "" : "*CONNECTOR ELASTICITY, COMPONENT=4\n" + std::string(stiffness) + "\n";
    const Simulation s = run(held + axes + "*BOUNDARY\n98, 1, 6\n" + connector("REVOLUTE", "98, 99", behavior, "UP") +
                             kStatic + "*CLOAD\n99, 6, 1.\n");
    const double turn = end(s).turn.z();
    if (*stiffness == 0) {
      free = turn;
    } else {
      EXPECT_NEAR(1 / turn - 1 / free, base::strtod(stiffness), 1e-9);
    }
  }
  EXPECT_GT(free, 0);
  EXPECT_NEAR(end(run(held + "*BOUNDARY\n98, 1, 6\n" +
                      connector("CARTESIAN, ROTATION", "98, 99", "*CONNECTOR ELASTICITY, COMPONENT=6\n8.\n") + kStatic +
                      "*CLOAD\n99, 6, 1.\n"))
                  .turn.z(),
              1 / (1 / free + 8), 1e-12);
}

// Which of six loads at the end a joint to the ground takes: those of its constrained components leave the end at rest.
TEST_F(DeckConnectors, JointsHoldWhatTheirTypesSay) {
  const std::string held = kBar + kEnds + kClamp + "*BOUNDARY\n98, 1, 6\n";
  for (const auto& [type, constrained] :
       {std::pair("WELD", "123456"), std::pair("BEAM", "123456"), std::pair("JOIN, ALIGN", "123456"),
        std::pair("JOIN", "123"), std::pair("HINGE", "12356"), std::pair("JOIN, REVOLUTE", "12356"),
        std::pair("TRANSLATOR", "23456"), std::pair("SLOT, ALIGN", "23456"), std::pair("CYLINDRICAL", "2356"),
        std::pair("PLANAR", "156"), std::pair("SLOT", "23"), std::pair("SLIDE-PLANE", "1"), std::pair("REVOLUTE", "56"),
        std::pair("UJOINT", "1235"), std::pair("JOIN, UNIVERSAL", "1235")}) {
    for (int d = 1; d <= 6; ++d) {
      const Simulation s =
          run(held + connector(type, "98, 99") + kStatic + "*CLOAD\n99, " + std::to_string(d) + ", 1.\n");
      const EndMotion m = end(s);
      const double own = d < 4 ? m.way[d - 1] : m.turn[d - 4];
      const bool rests = std::string(constrained).find(static_cast<char>('0' + d)) != std::string::npos;
      EXPECT_EQ(std::abs(own) < 1e-12, rests) << type << " along " << d << ": " << own;
    }
  }
  // Axis 1 of the orientation is y, so that the hinge turns about y alone.
  const std::string axes = "*ORIENTATION, NAME=SIDE, SYSTEM=RECTANGULAR\n0.,1.,0., -1.,0.,0.\n3, 0.\n";
  for (int d = 4; d <= 6; ++d) {
    const Simulation s = run(held + axes + connector("HINGE", "98, 99", "", "SIDE") + kStatic + "*CLOAD\n99, " +
                             std::to_string(d) + ", 1.\n");
    EXPECT_EQ(std::abs(end(s).turn[d - 4]) < 1e-12, d != 5) << d;
  }
  // A link of length 3 along x keeps the end there; nodes at one place of two bars are one.
  const Simulation link = run(kBar + kEnds + kClamp + "*BOUNDARY\n97, 1, 3\n" + connector("LINK", "99, 97") + kStatic +
                              "*CLOAD\n99, 1, 1.\n");
  EXPECT_NEAR(end(link).way.x(), 0, 1e-12);
  const std::string other =
      "*NODE\n201,2,0,0\n202,4,0,0\n203,4,1,0\n204,2,1,0\n205,2,0,1\n206,4,0,1\n207,4,1,1\n208,2,1,1\n"
      "*ELEMENT, TYPE=C3D8, ELSET=BAR\n9, 201,202,203,204,205,206,207,208\n*NSET, NSET=X4\n202,203,206,207\n"
      "*ELEMENT, TYPE=CONN3D2, ELSET=J\n301,3,201\n302,13,204\n303,23,205\n304,33,208\n*CONNECTOR SECTION, "
      "ELSET=J\nJOIN\n";
  EXPECT_NEAR(moved(run(kBar + other + kClamp + kStatic + "*CLOAD\nX4, 1, 1.\n"), 202).x(), 16e-3, 1e-12);
}

// A lever from the reference node of the end: a joint at a node beside it acts there, also where the end follows in the
// mean. A force of 1 along y, 3 beside the end, turns it as a moment of 3 about z does.
TEST_F(DeckConnectors, BesideTheNode) {
  const std::string far = "*NODE\n96,5.,.5,.5\n*SURFACE, NAME=END\n2, S4\n";
  for (const char* how : {"KINEMATIC", "DISTRIBUTING"}) {
    const std::string coupling =
        "*COUPLING, REF NODE=96, SURFACE=END, CONSTRAINT NAME=C\n*" + std::string(how) + "\n1, 6\n";
    const std::string held = kBar + far + coupling + kClamp;
    const Simulation force = run(held + kStatic + "*CLOAD\n96, 2, 1.\n");
    const Simulation same = run(kBar + "*NODE\n96,2.,.5,.5\n*SURFACE, NAME=END\n2, S4\n" + coupling + kClamp + kStatic +
                                "*CLOAD\n96, 2, 1.\n96, 6, 3.\n");
    EXPECT_NEAR(end(force).turn.z(), end(same).turn.z(), 1e-12 * std::abs(end(same).turn.z())) << how;
    const Simulation hinged = run(held + connector("JOIN", ", 96") + kStatic + "*CLOAD\n96, 2, 1.\n23, 2, 1.\n");
    EXPECT_NEAR(hinged.value("part_coupling_1.position.y"), 0.5, 1e-12) << how;
    EXPECT_GT(std::abs(moved(hinged, 23).y()), 1e-6) << how;
  }
}

TEST_F(DeckConnectors, WhatIsRefused) {
  const std::string held = kBar + kEnds + kClamp + "*BOUNDARY\n98, 1, 6\n";
  const auto says = [&](const std::string& more, const std::vector<std::string>& parts) {
    refused(held + more + kStatic, parts);
  };
  says(connector("RETRACTOR", "98, 99"), {"bar.inp:", "*CONNECTOR SECTION RETRACTOR (1)"});
  says(connector("ALIGN", "98, 99"), {"*CONNECTOR SECTION ALIGN"});
  says(connector("HINGE", "98, 99", "*CONNECTOR ELASTICITY, COMPONENT=1\n1.\n"), {"component 1 of HINGE"});
  says(connector("SLOT", "98, 99", "*CONNECTOR STOP, COMPONENT=1\n0., 1.\n"), {"*CONNECTORSTOP"});
  says(connector("SLOT", "98, 99", "*CONNECTOR ELASTICITY, COMPONENT=1, NONLINEAR\n0., 0.\n1., 1.\n"),
       {"*CONNECTORELASTICITY NONLINEAR"});
  says(connector("SLOT", "98, 99", "*CONNECTOR DAMPING\n1.\n"), {"*CONNECTORDAMPING without COMPONENT"});
  says("*ELEMENT, TYPE=CONN3D2, ELSET=C\n501, 98, 99\n", {"elements CONN3D2 without *CONNECTOR SECTION (1)"});
  says("*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL\n0.,0.,0.,0.,0.,1.\n" + connector("HINGE", "98, 99", "", "O"),
       {"*ORIENTATION SYSTEM=CYLINDRICAL"});
  says(connector("HINGE", "98, 99", "", "NONE"), {"there is no *ORIENTATION 'NONE'"});
  says(connector("JOIN", "2, 99"), {"node 2 does not turn, and the connector joins it to another place"});
  refused(held + connector("BUSHING", "98, 99") + "*STEP, NLGEOM\n*STATIC\n",
          {"*CONNECTOR SECTION BUSHING in a step with large rotations"});
  refused(held + connector("HINGE", "98, 99") + kStatic + "*CONNECTOR MOTION\nC, 4, 0.1\n", {"*CONNECTORMOTION"});
}

// Bars whose end nodes stay in a plane, on a line, at a distance: what they did without is not what they do, and the
// constraint holds. CalculiX's numbers are in tests/cli/deck_test.py.
TEST_F(DeckConnectors, MultiPointConstraints) {
  const std::string load = kClamp + kStatic + "*CLOAD\n33, 1, 1.\n3, 2, 0.5\n";
  const auto plane = [&](const Simulation& s) {  // of the end, through 3, 13, 23: how far 33 leaves it
    return moved(s, 33).x() - moved(s, 13).x() - moved(s, 23).x() + moved(s, 3).x();
  };
  EXPECT_GT(std::abs(plane(run(kBar + load))), 1e-5);
  EXPECT_NEAR(plane(run(kBar + "*MPC\nPLANE, 3, 13, 23, 33\n" + load)), 0, 1e-12);
  const auto bend = [&](const Simulation& s) -> Vec3 { return moved(s, 1) - 2 * moved(s, 2) + moved(s, 3); };
  EXPECT_GT(bend(run(kBar + load)).tail<2>().norm(), 1e-5);
  EXPECT_NEAR(bend(run(kBar + "*MPC\nSTRAIGHT, 1, 3,\n2\n" + load)).tail<2>().norm(), 0, 1e-12);
  const auto length = [&](const Simulation& s) { return (moved(s, 33) - moved(s, 3)).dot(Vec3(0, 1, 1)); };
  EXPECT_GT(std::abs(length(run(kBar + load))), 1e-5);
  EXPECT_NEAR(length(run(kBar + "*MPC\nBEAM, 3, 33\n" + load)), 0, 1e-12);
  refused(kBar + "*MPC\nMEANROT, 3, 33\n" + load, {"bar.inp:28: ", "*MPC MEANROT (1)"});
  refused(kBar + "*MPC\nPLANE, 3, 13, 23\n" + load, {"*MPC PLANE has 3 nodes; it needs 4 or more"});
  refused(kBar + "*MPC\nPLANE, 1, 2, 3, 13\n" + load, {"the first three nodes lie on a line"});
  refused(kBar + "*MPC\nPLANE, 1, 2, 11, 33\n" + load, {"node 33 lies 1 beside it from the start"});
  refused(kBar + "*MPC\nBEAM, 3, 33\n" + kClamp + "*STEP, NLGEOM\n*STATIC\n",
          {"*MPC BEAM in a step with large displacements"});
}

}  // namespace deck_connectors_test
}  // namespace espalier::dynamics
