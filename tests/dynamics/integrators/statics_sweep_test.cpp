// Statics of many models that nobody chose by hand: random cantilevers, the models of models/, meshes of other people.
// Truth: an equilibrium that is reported is one: reactions and loads add up to zero, forces and moments.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdlib>
#include <random>

#include "dynamics/mesh/read.hpp"
#include "dynamics/model/model_common.hpp"
#include "places.hpp"

namespace espalier::dynamics {
namespace {

using Vec3 = Eigen::Vector3d;

std::string list(const Vec3& x) { return fmt::format("[{}, {}, {}]", x.x(), x.y(), x.z()); }

/// A cantilever along x with a load on its end.
struct Cantilever {
  std::string text;
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
};

/// One of four kinds of body, slenderness 5 to 100, a force of up to 10 EI / L^2 (where a cantilever is bent far
/// round) and, where the end has axes, a moment of up to 2 EI / L.
Cantilever random_cantilever(unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> normal;
  const int kind = static_cast<int>(seed % 4);
  const double young = std::pow(10, 6 + 6 * uniform(engine)), length = std::pow(10, -2 + 3 * uniform(engine));
  const double thickness = length / std::pow(10, 0.7 + 1.3 * uniform(engine)),
               width = thickness * (1 + uniform(engine));
  const double ei = young * width * std::pow(thickness, 3) / 12;
  const auto direction = [&] { return Vec3(normal(engine), normal(engine), normal(engine)).normalized(); };
  Cantilever c;
  c.force = 10 * uniform(engine) * ei / (length * length) * direction();
  if (kind != 0) c.moment = 2 * uniform(engine) * ei / length * direction();
  const std::string material = fmt::format("material = {{ young = {}, poisson = 0.3, density = 1000 }}", young);
  const int elements = 3 + static_cast<int>(6 * uniform(engine));
  std::string wall = "node = 1", end = "node = -1";
  c.text = "[bodies.arm]\n";
  if (kind == 0) {
    c.text += fmt::format(
        "type = \"cable\"\nstart = [0, 0, 0]\nend = [{}, 0, 0]\nelements = {}\naxial = {}\nbending = "
        "{}\nmass_per_length = {}\n",
        length, elements, young * width * thickness, ei, 1000 * width * thickness);
  } else if (kind == 1) {
    c.text += fmt::format(
        "type = \"beam\"\nstart = [0, 0, 0]\nend = [{}, 0, 0]\nelements = {}\nheight = {}\nwidth = {}\n{}\n", length,
        elements, thickness, width, material);
  } else {
    c.text += fmt::format(
        "type = \"solid\"\nmesh = {{ part = \"block\", lx = {}, ly = {}, lz = {}, divisions = [{}, 1, 1], "
        "element = \"{}\" }}\n{}\n",
        length, width, thickness, elements, kind == 2 ? "hex8" : "hex20", material);
    wall = "face = \"x0\"", end = "face = \"x1\"";
  }
  c.text += fmt::format("[markers.end]\nbody = \"arm\"\n{}\n", end);
  if (kind == 0) {  // a cable's node has no axes: the first element is held at both ends
    c.text += fmt::format(
        "[joints.wall]\ntype = \"spherical\"\na = {{ body = \"ground\" }}\nb = {{ body = \"arm\", {} }}\n"
        "[joints.second]\ntype = \"spherical\"\na = {{ body = \"ground\", point = [{}, 0, 0] }}\n"
        "b = {{ body = \"arm\", node = 2 }}\n",
        wall, length / elements);
  } else {
    c.text += fmt::format(
        "[joints.wall]\ntype = \"fixed\"\na = {{ body = \"ground\" }}\nb = {{ body = \"arm\", {} }}\n", wall);
  }
  c.text += fmt::format("[forces.load]\ntype = \"load\"\na = \"end\"\nforce = {}\nmoment = {}\n[statics]\n",
                        list(c.force), list(c.moment));
  return c;
}

Vec3 vector_of(const Simulation& s, const std::string& name) {
  return {s.value(name + ".x"), s.value(name + ".y"), s.value(name + ".z")};
}

TEST(StaticsSweep, RandomCantileversAreSolvedOrTheirLimitPointsReported) {
  int solved = 0, limits = 0;
  for (unsigned seed = 1; seed <= 100; ++seed) {
    const Cantilever c = random_cantilever(seed);
    Simulation s;
    Status status = s.load_text(c.text, "model.toml");
    if (status.ok()) status = s.run();
    if (!status.ok()) {
      EXPECT_NE(status.message.find("limit point"), std::string::npos) << "seed " << seed << ": " << status.message;
      ++limits;
      continue;
    }
    ++solved;
    const bool cable = seed % 4 == 0;
    const Vec3 reaction = vector_of(s, "wall.force") + (cable ? vector_of(s, "second.force") : Vec3(0, 0, 0));
    EXPECT_LT((reaction + c.force).norm(), 1e-5 * c.force.norm() + 1e-5 * reaction.norm()) << "seed " << seed;
    if (cable) continue;
    // About the origin of the joint's frame on the arm, which is held at the ground's origin.
    const Vec3 moments = vector_of(s, "wall.moment") + c.moment + vector_of(s, "end.position").cross(c.force);
    EXPECT_LT(moments.norm(), 1e-5 * (vector_of(s, "wall.moment").norm() + c.moment.norm())) << "seed " << seed;
  }
  EXPECT_EQ(solved + limits, 100);
  RecordProperty("solved", solved);
}

TEST(StaticsSweep, ModelsOfTheRepositoryUnderGravityAndTenTimesIt) {
  const std::filesystem::path models = espalier::test::source_folder() / "models";
  for (const char* name : {"chain", "engine", "rotor"})
    for (const double times : {1.0, 10.0}) {
      SimulationOptions options;
      options.set = {fmt::format("gravity=[0, {}, 0]", -9.81 * times), "initial.statics=true", "integrator.end=1e-9"};
      Simulation s(options);
      const Status status = s.load((models / (std::string(name) + ".toml")).string());
      EXPECT_TRUE(status.ok() || status.message.find("limit point") != std::string::npos)
          << name << " under " << times << " g: " << status.message;
    }
}

// The models of other people's meshes, as they stand: rotors turn freely in their bearings. With ESPALIER_ALL_MESHES=1
// the large ones too (minutes).
TEST(StaticsSweep, ModelsOfRealMeshesUnderGravityAndTenTimesIt) {
  if (!std::filesystem::exists(espalier::test::shared_data() / "mesh"))
    GTEST_SKIP() << espalier::test::shared_data() / "mesh"
                 << " is not there";
  const std::filesystem::path models = espalier::test::source_folder() / "models" / "real";
  const bool all = std::getenv("ESPALIER_ALL_MESHES") != nullptr;
  for (const char* name : {"engine", "rotor", "wheelset", "slot", "tyre"}) {
    if (!all && name != std::string("engine") && name != std::string("rotor")) continue;
    for (const double times : {1.0, 10.0}) {
      SimulationOptions options;
      const double inch = name == std::string("slot") ? 1 / 0.0254 : 1;  // its unit of length
      options.set = {fmt::format("gravity=[0, {}, 0]", -9.81 * inch * times), "initial.statics=true",
                     "initial.velocities=project", "integrator.end=1e-9"};
      Simulation s(options);
      const Status status = s.load((models / (std::string(name) + ".toml")).string());
      EXPECT_TRUE(status.ok() || status.message.find("limit point") != std::string::npos)
          << name << " under " << times << " g: " << status.message;
      if (all) fmt::print("{} {} g: {}\n", name, times, status.ok() ? "solved" : status.message);
    }
  }
}

/// Three nodes far apart from each other.
std::array<std::int64_t, 3> supports(const Mesh& mesh) {
  std::size_t first = 0, second = 0, third = 0;
  const auto at = [&](std::size_t k) { return Vec3(mesh.nodes[k][0], mesh.nodes[k][1], mesh.nodes[k][2]); };
  const auto farthest = [&](const auto& distance) {
    std::size_t best = 0;
    for (std::size_t k = 0; k < mesh.nodes.size(); ++k)
      if (distance(at(k)) > distance(at(best))) best = k;
    return best;
  };
  first = farthest([](const Vec3& x) { return -x.sum(); });
  second = farthest([&](const Vec3& x) { return (x - at(first)).norm(); });
  const Vec3 line = (at(second) - at(first)).normalized();
  third = farthest([&](const Vec3& x) { return line.cross(x - at(first)).norm(); });
  return {mesh.node_label(static_cast<Index>(first)), mesh.node_label(static_cast<Index>(second)),
          mesh.node_label(static_cast<Index>(third))};
}

/// Steel in the units of the file, gravity along z; held at three nodes.
std::string resting(const std::string& file, const Mesh& mesh, double gravity) {
  std::string text = fmt::format(R"(gravity = [0, 0, {}]
[bodies.part]
type = "solid"
mesh = {{ file = "{}" }}
material = {{ young = 2.1e11, poisson = 0.3, density = 7850 }}
[statics]
)",
                                 -gravity, file);
  const auto nodes = supports(mesh);
  for (std::size_t k = 0; k < 3; ++k)
    text += fmt::format(
        "[joints.support{}]\ntype = \"spherical\"\na = {{ body = \"ground\" }}\nb = {{ body = \"part\", node = "
        "{} }}\n",
        k, nodes[k]);
  return text;
}

// All meshes of one kind of solid that the readers know. With ESPALIER_ALL_MESHES=1 those above 100 kB too (minutes).
TEST(StaticsSweep, MeshesOfOtherPeopleUnderGravityAndTenTimesIt) {
  const std::filesystem::path folder = espalier::test::shared_data() / "mesh";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const bool all = std::getenv("ESPALIER_ALL_MESHES") != nullptr;
  int tried = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (!all && entry.file_size() > 100000) continue;
    Mesh mesh;
    try {
      mesh = read_mesh(entry.path().string());
      mesh.drop_unused_nodes();
    } catch (const std::exception&) {
      continue;  // of a format, or of elements, that are not simulated
    }
    for (const double times : {1.0, 10.0}) {
      Simulation s;
      Status status = s.load_text(resting(entry.path().string(), mesh, 9.81 * times), "model.toml");
      if (status.code == StatusCode::invalid_input) break;  // shells, inverted elements: not simulated
      if (status.ok()) status = s.run();
      ++tried;
      const auto says = [&](const char* words) { return status.message.find(words) != std::string::npos; };
      EXPECT_TRUE(status.ok() || says("limit point") ||
                  (mesh.pieces({}).size() > 1 && says("pieces that share no node")))
          << entry.path().filename() << " under " << times << " g: " << status.message;
      if (all)
        fmt::print("{} {} g: {} steps, {}\n", entry.path().filename().string(), times, s.summary().steps,
                   status.ok() ? "solved" : status.message);
    }
  }
  EXPECT_GT(tried, 10);
}

}  // namespace
}  // namespace espalier::dynamics
