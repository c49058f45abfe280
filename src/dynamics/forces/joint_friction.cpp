#include "dynamics/forces/joint_friction.hpp"

#include <cmath>
#include <stdexcept>

namespace espalier::dynamics {
namespace {

using Quotient = FrictionQuotient;

Quotient quotient(const FrictionCurve& c, double s) {
  const double more = c.static_coefficient - c.dynamic_coefficient;
  // Below this slip the first two terms of the series have 12 digits: mu / s = a (1 - b s^2), and the slope is -2 a b.
  if (s < 1e-3 * std::min(c.slip_speed, c.stribeck_speed)) {
    const double a = c.static_coefficient / c.slip_speed;
    const double bent =
        c.static_coefficient / (3 * c.slip_speed * c.slip_speed) + more / (c.stribeck_speed * c.stribeck_speed);
    return {a - bent / c.slip_speed * s * s, -2 * bent / c.slip_speed};
  }
  const double x = s / c.stribeck_speed, falling = more * std::exp(-x * x), h = std::tanh(s / c.slip_speed);
  const double mu = (c.dynamic_coefficient + falling) * h;
  const double mu_slope =
      (c.dynamic_coefficient + falling) * (1 - h * h) / c.slip_speed - 2 * x / c.stribeck_speed * falling * h;
  return {mu / s, (mu_slope - mu / s) / (s * s)};
}

/// The coefficient a at rest with which the largest mu(s) is the static one, tanh and all: at stribeck_speed = 10
/// slip_speed the curve with a = static would reach 0.95 of it alone.
FrictionCurve reaching(FrictionCurve c) {
  const double wanted = c.static_coefficient;
  if (wanted <= c.dynamic_coefficient || c.stribeck_speed < c.slip_speed) return c;
  const auto largest = [&c] {
    // The maximum lies where tanh is nearly 1, at some slip speeds, or not far behind the Stribeck speed.
    constexpr int kPoints = 400;
    double most = 0;
    for (int k = 1; k <= kPoints; ++k) {
      const double s = c.slip_speed * std::pow(3 * c.stribeck_speed / c.slip_speed, static_cast<double>(k) / kPoints) *
                       std::min(1.0, 20.0 * k / kPoints);
      most = std::max(most, quotient(c, s).phi * s);
    }
    return most;
  };
  for (int k = 0; k < 40; ++k) c.static_coefficient *= wanted / std::max(largest(), 0.25 * wanted);
  return c;
}

class Friction final : public CoordinateLaw {
 public:
  explicit Friction(const FrictionLaw& law) : law_(law) { law_.curve = reaching(law.curve); }

  [[nodiscard]] Strength strength(const LawPoint& p) const override {
    const Slip x = slip(p);
    const double r = law_.radius, n = p.inputs[0];
    return {r * n * x.q.phi * x.u + law_.viscous * p.rate, 0,
            r * r * n * (x.q.phi + x.q.slope * x.u * x.u) + law_.viscous};
  }
  [[nodiscard]] double by_input(const LawPoint& p, std::size_t i) const override {
    const Slip x = slip(p);
    return i == 0 ? law_.radius * x.q.phi * x.u : law_.radius * p.inputs[0] * x.u * x.q.slope * x.w;
  }
  [[nodiscard]] bool switches() const override { return true; }
  // Where it turns round. So slowly it creeps; across the direction of a slip there is no switch.
  void branches(const LawPoint& p, Branches& out) const override {
    const double w = p.inputs.size() > 1 ? p.inputs[1] : 0.0;
    out.push_back({.value = law_.radius * p.rate, .dead = 0.1 * law_.curve.slip_speed + std::abs(w)});
  }

 private:
  struct Slip {
    double u, w;
    Quotient q;
  };
  [[nodiscard]] Slip slip(const LawPoint& p) const {
    const double u = law_.radius * p.rate, w = p.inputs.size() > 1 ? p.inputs[1] : 0.0;
    return {u, w, quotient(law_.curve, std::hypot(u, w))};
  }

  FrictionLaw law_;
};

class LoadFunction final : public StateFunction {
 public:
  LoadFunction(const Joint& joint, const FrictionLoad& load)
      : a_(joint.frame(0)), load_(load), force_(reaction_of(joint, 1, false)), moment_(reaction_of(joint, 1, true)) {
    coordinates_ = force_->coordinates();  // those of frame A first
    multipliers_ = force_->multipliers();
  }
  [[nodiscard]] double value(const StateView& s) const override {
    const Vec3 z = axis(s);
    return load_.preload + WeightedNorm(force_->value(s), z, load_.radial, load_.axial).size +
           WeightedNorm(moment_->value(s), z, load_.bending, load_.torsion).size;
  }

 protected:
  /// across |x - z z.x| + along |z.x| with its gradients by x and z.
  struct WeightedNorm {
    double size;
    Vec3 by_x, by_z;
    WeightedNorm(const Vec3& x, const Vec3& z, double across, double along) {
      const double axial = z.dot(x), side = axial < 0 ? -1.0 : 1.0;
      const Vec3 radial = x - axial * z;
      const double length = radial.norm();
      const Vec3 direction = length > 0 ? Vec3(radial / length) : Vec3(Vec3::Zero());
      size = across * length + along * std::abs(axial);
      by_x = across * direction + along * side * z;
      by_z = -across * axial * direction + along * side * x;
    }
  };

