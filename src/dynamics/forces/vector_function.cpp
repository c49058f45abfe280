#include "dynamics/forces/vector_function.hpp"

#include "dynamics/bodies/rotation.hpp"

namespace espalier::dynamics {
namespace {

using Columns6 = Eigen::Matrix<double, 6, Eigen::Dynamic>;

Columns6 jacobian(const Frame& frame, ConstSpan q) {
  Columns6 j(6, static_cast<Eigen::Index>(frame.coordinates().size()));
  if (j.cols() > 0) frame.jacobian(q, j.data());
  return j;
}

Columns6 rate_jacobian(const Frame& frame, ConstSpan q, ConstSpan v) {
  Columns6 j(6, static_cast<Eigen::Index>(frame.coordinates().size()));
  if (j.cols() > 0) frame.rate_jacobian(q, v, j.data());
  return j;
}

void append(std::vector<Index>& list, std::span<const Index> more) {
  list.insert(list.end(), more.begin(), more.end());
}

// dr = J_r dq, dphi = J_phi dq; the twist J v.
class FrameMotionFunction final : public VectorFunction {
 public:
  FrameMotionFunction(std::shared_ptr<const Frame> frame, Motion what) : frame_(std::move(frame)), what_(what) {
    append(coordinates_, frame_->coordinates());
  }
  [[nodiscard]] Vec3 value(const StateView& s) const override {
    FrameMotion m;
    frame_->motion(s.q, s.v, m);
    switch (what_) {
      case Motion::position:
        return m.r;
      case Motion::velocity:
        return m.vel;
      case Motion::rotation:
        return rotation_log(m.rot);
      case Motion::angular_velocity:
        break;
    }
    return m.omega;
  }
  Vec3 derivatives(const StateView& s, Derivatives& out) const override {
    clear(out);
    Vec3 y = value(s);
    const Columns6 j = jacobian(*frame_, s.q);
    if (what_ == Motion::position) {
      out.q = j.topRows<3>();
    } else if (what_ == Motion::rotation) {
      out.q = inverse_left_tangent(y) * j.bottomRows<3>();
    } else {
      const int row = what_ == Motion::velocity ? 0 : 3;
      out.q = rate_jacobian(*frame_, s.q, s.v).middleRows<3>(row);
      out.v = j.middleRows<3>(row);
    }
    return y;
  }

 private:
  std::shared_ptr<const Frame> frame_;
  Motion what_;
};

// On frame f: -sum lambda_r factor c_r, c_r the gradient of term r by the twist of f.
class ReactionFunction final : public VectorFunction {
 public:
  ReactionFunction(const Joint& joint, int f, bool moment) : joint_(joint), f_(f), row_(moment ? 3 : 0) {
    for (int k = 0; k < joint.frames(); ++k) append(coordinates_, joint.frame(k).coordinates());
    for (Index r = 0; r < joint.sizes().constraints; ++r) multipliers_.push_back(joint.placement().c + r);
  }
  [[nodiscard]] Vec3 value(const StateView& s) const override {
    const Wrench w = joint_.reaction(s, f_);
    return row_ == 0 ? w.force : w.moment;
  }
  Vec3 derivatives(const StateView& s, Derivatives& out) const override {
    clear(out);
    Vec3 sum = Vec3::Zero();
    RelativeValue value;
    for (std::size_t r = 0; r < joint_.rows().size(); ++r) {
      const double lambda = s.lambda[static_cast<std::size_t>(multipliers_[r])];
      for (const JointRow::Term& term : joint_.rows()[r].terms) {
        if (term.a != f_ && term.b != f_) continue;
        const int place = row_ + (term.b == f_ ? 6 : 0);
        const FrameMotion a = joint_.frame_motion(s.q, {}, term.a), b = joint_.frame_motion(s.q, {}, term.b);
        evaluate(term, a, b, false, value);
        const Vec3 c = term.factor * Eigen::Map<const Vec12>(value.c.data()).segment<3>(place);
        out.lambda.col(static_cast<Eigen::Index>(r)) -= c;
        sum -= lambda * c;
        Mat12 k = Mat12::Zero();
        add_curvature(term, a, b, lambda * term.factor, k);
        add_columns(term.a, s.q, k.block<3, 6>(place, 0), out);
        add_columns(term.b, s.q, k.block<3, 6>(place, 6), out);
      }
    }
    return sum;
  }

