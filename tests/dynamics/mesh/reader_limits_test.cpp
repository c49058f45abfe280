// Texts and mesh files made to exhaust memory, the stack or patience. Truth: each is refused with its place (the file
// and its line where there is one) within a second and without memory to speak of; the greatest sizes that are allowed
// pass.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>

#include "dynamics/mesh/mesh_files.hpp"
#include "dynamics/model/model_common.hpp"
#include "dynamics/model/read/expand.hpp"
#include "dynamics/model/read/expression.hpp"

namespace espalier::dynamics::test {
namespace reader_limits_test {

using Clock = std::chrono::steady_clock;

std::string times(int count, const std::string& piece) {
  std::string result;
  for (int k = 0; k < count; ++k) result += piece;
  return result;
}

long peak_kilobytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

/// Runs `action`, which must throw an Error that contains `says`, soon and without much memory.
template <class Action>
void expect_refused(const char* name, const std::string& says, const Action& action) {
  constexpr double kMostSeconds = 10;  // sanitizers and busy machines included; without the limits: minutes or for ever
  constexpr long kMostKilobytes = 600000;
  const auto start = Clock::now();
  const long before = peak_kilobytes();
  try {
    action();
    ADD_FAILURE() << name << ": not refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.status().code, StatusCode::invalid_input) << name;
    EXPECT_NE(std::string(error.what()).find(says), std::string::npos) << name << ": " << error.what();
    EXPECT_LT(std::string(error.what()).size(), 2000U) << name;
  }
  EXPECT_LT(std::chrono::duration<double>(Clock::now() - start).count(), kMostSeconds) << name;
  EXPECT_LT(peak_kilobytes() - before, kMostKilobytes) << name;
}

TEST(ReaderLimits, Expressions) {
  constexpr int kMany = 1000000;
  for (const char* piece : {"1^", "1+", "(", "-(", "sin(", "1^-", "aa", "min(1,"}) {
    const std::string text = times(kMany, piece) + "1";
    expect_refused(piece, "characters", [&] { model::Expression(text, {}, false); });
    const std::string shorter = times(20000, piece) + "1";
    if (std::string(piece) == "1+") {
      EXPECT_EQ(model::Expression(shorter, {}, false).value(), 20001);
    } else {
      expect_refused(piece, "character", [&] { model::Expression(shorter, {}, false); });
    }
  }
  EXPECT_EQ(model::Expression(times(150, "1^") + "2", {}, false).value(), 1);
  EXPECT_EQ(model::Expression(times(150, "(") + "2" + times(150, ")"), {}, false).value(), 2);
}

TEST(ReaderLimits, NumbersOfExpressions) {
  for (const auto& [text, value] : {std::pair{"1e-400", 0.0}, {".5", 0.5}, {"1.", 1.0}, {"1e3", 1e3}, {"0.1", 0.1}})
    EXPECT_EQ(model::Expression(text, {}, false).value(), value) << text;
  EXPECT_TRUE(std::isinf(model::Expression("1e400", {}, false).value()));
  EXPECT_THROW(model::Expression("0x10", {}, false), Error);
}

TEST(ReaderLimits, KeysAndNesting) {
  const auto parse = [](const std::string& text) { static_cast<void>(model::parse_toml(text, "model.toml")); };
  const std::string key = times(100000, "a.") + "a";
  expect_refused("dotted key", "model.toml:2", [&] { parse("title = \"x\"\n" + key + " = 1\n"); });
  expect_refused("quoted parts", "model.toml:1", [&] { parse(times(100000, "\"a.b\".") + "a = 1\n"); });
  expect_refused("blanks between", "model.toml:1", [&] { parse(times(100000, "a . ") + "a = 1\n"); });
  expect_refused("header", "model.toml:1", [&] { parse("[" + key + "]\n"); });
  expect_refused("inline table", "model.toml:1", [&] { parse("x = { " + key + " = 1 }\n"); });
  expect_refused("behind a text", "model.toml:4", [&] { parse("x = \"\"\"\n...\n\"\"\"\n" + key + " = 1\n"); });
  expect_refused("long key", "model.toml:1", [&] { parse(std::string(2000000, 'a') + " = 1\n"); });
  expect_refused("lists", "model.toml:1", [&] { parse("x = " + times(100000, "[") + "\n"); });
  const std::string sixty = times(60, "a.") + "a";
  expect_refused("keys in tables", "model.toml:1", [&] {
    std::string text = "x = ";
    for (int k = 0; k < 20; ++k) text += "{ " + sixty + " = ";
    parse(text + "1" + times(20, "}") + "\n");
  });
  expect_refused("--set", "--set", [&] {
    model::Value root;
    model::expand(root, {key + "=1"});
  });
  // Points in texts and comments are no keys; numbers have one.
  parse("# " + std::string(5000, '.') + "\nx = \"" + std::string(5000, '.') + "\"\ny = [" + times(5000, "1.5, ") +
        "2.5]\nz = '''\n" + std::string(5000, '.') + "\n'''\n" + sixty + " = 1\n");
}

TEST(ReaderLimits, Repetitions) {
  const auto expand = [](const std::string& range, const std::string& more = "") {
    model::Value root =
        model::parse_toml("[[repeat]]\n" + range + "\n[repeat.bodies.\"b{i}\"]\nmass = \"i\"\n" + more, "model.toml");
    model::expand(root, {});
    return root.find("bodies")->entries.size();
  };
  expect_refused("from 1e17", "model.toml:1", [&] { expand("from = 1e17\nto = 1.0000000000000001e17"); });
  expect_refused("from -1e300", "model.toml:1", [&] { expand("from = -1e300\nto = -1e300"); });
  expect_refused("too far", "model.toml:1", [&] { expand("from = 0\nto = 1e7"); });
  expect_refused("too many", "model.toml:1",
                 [&] { expand("from = 1\nto = 1000000", "a = 1\nb = 1\nc = 1\nd = 1\ne = 1\nf = [1, 2, 3]\n"); });
  expect_refused("too many together", "repeat", [&] {
    std::string more;
    for (int k = 0; k < 10; ++k)
      more += fmt::format("[[repeat]]\nfrom = 1\nto = 999999\n[repeat.bodies.\"c{}-{{i}}\"]\nmass = 1\n", k);
    expand("from = 1\nto = 2", more);
  });
  EXPECT_EQ(expand("from = 999999999999990\nto = 1e15"), 11U);
  const auto start = Clock::now();  // each name is looked up once, not beside all others
  EXPECT_EQ(expand("from = 1\nto = 50000"), 50000U);
  EXPECT_LT(std::chrono::duration<double>(Clock::now() - start).count(), 20);
}

/// Loads a model, which must be refused like the above, by its status.
void expect_model_refused(const std::string& text, const std::string& says, SimulationOptions options = {},
                          StatusCode code = StatusCode::invalid_input) {
  const long before = peak_kilobytes();
  const auto start = Clock::now();
  Simulation simulation(std::move(options));
  const Status status = simulation.load_text(text, "model.toml");
  EXPECT_EQ(static_cast<int>(status.code), static_cast<int>(code)) << status.message;
  EXPECT_NE(status.message.find(says), std::string::npos) << status.message;
  EXPECT_LT(status.message.size(), 2000U);
  EXPECT_LT(std::chrono::duration<double>(Clock::now() - start).count(), 10) << says;
  EXPECT_LT(peak_kilobytes() - before, 600000) << says;
}

/// Every whole number that says how much is made, one after the other.
TEST(ReaderLimits, NumbersThatTakeMemory) {
  const auto surface = [](const std::string& lines) { return kPendulum + "[surfaces.s]\nbody = \"ground\"\n" + lines; };
  const auto part = [](const std::string& mesh) {
    return kPendulum +
           "[bodies.part]\ntype = \"solid\"\nmaterial = { young = 1e9, poisson = 0.3, density = 1000 }\nmesh = { " +
           mesh + " }\n";
  };
  const std::string sprocket = "shape = \"sprocket\"\npitch = 1e-2\nroller_radius = 3e-3\nwidth = 1e-2\n";
  for (const char* many : {"10001", "2000000000"}) {
    const std::string number(many);
    expect_model_refused(surface(sprocket + "teeth = " + number + "\n"), "from 6 to 10000");
    expect_model_refused(surface("shape = \"line\"\nradius = 1\ndivisions = " + number + "\n"), "from 1 to 1000");
    expect_model_refused(part("part = \"tyre\", sectors = " + number + "0"), "sectors");
    expect_model_refused(part("part = \"spur-gear\", teeth = " + number + "0"), "teeth");
    expect_model_refused(part("part = \"bladed-rotor\", blades = " + number + "0"), "blades");
    expect_model_refused(kPendulum + "[forces.push]\ntype = \"load\"\na = { body = \"bob\" }\nforce = [1, 0, 0]\n" +
                             "[harmonic]\nfrom = 1\nto = 2\nloads = [\"push\"]\nphases = " + number + "\n",
                         "phases");
  }
  expect_model_refused(part("part = \"block\", divisions = [100000, 100000, 100000]"), "divisions");
  // Lengths that make far more elements than were wished for.
  for (const char* extreme : {"part = \"bladed-rotor\", shaft_length = 1e12", "part = \"chain-link\", pitch = 1e12",
                              "part = \"connecting-rod\", length = 1e15"}) {
    Simulation simulation{SimulationOptions{}};
    const long before = peak_kilobytes();
    const Status status = simulation.load_text(part(extreme), "model.toml");
    EXPECT_FALSE(status.ok()) << extreme;
    EXPECT_LT(peak_kilobytes() - before, 2000000) << extreme << ": " << status.message;
  }
}

/// Every length of every part next to nothing. Truth: a part, or an error that is the model's and not ours.
TEST(ReaderLimits, LengthsNextToNothing) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> parts = {
      {"block", {"lx", "ly", "lz"}},
      {"connecting-rod",
       {"length", "big_inner", "big_outer", "small_inner", "small_outer", "shank_big", "shank_small", "thickness"}},
      {"chain-link", {"pitch", "inner", "outer", "waist", "thickness"}},
      {"crank",
       {"throw_radius", "journal_radius", "pin_radius", "web_big", "web_small", "web_neck", "journal_length",
        "web_thickness", "pin_length"}},
      {"guide", {"lead", "radius", "angle", "height", "width"}},
      {"bladed-rotor",
       {"bore_radius", "shaft_radius", "disc_radius", "tip_radius", "shaft_length", "disc_thickness", "bearing_length",
        "disc_position", "blade_fraction"}},
      {"spur-gear", {"module", "pressure_angle", "width", "bore_radius"}},
      {"tyre", {"radius", "section_radius", "thickness", "opening"}}};
  for (const auto& [part, keys] : parts)
    for (const std::string& key : keys)
      for (const char* length : {"1e-12", "1e-300"}) {
        Simulation simulation{SimulationOptions{}};
        const std::string text = fmt::format(
            "{}[bodies.part]\ntype = \"solid\"\nmaterial = {{ young = 1e9, poisson = 0.3, density = 1000 }}\n"
            "mesh = {{ part = \"{}\", unknowns = 500, {} = {} }}\n",
            kPendulum, part, key, length);
        Status status;
        EXPECT_NO_THROW(status = simulation.load_text(text, "model.toml")) << part << ' ' << key << ' ' << length;
        if (status.code == StatusCode::invalid_input) {
          EXPECT_NE(status.message.find("bodies.part"), std::string::npos) << status.message;
        } else if (!status.ok()) {
          EXPECT_EQ(status.code, StatusCode::out_of_memory) << status.message;
          EXPECT_NE(status.message.find("mesher"), std::string::npos) << status.message;
        }
      }
}

/// Names with * in a contact. Truth: each is answered at once, with the letters that fit.
TEST(ReaderLimits, PatternsOfSurfaces) {
  const auto model = [](const std::string& name, const std::string& pattern) {
    return kPendulum + "[surfaces.\"" + name +
           "\"]\nbody = \"bob\"\nshape = \"sphere\"\nradius = 0.01\n[surfaces.floor]\nbody = \"ground\"\nshape = "
           "\"plane\"\npoint = [0, 0, -9]\nnormal = [0, 0, 1]\n[contacts.c]\nsurfaces = [\"" +
           pattern + "\", \"floor\"]\nstiffness = 1e3\n";
  };
  const std::string many_a(900, 'a');
  const auto fits = [&](const std::string& name, const std::string& pattern) {
    const auto start = Clock::now();
    Simulation simulation{SimulationOptions{}};
    const Status status = simulation.load_text(model(name, pattern), "model.toml");
    EXPECT_LT(std::chrono::duration<double>(Clock::now() - start).count(), 10);
    const bool refused = status.message.find("there is no surface") != std::string::npos;
    EXPECT_NE(status.ok(), refused) << status.message;
    EXPECT_LT(status.message.size(), 2000U);
    return status.ok();
  };
  for (const char* pattern : {"ball", "*", "b*", "*l", "*al*", "b*a*l*l", "**b**a**", "*b*a*l*l*"})
    EXPECT_TRUE(fits("ball", pattern)) << pattern;
  for (const char* pattern : {"bal", "balls", "*x*", "b*b", "*ba", "a*", "*l*l*l*", "l*", ""})
    EXPECT_FALSE(fits("ball", pattern)) << pattern;
  EXPECT_TRUE(fits("aab", "*ab"));     // the first a is none of the end
  EXPECT_TRUE(fits("aaab", "*a*ab"));  // likewise
  EXPECT_FALSE(fits("ab", "*a*ab"));
  EXPECT_TRUE(fits("ball", times(200000, "*")));
  EXPECT_FALSE(fits("ball", times(200000, "*") + "x"));
  EXPECT_FALSE(fits(many_a, times(200, "*a") + "b"));
  EXPECT_TRUE(fits(many_a + "b", times(200, "*a") + "b"));
  EXPECT_FALSE(fits("ball", times(200000, "?")));
}

/// Devices without an end.
TEST(ReaderLimits, FilesWithoutAnEnd) {
  SimulationOptions options;
  options.restart = "/dev/zero";
  expect_model_refused(kPendulum, "/dev/zero: this is not a restart file", options);
  options.restart = "/dev/urandom";
  expect_model_refused(kPendulum, "/dev/urandom: this is not a restart file", options);
  const long before = peak_kilobytes();
  EXPECT_EQ(static_cast<int>(Simulation{SimulationOptions{}}.load("/dev/zero").code),
            static_cast<int>(StatusCode::invalid_input));
  for (const char* kind : {"mesh = { file = \"/dev/zero\" }"})
    expect_model_refused(kPendulum +
                             "[bodies.part]\ntype = \"solid\"\nmaterial = { young = 1, poisson = 0, density = 1 }\n" +
                             kind + "\n",
                         "/dev/zero");
  EXPECT_LT(peak_kilobytes() - before, 600000);
}

/// A zero byte would cut the name for the system. Truth: refused, and nothing is written.
TEST(ReaderLimits, PathsWithAZeroByte) {
  const ScratchFolder scratch;
  const std::string cut = scratch.path() + "/cut", zero = cut + std::string("\0more", 5);
  const auto refused = [&](auto member) {
    SimulationOptions options;
    options.*member = zero;
    expect_model_refused(kPendulum, "zero byte", options);
  };
  refused(&SimulationOptions::out);
  refused(&SimulationOptions::dump);
  refused(&SimulationOptions::analyses);
  refused(&SimulationOptions::restart);
  EXPECT_EQ(static_cast<int>(Simulation{SimulationOptions{}}.load(zero).code),
            static_cast<int>(StatusCode::invalid_input));
  expect_model_refused(
      kPendulum +
          "[surfaces.s]\nbody = \"ground\"\nfile = \"/dev/null\\u0000x\"\nshape = \"mesh\"\n[surfaces.t]\nbody = "
          "\"bob\"\nshape = \"sphere\"\nradius = 1\n[contacts.c]\nsurfaces = [\"s\", \"t\"]\nstiffness = 1\n",
      "zero byte");
  EXPECT_FALSE(std::filesystem::exists(cut));
}

using ReaderLimitsMesh = MeshFiles;

constexpr const char* kTet = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=ALL\n1,1,2,3,4\n";

TEST_F(ReaderLimitsMesh, InpIncludes) {
  constexpr int kFiles = 15;
  std::string last;
  for (int k = kFiles; k >= 1; --k) {
    const std::string next = k == kFiles ? "*NODE\n" : times(10, fmt::format("*INCLUDE, INPUT=f{}.inp\n", k + 1));
    last = write(fmt::format("f{}.inp", k), next);
  }
  expect_refused("fifteen files", ".inp:", [&] { static_cast<void>(read_mesh(last)); });
  const std::string self = write("self.inp", "*INCLUDE, INPUT=self.inp\n*INCLUDE, INPUT=self.inp\n");
  expect_refused("itself", "self.inp:1", [&] { static_cast<void>(read_mesh(self)); });
}

TEST_F(ReaderLimitsMesh, InpSets) {
  const std::string tet(kTet);
  const auto refuse = [&](const char* name, const std::string& more, const std::string& says) {
    const std::string path = write("m.inp", tet + more);
    expect_refused(name, says, [&] { static_cast<void>(read_mesh(path)); });
  };
  refuse("2^31", "*NSET, NSET=S, GENERATE\n1, 2147483648\n", "m.inp:9");
  refuse("2^63", "*NSET, NSET=S, GENERATE\n1, 9223372036854775807, 1\n", "members");
  refuse("negative to positive", "*NSET, NSET=S, GENERATE\n-9223372036854775807, 9223372036854775807\n", "m.inp:9");
  refuse("elements", "*ELSET, ELSET=S, GENERATE\n1, 2147483648\n", "m.inp:9");
  EXPECT_TRUE(read_mesh(write("m.inp", tet + "*NSET, NSET=S, GENERATE\n5, 9223372036854775807, 9223372036854775806\n"))
                  .node_sets.empty());  // a step that overflows
  std::string nested = "*NSET, NSET=S0\n1,2,3,4\n";
  for (int k = 1; k <= 30; ++k) nested += fmt::format("*NSET, NSET=S{}\n", k) + times(10, fmt::format("S{},\n", k - 1));
  refuse("sets of sets", nested, "members");
  const Mesh mesh =
      read_mesh(write("good.inp", tet + "*NSET, NSET=S, GENERATE\n1, 4\n*NSET, NSET=ODD, GENERATE\n1,4,2\n"));
  EXPECT_EQ(mesh.node_set("S"), (std::vector<Index>{0, 1, 2, 3}));
  EXPECT_EQ(mesh.node_set("ODD"), (std::vector<Index>{0, 2}));
}

TEST_F(ReaderLimitsMesh, InpInstances) {
  std::string part = "*PART, NAME=P\n*NODE\n";
  for (int k = 1; k <= 20000; ++k) part += fmt::format("{},0,0,0\n", k);
  part += "*END PART\n";
  for (int k = 0; k < 20000; ++k) part += fmt::format("*INSTANCE, NAME=I{}, PART=P\n*END INSTANCE\n", k);
  const std::string path = write("m.inp", part);
  expect_refused("instances", "instances", [&] { static_cast<void>(read_mesh(path)); });
}

/// A circle, and a chain of systems each of which refers to the one before three times.
TEST_F(ReaderLimitsMesh, NastranSystems) {
  const auto file = [&](int depth, bool circle) {
    std::string text = "BEGIN BULK\n";
    for (int k = 1; k <= depth; ++k)
      text += fmt::format("CORD2R,{},{},0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n", k, k > 1 ? k - 1 : circle ? depth : 0);
    for (int k = 1; k <= 4; ++k)
      text += fmt::format("GRID,{},{},{}.,{}.,{}.\n", k, depth, k == 2 ? 1 : 0, k == 3 ? 1 : 0, k == 4 ? 1 : 0);
    return write("m.bdf", text + "CTETRA,1,1,1,2,3,4\nENDDATA\n");
  };
  const auto start = Clock::now();
  EXPECT_NEAR(mesh_volume(read_mesh(file(40, false))), 1.0 / 6, 1e-12);
  EXPECT_LT(std::chrono::duration<double>(Clock::now() - start).count(), 10);
  expect_refused("circle", "circle", [&] { static_cast<void>(read_mesh(file(3, true))); });
  expect_refused("deep", "64 deep", [&] { static_cast<void>(read_mesh(file(100000, false))); });
}

TEST_F(ReaderLimitsMesh, NastranRanges) {
  std::string text = "BEGIN BULK\n";
  for (int k = 1; k <= 3000; ++k) text += fmt::format("GRID,{},,{}.,0.,{}.\n", k, k % 10, k / 10);
  text += "CTETRA,1,1,1,2,11,4\n";
  for (int k = 0; k < 20000; ++k) text += "SPC1,7,123,1,THRU,3000\n";
  expect_refused("ranges", "SPC1", [&] { static_cast<void>(read_mesh(write("m.bdf", text))); });
}

/// Counts that the files cannot hold.
TEST_F(ReaderLimitsMesh, DeclaredCounts) {
  const std::string vtk = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n";
  for (const char* rest : {"POINTS 2000000000 double\n", "POINTS 9223372036854775807 double\n",
                           "CELLS 2000000000 2000000000\n", "CELLS 1 9223372036854775807\n", "CELL_TYPES 2000000000\n",
                           "CELL_DATA 2000000000\nSCALARS s int\nLOOKUP_TABLE d\n",
                           "CELL_DATA 4\nFIELD f 1\na 3000000000 3000000000 int\n"})
    expect_refused(rest, "m.vtk:", [&] { static_cast<void>(read_mesh(write("m.vtk", vtk + rest))); });
  for (const char* rest :
       {"$Nodes\n2000000000\n", "$Nodes\n1 2000000000 1 2\n0 1 0 2000000000\n", "$Elements\n2000000000\n",
        "$Elements\n1 2000000000 1 2\n2 1 2 2000000000\n", "$PhysicalNames\n2000000000\n",
        "$Entities\n2000000000 2000000000 2000000000 2000000000\n"}) {
    expect_refused(rest, "m.msh:", [&] {
      static_cast<void>(read_mesh(write("m.msh", std::string("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n") + rest)));
    });
    expect_refused(rest, "m.msh:", [&] {
      static_cast<void>(read_mesh(write("m.msh", std::string("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n") + rest)));
    });
  }
}

}  // namespace reader_limits_test
}  // namespace espalier::dynamics::test
