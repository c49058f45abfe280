#include "dynamics/bodies/modal_damping.hpp"

#include <algorithm>
#include <cmath>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "dynamics/bodies/rotation.hpp"

namespace espalier::dynamics {
namespace {

/// Elastic forces of shapes in one body: K_b phi, from its own part of W.
Eigen::MatrixXd elastic_forces(AssembledSystem& system, Component& body, const State& state,
                               const Eigen::MatrixXd& shapes) {
  const SparsePattern& p = system.tangent_pattern();
  std::vector<double> values(at(p.nonzeros()));
  State rest = state;
  std::fill(rest.v.begin(), rest.v.end(), 0.0);
  std::fill(rest.a.begin(), rest.a.end(), 0.0);
  body.tangent(rest.view(), {0, 0, 1}, values);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(shapes.rows(), shapes.cols());
  const Index first = body.placement().v, count = body.sizes().velocity;
  for (Index j = first; j < first + count; ++j)
    for (Offset k = p.ptr[at(j)]; k < p.ptr[at(j) + 1]; ++k)
      if (values[at(k)] != 0) out.row(p.ind[at(k)]) += values[at(k)] * shapes.row(j);
  return out;
}

/// Takes from forces on nodes what rounding has left of a resultant: stiff sections make it as large as the forces of
/// slow modes. @param x  the body's configuration
void balance(const double* x, int vertices_per_node, Eigen::Ref<Eigen::MatrixXd> forces) {
  Eigen::MatrixXd rigid = Eigen::MatrixXd::Zero(forces.rows(), 6);
  for (Eigen::Index k = 0; 3 * k < forces.rows(); ++k) {
    if (k % vertices_per_node == 0) rigid.block<3, 3>(3 * k, 0).setIdentity();
    rigid.block<3, 3>(3 * k, 3) = -skew(Eigen::Map<const Vec3>(x + 3 * k));
  }
  const dense::QrFactors qr = dense::qr_factors(rigid);
  std::vector<Eigen::Index> kept;  // a straight cable has no turn about itself
  for (Eigen::Index k = 0; k < 6; ++k)
    if (std::abs(qr.r(k, k)) > 1e-8 * rigid.col(k).norm()) kept.push_back(k);
  const Eigen::MatrixXd basis = qr.q(Eigen::all, kept);
  for (int pass = 0; pass < 2; ++pass) forces -= (basis * (basis.transpose() * forces)).eval();
}

}  // namespace

Index ModalDamping::coordinates() const { return static_cast<Index>(list().size()); }

std::vector<Index> ModalDamping::list() const {
  std::vector<Index> out;
  for (const auto& [body, ratio, first] : nodal_)
    for (Index k = 0; k < body->sizes().velocity; ++k) out.push_back(body->placement().v + k);
  for (const auto& [body, ratio, first] : reduced_)
    for (Index k = 6; k < body->sizes().velocity; ++k) out.push_back(body->placement().v + k);
  return out;
}

void ModalDamping::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const {
  std::vector<Index> all = list();
  std::sort(all.begin(), all.end());
  w.add_block(all, all);
}

void ModalDamping::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) {
  coordinates_ = list();
  Eigen::Index next = 0;
  for (auto& part : nodal_) part.first = std::exchange(next, next + part.body->sizes().velocity);
  for (auto& part : reduced_) part.first = std::exchange(next, next + part.body->sizes().velocity - 6);
  start_.clear();
  for (const Index column : coordinates_)
    for (const Index row : coordinates_) start_.push_back(find_entry(w, column, row));
}

