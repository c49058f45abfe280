#include "dynamics/substructure/substructure.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "dynamics/bodies/rotation.hpp"

namespace espalier::dynamics {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRigid = 1e-5;      // what rigid motion may strain, of what its displacements would by themselves
constexpr double kIsotropic = 1e-5;  // how far the mass may differ by direction, relative
constexpr double kMassless = 1e-13;  // smallest inertia of a motion, relative, unknowns scaled to equal inertia
constexpr double kLoose = 1e-10;     // square of a frequency over the largest one: nothing holds it

/// The points that stand for the nodes. They have a mass, as bodies ask for one, that nothing uses.
class PointGroup final : public ElementGroup {
 public:
  explicit PointGroup(Index count) {
    for (Index k = 0; k < count; ++k) vertices_.push_back(k);
  }
  [[nodiscard]] Index count() const override { return static_cast<Index>(vertices_.size()); }
  [[nodiscard]] int vertices_per_element() const override { return 1; }
  [[nodiscard]] std::span<const Index> vertices(Index e) const override { return {&vertices_[at(e)], 1}; }
  [[nodiscard]] bool evaluate(Index, const ElementInput&, ElementOutput& out) const override {
    std::fill_n(out.force, 3, 0.0);
    if (out.tangent != nullptr) std::fill_n(out.tangent, 9, 0.0);
    out.energy = 0;
    return true;
  }
  void mass(Index, const double*, double* m) const override { *m = 1; }

 private:
  std::vector<Index> vertices_;
};

std::unique_ptr<NodalBody> points_of(const Substructure& s) {
  std::vector<double> reference;
  for (const SubstructureNode& node : s.nodes) {
    reference.insert(reference.end(), node.position.data(), node.position.data() + 3);
    const Mat3 axes = Mat3::Identity();
    reference.insert(reference.end(), axes.data(), axes.data() + 9);
  }
  std::vector<std::unique_ptr<ElementGroup>> groups;
  groups.push_back(std::make_unique<PointGroup>(static_cast<Index>(reference.size() / 3)));
  return std::make_unique<NodalBody>(
      std::make_unique<FlexibleBody>(s.name, 4, std::move(reference), std::move(groups)));
}

/// The matrices, their rigid motions, and what follows from both.
class Reducer {
 public:
  explicit Reducer(const Substructure& s) : s_(s), mass_(s.mass), stiffness_(s.stiffness), size_(mass_.rows()) {
    for (const SubstructureNode& node : s.nodes) nodal_ += node.components;
    for (Eigen::Index k = 0; k < size_; ++k)
      if (!(mass_(k, k) > 0)) fail(fmt::format("row {} of the mass matrix has no inertia ({:g})", k + 1, mass_(k, k)));
    find_rigid_motions();
    find_mass();
  }

  SubstructureBody reduce(const ReductionOptions& options) {
    find_shapes(options);
    SubstructureBody body;
    body.points = points_of(s_);
    body.shapes.centre = centre_;
    body.shapes.mass = VectorXd::Constant(x_.cols(), body_mass_);
    body.shapes.stiffness = body_mass_ * squares_;
    body.shapes.shapes = shapes_of_points();
    body.shapes.from_interfaces = std::max<Index>(0, static_cast<Index>(x_.cols() - (size_ - nodal_)));
    body.inertia = inertia();
    return body;
  }

 private:
  /// Columns: displacement along x, y, z, rotation about them through `origin`; of the nodes' unknowns.
  [[nodiscard]] MatrixXd nodal_motions(const Vec3& origin) const {
    MatrixXd t = MatrixXd::Zero(nodal_, 6);
    Eigen::Index row = 0;
    for (const SubstructureNode& node : s_.nodes) {
      t.block<3, 3>(row, 0).setIdentity();
      t.block<3, 3>(row, 3) = -skew(node.position - origin);
      if (node.components == 6) t.block<3, 3>(row + 3, 3).setIdentity();
      row += node.components;
    }
    return t;
  }