 private:
  void add_columns(int frame, ConstSpan q, const Eigen::Matrix<double, 3, 6>& by_motion, Derivatives& out) const {
    Eigen::Index first = 0;
    for (int k = 0; k < frame; ++k) first += static_cast<Eigen::Index>(joint_.frame(k).coordinates().size());
    const Columns6 j = jacobian(joint_.frame(frame), q);
    out.q.middleCols(first, j.cols()) -= by_motion * j;
  }

  const Joint& joint_;
  int f_, row_;
};

// The law's own derivatives by the motion of its frames, and by its inputs.
class WrenchFunction final : public VectorFunction {
 public:
  WrenchFunction(const FrameForce& force, int f, bool moment) : force_(force), row_(6 * f + (moment ? 3 : 0)) {
    for (const int k : {0, 1}) append(coordinates_, force.frame(k).coordinates());
    for (const StateFunctionPtr& u : force.inputs().functions()) {
      append(coordinates_, u->coordinates());
      append(multipliers_, u->multipliers());
    }
  }
  [[nodiscard]] Vec3 value(const StateView& s) const override { return force_.wrenches(s, nullptr).segment<3>(row_); }
  Vec3 derivatives(const StateView& s, Derivatives& out) const override {
    clear(out);
    FrameForce::Derivatives d;
    const Vec12 w = force_.wrenches(s, &d);
    Eigen::Index first = 0, multiplier = 0;
    for (const int f : {0, 1}) {
      const Columns6 j = jacobian(force_.frame(f), s.q);
      const auto by_motion = d.k.block<3, 6>(row_, 6 * f), by_twist = d.d.block<3, 6>(row_, 6 * f);
      out.q.middleCols(first, j.cols()) = by_motion * j + by_twist * rate_jacobian(force_.frame(f), s.q, s.v);
      out.v.middleCols(first, j.cols()) = by_twist * j;
      first += j.cols();
    }
    StateGradient g;
    for (std::size_t k = 0; k < d.inputs.size(); ++k) {
      force_.inputs().functions()[k]->gradient(s, g);
      const Vec3 slope = d.inputs[k].segment<3>(row_);
      for (std::size_t i = 0; i < g.q.size(); ++i, ++first) {
        out.q.col(first) = slope * g.q[i];
        out.v.col(first) = slope * g.v[i];
      }
      for (const double x : g.lambda) out.lambda.col(multiplier++) = slope * x;
    }
    return w.segment<3>(row_);
  }

 private:
  const FrameForce& force_;
  int row_;
};

class ComponentFunction final : public StateFunction {
 public:
  ComponentFunction(VectorFunctionPtr vector, int component) : vector_(std::move(vector)), component_(component) {
    coordinates_ = vector_->coordinates();
    multipliers_ = vector_->multipliers();
  }
  [[nodiscard]] double value(const StateView& s) const override {
    const Vec3 y = vector_->value(s);
    return component_ < 3 ? y[component_] : y.norm();
  }

 protected:
  void add_gradient(const StateView& s, StateGradient& out) const override {
    VectorFunction::Derivatives d;
    const Vec3 y = vector_->derivatives(s, d);
    const Vec3 direction = component_ < 3 ? Vec3(Vec3::Unit(component_))
                           : y.norm() > 0 ? Vec3(y.normalized())
                                          : Vec3(Vec3::Zero());
    const auto add = [&](const VectorFunction::Columns& columns, std::vector<double>& to) {
      for (Eigen::Index i = 0; i < columns.cols(); ++i)
        to[static_cast<std::size_t>(i)] += direction.dot(columns.col(i));
    };
    add(d.q, out.q);
    add(d.v, out.v);
    add(d.lambda, out.lambda);
  }

