#include "dynamics/forces/cable_force.hpp"

#include <cmath>
#include <stdexcept>

#include "base/at.hpp"

namespace espalier::dynamics {
namespace {

using CableRow = Eigen::RowVectorXd;
using Rows3 = Eigen::Matrix<double, 3, Eigen::Dynamic>;

}  // namespace

/// The straight parts of the cable, k from frame k to k + 1, with derivatives as of Number.
struct CableForce::Terms {
  std::vector<FrameMotion> motions;
  std::vector<Vec3> u;       // directions
  std::vector<Rows3> du;     // their derivatives
  std::vector<Number> l, r;  // lengths and their rates
  Number length, rate;       // of all
  std::vector<Number> pull;
};

CableForce::CableForce(std::string name, std::vector<FramePtr> frames, const CableForceLaw& law)
    : Component(std::move(name)), frames_(std::move(frames)), law_(law) {
  if (!(law.stiffness > 0 && law.slip_speed > 0 && law.damping >= 0 && law.friction >= 0))
    throw std::invalid_argument(
        "a cable needs a positive stiffness and slip speed, and no negative damping and friction");
  std::vector<const Frame*> plain;
  for (const FramePtr& frame : frames_) plain.push_back(frame.get());
  blocks_ = FrameBlocks(std::move(plain), {});
}

CableForce::Terms CableForce::parts(const StateView& s, bool derivatives) const {
  const auto n = static_cast<Eigen::Index>(frames_.size()), columns = derivatives ? 6 * n : 0;
  const std::size_t count = frames_.size() - 1;
  Terms p;
  p.motions.resize(frames_.size());
  for (std::size_t i = 0; i < frames_.size(); ++i) frames_[i]->motion(s.q, s.v, p.motions[i]);
  const auto sum = [&](const std::vector<Number>& all, std::size_t first, std::size_t last) {
    Number total{0, CableRow::Zero(columns)};
    for (std::size_t k = first; k < last; ++k) {
      total.value += all[k].value;
      total.by += all[k].by;
    }
    return total;
  };
  for (std::size_t k = 0; k < count; ++k) {
    const Vec3 d = p.motions[k + 1].r - p.motions[k].r, v = p.motions[k + 1].vel - p.motions[k].vel;
    const double l = d.norm();
    if (!(l > 0))
      throw Error(
          StatusCode::singular,
          "two rings of a cable that follow each other have come together, and the cable has no direction between "
          "them: put them apart");
    const Vec3 u = d / l;
    p.u.push_back(u);
    p.l.push_back({l, CableRow::Zero(columns)});
    p.r.push_back({u.dot(v), CableRow::Zero(columns)});
    p.du.emplace_back(Rows3::Zero(3, columns));
    if (!derivatives) continue;
    const Mat3 across = (Mat3::Identity() - u * u.transpose()) / l;
    for (const auto& [frame, sign] :
         {std::pair{static_cast<Eigen::Index>(k), -1.0}, {static_cast<Eigen::Index>(k) + 1, 1.0}}) {
      p.l.back().by.segment<3>(3 * frame) = sign * u.transpose();
      p.du.back().middleCols<3>(3 * frame) = sign * across;
      p.r.back().by.segment<3>(3 * frame) = sign * (across * v).transpose();
      p.r.back().by.segment<3>(3 * (n + frame)) = sign * u.transpose();
    }
  }
  p.length = sum(p.l, 0, count);
  p.rate = sum(p.r, 0, count);
  // The mean pull.
  const double stretch = p.length.value - law_.rest;
  Number mean{law_.stiffness * stretch + law_.damping * p.rate.value, CableRow::Zero(columns)};
  const bool taut = active_ && stretch > 0 && mean.value > 0;
  if (!taut) mean.value = 0;
  if (taut) mean.by = law_.stiffness * p.length.by + law_.damping * p.rate.by;
  if (law_.friction == 0 || !taut) {
    p.pull.assign(count, mean);
    return p;
  }
  // pull_k = mean h_k / share, ln h_k = sum of friction theta_j tanh(w_j / slip_speed) of the rings before part k,
  // share = sum l_k h_k / length, w_j = length_j / length rate - rate_j with the length and rate of all before ring j.
  std::vector<Number> logarithm = {{0, CableRow::Zero(columns)}};
  for (std::size_t k = 1; k < count; ++k) {
    const Vec3 &before = p.u[k - 1], &after = p.u[k];
    const double sine = before.cross(after).norm(), cosine = before.dot(after), theta = std::atan2(sine, cosine);
    const Number l = sum(p.l, 0, k), r = sum(p.r, 0, k);
    const double share = l.value / p.length.value, w = share * p.rate.value - r.value;
    const double slip = std::tanh(w / law_.slip_speed), slope = (1 - slip * slip) / law_.slip_speed;
    Number x{logarithm.back().value + law_.friction * theta * slip, logarithm.back().by};
    if (derivatives) {
      constexpr double kStraight = 1e-12;  // there a turn has no direction
      const CableRow turn = sine > kStraight ? CableRow(-((after - cosine * before).transpose() * p.du[k - 1] +
                                                          (before - cosine * after).transpose() * p.du[k]) /
                                                        sine)
                                             : CableRow(CableRow::Zero(columns));
      const CableRow by_w = share * p.rate.by + p.rate.value / p.length.value * (l.by - share * p.length.by) - r.by;
      x.by += law_.friction * (slip * turn + theta * slope * by_w);
    }
    logarithm.push_back(std::move(x));
  }
  Number share{0, CableRow::Zero(columns)};
  for (std::size_t k = 0; k < count; ++k) {
    const double h = std::exp(logarithm[k].value);
    share.value += p.l[k].value * h / p.length.value;
    share.by += h / p.length.value * (p.l[k].by + p.l[k].value * logarithm[k].by);
  }
  share.by -= share.value / p.length.value * p.length.by;
  for (std::size_t k = 0; k < count; ++k) {
    const double part = std::exp(logarithm[k].value) / share.value;
    p.pull.push_back(
        {mean.value * part, part * mean.by + mean.value * part * (logarithm[k].by - share.by / share.value)});
  }
  return p;
}

Vec3 CableForce::applied(const StateView& s, int f) const {
  const Terms p = parts(s, false);
  Vec3 force = Vec3::Zero();
  if (at(f) < p.u.size()) force += p.pull[at(f)].value * p.u[at(f)];
  if (f > 0) force -= p.pull[at(f) - 1].value * p.u[at(f) - 1];
  return force;
}

void CableForce::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const { blocks_.declare(w); }

void CableForce::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) { blocks_.bind(w, pool()); }

