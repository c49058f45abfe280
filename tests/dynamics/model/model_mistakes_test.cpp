// Models that are broken on purpose: every one must end in invalid_input with file, line, the name concerned and what
// to change.
#include <gtest/gtest.h>

#include <limits>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

std::vector<Mistake> mistakes() {
  const std::string& p = kPendulum;
  const std::string solid = p + R"([bodies.block]
type = "solid"
material = { young = 1e9, poisson = 0.3, density = 1000 }
mesh = { part = "block", divisions = [1, 1, 1] }
)";
  return {
      {"syntax", "title = \n" + p, {"model.toml:1"}},
      {"unknown key",
       replaced(p, "mass = 2", "mass = 2\nmas = 3"),
       {"model.toml:5", "bodies.bob.mas", "did you mean 'mass'"}},
      {"misspelt key", replaced(p, "mass = 2", "mas = 2"), {"bodies.bob.mas", "did you mean 'mass'"}},
      {"missing key", replaced(p, "mass = 2\n", ""), {"model.toml:2", "bodies.bob", "needs 'mass'"}},
      {"zero mass", replaced(p, "mass = 2", "mass = 0"), {"model.toml:4", "bodies.bob.mass", "greater than 0"}},
      {"negative inertia", replaced(p, "[1e-9, 1e-9", "[-1, 1e-9"), {"model.toml:5", "inertia"}},
      {"NaN", replaced(p, "mass = 2", "mass = nan"), {"model.toml:4", "finite"}},
      {"infinite", replaced(p, "[1, 0, 0]", "[inf, 0, 0]"), {"model.toml:6", "finite"}},
      {"wrong type", replaced(p, "mass = 2", "mass = true"), {"model.toml:4", "a number", "true or false"}},
      {"bad expression", replaced(p, "mass = 2", "mass = \"2*lenght\""), {"model.toml:4", "lenght"}},
      {"division by zero", replaced(p, "mass = 2", "mass = \"1/0\""), {"model.toml:4", "finite"}},
      {"short vector", replaced(p, "[1, 0, 0]", "[1, 0]"), {"model.toml:6", "three numbers"}},
      {"unknown joint", replaced(p, "\"revolute\"", "\"revolut\""), {"model.toml:8", "did you mean 'revolute'"}},
      {"unknown body", replaced(p, "\"ground\", \"bob\"", "\"ground\", \"bop\""), {"bop", "did you mean 'bob'"}},
      {"unknown section", p + "[joint.x]\n", {"joint", "did you mean 'joints'"}},
      {"unknown marker",
       replaced(p, "bodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]",
                "a = \"here\"\nb = { body = \"bob\" }"),
       {"unknown marker 'here'"}},
      {"circle",
       p + "[markers]\nx = { same_as = \"y\" }\ny = { same_as = \"z\" }\nz = { same_as = \"x\" }\n",
       {"circle", "-> y -> z"}},
      {"double name", p + "[markers.bob]\nbody = \"ground\"\n", {"'bob' is taken", "bodies.bob"}},
      {"no integrator", p.substr(0, p.find("[integrator]")), {"[integrator]"}},
      {"no bodies", "[integrator]\nend = 1\n", {"no bodies"}},
      {"end before start", replaced(p, "end = 1", "end = -1"), {"model.toml:15", "later than the start"}},
      {"unknown quantity",
       p + "[output]\nquantities = [\"bob.positon.x\"]\n",
       {"bob.positon.x", "did you mean 'position'"}},
      {"unknown object", p + "[output]\nquantities = [\"bo.position.x\"]\n", {"did you mean 'bob'"}},
      {"unknown solver option", p + "[solver]\ndevise = \"cpu\"\n", {"devise"}},
      {"missing mesh",
       replaced(solid, "{ part = \"block\", divisions = [1, 1, 1] }", "{ file = \"none.msh\" }"),
       {"model.toml:16", "none.msh", "relative to the folder"}},
      {"unknown part", replaced(solid, "\"block\"", "\"blok\""), {"did you mean 'block'"}},
      {"bad material", replaced(solid, "poisson = 0.3", "poisson = 0.5"), {"poisson", "(-1, 0.5)"}},
      {"unknown material",
       replaced(solid, "{ young = 1e9, poisson = 0.3, density = 1000 }", "\"steel\""),
       {"unknown material 'steel'"}},
      {"flexible without place", solid + "[markers.m]\nbody = \"block\"\n", {"model.toml:20", "say where"}},
      {"unknown face", solid + "[markers.m]\nbody = \"block\"\nface = \"x2\"\n", {"x2", "x1"}},
      {"node with axes",
       solid + "[joints.k]\ntype = \"revolute\"\na = { body = \"ground\", axis = [0, 0, 1] }\nb = { body = \"block\", "
               "node = 1 }\n",
       {"joints.k", "not to a node"}},
      {"contradictory velocity",
       replaced(p, "mass = 2", "mass = 2\nvelocity = [1, 0, 0]"),
       {"model.toml:2", "velocity contradicts", "bob", "project"}},
      {"contradictory joints",
       p + "[joints.far]\ntype = \"spherical\"\na = { body = \"ground\", point = [9, 0, 0] }\nb = { body = \"bob\" }\n",
       {"far"}},
      {"endless repeat", p + "[[repeat]]\nto = 1e9\n[repeat.markers.\"m{i}\"]\nbody = \"ground\"\n", {"whole numbers"}},
      {"repeat without index",
       p + "[[repeat]]\nto = 1\n[repeat.markers.m]\nbody = \"ground\"\n",
       {"there already", "{i}"}},
      {"brace", p + "[markers.m]\nbody = \"bob{\"\n", {"'}' is missing"}},
      {"date", "when = 2020-01-01\n" + p, {"model.toml:1", "dates"}},
      {"more elements than numbers",
       replaced(solid, "[1, 1, 1]", "[2000000000, 1, 1]"),
       {"model.toml:19", "divisions", "1e+08"}},
      {"elements beyond all memory",
       replaced(solid, "[1, 1, 1]", "[1000, 1000, 1000]"),
       {"divisions", "1e+09 elements"}},
      {"fractional divisions", replaced(solid, "[1, 1, 1]", "[1, 1.4, 1]"), {"divisions", "whole numbers"}},
      {"endless cable",
       p + "[bodies.c]\ntype = \"cable\"\nstart = [0, 0, 0]\nend = [1, 0, 0]\nelements = 2000000000\naxial = "
           "1\nbending "
           "= 1\nmass_per_length = 1\n",
       {"model.toml:20", "bodies.c.elements", "100000000"}},
      {"steps between nothing", p + "max_step = 0.01\nmin_step = 1\n", {"model.toml:17", "min_step", "max_step"}},
      {"endless outputs", p + "[output]\nvtu_interval = 1e-30\n", {"model.toml:16", "1e-30", "every step"}},
      {"component of a component",
       p + "[output]\nquantities = [\"bob.position.x.y\"]\n",
       {"bob.position.x.y", "only one of x, y, z, norm"}},
      {"component of a number",
       p + "[output]\nquantities = [\"hinge.coordinate.x\"]\n",
       {"hinge.coordinate.x", "number without components"}},
      {"spring without length",
       p + "[forces.s]\ntype = \"spring\"\nbodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\nstiffness = 1\n",
       {"model.toml:16", "forces.s", "no direction"}},
      {"function without value",
       p + "[joints.m]\ntype = \"rotation-motor\"\nbodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\naxis = [0, 0, "
           "1]\nmotion = \"sqrt(t - "
           "1)\"\n",
       {"model.toml:16", "joints.m", "\"sqrt(t - 1)\"", "not a finite number at t = 0"}},
  };
}

