/// \file
/// The families of generated systems as group models. Young's modulus 1, Poisson's ratio 0.3, density 1; the stiffness
/// of every element is multiplied by a random factor in [0.7, 1.3).
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "espalier/matrix.hpp"
#include "matrix/generators/group_model.hpp"
#include "matrix/generators/hex8.hpp"
#include "matrix/generators/hex_grid.hpp"

namespace espalier::matrix {

/// What every family takes besides its sizes.
struct Randomness {
  std::uint64_t seed = 1;  ///< of the element factors
};

/// A box of nx x ny x nz elements of 1 x 1 x height, clamped at the face x = 0, whose nodes are left out:
/// n = 3 nx (ny + 1) (nz + 1). Height 1: 3-D elasticity; nz = 1 and height 0.3: thin plate. Positive definite.
std::unique_ptr<GroupModel> make_clamped_box(HexGrid grid, double height, Randomness random);
/// The same with elements of other shapes. @param stiffness one for all, or one for each y
std::unique_ptr<GroupModel> make_clamped_box(HexGrid grid, std::vector<HexStiffness> stiffness, Randomness random);

/// The consistent mass of the box of unit cubes, density 1, in the numbering of its stiffness. Positive definite.
std::unique_ptr<GroupModel> make_clamped_box_mass(HexGrid grid);

/// A cylindrical roof (as Scordelis and Lo's): nx elements along the axis, ny along an arc of 80 degrees, one element
/// of thickness 0.3; elements are 1 long on the middle surface in both directions, so the radius is ny / (80 pi / 180).
/// Clamped at the curved edge x = 0, the other edges free: n = 3 nx (ny + 1) 2. Positive definite.
std::unique_ptr<GroupModel> make_shell(Index nx, Index ny, Randomness random);

/// -Laplace by 7 points on nx x ny x nz inner nodes, zero outside: diagonal 6, neighbours -1; n = nx ny nz.
std::unique_ptr<GroupModel> make_poisson(Index nx, Index ny, Index nz);

/// The clamped box (unit cubes) plus 0.8 times the consistent mass between x and y: entry (x_a, y_b) += 0.8 m_ab and
/// (y_a, x_b) -= 0.8 m_ab, the gyroscopic matrix of a body that turns about z. Unsymmetric values, symmetric pattern.
std::unique_ptr<GroupModel> make_gyroscopic(HexGrid grid, Randomness random);

/// A chain of flexible bodies, each a free box of grid elements (unit cubes) with K + M/2 (K with the element factors,
/// M consistent), and 3 multipliers per joint that tie the averages of face displacements: joint 0 the face x = 0 of
/// body 0 to the ground, joint b the face x = nx of body b-1 (entries 1/nodes of the face) to the face x = 0 of body b
/// (-1/nodes). Groups: all nodes, body by body, then the joints.
/// n = bodies (3 (nx+1) (ny+1) (nz+1) + 3); inertia (n - 3 bodies, 3 bodies, 0).
std::unique_ptr<GroupModel> make_kkt_chain(Index bodies, HexGrid grid, Randomness random);

/// D A D with D = diag(2^k_i), k_i uniform in -20..20 (12 decades): exact in binary arithmetic, so that A and D A D
/// have the same inertia. `a` symmetric.
void scale_badly(SparseMatrix& a, std::uint64_t seed);

/// Appends `redundant` multiplier rows to a KKT matrix in lower storage whose last `constraints` rows are multipliers
/// without diagonal: each the combination w row_p + v row_q of two different constraint rows, with w and v out of
/// +-{1/2, 1, 2}. Rows of the chain's constraints do not overlap, so the combinations are exact and the matrix has
/// exactly `redundant` more zero eigenvalues. @pre constraints >= 2
SparseMatrix append_redundant_rows(const SparseMatrix& a, Index constraints, Index redundant, std::uint64_t seed);

}  // namespace espalier::matrix
