// Couplings in the mean whose nodes have weights of their own. Truth: the forces that a force F and a moment M at the
// reference node make at the nodes, f_k = w_k F / W + w_k (J^-1 (M + (x - m) x F)) x (x_k - m), with the mean m, the
// sum W of the weights and J = sum w_k (|r_k|^2 - r_k r_k^T) (MSC Nastran, Quick Reference Guide, RBE3), put there one
// by one; and the motion of the reference node, which is the dual of that.
#include <gtest/gtest.h>

#include <map>

#include "dynamics/mesh/deck_bar.hpp"

namespace espalier::dynamics {
namespace deck_couplings_test {

using test::kBar;
using test::kClamp;
using test::kStatic;

struct Weighed {
  std::map<int, Vec3> places;
  std::map<int, double> weights;
  [[nodiscard]] double sum() const {
    double all = 0;
    for (const auto& [node, w] : weights) all += w;
    return all;
  }
  [[nodiscard]] Vec3 mean(const std::map<int, Vec3>& of) const {
    Vec3 m = Vec3::Zero();
    for (const auto& [node, w] : weights) m += w / sum() * of.at(node);
    return m;
  }
  [[nodiscard]] Mat3 inertia() const {
    Mat3 j = Mat3::Zero();
    for (const auto& [node, w] : weights) {
      const Vec3 r = places.at(node) - mean(places);
      j += w * (r.squaredNorm() * Mat3::Identity() - r * r.transpose());
    }
    return j;
  }
  [[nodiscard]] std::map<int, Vec3> forces(const Vec3& at, const Vec3& force, const Vec3& moment) const {
    const Vec3 m = mean(places), turn = inertia().inverse() * (moment + (at - m).cross(force));
    std::map<int, Vec3> out;
    for (const auto& [node, w] : weights) out[node] = w / sum() * force + w * turn.cross(places.at(node) - m);
    return out;
  }
  /// The motion of the reference node, linear in the displacements of the nodes.
  [[nodiscard]] Vec3 motion(const Vec3& at, const std::map<int, Vec3>& moved) const {
    Vec3 spin = Vec3::Zero();
    for (const auto& [node, w] : weights) spin += w * (places.at(node) - mean(places)).cross(moved.at(node));
    return mean(moved) + Vec3(inertia().inverse() * spin).cross(at - mean(places));
  }
};

class DeckCouplings : public test::DeckBar {
 protected:
  const std::map<int, Vec3> corners_ = {{3, {2, 0, 0}}, {13, {2, 1, 0}}, {23, {2, 0, 1}}, {33, {2, 1, 1}}};
  static constexpr int kSome[] = {2, 12, 22, 32, 3, 13, 23, 33};