  void find_rigid_motions() {
    const Eigen::Index scalars = size_ - nodal_;
    MatrixXd t(size_, 6);
    t.topRows(nodal_) = nodal_motions(Vec3::Zero());
    if (scalars > 0) {
      MatrixXd by_scalars = dense::times(stiffness_.bottomLeftCorner(scalars, nodal_), t.topRows(nodal_));
      if (!dense::solve_definite(stiffness_.bottomRightCorner(scalars, scalars), by_scalars))
        fail("the stiffness of its scalars (unknowns of no listed node) is not positive definite");
      t.bottomRows(scalars) = -by_scalars;
    }
    // Each motion alone; a rotation is measured about a point of the body.
    const Vec3 middle = s_.nodes.front().position;
    for (int i = 0; i < 6; ++i) {
      VectorXd motion = t.col(i);
      if (i >= 3) motion -= t.leftCols<3>() * Vec3(Vec3::Unit(i - 3).cross(middle));
      const VectorXd force = stiffness_ * motion,
                     own = stiffness_.diagonal().cwiseAbs().cwiseProduct(motion.cwiseAbs());
      if (force.cwiseAbs().maxCoeff() > kRigid * own.maxCoeff())
        fail(
            fmt::format("its stiffness resists {} {} (a force of {:g} where {:g} hold it in balance); a substructure "
                        "must be free, and the places, order and units of its nodes those of the matrices",
                        i < 3 ? "displacement along" : "rotation about", "xyz"[i % 3], force.cwiseAbs().maxCoeff(),
                        own.maxCoeff()));
    }
    motions_ = std::move(t);
  }

  void find_mass() {
    const Eigen::Matrix<double, 6, 6> gram = dense::times(dense::transposed_times(motions_, mass_), motions_);
    const Mat3 total = gram.topLeftCorner<3, 3>();
    body_mass_ = total.trace() / 3;
    if (!(body_mass_ > 0) || (total - body_mass_ * Mat3::Identity()).cwiseAbs().maxCoeff() > kIsotropic * body_mass_)
      fail(fmt::format("its mass differs by direction: {:g}, {:g}, {:g} along x, y, z, {:g} between them", total(0, 0),
                       total(1, 1), total(2, 2), (total - Mat3(total.diagonal().asDiagonal())).cwiseAbs().maxCoeff()));
    const Mat3 moment = gram.topRightCorner<3, 3>() / body_mass_;  // -skew(centre)
    centre_ = 0.5 * Vec3(moment(1, 2) - moment(2, 1), moment(2, 0) - moment(0, 2), moment(0, 1) - moment(1, 0));
    // Rotations about the centre of mass: those about the origin, moved back.
    motions_.rightCols<3>() -= motions_.leftCols<3>() * (-skew(centre_));
    const MatrixXd turns = motions_.rightCols<3>();
    inertia_ = dense::times(dense::transposed_times(turns, mass_), turns);
    inertia_ = 0.5 * (inertia_ + inertia_.transpose().eval());
    const Vec3 principal = dense::principal_values(inertia_);
    if (!(principal[0] > 1e-10 * principal[2])) fail("it has no inertia about an axis");
  }

  void find_shapes(const ReductionOptions& options) {
    const VectorXd scale = mass_.diagonal().cwiseSqrt().cwiseInverse();  // unknowns of equal inertia
    const MatrixXd rows = dense::times(scale.asDiagonal() * mass_, motions_);
    const MatrixXd basis = dense::qr_factors(rows).q;
    const MatrixXd beside = scale.asDiagonal() * basis.rightCols(size_ - 6);  // no share in rigid motion
    const MatrixXd m = dense::times(dense::transposed_times(beside, mass_), beside),
                   k = dense::times(dense::transposed_times(beside, stiffness_), beside);
    if (m.rows() == 0) return x_.resize(size_, 0), squares_.resize(0), void();
    const VectorXd masses = dense::symmetric_eigenvalues(0.5 * (m + m.transpose()));
    if (!(masses[0] > kMassless * masses[m.rows() - 1]))
      fail(fmt::format("its mass matrix gives {} motions no inertia or a negative one (least {:g} of the largest)",
                       (masses.array() <= kMassless * masses[m.rows() - 1]).count(), masses[0] / masses[m.rows() - 1]));
    const dense::Spectrum eigen = dense::symmetric_eigen(0.5 * (k + k.transpose()), 0.5 * (m + m.transpose()));
    const VectorXd& squares = eigen.values;
    if (!(squares[0] > kLoose * squares[squares.size() - 1]))
      fail(
          fmt::format("it has motions without stiffness beside the six rigid ones (square of a frequency {:g}, largest "
                      "{:g}): pieces that do not hold together, or nodes that are not listed",
                      squares[0], squares[squares.size() - 1]));
    Eigen::Index kept = squares.size();
    if (std::isfinite(options.modes)) kept = std::min(kept, static_cast<Eigen::Index>(options.modes));
    const double bound = std::pow(2 * std::numbers::pi * options.frequency, 2);
    while (kept > 0 && squares[kept - 1] > bound) --kept;
    squares_ = squares.head(kept);
    x_ = std::sqrt(body_mass_) * dense::times(beside, eigen.vectors.leftCols(kept));
    for (Eigen::Index c = 0; c < kept; ++c) {  // the sign: the largest part, counted in energy, is positive
      Eigen::Index largest = 0;
      x_.col(c).cwiseQuotient(scale).cwiseAbs().maxCoeff(&largest);
      if (x_(largest, c) < 0) x_.col(c) *= -1;
    }
  }