  void add_gradient(const StateView& s, StateGradient& out) const override {
    VectorFunction::Derivatives df, dm;
    const Vec3 f = force_->derivatives(s, df), m = moment_->derivatives(s, dm), z = axis(s);
    const WeightedNorm force(f, z, load_.radial, load_.axial), moment(m, z, load_.bending, load_.torsion);
    for (Eigen::Index i = 0; i < df.q.cols(); ++i)
      out.q[at(i)] += force.by_x.dot(df.q.col(i)) + moment.by_x.dot(dm.q.col(i));
    for (Eigen::Index i = 0; i < df.lambda.cols(); ++i)
      out.lambda[at(i)] += force.by_x.dot(df.lambda.col(i)) + moment.by_x.dot(dm.lambda.col(i));
    // dz = dphi_A x z
    const Vec3 by_turn = z.cross(force.by_z + moment.by_z);
    std::vector<double> j(6 * a_.coordinates().size());
    if (!j.empty()) a_.jacobian(s.q, j.data());
    for (std::size_t i = 0; i < a_.coordinates().size(); ++i)
      out.q[i] += by_turn.dot(Vec3(j[6 * i + 3], j[6 * i + 4], j[6 * i + 5]));
  }

 private:
  [[nodiscard]] Vec3 axis(const StateView& s) const {
    FrameMotion m;
    a_.motion(s.q, {}, m);
    return m.rot.col(2);
  }

  const Frame& a_;
  FrictionLoad load_;
  VectorFunctionPtr force_, moment_;
};

class OffsetFunction final : public CompositeFunction {
 public:
  OffsetFunction(StateFunctionPtr y, double offset) : CompositeFunction({std::move(y)}), offset_(offset) {}
  [[nodiscard]] double value(const StateView& s) const override { return offset_ + parts()[0]->value(s); }

 protected:
  void add_gradient(const StateView& s, StateGradient& out) const override { add_part(s, 0, 1, out); }

 private:
  double offset_;
};

class RowLoadFunction final : public StateFunction {
 public:
  RowLoadFunction(Index row, double factor, double preload) : factor_(factor), preload_(preload) {
    multipliers_.push_back(row);
  }
  [[nodiscard]] double value(const StateView& s) const override { return preload_ + factor_ * std::abs(lambda(s)); }

 protected:
  void add_gradient(const StateView& s, StateGradient& out) const override {
    out.lambda[0] += lambda(s) < 0 ? -factor_ : factor_;
  }

 private:
  [[nodiscard]] double lambda(const StateView& s) const { return s.lambda[at(multipliers_[0])]; }
  double factor_, preload_;
};

class ScaledFunction final : public CompositeFunction {
 public:
  ScaledFunction(StateFunctionPtr y, double factor) : CompositeFunction({std::move(y)}), factor_(factor) {}
  [[nodiscard]] double value(const StateView& s) const override { return factor_ * parts()[0]->value(s); }

 protected:
  void add_gradient(const StateView& s, StateGradient& out) const override { add_part(s, 0, factor_, out); }

 private:
  double factor_;
};

}  // namespace

StateFunctionPtr friction_load(const Joint& joint, const FrictionLoad& load) {
  return std::make_shared<LoadFunction>(joint, load);
}

StateFunctionPtr friction_load_of_force(const Joint& joint, double preload) {
  constexpr int kNorm = 3;
  return std::make_shared<OffsetFunction>(component_of(reaction_of(joint, 1, false), kNorm), preload);
}

StateFunctionPtr friction_load_of_row(const Joint& joint, std::size_t row, double factor, double preload) {
  return std::make_shared<RowLoadFunction>(joint.placement().c + static_cast<Index>(row), factor, preload);
}

FrictionQuotient friction_quotient(const FrictionCurve& curve, double s) { return quotient(curve, s); }

FrictionCurve checked_curve(const FrictionCurve& curve) {
  if (!(curve.slip_speed > 0 && curve.stribeck_speed > 0))
    throw std::invalid_argument("friction needs positive speeds and a positive radius");
  if (!(curve.dynamic_coefficient >= 0 && curve.static_coefficient >= 0))
    throw std::invalid_argument("coefficients of friction must not be negative");
  return reaching(curve);
}

std::unique_ptr<CoordinateLaw> friction_law(const FrictionLaw& law) {
  const FrictionCurve& c = law.curve;
  if (!(c.slip_speed > 0 && c.stribeck_speed > 0 && law.radius > 0))
    throw std::invalid_argument("friction needs positive speeds and a positive radius");
  if (!(c.dynamic_coefficient >= 0 && c.static_coefficient >= 0 && law.viscous >= 0))
    throw std::invalid_argument("coefficients of friction must not be negative");
  return std::make_unique<Friction>(law);
}

StateFunctionPtr scaled(StateFunctionPtr y, double factor) {
  return std::make_shared<ScaledFunction>(std::move(y), factor);
}

}  // namespace espalier::dynamics