 private:
  VectorFunctionPtr vector_;
  int component_;
};

// dg = c J dq; g' = c J v, dg' = (w^T dc/dx J + c d(J v)/dq) dq + c J dv.
class RelativeFunction final : public StateFunction {
 public:
  explicit RelativeFunction(const RelativeQuantity& what) : what_(what) {
    append(coordinates_, what.a->coordinates());
    append(coordinates_, what.b->coordinates());
  }
  [[nodiscard]] double value(const StateView& s) const override {
    FrameMotion a, b;
    const RelativeValue g = evaluated(s, a, b);
    if (what_.rate) return Eigen::Map<const Vec12>(g.c.data()).dot(twist(a, b));
    return what_.turns != nullptr && what_.coordinate.turns() ? what_.turns->unwrapped(g.value, s.t) : g.value;
  }

 protected:
  void add_gradient(const StateView& s, StateGradient& out) const override {
    FrameMotion a, b;
    const RelativeValue g = evaluated(s, a, b);
    const Eigen::Map<const Vec12> c(g.c.data());
    Mat12 curvature = Mat12::Zero();
    if (what_.rate) add_curvature(what_.coordinate, a, b, 1.0, curvature);
    const Vec12 turn = curvature.transpose() * twist(a, b);
    std::size_t at = 0;
    for (const auto& [frame, block] : {std::pair{what_.a, 0}, std::pair{what_.b, 6}}) {
      const Columns6 j = jacobian(*frame, s.q), jv = what_.rate ? rate_jacobian(*frame, s.q, s.v) : Columns6();
      for (Eigen::Index i = 0; i < j.cols(); ++i, ++at) {
        const double along = c.segment<6>(block).dot(j.col(i));
        out.q[at] += what_.rate ? turn.segment<6>(block).dot(j.col(i)) + c.segment<6>(block).dot(jv.col(i)) : along;
        if (what_.rate) out.v[at] += along;
      }
    }
  }

 private:
  RelativeValue evaluated(const StateView& s, FrameMotion& a, FrameMotion& b) const {
    what_.a->motion(s.q, s.v, a);
    what_.b->motion(s.q, s.v, b);
    RelativeValue g;
    evaluate(what_.coordinate, a, b, false, g);
    return g;
  }
  static Vec12 twist(const FrameMotion& a, const FrameMotion& b) {
    Vec12 w;
    w << a.vel, a.omega, b.vel, b.omega;
    return w;
  }

  RelativeQuantity what_;
};

}  // namespace

void VectorFunction::clear(Derivatives& out) const {
  const auto n = static_cast<Eigen::Index>(coordinates_.size()), m = static_cast<Eigen::Index>(multipliers_.size());
  out.q.setZero(3, n);
  out.v.setZero(3, n);
  out.lambda.setZero(3, m);
}

VectorFunctionPtr motion_of(std::shared_ptr<const Frame> frame, Motion what) {
  return std::make_shared<FrameMotionFunction>(std::move(frame), what);
}

VectorFunctionPtr reaction_of(const Joint& joint, int f, bool moment) {
  return std::make_shared<ReactionFunction>(joint, f, moment);
}

VectorFunctionPtr wrench_of(const FrameForce& force, int f, bool moment) {
  return std::make_shared<WrenchFunction>(force, f, moment);
}

StateFunctionPtr component_of(VectorFunctionPtr vector, int component) {
  return std::make_shared<ComponentFunction>(std::move(vector), component);
}

StateFunctionPtr relative_quantity(const RelativeQuantity& what) { return std::make_shared<RelativeFunction>(what); }

}  // namespace espalier::dynamics