TEST(ModelMistakes, EndInInvalidInputThatSaysWhereAndWhat) {
  for (const Mistake& m : mistakes()) {
    Simulation simulation;
    const Status status = simulation.load_text(m.text, "model.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << m.name << ": " << status.message;
    for (const std::string& word : m.says)
      EXPECT_NE(status.message.find(word), std::string::npos)
          << m.name << ": \"" << word << "\" in: " << status.message;
  }
}

TEST(ModelMistakes, LongExpressionsAreShownInPart) {
  Simulation simulation;
  const Status status =
      simulation.load_text("[parameters]\nx = \"" + std::string(100'000, '(') + "\"\n" + kPendulum, "model.toml");
  EXPECT_EQ(status.code, StatusCode::invalid_input);
  EXPECT_LT(status.message.size(), 400U);
}

TEST(ModelMistakes, TimesAndOptionsThatCannotBe) {
  SimulationOptions options;
  options.until = std::numeric_limits<double>::infinity();
  Simulation endless(options);
  EXPECT_EQ(endless.load_text(kPendulum, "model.toml").code, StatusCode::invalid_input);
  options = {};
  options.dump_every = 0;
  EXPECT_THROW(Simulation{options}, std::invalid_argument);
  options.dump_every = 1;
  options.dump_count = -1;
  EXPECT_THROW(Simulation{options}, std::invalid_argument);
}

TEST(ModelMistakes, ForceWithoutDirectionIsNamed) {
  const std::string text = R"([bodies.bob]
type = "rigid"
mass = 1
inertia = [1, 1, 1]
position = [0, 0, 0]
[forces.short]
type = "spring"
a = { body = "ground" }
b = { body = "bob" }
stiffness = 1
rest = 0
[integrator]
end = 1
)";
  Simulation simulation;
  const Status status = simulation.load_text(text, "model.toml");
  EXPECT_EQ(status.code, StatusCode::singular);
  EXPECT_NE(status.message.find("\"short\": the distance of two points"), std::string::npos) << status.message;
}

TEST(ModelMistakes, InvertedElementOfAMeshFileIsNamed) {
  const ScratchFolder folder;
  std::ofstream(folder.path() + "/bad.inp")
      << "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=E\n77,1,3,2,4\n";
  Simulation simulation;
  const Status status = simulation.load_text(kPendulum +
                                                 "[bodies.block]\ntype = \"solid\"\nmaterial = { young = 1e9, density "
                                                 "= 1000 }\nmesh = { file = \"" +
                                                 folder.path() + "/bad.inp\" }\n",
                                             "model.toml");
  EXPECT_EQ(status.code, StatusCode::invalid_input);
  for (const std::string word : {"model.toml:16", "bodies.block", "77"})
    EXPECT_NE(status.message.find(word), std::string::npos) << status.message;
}

TEST(ModelMistakes, OverridesAreCheckedToo) {
  for (const std::string set : {"nothing", "=3", "a..b=2", "bodies.bob.mass.x=2"}) {
    SimulationOptions options;
    options.set = {set};
    Simulation simulation(options);
    const Status status = simulation.load_text(kPendulum, "model.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << set;
    EXPECT_NE(status.message.find("--set"), std::string::npos) << status.message;
  }
}

TEST(ModelMistakes, UnknownQuantityIsMisuse) {
  const Simulation s = simulated(kPendulum);
  EXPECT_THROW(static_cast<void>(s.value("bob.colour")), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(s.value("bob.position")), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(Simulation().time()), std::logic_error);
}

}  // namespace
}  // namespace espalier::dynamics
