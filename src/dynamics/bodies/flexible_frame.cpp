#include "dynamics/bodies/flexible_frame.hpp"

#include <fmt/format.h>

#include <map>
#include <stdexcept>

#include "dense/dense.hpp"
#include "dynamics/bodies/rotation.hpp"
#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics {
namespace {

Mat3 g_of(const Mat3& u) { return u.trace() * Mat3::Identity() - u; }

Vec3 reference_of(const FlexibleBody& body, Index vertex) {
  return Eigen::Map<const Vec3>(body.reference().data() + 3 * vertex);
}

/// w_a force + by_arm B_a for each vertex, from `out` on. @return the end of it
double* write_forces(const std::vector<FrameVertex>& vertices, const Vec3& force, const Mat3& by_arm, double* out) {
  // Numbers of their own, not parts of matrices that `out` could be a part of: they stay in registers.
  const double f0 = force[0], f1 = force[1], f2 = force[2];
  const double m00 = by_arm(0, 0), m01 = by_arm(0, 1), m02 = by_arm(0, 2);
  const double m10 = by_arm(1, 0), m11 = by_arm(1, 1), m12 = by_arm(1, 2);
  const double m20 = by_arm(2, 0), m21 = by_arm(2, 1), m22 = by_arm(2, 2);
  for (const FrameVertex& a : vertices) {
    const double w = a.weight, x = a.arm[0], y = a.arm[1], z = a.arm[2];
    out[0] = w * f0 + (m00 * x + m01 * y + m02 * z);
    out[1] = w * f1 + (m10 * x + m11 * y + m12 * z);
    out[2] = w * f2 + (m20 * x + m21 * y + m22 * z);
    out += 3;
  }
  return out;
}

/// Area of one face in the reference state.
double face_area(const FlexibleBody& body, ElementType type, const std::vector<Index>& nodes) {
  double area = 0;
  for (const QuadraturePoint& point : face_quadrature(type)) {
    double dn[2 * kMaxElementNodes];
    shape_gradients(type, point.xi.data(), dn);
    Vec3 g1 = Vec3::Zero(), g2 = Vec3::Zero();
    for (std::size_t a = 0; a < nodes.size(); ++a) {
      g1 += dn[a] * reference_of(body, nodes[a]);
      g2 += dn[nodes.size() + a] * reference_of(body, nodes[a]);
    }
    area += point.weight * g1.cross(g2).norm();
  }
  return area;
}

}  // namespace

FlexibleFrame::FlexibleFrame(const FlexibleBody& body, std::vector<FrameVertex> vertices, const Mat3& axes)
    : body_(body), vertices_(std::move(vertices)), axes_(axes) {
  Mat3 a = Mat3::Zero();
  double arms = 0;
  for (const FrameVertex& vertex : vertices_) {
    a += reference_of(body, vertex.vertex) * vertex.arm.transpose();
    arms += vertex.arm.norm();
  }
  has_rotation_ = arms > 0;
  if (!has_rotation_) return;
  const Vec3 s = dense::nearest_rotation(a).values;
  if (!(s[1] > 1e-9 * s[0]))  // far above round-off, far below any face that could carry a moment
    throw std::invalid_argument(
        fmt::format("frame on '{}': its nodes lie on a line, so they have no rotation about it", body.name()));
}

std::span<const Index> FlexibleFrame::coordinates() const {
  if (coordinates_.empty())
    for (const FrameVertex& vertex : vertices_)
      for (Index i = 0; i < 3; ++i) coordinates_.push_back(body_.coordinate(vertex.vertex) + i);
  return coordinates_;
}

Vec3 FlexibleFrame::at(ConstSpan values, Index first, Index vertex) const {
  return Eigen::Map<const Vec3>(values.data() + first + 3 * vertex);
}

FlexibleFrame::Fit FlexibleFrame::fit(ConstSpan q) const {
  Mat3 a = Mat3::Zero();
  for (const FrameVertex& vertex : vertices_) a += at(q, body_.placement().q, vertex.vertex) * vertex.arm.transpose();
  Fit result;
  result.rotation = dense::nearest_rotation(a).rotation;
  result.stretch = result.rotation.transpose() * a;
  result.inverse_g = g_of(result.stretch).inverse();
  return result;
}

// On a frame without rotation moments do nothing.
FlexibleFrame::Fit FlexibleFrame::fit_or_none(ConstSpan q) const {
  return has_rotation_ ? fit(q) : Fit{Mat3::Identity(), Mat3::Identity(), Mat3::Zero()};
}