  static std::string list(const std::map<int, Vec3>& forces) {
    std::string text = "*CLOAD\n";
    for (const auto& [node, f] : forces)
      for (int d = 0; d < 3; ++d) text += fmt::format("{}, {}, {:.17g}\n", node, d + 1, f[d]);
    return text;
  }
  std::map<int, Vec3> all_moved(const Simulation& s, const char* file = "bar.inp") const {
    Mesh mesh = read_mesh((folder_ / file).string());
    mesh.drop_unused_nodes();
    const SimulationFrame frame = s.frame();
    std::map<int, Vec3> out;
    for (std::size_t k = 0; k < mesh.node_labels.size(); ++k)
      out[static_cast<int>(mesh.node_labels[k])] = Eigen::Map<const Vec3>(frame.displacement.data() + 3 * k);
    return out;
  }
  static void expect_same(const std::map<int, Vec3>& a, const std::map<int, Vec3>& b) {
    for (const int n : kSome) EXPECT_LT((a.at(n) - b.at(n)).norm(), 1e-13 + 1e-9 * b.at(3).norm()) << n;
  }
  static Vec3 place(const Simulation& s) {
    return {s.value("part_coupling_1.position.x"), s.value("part_coupling_1.position.y"),
            s.value("part_coupling_1.position.z")};
  }
};

/// The same bar for Nastran; the mesh is read by its ending.
const std::string kBulk =
    "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,2.,0.,0.\nGRID,11,,0.,1.,0.\nGRID,12,,1.,1.,0.\nGRID,13,,2.,1.,0.\n"
    "GRID,21,,0.,0.,1.\nGRID,22,,1.,0.,1.\nGRID,23,,2.,0.,1.\nGRID,31,,0.,1.,1.\nGRID,32,,1.,1.,1.\nGRID,33,,2.,1.,1.\n"
    "CHEXA,1,7,1,2,12,11,21,22\n+,32,31\nCHEXA,2,7,2,3,13,12,22,23\n+,33,32\nPSOLID,7,1\nMAT1,1,1000.,,0.,2.\n"
    "SPC1,1,123,1,11,21,31\n";

TEST_F(DeckCouplings, Rbe3WithWeights) {
  const Vec3 at(2.7, 0.1, 0.9), force(0.03, -0.02, 0.05), moment(0.02, 0.04, -0.01);
  const Weighed truth{corners_, {{3, 1}, {13, 2.5}, {23, 2.5}, {33, 0.75}}};
  const std::string rbe3 = "GRID,99,,2.7,.1,.9\nRBE3,90,,99,123456,1.,123,3,2.5\n+,123,13,23,.5,123,33,.25,123\n+,33\n";
  const auto run_nastran = [&](const std::string& bulk) {
    Simulation s;
    Status status = s.load(write("bar.bdf", "SOL 101\nCEND\nSPC=1\nLOAD=2\nBEGIN BULK\n" + kBulk + bulk + "ENDDATA\n"));
    if (status.ok()) status = s.run();
    EXPECT_TRUE(status.ok()) << status.message;
    return s;
  };
  const Simulation s = run_nastran(rbe3 + "FORCE,2,99,,1.,.03,-.02,.05\nMOMENT,2,99,,1.,.02,.04,-.01\n");
  // Nastran's hexahedra are taken as those with modes of their own.
  std::string bar = kBar;
  bar.replace(bar.find("TYPE=C3D8,"), 10, "TYPE=C3D8I,");
  const Simulation one_by_one = run(bar + kClamp + kStatic + list(truth.forces(at, force, moment)));
  const std::map<int, Vec3> a = all_moved(s, "bar.bdf"), b = all_moved(one_by_one);
  EXPECT_GT(b.at(3).norm(), 1e-3);
  expect_same(a, b);
  EXPECT_LT((place(s) - at - truth.motion(at, b)).norm(), 1e-9 * b.at(3).norm());
  // The same load in a system with x along y, and along the directions of a cylinder whose axis is 1 away along -x.
  const Simulation turned =
      run_nastran(rbe3 +
                  "CORD2R,5,,0.,0.,0.,0.,0.,1.,+\n+,0.,1.,0.\nCORD2C,6,,1.7,.1,0.,1.7,.1,1.,+\n+,1.7,1.1,0.\n"
                  "FORCE,2,99,5,1.,-.02,-.03,.05\nMOMENT,2,99,6,1.,.02,.04,-.01\n");
  expect_same(all_moved(turned, "bar.bdf"), b);
  // Its weights are seen: with equal ones it is another motion.
  const Simulation even = run_nastran(
      "GRID,99,,2.7,.1,.9\nRBE3,90,,99,123456,1.,123,3,13\n+,23,33\nFORCE,2,99,,1.,.03,"
      "-.02,.05\nMOMENT,2,99,,1.,.02,.04,-.01\n");
  EXPECT_GT((all_moved(even, "bar.bdf").at(13) - b.at(13)).norm(), 1e-2 * b.at(13).norm());
  // Held at its reference node: the mean motion vanishes there.
  const Simulation held = run_nastran(rbe3 + "SPC1,1,123,99\nFORCE,2,3,,1.,0.,.3,0.\n");
  const std::map<int, Vec3> moved_ends = all_moved(held, "bar.bdf");
  EXPECT_GT(moved_ends.at(3).norm(), 1e-5);
  EXPECT_LT(truth.motion(at, moved_ends).norm(), 1e-9 * moved_ends.at(3).norm());
}

TEST_F(DeckCouplings, WhatIsSaidOfRbe3) {
  const auto load = [&](const std::string& rbe3) {
    Simulation s;
    Status status = s.load(write("bar.bdf", "SOL 101\nCEND\nSPC=1\nLOAD=2\nBEGIN BULK\n" + kBulk +
                                                "GRID,99,,2.,.5,.5\n" + rbe3 + "FORCE,2,99,,1.,0.,0.,1.\nENDDATA\n"));
    if (status.ok()) status = s.run();
    std::string all = status.message;
    for (const std::string& notice : s.summary().notices) all += notice + "\n";
    return all;
  };
  EXPECT_NE(load("RBE3,90,,99,123,1.,123456,3,13\n+,23,33\n").find("rotations of its grid points"), std::string::npos);
  EXPECT_NE(load("RBE3,90,,99,123,1.,123,3,-2.\n+,123,13,23,33\n").find("the weight -2 is negative"),
            std::string::npos);
  EXPECT_NE(load("RBE3,90,,99,123,1.,12,3,2.\n+,123,13,23,33\n").find("RBE3 of some directions"), std::string::npos);
  EXPECT_NE(load("RBE3,90,,99,123,0.,123,3,13\n+,23,33\n").find("couples no grid points"), std::string::npos);
}

// CalculiX's old kind: the displacement of the reference is the weighted mean, wherever it lies.
TEST_F(DeckCouplings, DistributingCoupling) {
  const Weighed truth{corners_, {{3, 1}, {13, 3}, {23, 0.5}, {33, 1.5}}};
  const std::string coupling =
      "*NODE\n99,7.,8.,9.\n*ELEMENT, TYPE=DCOUP3D, ELSET=E1\n77, 99\n*DISTRIBUTING COUPLING, ELSET=E1\n3, 1.\n13, "
      "3.\n23, 0.5\n33, 1.5\n1, 0.\n";
  const Vec3 force(0.03, -0.02, 0.05);
  std::map<int, Vec3> forces;
  for (const auto& [node, w] : truth.weights) forces[node] = w / truth.sum() * force;
  const Simulation s = run(kBar + coupling + kClamp + kStatic + "*CLOAD\n99, 1, .03\n99, 2, -.02\n99, 3, .05\n");
  const bool said = std::any_of(s.summary().notices.begin(), s.summary().notices.end(), [](const std::string& n) {
    return n.find("*DISTRIBUTING COUPLING is taken as CalculiX takes it") != std::string::npos;
  });
  EXPECT_TRUE(said);
  const std::map<int, Vec3> a = all_moved(s);
  const Simulation one_by_one = run(kBar + kClamp + kStatic + list(forces));
  expect_same(a, all_moved(one_by_one));
  // Led by 1e-3 along y: the mean moves so, by forces in the shares of the weights.
  const Simulation led = run(kBar + coupling + kClamp + "*BOUNDARY\n99, 2, 2, 1e-3\n" + kStatic);
  const std::map<int, Vec3> b = all_moved(led);
  EXPECT_LT(std::abs(truth.mean(b).y() - 1e-3), 1e-15);
  const double push = led.value("part_joint_1.force.y");
  for (auto& [node, f] : forces) f = Vec3(0, truth.weights.at(node) / truth.sum() * std::abs(push), 0);
  expect_same(b, all_moved(run(kBar + kClamp + kStatic + list(forces))));
  refused(kBar + coupling + kClamp + kStatic + "*CLOAD\n99, 4, 1.\n",
          {"a moment acts on node 99, which does not turn"});
  refused(kBar + coupling + "*DISTRIBUTING COUPLING, ELSET=NONE\n3, 1.\n" + kClamp + kStatic, {"no element DCOUP3D"});
  refused(kBar + "*NODE\n99,7.,8.,9.\n*ELEMENT, TYPE=DCOUP3D, ELSET=E1\n77, 99\n" + kClamp + kStatic,
          {"elements DCOUP3D (1)"});
  const std::string surface =
      "*NODE\n99,2.,.5,.5\n*SURFACE, NAME=END\n2, S4\n*COUPLING, REF NODE=99, SURFACE=END, "
      "CONSTRAINT NAME=C\n*DISTRIBUTING, WEIGHTING METHOD=LINEAR\n1, 6\n";
  refused(kBar + surface + kClamp + kStatic, {"*DISTRIBUTING WEIGHTINGMETHOD=LINEAR"});
}

TEST_F(DeckCouplings, WeightsOfAMarker) {
  const auto model = [&](const std::string& keys) {
    write("bar.inp", kBar);
    Simulation s;
    Status status = s.load_text(
        "bodies.part = { type = \"solid\", mesh = { file = \"bar.inp\" }, hex8 = \"full\" }\nmarkers.end = { body = "
        "\"part\", " +
            keys +
            " }\nsupports.clamp = { body = \"part\", nodes = \"X0\", hold = \"all\" }\nforces.push = { type = "
            "\"load\", "
            "a = \"end\", force = [0.03, 0.0, 0.0] }\nstatics.linear = true\noutput.quantities = [\"end.position\"]\n",
        (folder_ / "model.toml").string());
    if (status.ok()) status = s.run();
    return std::pair(status, std::move(s));
  };
  const auto [status, s] = model("nodes = [3, 13, 23, 33, 13], weights = [1, 1, 2, 4, 2]");
  ASSERT_TRUE(status.ok()) << status.message;
  std::map<int, Vec3> forces;
  for (const auto& [node, w] : std::map<int, double>{{3, 1}, {13, 3}, {23, 2}, {33, 4}})
    forces[node] = Vec3(0.003 * w, 0, 0);
  const std::map<int, Vec3> a = all_moved(s);
  expect_same(a, all_moved(run(kBar + kClamp + kStatic + list(forces))));
  for (const auto& [keys, says] :
       {std::pair("nodes = [3, 13], weights = [1]", "needs one number for each node of"),
        std::pair("nodes = \"X2\", weights = [1]", "needs one number for each node of"),
        std::pair("nodes = [3, 13], weights = [1, 0]", "must all be greater than 0"),
        std::pair("nodes = [3, 13, 23], weights = [1, 1, 2], attach = \"rigid\"", "are of the mean of nodes")})
    EXPECT_NE(model(keys).first.message.find(says), std::string::npos) << model(keys).first.message;
}

}  // namespace deck_couplings_test
}  // namespace espalier::dynamics
