/// \file
/// A point of one face next to another face: gap, and its derivatives.
#pragma once

#include "dynamics/contact/face_surface.hpp"
#include "dynamics/contact/law.hpp"

namespace espalier::dynamics::contact {

using Mat3X = Eigen::Matrix<double, 3, Eigen::Dynamic>;
using VecX = Eigen::VectorXd;
using MatX = Eigen::MatrixXd;

/// A place on a face of a surface.
struct FaceSpot {
  Index face = -1;
  std::array<double, 2> xi{};
};

/// Gap between a point x of the first face (at a fixed place of its material) and the point of the second face on whose
/// normal it lies. Derivatives by the positions of all nodes, those of the first face before those of the second.
/// g n = x - y(xi), n normal to the second face, out of it (Wriggers, Computational Contact Mechanics (2006), 6.2):
///   dg = n . (dx - dy),  m_ab dxi^b - g k_ab dxi^b = t_a . (dx - dy) + g n . dt_a,
///   d^2 g = -(t^a . (dx - dy)) (n . dt_a + k_ab dxi^b) - (n . dt_a) dxi^a
/// with t_a = y,a, m_ab = t_a . t_b, k_ab = n . y,ab and dt_a = y,a of the displacements. Of a line as the second one
/// the same holds with one tangent t. Its normal is free to turn about it: with g = |x - y|, less the radius, and b = n
/// x t / |t|, dn has the part b (b . (dx - dy)) / |x - y| as well, and d^2 g the square (b . (dx - dy))^2 / |x - y|.
class FaceTouch {
 public:
  FaceTouch(const FacePlace& point, int point_nodes, const SurfaceFace& second, const std::array<double, 2>& xi);

  [[nodiscard]] double gap() const { return gap_; }
  [[nodiscard]] const Vec3& normal() const { return normal_; }
  [[nodiscard]] const FacePlace& opposite() const { return opposite_; }
  [[nodiscard]] int coordinates() const { return 3 * (first_ + second_); }

  /// @pre the other functions are called behind it
  void differentiate();
  [[nodiscard]] const VecX& gap_by() const { return gap_by_; }
  [[nodiscard]] MatX gap_by_twice() const;
  [[nodiscard]] Mat3X normal_by() const;
  /// The derivative of dx - dy, at the place that the projection has.
  [[nodiscard]] Mat3X slip_by() const;
  /// The derivative of the point's distance from the place opposite, x - y(xi), which moves on.
  [[nodiscard]] Mat3X lever_by() const;
  /// The derivative of y,1 at a place that stays, and at the one that moves on.
  [[nodiscard]] Mat3X slope_by() const;
  [[nodiscard]] Mat3X tangent_by() const;
  /// Adds -y(xi)'s derivative by xi alone, with w_a the fields of y,a (positions, velocities), to `out`.
  void add_shift(const std::array<Vec3, 2>& w, double factor, Mat3X& out) const;
  /// f = [N_1 T; -N_2 T], the coordinates' share of a force T on the point and -T opposite to it.
  [[nodiscard]] VecX share(const Vec3& force) const;
  /// The derivative of share(T) with T held.
  [[nodiscard]] MatX share_by(const Vec3& force) const;
  /// How xi moves.
  [[nodiscard]] const std::array<VecX, 2>& place_by() const { return place_by_; }

 private:
  const FacePlace& point_;
  const SurfaceFace& face_;
  std::array<double, 2> xi_;
  int first_, second_;
  int tangents_;  // of the second face: 2, of a line 1
  FacePlace opposite_;
  Vec3 normal_;
  double distance_, gap_;          // from the face, or the axis of a line; without its radius
  Vec3 across_ = Vec3::Zero();     // b of a line
  VecX sideways_;                  // b . (dx - dy)
  Eigen::Matrix2d bend_, raised_;  // k_ab; inverse of m_ab
  VecX gap_by_;
  std::array<VecX, 2> along_, turn_, place_by_, bent_;  // t_a . (dx - dy), n . dt_a, dxi^a, n . dt_a + k_ab dxi^b
};

}  // namespace espalier::dynamics::contact