Mat3 FlexibleFrame::Fit::force_of(const Vec3& moment) const {
  return rotation * skew(inverse_g.transpose() * (rotation.transpose() * moment));
}

FlexibleFrame::Derivative FlexibleFrame::Fit::derivative(const FrameVertex& b, int j) const {
  const Vec3 turned = rotation.row(j).transpose();  // R^T e_j
  const Vec3 phi = inverse_g * b.arm.cross(turned);
  return {phi, turned * b.arm.transpose() - skew(phi) * stretch};
}

FlexibleFrame::Turning FlexibleFrame::turning(const Fit& f, ConstSpan v) const {
  Vec3 spin = Vec3::Zero();
  Mat3 rate = Mat3::Zero();
  for (const FrameVertex& vertex : vertices_) {
    const Vec3 turned = f.rotation.transpose() * at(v, body_.placement().v, vertex.vertex);
    spin += vertex.arm.cross(turned);
    rate += turned * vertex.arm.transpose();
  }
  return {f.inverse_g * spin, rate};
}

void FlexibleFrame::motion(ConstSpan q, ConstSpan v, FrameMotion& out) const {
  out = FrameMotion{};
  for (const FrameVertex& vertex : vertices_) {
    out.r += vertex.weight * at(q, body_.placement().q, vertex.vertex);
    if (!v.empty()) out.vel += vertex.weight * at(v, body_.placement().v, vertex.vertex);
  }
  if (!has_rotation_) return;
  const Fit f = fit(q);
  out.rot = f.rotation * axes_;
  if (v.empty()) return;
  const auto [omega, rate] = turning(f, v);
  // G omega' = d/dt(sum B x R^T v) - G' omega with a = 0; U' = R^T A' - [omega] U
  const Mat3 stretch_rate = rate - skew(omega) * f.stretch;
  Vec3 right = -g_of(stretch_rate) * omega;
  for (const FrameVertex& vertex : vertices_)
    right -= vertex.arm.cross(omega.cross(f.rotation.transpose() * at(v, body_.placement().v, vertex.vertex)));
  out.omega = f.rotation * omega;
  out.bias_alpha = f.rotation * (f.inverse_g * right);
}

void FlexibleFrame::jacobian(ConstSpan q, double* j) const {
  const auto n = static_cast<Eigen::Index>(3 * vertices_.size());
  Eigen::Map<Eigen::Matrix<double, 6, Eigen::Dynamic>> result(j, 6, n);
  result.setZero();
  const Fit f = fit_or_none(q);
  const Mat3 left = f.rotation * f.inverse_g, right = f.rotation.transpose();
  Eigen::Index column = 0;
  for (const FrameVertex& vertex : vertices_) {
    result.block<3, 3>(0, column) = vertex.weight * Mat3::Identity();
    result.block<3, 3>(3, column) = left * (skew(vertex.arm) * right);
    column += 3;
  }
}

void FlexibleFrame::project(ConstSpan q, const FrameMotion& /*motion*/, const double* c, int count, double* out) const {
  const Fit f = fit_or_none(q);
  for (int r = 0; r < count; ++r, c += 6) {
    const Eigen::Map<const Vec6> wrench(c);
    out = write_forces(vertices_, wrench.head<3>(), f.force_of(wrench.tail<3>()), out);
  }
}

/// The velocity of the origin has a constant J. omega = R w, G w = sum B x t with t = R^T v; for dx_b = e_j:
/// d omega = R (phi x w + dw), G dw = -sum B x (phi x t) - dG w, and sum B x (phi x t) = (tr T) phi - T phi with
/// T = sum t B^T.
void FlexibleFrame::rate_jacobian(ConstSpan q, ConstSpan v, double* jv) const {
  const auto n = static_cast<Eigen::Index>(3 * vertices_.size());
  Eigen::Map<Eigen::Matrix<double, 6, Eigen::Dynamic>> result(jv, 6, n);
  result.setZero();
  if (!has_rotation_) return;
  const Fit f = fit(q);
  const auto [omega, rate] = turning(f, v);
  Eigen::Index column = 0;
  for (const FrameVertex& b : vertices_)
    for (int j = 0; j < 3; ++j, ++column) {
      const auto [phi, d_stretch] = f.derivative(b, j);
      const Vec3 d_omega = f.inverse_g * (-g_of(rate) * phi - g_of(d_stretch) * omega);
      result.block<3, 1>(3, column) = f.rotation * (phi.cross(omega) + d_omega);
    }
}

