#include "dynamics/bodies/reduced_inertia.hpp"

#include "base/at.hpp"

namespace espalier::dynamics {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Component i of the columns of x, which hold three numbers for every vertex.
auto component(const MatrixXd& x, Eigen::Index i) {
  using Stride = Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>;
  return Eigen::Map<const MatrixXd, 0, Stride>(x.data() + i, x.rows() / 3, x.cols(), Stride(x.rows(), 3));
}

MatrixXd mass_times(const FlexibleBody& body, const MatrixXd& x) {
  const VertexPattern& p = body.assembly().pattern();
  MatrixXd y = MatrixXd::Zero(x.rows(), x.cols());
  for (Eigen::Index c = 0; c < x.cols(); ++c)
    for (Index b = 0; b < body.vertices(); ++b)
      for (Offset e = p.ptr[at(b)]; e < p.ptr[at(b) + 1]; ++e)
        y.col(c).segment<3>(3 * b) += body.mass()[at(e)] * x.col(c).segment<3>(3 * p.ind[at(e)]);
  return y;
}

}  // namespace

ReducedInertia inertia_of_mesh(const FlexibleBody& body, const ReducedBasis& shapes) {
  ReducedInertia out;
  out.mass = body.mass_properties(body.reference(), {}).mass;
  MatrixXd rest = Eigen::Map<const MatrixXd>(body.reference().data(), 3 * body.vertices(), 1);
  for (Index v = 0; v < body.vertices(); v += body.vertices_per_node()) rest.block<3, 1>(3 * v, 0) -= shapes.centre;
  const MatrixXd m_rest = mass_times(body, rest), m_shapes = mass_times(body, shapes.shapes);
  const Eigen::Index n = shapes.mass.size();
  out.first.resize(9 * n);
  out.pairs.resize(9 * n, n);
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i) {
      out.rest(i, j) = component(rest, i).col(0).dot(component(m_rest, j).col(0));
      if (n == 0) continue;
      const VectorXd d = component(shapes.shapes, i).transpose() * component(m_rest, j);
      const MatrixXd u = component(shapes.shapes, i).transpose() * component(m_shapes, j);
      for (Eigen::Index k = 0; k < n; ++k) {
        out.first[9 * k + 3 * j + i] = d[k];
        out.pairs.row(9 * k + 3 * j + i) = u.row(k);
      }
    }
  return out;
}

}  // namespace espalier::dynamics
