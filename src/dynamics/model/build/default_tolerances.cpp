#include "dynamics/model/build/default_tolerances.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace espalier::dynamics::model {
namespace {

using Box = Eigen::AlignedBox3d;

void add_ball(Box& box, const Vec3& centre, double radius) {
  box.extend(centre - Vec3::Constant(radius)).extend(centre + Vec3::Constant(radius));
}

/// Bodies, and the origins of the frames of joints and forces.
Box box_of(const Mechanism& mechanism, const State& s) {
  Box box;
  for (const BuiltBody& body : mechanism.bodies) {
    const auto* q = s.q.data() + body.component().placement().q;
    const Vec3 first = Eigen::Map<const Vec3>(q);
    if (const auto* rigid = std::get_if<RigidSpec>(&body.spec.shape)) {
      add_ball(box, first, 0.5 * std::sqrt(6 * rigid->data.inertia.trace() / rigid->data.mass));  // as of a block
    } else if (body.reduced != nullptr) {
      std::vector<double> size(s.v.size());
      body.reduced->magnitude(s.q, size);
      add_ball(box, first, size[static_cast<std::size_t>(body.reduced->placement().v)]);
    } else if (body.flexible != nullptr) {
      for (Index v = 0; v < body.flexible->vertices(); v += body.flexible->vertices_per_node())
        box.extend(Vec3(Eigen::Map<const Vec3>(q + 3 * v)));
    } else {
      box.extend(first);
    }
  }
  FrameMotion motion;
  const auto add = [&](const Frame& frame) {
    frame.motion(s.q, {}, motion);
    box.extend(motion.r);
  };
  for (const Joint* joint : mechanism.joints)
    for (int f = 0; f < joint->frames(); ++f) add(joint->frame(f));
  for (const BuiltForce& force : mechanism.forces)
    for (int f = 0; f < 2; ++f) add(force.force->frame(f));
  return box;
}

std::vector<char> lengths_of(const Mechanism& mechanism, std::size_t count) {
  std::vector<char> lengths(count, 1);
  for (const BuiltBody& body : mechanism.bodies) {
    char* own = lengths.data() + body.component().placement().v;
    if (body.rigid != nullptr || body.reduced != nullptr) {
      std::fill_n(own + 3, 3, char{0});
    } else if (body.flexible != nullptr) {
      for (Index v = 0; v < body.flexible->vertices(); ++v)
        if (v % body.flexible->vertices_per_node() != 0) std::fill_n(own + 3 * v, 3, char{0});
    }
  }
  return lengths;
}

/// How far lengths move in an implicit step of length t from the state, linearised: a static deflection where all is
/// held, g t^2 where something falls. With dq = t v + t^2 b, dv = t b, and the forces F of some time of the run instead
/// of those of the start, F_0, the most of
///   (M + t D + t^2 K) b + Phi_q^T dlambda = M a + F - F_0 - t K v,   Phi_q b = 0
double way_of(Equations& equations, const State& state, const std::vector<char>& lengths, double t) {
  System& system = equations.system();
  const std::size_t n = state.v.size();
  std::vector<double> b(n + state.lambda.size()), with(n), without(n), later(n), dq(n), no_a(n);
  const double fastest = max_norm(state.v), part = fastest > 0 ? 1e-6 * t : 0;
  system.residual(state.view(), with);
  StateView at = state.view();
  at.a = no_a;
  system.residual(at, without);
  const std::vector<double> forces = without;  // -F_0
  for (std::size_t i = 0; i < n; ++i) b[i] = with[i] - without[i];
  if (part > 0) {
    std::vector<double> q(state.q.size());
    for (std::size_t i = 0; i < n; ++i) dq[i] = part * state.v[i];
    system.retract(state.q, dq, q);
    at = state.view();
    at.q = q;
    system.residual(at, without);
    for (std::size_t i = 0; i < n; ++i) b[i] -= t / part * (without[i] - with[i]);
  }
  equations.evaluate_constraints(state.t, state.q, {});
  equations.factorize(state.view(), {1, t, t * t});
  double way = 0;
  for (const double share : {0.0, 0.07, 0.15, 0.25, 0.38, 0.5, 0.62, 0.75, 0.9, 1.0}) {
    at = state.view();
    at.a = no_a;
    at.t = state.t + share * t;
    system.residual(at, later);
    std::vector<double> step = b;
    for (std::size_t i = 0; i < n; ++i) step[i] += forces[i] - later[i];
    equations.solve(step);
    for (std::size_t i = 0; i < n; ++i)
      if (lengths[i] != 0) way = std::max(way, std::abs(t * state.v[i] + t * t * step[i]));
  }
  return way;
}

bool is_driven(const Mechanism& mechanism) {
  return std::any_of(mechanism.joints.begin(), mechanism.joints.end(), [](const Joint* joint) {
    return std::any_of(joint->rows().begin(), joint->rows().end(), [](const JointRow& row) { return row.driven; });
  });
}

/// Whether vibrations stay alive: of some flexible body those of 200 periods in the run are not damped away in it,
/// which orders of BDF above 2 would make grow.
bool rings(const Mechanism& mechanism, double duration) {
  constexpr double kDamped = 5e-5;
  return std::any_of(mechanism.bodies.begin(), mechanism.bodies.end(), [&](const BuiltBody& body) {
    return body.flexible != nullptr && (body.reduced != nullptr || body.spec.damping.stiffness < kDamped * duration);
  });
}

}  // namespace