  /// Displacements of the points and of their axes.
  [[nodiscard]] MatrixXd shapes_of_points() const {
    MatrixXd out = MatrixXd::Zero(static_cast<Eigen::Index>(12 * s_.nodes.size()), x_.cols());
    Eigen::Index row = 0, point = 0;
    for (const SubstructureNode& node : s_.nodes) {
      out.middleRows<3>(point) = x_.middleRows<3>(row);
      for (int axis = 0; axis < 3 && node.components == 6; ++axis)  // theta x e
        out.middleRows<3>(point + 3 + 3 * axis) = -skew(Vec3::Unit(axis)) * x_.middleRows<3>(row + 3);
      row += node.components;
      point += 12;
    }
    return out;
  }

  /// Each node's displacement and rotation times e_i from the left.
  [[nodiscard]] MatrixXd turned(int i, const MatrixXd& x) const {
    MatrixXd out = MatrixXd::Zero(x.rows(), x.cols());
    for (Eigen::Index row = 0; row < nodal_; row += 3)
      out.middleRows<3>(row) = skew(Vec3::Unit(i)) * x.middleRows<3>(row);
    return out;
  }

  [[nodiscard]] ReducedInertia inertia() const {
    const auto outer_of = [](const Mat3& w, const Vec3& c) {
      return Mat3(0.5 * w.trace() * Mat3::Identity() - 0.5 * (w + w.transpose()) - 0.5 * skew(c));
    };
    const Eigen::Index n = x_.cols();
    ReducedInertia out;
    out.mass = body_mass_;
    out.rest = outer_of(inertia_, Vec3::Zero());
    out.first.resize(9 * n);
    out.pairs.resize(9 * n, n);
    std::array<MatrixXd, 3> b, mb;
    std::array<MatrixXd, 3> with_shapes, at_rest;
    std::array<std::array<MatrixXd, 3>, 3> with_each;
    for (int i = 0; i < 3; ++i) {
      b.at(i) = turned(i, x_);
      mb.at(i) = dense::times(mass_, b.at(i));
      with_shapes.at(i) = dense::transposed_times(mb.at(i), x_);  // C_i(k, l)
      at_rest.at(i) =
          dense::transposed_times(mb.at(i), motions_.rightCols<3>());  // W(i, j) of shape k and rest in (k, j)
    }
    // The share of e_i x phi_k in the shapes is made antisymmetric, in W as in C: kinetic energy stays positive.
    std::array<MatrixXd, 3> turning;
    for (int i = 0; i < 3; ++i) turning.at(i) = 0.5 * (with_shapes.at(i) - with_shapes.at(i).transpose());
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        with_each.at(i).at(j) = dense::transposed_times(b.at(i), mb.at(j)) +
                                (dense::times(turning.at(i), turning.at(j).transpose()) -
                                 dense::times(with_shapes.at(i), with_shapes.at(j).transpose())) /
                                    body_mass_;
    for (Eigen::Index k = 0; k < n; ++k) {
      Mat3 w;
      for (int i = 0; i < 3; ++i) w.row(i) = at_rest.at(i).row(k);
      Eigen::Map<Mat3>(out.first.data() + 9 * k) = outer_of(w, Vec3::Zero());
      for (Eigen::Index l = 0; l < n; ++l) {
        Vec3 c;
        for (int i = 0; i < 3; ++i) {
          c[i] = turning.at(i)(k, l);
          for (int j = 0; j < 3; ++j) w(i, j) = with_each.at(i).at(j)(k, l);
        }
        Eigen::Map<Mat3>(out.pairs.col(l).data() + 9 * k) = outer_of(w, c);
      }
    }
    return out;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(StatusCode::invalid_input, fmt::format("substructure '{}': {}", s_.name, what));
  }

  const Substructure& s_;
  const MatrixXd &mass_, &stiffness_;
  Eigen::Index size_, nodal_ = 0;
  MatrixXd motions_;  // rigid: three displacements, three rotations about the centre of mass
  double body_mass_ = 0;
  Vec3 centre_ = Vec3::Zero();
  Mat3 inertia_ = Mat3::Zero();
  MatrixXd x_;        // shapes in the unknowns of the matrices, x^T M x = body_mass_
  VectorXd squares_;  // of their angular frequencies
};

}  // namespace

SubstructureBody make_substructure(const Substructure& substructure, const ReductionOptions& options) {
  return Reducer(substructure).reduce(options);
}

}  // namespace espalier::dynamics