/// J^T [0; m] has the vertex forces R (c x B_a), G c = R^T m; here they are differentiated for dx_b = e_j:
/// phi x (c x B) + dc x B is one matrix times B.
Mat3 FlexibleFrame::Fit::change_of_force(const FrameVertex& b, int j, const Vec3& moment, const Vec3& c) const {
  const auto [phi, d_stretch] = derivative(b, j);
  const Vec3 dc = inverse_g * (-phi.cross(moment) - g_of(d_stretch) * c);
  return rotation * (skew(phi) * skew(c) + skew(dc));
}

void FlexibleFrame::wrench_stiffness(ConstSpan q, const Vec6& wrench, double scale, double* k) const {
  if (!has_rotation_) return;
  const auto n = static_cast<Eigen::Index>(3 * vertices_.size());
  Eigen::Map<Eigen::MatrixXd> result(k, n, n);
  const Fit f = fit(q);
  const Vec3 moment = f.rotation.transpose() * wrench.tail<3>();
  const Vec3 c = f.inverse_g * moment;
  Eigen::Index column = 0;
  for (const FrameVertex& b : vertices_)
    for (int j = 0; j < 3; ++j, ++column) {
      const Mat3 force = scale * f.change_of_force(b, j, moment, c);
      Eigen::Index row = 0;
      for (const FrameVertex& a : vertices_) {
        result.block<3, 1>(row, column).noalias() += force * a.arm;
        row += 3;
      }
    }
}

/// In a column the force on vertex a is w_a times a force plus one matrix times B_a: of C, and of the wrench.
void FlexibleFrame::tangent_columns(ConstSpan q, const TangentColumns& columns, double* out) const {
  const Fit f = fit_or_none(q);
  const Vec3 moment = f.rotation.transpose() * columns.wrench.tail<3>(), c = f.inverse_g * moment;
  const bool turned = has_rotation_ && !moment.isZero(0);
  for (std::size_t k = 0; k < columns.count; ++k) {
    const Eigen::Map<const Vec6> of_c(columns.c + 6 * k);
    Mat3 by_arm = f.force_of(of_c.tail<3>());
    const std::size_t coordinate = columns.first + k;
    if (turned) by_arm += f.change_of_force(vertices_[coordinate / 3], static_cast<int>(coordinate % 3), moment, c);
    out = write_forces(vertices_, of_c.head<3>(), by_arm, out);
  }
}

std::unique_ptr<FlexibleFrame> make_node_frame(const FlexibleBody& body, Index node) {
  return std::make_unique<FlexibleFrame>(body,
                                         std::vector<FrameVertex>{{node * body.vertices_per_node(), 1, Vec3::Zero()}});
}

std::unique_ptr<FlexibleFrame> make_face_frame(const FlexibleBody& body, const Mesh& mesh,
                                               std::span<const MeshFace> faces, const Mat3& axes) {
  if (faces.empty() || body.vertices_per_node() != 1)
    throw std::invalid_argument(fmt::format("face frame on '{}': needs faces of a solid body", body.name()));
  std::map<Index, double> weights;
  double total = 0;
  for (const MeshFace& face : faces) {
    const auto nodes = mesh.face_nodes(face);
    const auto& shape = shape_of(mesh.type(face.element)).faces[at(face.face)];
    const double area = face_area(body, shape.type, nodes);
    total += area;
    for (const Index n : nodes) weights[n] += area / static_cast<double>(nodes.size());
  }
  Vec3 centre = Vec3::Zero();
  for (const auto& [node, weight] : weights) centre += weight / total * reference_of(body, node);
  std::vector<FrameVertex> vertices;
  for (const auto& [node, weight] : weights)
    vertices.push_back({node, weight / total, weight / total * (reference_of(body, node) - centre)});
  return std::make_unique<FlexibleFrame>(body, std::move(vertices), axes);
}

std::unique_ptr<FlexibleFrame> make_beam_frame(const FlexibleBody& body, Index node, const Mat3& axes) {
  if (body.vertices_per_node() != 4)
    throw std::invalid_argument(fmt::format("beam frame on '{}': it is not a beam body", body.name()));
  const Index first = 4 * node;
  return std::make_unique<FlexibleFrame>(body,
                                         std::vector<FrameVertex>{{first, 1, Vec3::Zero()},
                                                                  {first + 2, 0, reference_of(body, first + 2)},
                                                                  {first + 3, 0, reference_of(body, first + 3)}},
                                         axes);
}

}  // namespace espalier::dynamics
