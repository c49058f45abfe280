/// \file
/// A flexible body of a model as reduced matrices for other programs, by Craig and Bampton's method.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "espalier/dynamics.hpp"

namespace espalier {

/// What is to be reduced, and to what.
struct ReducedMatricesOptions {
  std::string body;  ///< flexible; may be empty where the model has one alone
  /// Frames on the body: names of [markers], or frames of joints and forces ("hinge.b"). Empty: all frames of joints
  /// and forces on the body.
  std::vector<std::string> interfaces;
  int modes = -1;               ///< kept with the interfaces at rest; -1: as `reduce` of the body says, or 20
  double frequency = 0;         ///< Hz; > 0: only modes below it
  std::int64_t first_node = 1;  ///< number of the first interface; the others and the scalars follow
};

/// A place where other programs hold on to the body.
struct ReducedInterface {
  std::string name;
  std::int64_t node = 0;             ///< its number in the files
  std::array<double, 3> position{};  ///< in the axes of the mesh, in which all matrices are
  int components = 6;                ///< three displacements, or these and three rotations
  Index first = 0;                   ///< row of its first component, from 0
};

/// x = shapes q, with q the components of the interfaces, one after the other, and then amplitudes of modes.
struct ReducedMatrices {
  Status status;
  std::string body, units;  ///< units as the model states them, or ""
  std::vector<ReducedInterface> interfaces;
  std::int64_t first_scalar = 0;                 ///< number of the first mode in the files
  std::vector<double> frequencies;               ///< of the modes with the interfaces at rest, Hz
  Index size = 0;                                ///< rows of the matrices
  std::vector<double> stiffness, mass, damping;  ///< size x size, symmetric; damping is empty where there is none
  std::array<double, 3> position{};              ///< where the model puts the origin of the mesh
  std::array<double, 9> rotation{};              ///< and how it turns it: global = rotation mesh, row by row
  double total_mass = 0;
  std::array<double, 3> centre{};      ///< of mass
  std::vector<std::int64_t> nodes;     ///< labels of the nodes of the mesh
  int vectors_per_node = 1;            ///< 1: displacement; 2: and a change of direction (shells, cables); 4: beams
  std::vector<double> node_positions;  ///< 3 for each node
  std::vector<double> shapes;          ///< 3 vectors_per_node nodes rows, size columns, column by column
  std::vector<std::string> notices;
};

[[nodiscard]] ReducedMatrices reduced_matrices(const std::string& path, const ReducedMatricesOptions& what,
                                               const SimulationOptions& options = {});
/// The same of a text, with a name for messages.
[[nodiscard]] ReducedMatrices reduced_matrices_of_text(const std::string& text, const std::string& name,
                                                       const ReducedMatricesOptions& what,
                                                       const SimulationOptions& options = {});

/// Which files are written. Each holds stiffness, mass, and damping where there is some.
struct ReducedFiles {
  bool op4 = false;       ///< STEM.op4: OUTPUT4 of Nastran, binary, with the shapes
  bool op4_text = false;  ///< STEM_text.op4: the same as text with all digits
  bool dmig = false;      ///< STEM.bdf: DMIG cards with GRID and SPOINT
  bool mtx = false;       ///< STEM_k.mtx, STEM_m.mtx, STEM_c.mtx: Matrix Market
  bool npz = false;       ///< STEM.npz: NumPy, with shapes and the nodes of the mesh
};

/// Writes the files and STEM.json, which says what each row of the matrices is. @return the names of all, in order
/// @throws Error(invalid_input) for a folder that is not there, a full disk, ...
std::vector<std::string> write_reduced_matrices(const ReducedMatrices& matrices, const std::string& stem,
                                                const ReducedFiles& files);

}  // namespace espalier
