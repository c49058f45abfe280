// Which bodies nothing holds, and where to. Truth: counted by hand.
#include "dynamics/model/run/free_motions.hpp"

#include <gtest/gtest.h>

#include "dynamics/mesh/mesh_files.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace free_motions_test {

std::vector<std::string> loose(const std::string& text) {
  const auto mechanism = built(text + "[statics]\n");
  State s(mechanism->system.sizes());
  mechanism->system.initial(s.q, s.v);
  mechanism->system.set_load_factor(0);
  return model::free_motions(*mechanism, {}, s).texts;
}

using Lines = std::vector<std::string>;

const std::string kBlock = R"([bodies.block]
type = "solid"
mesh = { part = "block", lx = 0.5, divisions = [2, 1, 1] }
material = { young = 2e11, poisson = 0.3, density = 7800 }
position = [1, 2, 3]
)";
const std::string kBob = R"([bodies.bob]
type = "rigid"
mass = 2
inertia = [1e-3, 2e-3, 3e-3]
position = [0.3, 0.4, 0]
rotation = [0.3, -0.2, 0.5]
)";

TEST(FreeMotions, OfOneBody) {
  EXPECT_EQ(loose(kBlock), Lines{"'block' can move along every direction and turn about every axis"});
  EXPECT_EQ(loose(kBob), Lines{"'bob' can move along every direction and turn about every axis"});
  EXPECT_EQ(loose("[bodies.m]\ntype = \"point\"\nmass = 1\n"), Lines{"'m' can move along every direction"});
  const std::string joint = "[joints.hold]\nbodies = [\"ground\", \"bob\"]\nat = [0.3, 0, 1]\n";
  EXPECT_EQ(loose(kBob + joint + "axis = [0, 0, 1]\ntype = \"revolute\"\n"),
            Lines{"'bob' can turn about z through (0.3, 0, 0)"});
  EXPECT_EQ(loose(kBob + joint + "type = \"spherical\"\n"), Lines{"'bob' can turn about every axis"});
  EXPECT_EQ(loose(kBob + joint + "axis = [1, 1, 0]\ntype = \"prismatic\"\n"),
            Lines{"'bob' can move along (0.7071, 0.7071, 0)"});
  EXPECT_EQ(loose(kBob + joint + "axis = [0, 0, 1]\ntype = \"cylindrical\"\n"),
            Lines{"'bob' can move along z and turn about z through (0.3, 0, 0)"});
  EXPECT_EQ(loose(kBob + joint + "axis = [0, 0, 1]\ntype = \"planar\"\n"),
            Lines{"'bob' can move along every direction across z and turn about z"});
  EXPECT_EQ(loose(kBob + joint + "type = \"fixed\"\n"), Lines{});
}

TEST(FreeMotions, OfFacesNodesSpringsAndCables) {
  const std::string face =
      "b = { body = \"block\", face = \"x0\" }\na = { body = \"ground\", point = [1, 2.5, 3.5] }\n";
  EXPECT_EQ(loose(kBlock + "[joints.wall]\ntype = \"fixed\"\n" + face), Lines{});
  EXPECT_EQ(loose(kBlock + "[joints.wall]\ntype = \"spherical\"\n" + face), Lines{"'block' can turn about every axis"});
  // One spring along y: five motions are left, none of them a turn about a place of its own.
  EXPECT_EQ(
      loose(kBob + "[forces.s]\ntype = \"spring\"\nstiffness = 5\na = { body = \"ground\", point = [0.3, 0, 0] }\n"
                   "b = { body = \"bob\" }\n"),
      Lines{"'bob' can move along every direction across y and turn about every axis"});
  EXPECT_EQ(loose(kBob + "[forces.s]\ntype = \"bushing\"\nstiffness = [5, 5, 5]\nangular_stiffness = [1, 1, 1]\n"
                         "a = { body = \"ground\", point = [0.3, 0.4, 0] }\nb = { body = \"bob\" }\n"),
            Lines{});
  // A straight cable has no turn about itself.
  EXPECT_EQ(loose("[bodies.rope]\ntype = \"cable\"\nstart = [0, 0, 0]\nend = [2, 0, 0]\naxial = 1e6\nbending = 10\n"
                  "mass_per_length = 1\n[joints.end]\ntype = \"spherical\"\na = { body = \"ground\" }\n"
                  "b = { body = \"rope\", node = 1 }\n"),
            Lines{"'rope' can turn about every axis across x"});
}

TEST(FreeMotions, OfBodiesTogether) {
  const std::string both = kBlock + kBob +
                           "[joints.weld]\ntype = \"fixed\"\na = { body = \"block\", face = \"x1\" }\nb = { body = "
                           "\"bob\" }\n[joints.hinge]\ntype = \"revolute\"\nbodies = [\"ground\", \"bob\"]\n"
                           "at = [5, 6, 7]\naxis = [0, 1, 0]\n";
  EXPECT_EQ(loose(both),
            (Lines{"'block' can turn about y through (5, 2.5, 7)", "'bob' can turn about y through (5, 0.4, 7)"}));
  EXPECT_EQ(loose(both + "[forces.coil]\ntype = \"rotational-spring\"\nstiffness = 1\n"
                         "a = { body = \"ground\", axis = [0, 1, 0] }\nb = { body = \"bob\", axis = [0, 1, 0] }\n"),
            Lines{});
}

