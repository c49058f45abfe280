/// \file
/// Flexible bodies of which only reduced mass and stiffness matrices are known: substructures (superelements) that
/// another program has made, in a floating frame of reference.
#pragma once

#include "dynamics/bodies/reduced_inertia.hpp"
#include "dynamics/substructure/matrix_file.hpp"

namespace espalier::dynamics {

/// A node of a substructure.
struct SubstructureNode {
  std::int64_t label = 0;
  Vec3 position = Vec3::Zero();
  int components = 0;  ///< 6: displacement and rotation, 3: displacement alone; 0: as the matrices' labels say, or 6
};

/// Mass and stiffness of one, symmetric. Their unknowns: the components of each node, then scalars (amplitudes of
/// modes, and what is not listed as a node).
struct Substructure {
  std::string name;
  std::vector<SubstructureNode> nodes;
  Eigen::MatrixXd mass, stiffness;
};

/// Puts the matrices of files in order. Labels say which rows belong to which node. Without labels the rows stand in
/// the order of `nodes`, their components together, and scalars follow. Of a symmetric matrix either triangle or both
/// may be given.
/// @throws Error(invalid_input) naming the body, and the matrix, node and component
[[nodiscard]] Substructure arrange(std::string name, const FileMatrix& mass, const FileMatrix& stiffness,
                                   std::vector<SubstructureNode> nodes);

/// What a reduced body is made of.
struct SubstructureBody {
  /// The nodes as a body of points, four vertices each (the place, and three axes that the node's rotation turns),
  /// without mass or stiffness of its own: what frames, pictures and sensors hold on to.
  std::unique_ptr<NodalBody> points;
  ReducedBasis shapes;  ///< of the points; the amplitude is the root mean square of the displacement of the mass
  ReducedInertia inertia;
};

/// Shapes and inertia of a free substructure.
///
/// K must not resist rigid motion: six motions T follow from the places of the nodes, for scalars from K T = 0. Mass,
/// centre and moments of inertia are T^T M T. The shapes are the eigenvectors of K and M beside T.
///
/// How inertia changes with strain asks for fields such as e_i x phi_k, which matrices do not tell. As in the
/// superelements of M. Geradin and A. Cardona ("Flexible Multibody Dynamics", 2001, chapter 6) they are interpolated by
/// the substructure itself: displacement and rotation of each node are turned, scalars are left out. With b_ik the
/// vector of e_i x phi_k, W_kl(i, j) = b_ik^T M b_jl and C_ikl = b_ik^T M phi_l, sum m_ab phi_ak phi_bl^T is
/// tr(W_kl) / 2 I - sym(W_kl) - skew(C_kl) / 2. C is made antisymmetric in k and l, as it is for true fields, and W
/// with it, so that no motion has a negative kinetic energy. Exact where the mass stands at the nodes, and the better
/// the more nodes there are. Energy and momentum are conserved in any case.
///
/// @param options `modes` shapes are kept, or those below `frequency`; by default all
/// @throws Error(invalid_input) naming the body: matrices that are not symmetric, K that resists rigid motion or has
/// motions without stiffness beside it, M that gives unknowns no inertia
[[nodiscard]] SubstructureBody make_substructure(const Substructure& substructure, const ReductionOptions& options);

}  // namespace espalier::dynamics
