/// \file
/// A bar as a deck of Abaqus or CalculiX, and what runs it.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/mesh/mesh_files.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics::test {

/// A bar of two cubes along x, Young's modulus 1000, no Poisson's ratio, density 2. Nodes 1 to 3 along x, 11 beside
/// them in y, 21 above; the ends are X0 (1, 11, 21, 31) and X2 (3, 13, 23, 33).
inline const std::string kBar =
    "*NODE\n1,0,0,0\n3,2,0,0\n*NGEN, NSET=EDGE\n1,3\n*NCOPY, CHANGE NUMBER=10, OLD SET=EDGE, NEW SET=SIDE, SHIFT\n"
    "0,1,0\n0,0,0, 0,0,1, 0\n*NSET, NSET=LOWER\nEDGE, SIDE\n*NCOPY, CHANGE NUMBER=20, OLD SET=LOWER, SHIFT\n0,0,1\n"
    "0,0,0, 0,0,1, 0\n*ELEMENT, TYPE=C3D8, ELSET=BAR\n1, 1,2,12,11, 21,22,32,31\n2, 2,3,13,12, 22,23,33,32\n"
    "*NSET, NSET=X0\n1,11,21,31\n*NSET, NSET=X2\n3,13,23,33\n"
    "*MATERIAL, NAME=M\n*ELASTIC\n1000., 0.\n*DENSITY\n2.\n*SOLID SECTION, ELSET=BAR, MATERIAL=M\n";
inline const std::string kClamp = "*BOUNDARY\nX0, 1, 3\n";
inline const std::string kStatic = "*STEP\n*STATIC\n";

class DeckBar : public MeshFiles {
 protected:
  /// Runs a deck as it is.
  Simulation run(const std::string& deck) {
    Simulation s;
    Status status = s.load(write("bar.inp", deck));
    if (status.ok()) status = s.run();
    EXPECT_TRUE(status.ok()) << status.message << "\n" << deck;
    return s;
  }
  /// Displacement of a node of the last deck that was written.
  Vec3 moved(const Simulation& s, int label) const {
    Mesh mesh = read_mesh((folder_ / "bar.inp").string());
    mesh.drop_unused_nodes();
    const auto at = std::find(mesh.node_labels.begin(), mesh.node_labels.end(), label) - mesh.node_labels.begin();
    const SimulationFrame frame = s.frame();
    return Eigen::Map<const Vec3>(frame.displacement.data() + 3 * at);
  }
  void refused(const std::string& deck, const std::vector<std::string>& says) {
    Simulation s;
    const Status status = s.load(write("bar.inp", deck));
    ASSERT_FALSE(status.ok()) << deck;
    for (const std::string& part : says)
      EXPECT_NE(status.message.find(part), std::string::npos) << status.message << "\n" << deck;
  }
};

}  // namespace espalier::dynamics::test