bool wants_default_tolerances(const IntegratorSpec& integrator) {
  return integrator.method == Method::bdf && !integrator.states_tolerances && integrator.bdf.fixed_step == 0;
}

void set_default_tolerances(IntegratorSpec& integrator, Equations& equations, const Mechanism& mechanism,
                            const Description& model, const State& state, double duration) {
  constexpr double kPlain = 1e-8, kLongest = 100, kNothing = 1e-9;
  // Rigid bodies do not vibrate about where they are held.
  const bool all_flexible = std::all_of(mechanism.bodies.begin(), mechanism.bodies.end(),
                                        [](const BuiltBody& body) { return body.flexible != nullptr; });
  const double least_way = all_flexible ? 1e-3 : 0.1;
  BdfOptions& bdf = integrator.bdf;
  ErrorBudget& budget = bdf.budget;
  budget.lengths = lengths_of(mechanism, state.v.size());
  // A point that nothing holds has no extent but its way.
  double extent = box_of(mechanism, state).sizes().maxCoeff(), speed = 0, acceleration = model.gravity.norm();
  for (std::size_t i = 0; i < state.v.size(); ++i)
    if (budget.lengths[i] != 0) speed = std::max(speed, std::abs(state.v[i]));
  for (std::size_t i = 0; i < state.a.size() && !(model.gravity.norm() > 0 || speed > 0); ++i)
    if (budget.lengths[i] != 0) acceleration = std::max(acceleration, std::abs(state.a[i]));
  if (!(extent > 0)) extent = std::isfinite(duration) ? speed * duration + acceleration * duration * duration : 0;
  if (!(extent > 0)) extent = 1;
  // Runs that may last until something happens are judged by what the model moves like.
  speed = std::max(speed, std::sqrt(acceleration * extent));
  if (speed > 0) duration = std::min(duration, kLongest * extent / speed);
  if (!std::isfinite(duration)) duration = 1;
  budget.accuracy = integrator.accuracy;
  budget.extent = extent;
  budget.duration = duration;
  bdf.absolute = kPlain * extent;
  bdf.absolute_velocity = bdf.absolute / duration;
  bdf.scaled_constraints = !integrator.states_constraints;
  const bool stiff = std::any_of(mechanism.bodies.begin(), mechanism.bodies.end(),
                                 [](const BuiltBody& body) { return body.flexible != nullptr; });
  if (!stiff) return;
  budget.speed = std::max(speed, extent / duration);
  if (!integrator.states_order && rings(mechanism, duration)) bdf.max_order = 2;
  if (is_driven(mechanism)) return;
  double moves = 1;  // over the extent
  try {
    moves = way_of(equations, state, budget.lengths, duration) / extent;
  } catch (const Error&) {  // then it is as large as it is
  }
  if (!(moves > kNothing)) return;  // until something happens
  moves = std::clamp(moves, least_way, 1.0);
  budget.accuracy *= moves;
}

}  // namespace espalier::dynamics::model