void CableForce::residual(const StateView& s, Span f) {
  if (!active_) return;
  const Terms p = parts(s, false);
  std::vector<double> own;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    Vec6 wrench = Vec6::Zero();
    if (i < p.u.size()) wrench.head<3>() -= p.pull[i].value * p.u[i];
    if (i > 0) wrench.head<3>() += p.pull[i - 1].value * p.u[i - 1];
    const auto coordinates = frames_[i]->coordinates();
    own.assign(coordinates.size(), 0);
    if (own.empty()) continue;
    frames_[i]->project(s.q, p.motions[i], wrench.data(), 1, own.data());
    for (std::size_t k = 0; k < own.size(); ++k)
      if (coordinates[k] >= 0) f[at(coordinates[k])] += own[k];
  }
}

void CableForce::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  if (!active_) return;
  const Terms p = parts(s, true);
  const auto n = static_cast<Eigen::Index>(frames_.size());
  FrameBlocks::Derivatives out;
  out.k.setZero(6 * n, 6 * n);
  out.d.setZero(6 * n, 6 * n);
  out.wrench.setZero(6 * n);
  for (std::size_t k = 0; k < p.u.size(); ++k) {
    const Rows3 by = p.u[k] * p.pull[k].by + p.pull[k].value * p.du[k];  // of the pull on frame k
    for (const auto& [frame, sign] :
         {std::pair{static_cast<Eigen::Index>(k), 1.0}, {static_cast<Eigen::Index>(k) + 1, -1.0}}) {
      out.wrench.segment<3>(6 * frame) -= weights.q * sign * p.pull[k].value * p.u[k];
      for (Eigen::Index i = 0; i < n; ++i) {
        out.k.block<3, 3>(6 * frame, 6 * i) -=
            sign * (weights.q * by.middleCols<3>(3 * i) + weights.v * by.middleCols<3>(3 * (n + i)));
        out.d.block<3, 3>(6 * frame, 6 * i) -= sign * weights.q * by.middleCols<3>(3 * (n + i));
      }
    }
  }
  blocks_.add(s.q, s.v, out, pool(), w_values);
}

Energy CableForce::energy(const StateView& s) {
  if (!active_) return {};
  const double stretch = std::max(0.0, parts(s, false).length.value - law_.rest);
  return {0, 0.5 * law_.stiffness * stretch * stretch};
}

void CableForce::branches(const StateView& s, Branches& out) const {
  if (active_) out.push_back({.value = parts(s, false).length.value - law_.rest, .dead = 1e-12 * law_.rest});
}

CableForce::Number CableForce::number(const StateView& s, What what, bool derivatives) const {
  const Terms p = parts(s, derivatives);
  return what == What::length       ? p.length
         : what == What::rate       ? p.rate
         : what == What::first_pull ? p.pull.front()
                                    : p.pull.back();
}

namespace {

class CableQuantity final : public StateFunction {
 public:
  CableQuantity(const CableForce& cable, CableForce::What what) : cable_(cable), what_(what) {
    for (int f = 0; f < cable.frames(); ++f)
      coordinates_.insert(coordinates_.end(), cable.frame(f).coordinates().begin(), cable.frame(f).coordinates().end());
  }
  [[nodiscard]] double value(const StateView& s) const override { return cable_.number(s, what_, false).value; }

 protected:
  void add_gradient(const StateView& s, StateGradient& out) const override {
    const CableRow by = cable_.number(s, what_, true).by;
    const Eigen::Index n = cable_.frames();
    std::size_t at = 0;
    for (Eigen::Index f = 0; f < n; ++f) {
      const Frame& frame = cable_.frame(static_cast<int>(f));
      const auto count = static_cast<Eigen::Index>(frame.coordinates().size());
      Eigen::Matrix<double, 6, Eigen::Dynamic> j(6, count), jv = Eigen::MatrixXd::Zero(6, count);
      if (count == 0) continue;
      frame.jacobian(s.q, j.data());
      frame.rate_jacobian(s.q, s.v, jv.data());
      const CableRow x = by.segment<3>(3 * f), y = by.segment<3>(3 * (n + f));
      for (Eigen::Index i = 0; i < count; ++i, ++at) {
        out.q[at] += x.dot(j.col(i).head<3>()) + y.dot(jv.col(i).head<3>());
        out.v[at] += y.dot(j.col(i).head<3>());
      }
    }
  }

 private:
  const CableForce& cable_;
  CableForce::What what_;
};

}  // namespace

StateFunctionPtr cable_quantity(const CableForce& cable, CableForce::What what) {
  return std::make_shared<CableQuantity>(cable, what);
}

}  // namespace espalier::dynamics
