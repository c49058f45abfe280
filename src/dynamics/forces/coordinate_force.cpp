#include "dynamics/forces/coordinate_force.hpp"

#include "dynamics/forces/vector_function.hpp"

namespace espalier::dynamics {
namespace {

Vec12 twist(const FrameForce::Pair& p) {
  Vec12 w;
  w << p.a.vel, p.a.omega, p.b.vel, p.b.omega;
  return w;
}

Eigen::Map<const Vec12> gradient(const RelativeValue& g) { return Eigen::Map<const Vec12>(g.c.data()); }

class MotorLaw final : public CoordinateLaw {
 public:
  [[nodiscard]] Strength strength(const LawPoint& p) const override {
    double sum = 0;
    for (const double u : p.inputs) sum += p.load * u;
    return {-sum, 0, 0};
  }
  [[nodiscard]] double by_input(const LawPoint& p, std::size_t /*i*/) const override { return -p.load; }
};

}  // namespace

CoordinateForce::CoordinateForce(std::string name, FramePtr a, FramePtr b, Coordinate coordinate,
                                 std::unique_ptr<CoordinateLaw> law)
    : FrameForce(std::move(name), std::move(a), std::move(b)),
      coordinate_(std::move(coordinate)),
      law_(std::move(law)) {}

LawPoint CoordinateForce::point(const Pair& p, RelativeValue& g) const {
  dynamics::evaluate(coordinate_, p.a, p.b, false, g);
  if (coordinate_.turns()) g.value = turns_.unwrapped(g.value, p.t);
  return {p.t, g.value, gradient(g).dot(twist(p)), p.inputs, load_factor()};
}

Vec12 CoordinateForce::law(const Pair& p) const {
  RelativeValue g;
  const LawPoint at = point(p, g);
  return -law_->strength(at).value * gradient(g);
}

// w = -c s(g, c w'):  dw = -s dc - c (s_g c + s_rate w'^T dc/dx) dx - c s_rate c dw'
void CoordinateForce::law_derivatives(const Pair& p, Mat12& k, Mat12& d) const {
  RelativeValue g;
  const LawPoint at = point(p, g);
  const auto c = gradient(g);
  const CoordinateLaw::Strength s = law_->strength(at);
  Mat12 curvature = Mat12::Zero();
  add_curvature(coordinate_, p.a, p.b, 1.0, curvature);
  k = -s.value * curvature;
  k -= c * (s.by_g * c.transpose() + s.by_rate * (twist(p).transpose() * curvature));
  d = -s.by_rate * c * c.transpose();
}

Vec12 CoordinateForce::law_by_input(const Pair& p, std::size_t i) const {
  RelativeValue g;
  const LawPoint at = point(p, g);
  return -law_->by_input(at, i) * gradient(g);
}

double CoordinateForce::potential(const Pair& p) const {
  RelativeValue g;
  return law_->potential(point(p, g).g);
}

void CoordinateForce::law_branches(const StateView& s, Branches& out) const {
  if (!law_->switches()) return;
  const Pair p = pair(s);
  RelativeValue g;
  law_->branches(point(p, g), out);
}

void CoordinateForce::add_falling(const StateView& s, std::vector<FallingForce>& out) {
  if (!active() || !law_->switches()) return;
  const Pair p = pair(s);
  RelativeValue g;
  const double slope = law_->strength(point(p, g)).by_rate;
  if (slope < 0) out.push_back({all_coordinates(), to_coordinates(s.q, p, gradient(g)), slope});
}

void CoordinateForce::accept(const StateView& s) {
  if (!coordinate_.turns()) return;
  Pair p{s.t, {}, {}, {}};
  frame(0).motion(s.q, s.v, p.a);
  frame(1).motion(s.q, s.v, p.b);
  RelativeValue g;
  const LawPoint at = point(p, g);
  turns_.accept(at.g, at.rate, s.t);
}

void CoordinateForce::save(std::vector<double>& out) const {
  if (coordinate_.turns()) turns_.save(out);
}

void CoordinateForce::restore(ConstSpan& in) {
  if (coordinate_.turns()) turns_.restore(in);
}

namespace {

/// s(g, g', u): parts are g, its rate, and the inputs.
class StrengthFunction final : public CompositeFunction {
 public:
  explicit StrengthFunction(const CoordinateForce& force) : CompositeFunction(parts_of(force)), force_(force) {}
  [[nodiscard]] double value(const StateView& s) const override {
    if (!force_.active()) return 0;
    std::vector<double> inputs;
    const LawPoint p = point(s, inputs);
    return force_.strength_law().strength(p).value;
  }

 protected:
  void add_gradient(const StateView& s, StateGradient& out) const override {
    if (!force_.active()) return;
    std::vector<double> inputs;
    const LawPoint p = point(s, inputs);
    const CoordinateLaw::Strength slope = force_.strength_law().strength(p);
    add_part(s, 0, slope.by_g, out);
    add_part(s, 1, slope.by_rate, out);
    for (std::size_t k = 0; k < inputs.size(); ++k) add_part(s, 2 + k, force_.strength_law().by_input(p, k), out);
  }

 private:
  static std::vector<StateFunctionPtr> parts_of(const CoordinateForce& force) {
    std::vector<StateFunctionPtr> parts = {coordinate_of(force, false), coordinate_of(force, true)};
    for (const StateFunctionPtr& u : force.inputs().functions()) parts.push_back(u);
    return parts;
  }
  LawPoint point(const StateView& s, std::vector<double>& inputs) const {
    inputs = force_.inputs().values(s);
    return {s.t, parts()[0]->value(s), parts()[1]->value(s), inputs};
  }

  const CoordinateForce& force_;
};

}  // namespace

StateFunctionPtr coordinate_of(const CoordinateForce& force, bool rate) {
  return relative_quantity({&force.frame(0), &force.frame(1), force.coordinate(), &force.turns(), rate});
}

StateFunctionPtr strength_of(const CoordinateForce& force) { return std::make_shared<StrengthFunction>(force); }

std::unique_ptr<CoordinateLaw> motor_law() { return std::make_unique<MotorLaw>(); }

}  // namespace espalier::dynamics