/// `count` rods in a row, `links` of them in each chain, which hangs on the ground by a hinge.
std::string chains(int count, int links) {
  std::string text;
  for (int k = 0; k < count; ++k) {
    text +=
        fmt::format("[bodies.rod{0}]\ntype = \"rigid\"\nmass = 1\nbox = [1, 0.1, 0.1]\nposition = [{0}.5, 0, 0]\n", k);
    const std::string before = k % links == 0 ? "ground" : fmt::format("rod{}", k - 1);
    text += fmt::format(
        "[joints.hinge{0}]\ntype = \"revolute\"\nbodies = [\"{1}\", \"rod{0}\"]\nat = [{0}, 0, 0]\naxis = [0, 1, 0]\n",
        k, before);
  }
  return text;
}

// 2,000 rods on hinges, of which all but one are kept from turning: that one is found among them.
TEST(FreeMotions, OfThousandsOfBodies) {
  constexpr int kBodies = 2000;
  std::string text = chains(kBodies, 1);
  for (int k = 0; k < kBodies; ++k)
    if (k != 1234)
      text += fmt::format(
          "[forces.coil{0}]\ntype = \"rotational-spring\"\nstiffness = 1\na = {{ body = \"ground\", axis = [0, 1, 0] "
          "}}\n"
          "b = {{ body = \"rod{0}\", axis = [0, 1, 0] }}\n",
          k);
  EXPECT_EQ(loose(text), Lines{"'rod1234' can turn about y through (1234, 0, 0)"});
}

// A chain that is too long for a dense matrix is counted, its neighbours are looked at.
TEST(FreeMotions, LongChainsAreCounted) {
  const auto mechanism = built(chains(240, 240) + kBob + "[statics]\n");
  State s(mechanism->system.sizes());
  mechanism->system.initial(s.q, s.v);
  const model::FreeMotions found = model::free_motions(*mechanism, {}, s);
  EXPECT_EQ(found.unseen, 240U);
  EXPECT_EQ(found.texts, Lines{"'bob' can move along every direction and turn about every axis"});
}

// What a user sees: statics that finds no place for a body names it.
TEST(FreeMotions, AreNamedWhereStaticsFails) {
  const std::string text =
      "gravity = [0, 0, -9.81]\n" + kBlock + kBob +
      "[joints.rail]\ntype = \"prismatic\"\nbodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n"
      "[joints.wall]\ntype = \"fixed\"\na = { body = \"ground\", point = [1, 2.5, 3.5] }\n"
      "b = { body = \"block\", face = \"x0\" }\n";
  for (const char* run :
       {"[statics]\n", "[statics]\npath = \"load-steps\"\n", "[initial]\nstatics = true\n[integrator]\nend = 1\n"}) {
    Simulation s;
    Status status = s.load_text(text + run, "model.toml");
    if (status.ok()) status = s.run();
    EXPECT_EQ(status.code, StatusCode::accuracy_not_reached) << run;
    EXPECT_NE(status.message.find("without loads nothing holds these bodies: 'bob' can move along z."),
              std::string::npos)
        << status.message;
    EXPECT_EQ(status.message.find("'block' can"), std::string::npos) << status.message;
  }
}

// Two cubes that share no node, the first held: the second is not, and the body's whole motions do not show it.
using FreeMotionsOfMeshes = test::MeshFiles;
TEST_F(FreeMotionsOfMeshes, PiecesOfAMeshAreNamed) {
  std::string mesh = "*NODE\n";
  for (int cube = 0; cube < 2; ++cube)
    for (int k = 0; k < 8; ++k)
      mesh += fmt::format("{}, {}, {}, {}\n", 100 * cube + k + 1, 3 * cube + ((k & 3) == 1 || (k & 3) == 2 ? 1 : 0),
                          (k & 3) >= 2 ? 1 : 0, k >= 4 ? 1 : 0);
  mesh += "*ELEMENT, TYPE=C3D8, ELSET=all\n1, 1, 2, 3, 4, 5, 6, 7, 8\n2, 101, 102, 103, 104, 105, 106, 107, 108\n";
  mesh += "*SURFACE, NAME=wall, TYPE=ELEMENT\n1, S6\n";
  const std::string text =
      "gravity = [0, 0, -9.81]\n[bodies.cubes]\ntype = \"solid\"\nmaterial = { young = 1e9, poisson = "
      "0.3, density = 1000 }\nmesh = { file = \"" +
      write("cubes.inp", mesh) +
      "\" }\n[joints.hold]\ntype = \"fixed\"\na = { body = \"ground\", point = [0, 0.5, 0.5] }\nb = { "
      "body = \"cubes\", face = \"wall\" }\n[statics]\n";
  Simulation s;
  Status status = s.load_text(text, "model.toml");
  ASSERT_TRUE(status.ok()) << status.message;
  status = s.run();
  EXPECT_EQ(status.code, StatusCode::accuracy_not_reached);
  EXPECT_NE(status.message.find("'cubes': the mesh falls into 2 pieces that share no node, with the nodes 1, 101"),
            std::string::npos)
      << status.message;
}

// Loads that balance each other: statics ends, and says that the place is one of many. Their pull keeps the block from
// turning about y and z.
TEST(FreeMotions, AreANoticeWhereLoadsBalance) {
  const Simulation s = simulated(kBlock + R"([markers]
left = { body = "block", face = "x0" }
right = { body = "block", face = "x1" }
[forces]
pull = { type = "load", a = "right", force = [1e6, 0, 0] }
hold = { type = "load", a = "left", force = [-1e6, 0, 0] }
[statics]
)");
  ASSERT_EQ(s.summary().notices.size(), 1U);
  EXPECT_NE(s.summary().notices[0].find("indifferent: 'block' can move along every direction and turn about x. "),
            std::string::npos)
      << s.summary().notices[0];
}

}  // namespace free_motions_test
}  // namespace espalier::dynamics