void ModalDamping::set(AssembledSystem& system, const State& state, const Eigen::VectorXd& squares,
                       const Eigen::MatrixXd& shapes) {
  rest_.assign(state.q.begin(), state.q.end());
  std::vector<Eigen::Index> kept;
  for (Eigen::Index l = 0; l < squares.size(); ++l)
    if (squares[l] > 0) kept.push_back(l);
  const auto count = static_cast<Eigen::Index>(kept.size());
  const Eigen::MatrixXd chosen = shapes(Eigen::all, kept);
  factors_ = 2 * squares(kept).array().pow(-1.5);
  forces_.setZero(static_cast<Eigen::Index>(coordinates_.size()), count);
  const auto take = [&](Component& body, double ratio, Index skipped, Eigen::Index first) {
    const Eigen::MatrixXd forces = elastic_forces(system, body, state, chosen);
    const Eigen::Index rows = body.sizes().velocity - skipped;
    forces_.middleRows(first, rows) = std::sqrt(ratio) * forces.middleRows(body.placement().v + skipped, rows);
  };
  for (const auto& [body, ratio, first] : nodal_) {
    take(*body, ratio, 0, first);
    balance(state.q.data() + body->placement().q, body->vertices_per_node(),
            forces_.middleRows(first, body->sizes().velocity));
  }
  for (const auto& [body, ratio, first] : reduced_) take(*body, ratio, 6, first);
}

std::vector<Eigen::Matrix3d> ModalDamping::turns(ConstSpan q) const {
  std::vector<Eigen::Matrix3d> out;
  for (const auto& part : nodal_) {
    out.emplace_back(Eigen::Matrix3d::Identity());
    if (const auto found = part.body->turn(rest_, q))
      out.back() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(found->rotation.data());
  }
  return out;
}

void ModalDamping::turn_nodes(const std::vector<Eigen::Matrix3d>& by, bool back, Eigen::VectorXd& x) const {
  for (std::size_t b = 0; b < nodal_.size(); ++b) {
    Eigen::Map<Eigen::Matrix3Xd> nodes(x.data() + nodal_[b].first, 3, nodal_[b].body->vertices());
    nodes = ((back ? Eigen::Matrix3d(by[b].transpose()) : by[b]) * nodes).eval();
  }
}

void ModalDamping::residual(const StateView& s, Span f) {
  if (forces_.size() == 0 || s.v.empty()) return;
  Eigen::VectorXd x(forces_.rows());
  for (std::size_t k = 0; k < coordinates_.size(); ++k) x[static_cast<Eigen::Index>(k)] = s.v[at(coordinates_[k])];
  const std::vector<Eigen::Matrix3d> by = turns(s.q);
  turn_nodes(by, true, x);
  x = (forces_ * factors_.cwiseProduct(forces_.transpose() * x)).eval();
  turn_nodes(by, false, x);
  for (std::size_t k = 0; k < coordinates_.size(); ++k) f[at(coordinates_[k])] += x[static_cast<Eigen::Index>(k)];
}

// What changes with the bodies' turns is left to Newton's method: it is small as the damping is.
void ModalDamping::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  if (forces_.size() == 0 || weights.v == 0) return;
  Eigen::MatrixXd turned = forces_;
  const std::vector<Eigen::Matrix3d> by = turns(s.q);
  for (Eigen::Index l = 0; l < turned.cols(); ++l) {
    Eigen::VectorXd column = turned.col(l);
    turn_nodes(by, false, column);
    turned.col(l) = column;
  }
  const Eigen::MatrixXd c = weights.v * (turned * factors_.asDiagonal() * turned.transpose());
  for (std::size_t k = 0; k < start_.size(); ++k) w_values[at(start_[k])] += c.data()[k];
}

void ModalDamping::save(std::vector<double>& out) const {
  out.push_back(static_cast<double>(factors_.size()));
  out.insert(out.end(), factors_.data(), factors_.data() + factors_.size());
  out.insert(out.end(), forces_.data(), forces_.data() + forces_.size());
  out.insert(out.end(), rest_.begin(), rest_.end());
}

void ModalDamping::restore(ConstSpan& in) {
  const auto modes = static_cast<Eigen::Index>(in[0]);
  const auto rows = static_cast<Eigen::Index>(coordinates_.size());
  in = in.subspan(1);
  const auto take = [&](double* to, Eigen::Index count) {
    std::copy_n(in.begin(), count, to);
    in = in.subspan(at(count));
  };
  factors_.resize(modes);
  forces_.resize(rows, modes);
  take(factors_.data(), modes);
  take(forces_.data(), rows * modes);
  take(rest_.data(), static_cast<Eigen::Index>(rest_.size()));
}

}  // namespace espalier::dynamics
