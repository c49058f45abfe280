#include "dynamics/integrators/step_cases.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dynamics/bodies/flexible_frame.hpp"
#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/function_system.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/joints/joint.hpp"
#include "dynamics/reference/andrews.hpp"

namespace espalier::dynamics {

namespace {

StepCase finished(StepCase c) {
  Equations equations(*c.system);
  make_consistent(equations, c.start);
  return c;
}

StepCase of_components(StepCase c, std::unique_ptr<AssembledSystem> system) {
  system->finish();
  c.start = State(system->sizes());
  system->initial(c.start.q, c.start.v);
  c.system = std::move(system);
  return finished(std::move(c));
}

StepCase of_functions(StepCase c, DaeFunctions functions, std::vector<double> q, std::vector<double> v) {
  c.system = std::make_unique<FunctionSystem>(std::move(functions));
  c.start = State(c.system->sizes());
  c.start.q = std::move(q);
  c.start.v = std::move(v);
  return finished(std::move(c));
}

FramePtr on_ground(const Vec3& point, const Mat3& axes) { return std::make_unique<GroundFrame>(point, axes); }

}  // namespace

// Crank of 0.08 m about x at (0, 0.1, 0.12), upright, 6 rad/s; rod of 0.3 m, spherical at the crank, universal at the
// slider, which slides along x.
StepCase spatial_slider_crank() {
  const Vec3 a(0, 0.1, 0.12), b(0, 0.1, 0.2), c(0.2, 0, 0), gravity(0, 0, -9.81);
  const Vec3 along = (c - b).normalized(), across = Vec3::UnitZ().cross(along).normalized();
  Mat3 rod_axes, turn_x;  // turn_x: z of a joint along the global x
  rod_axes << along, across, along.cross(across);
  turn_x << Vec3::UnitY(), Vec3::UnitZ(), Vec3::UnitX();
  const Vec3 vb(0, -0.48, 0), vc(0.24, 0, 0);
  // omega x (c - b) = vc - vb, and the cross of the universal joint stays perpendicular: e_z . (omega x across) = 0.
  const Vec3 normal = along.cross(vc - vb) / (c - b).norm();
  const double spin = -normal.cross(across).z() / along.cross(across).z();
  auto system = std::make_unique<AssembledSystem>();
  const auto body = [&](const char* name, double mass, const Vec3& inertia, const Vec3& place, const Vec3& velocity,
                        const Vec3& omega, const Mat3& axes) -> RigidBody& {
    RigidBodyData d;
    d.mass = mass, d.inertia = inertia.asDiagonal(), d.position = place, d.rotation = quaternion_of(axes);
    d.velocity = velocity, d.angular_velocity = omega, d.gravity = gravity;
    return system->add(std::make_unique<RigidBody>(name, d));
  };
  const Mat3 one = Mat3::Identity();
  RigidBody& crank = body("crank", 0.12, {1e-4, 1e-5, 1e-4}, a, Vec3::Zero(), {6, 0, 0}, one);
  RigidBody& rod = body("rod", 0.5, {4e-4, 4e-3, 4e-3}, (b + c) / 2, (vb + vc) / 2, normal + spin * along, rod_axes);
  RigidBody& slider = body("slider", 2, {1e-4, 1e-4, 1e-4}, c, vc, Vec3::Zero(), one);
  system->add(revolute_joint("main bearing", on_ground(a, turn_x), frame_at(crank, a, turn_x)));
  system->add(spherical_joint("crank pin", frame_at(crank, b, one), frame_at(rod, b, one)));
  Mat3 cross;  // x of frame a is the global z
  cross << Vec3::UnitZ(), Vec3::UnitX(), Vec3::UnitY();
  system->add(universal_joint("wrist", frame_at(slider, c, cross), frame_at(rod, c, rod_axes)));
  system->add(prismatic_joint("guide", on_ground(Vec3::Zero(), turn_x), frame_at(slider, c, turn_x)));
  return of_components({"spatial", "spatial slider crank", nullptr, {}, 0.5, 1.0 / 400, {{0, 0}, {7, 6}, {14, 12}}},
                       std::move(system));
}

StepCase car_axis() {
  constexpr double kLength = 1, kFree = 0.5, kRoad = 0.1, kOmega = 10, kMass = 10 * 1e-2 * 1e-2 / 2;
  DaeFunctions f;
  f.coordinates = 4;  // left and right end of the axis: xl, yl, xr, yr
  f.constraints = 2;
  f.mass = [](ConstSpan, MatrixEntries m) {
    for (Index i = 0; i < 4; ++i) m(i, i) = kMass;
  };
  struct Road {  // the right wheel's contact (x, y) with two derivatives in time
    double x, y, x1, y1, x2, y2;
    explicit Road(double t)
        : y(kRoad * std::sin(kOmega * t)),
          y1(kRoad * kOmega * std::cos(kOmega * t)),
          y2(-kOmega * kOmega * kRoad * std::sin(kOmega * t)) {
      x = std::sqrt(kLength * kLength - y * y);
      x1 = -y * y1 / x;
      x2 = -(y1 * y1 + y * y2 + x1 * x1) / x;
    }
  };
  f.force = [](double t, ConstSpan q, ConstSpan, Span out) {
    const Road r(t);
    const double left = std::hypot(q[0], q[1]), right = std::hypot(q[2] - r.x, q[3] - r.y);
    out[0] = (kFree - left) * q[0] / left;
    out[1] = (kFree - left) * q[1] / left - kMass;
    out[2] = (kFree - right) * (q[2] - r.x) / right;
    out[3] = (kFree - right) * (q[3] - r.y) / right - kMass;
  };
  f.constraint = [](double t, ConstSpan q, Span phi) {
    const Road r(t);
    const double x = q[0] - q[2], y = q[1] - q[3];
    phi[0] = r.x * q[0] + r.y * q[1];
    phi[1] = x * x + y * y - kLength * kLength;
  };
  f.constraint_jacobian = [](double t, ConstSpan q, MatrixEntries j) {
    const Road r(t);
    j(0, 0) = r.x, j(0, 1) = r.y;
    j(1, 0) = 2 * (q[0] - q[2]), j(1, 1) = 2 * (q[1] - q[3]);
    j(1, 2) = -j(1, 0), j(1, 3) = -j(1, 1);
  };
  f.constraint_rate = [](double t, ConstSpan q, Span rate) {
    const Road r(t);
    rate[0] = r.x1 * q[0] + r.y1 * q[1];
  };
  f.constraint_gamma = [](double t, ConstSpan q, ConstSpan v, Span gamma) {
    const Road r(t);
    const double x = v[0] - v[2], y = v[1] - v[3];
    gamma[0] = -r.x2 * q[0] - r.y2 * q[1] - 2 * (r.x1 * v[0] + r.y1 * v[1]);
    gamma[1] = -2 * (x * x + y * y);
  };
  return of_functions({"car", "car axis", nullptr, {}, 3, 1.0 / 200}, std::move(f), {0, kFree, kLength, kFree},
                      {-kFree / kLength, 0, -kFree / kLength, 0});
}

DaeFunctions sundials_slider_crank_functions() {
  constexpr double kCrank = 0.5;  // the rod has the length 1
  DaeFunctions f;
  f.coordinates = 3;  // crank angle, slider, rod angle
  f.constraints = 2;
  f.mass = [](ConstSpan, MatrixEntries m) { m(0, 0) = m(1, 1) = 1, m(2, 2) = 2; };
  f.force = [](double, ConstSpan q, ConstSpan v, Span out) {
    const double s1 = std::sin(q[0]), c1 = std::cos(q[0]), s2 = std::sin(q[2]), c2 = std::cos(q[2]), x = q[1];
    const double s21 = s2 * c1 - c2 * s1, c21 = c2 * c1 + s2 * s1;
    const double length = std::sqrt(x * x - x * (c2 + kCrank * c1) + (1 + kCrank * kCrank) / 4 + kCrank * c21 / 2);
    const double rate = (2 * x * v[1] - v[1] * (c2 + kCrank * c1) + x * (s2 * v[2] + kCrank * s1 * v[0]) -
                         kCrank * s21 * (v[2] - v[0]) / 2) /
                        (2 * length);
    const double pull = (length - 1 + rate) / length;
    out[0] = -pull * kCrank * (s21 / 2 + x * s1) / 2;
    out[1] = pull * (c2 / 2 - x + kCrank * c1 / 2) + 1;
    out[2] = -pull * (x * s2 - kCrank * s21 / 2) / 2 - s2;
  };
  f.constraint = [](double, ConstSpan q, Span phi) {
    phi[0] = q[1] - std::cos(q[2]) - kCrank * std::cos(q[0]);
    phi[1] = -std::sin(q[2]) - kCrank * std::sin(q[0]);
  };
  f.constraint_jacobian = [](double, ConstSpan q, MatrixEntries j) {
    j(0, 0) = kCrank * std::sin(q[0]), j(0, 1) = 1, j(0, 2) = std::sin(q[2]);
    j(1, 0) = -kCrank * std::cos(q[0]), j(1, 2) = -std::cos(q[2]);
  };
  f.constraint_gamma = [](double, ConstSpan q, ConstSpan v, Span gamma) {
    gamma[0] = -std::cos(q[2]) * v[2] * v[2] - kCrank * std::cos(q[0]) * v[0] * v[0];
    gamma[1] = -std::sin(q[2]) * v[2] * v[2] - kCrank * std::sin(q[0]) * v[0] * v[0];
  };
  return f;
}

StepCase sundials_slider_crank() {
  const double rod = std::asin(-0.5);
  return of_functions({"crank", "SUNDIALS' slider crank", nullptr, {}, 2, 1.0 / 50}, sundials_slider_crank_functions(),
                      {std::numbers::pi / 2, std::cos(rod), rod}, {0, 0, 0});
}

StepCase andrews_mechanism() {
  StepCase c{
      "andrews", "Andrews' mechanism", std::make_unique<FunctionSystem>(andrews_functions()), andrews_start(), 0.03,
      0.03 / 400};
  return finished(std::move(c));
}

StepCase heavy_top() {
  RigidBodyData d;
  d.mass = 15;
  d.inertia = Vec3(0.234375, 0.46875, 0.234375).asDiagonal();
  d.position = {0, 1, 0};
  d.angular_velocity = {0, 150, -4.61538};
  d.velocity = d.angular_velocity.cross(d.position);
  d.gravity = {0, 0, -9.81};
  auto system = std::make_unique<AssembledSystem>();
  RigidBody& top = system->add(std::make_unique<RigidBody>("top", d));
  system->add(spherical_joint("tip", std::make_unique<GroundFrame>(), frame_at(top, Vec3::Zero())));
  return of_components({"top", "heavy top", nullptr, {}, 0.2, 1.0 / 1000, {{0, 0}}}, std::move(system));
}

StepCase flexible_pendulum() {
  const double area = 25e-6, young = 1e9 / 625, density = 8000.0 / 25;  // 5 sqrt(1e-6 / pi) m of radius
  auto system = std::make_unique<AssembledSystem>();
  auto cable = make_cable_body("pendulum", {0, 0, 0}, {1, 0, 0}, 4,
                               {young * area, young * area * area / (4 * std::numbers::pi), density * area});
  cable->set_gravity({0, -9.81, 0});
  cable->set_initial_motion({1, 0, 0, 0, 1, 0, 0, 0, 1}, {}, {}, {0, 4, 0});
  FlexibleBody& body = system->add(std::move(cable));
  system->add(spherical_joint("pin", std::make_unique<GroundFrame>(), make_node_frame(body, 0)));
  return of_components(
      {"flexible", "flexible pendulum", nullptr, {}, 0.2, 1.0 / 2000, {{0, 0}, {6, 6}, {12, 12}, {18, 18}, {24, 24}}},
      std::move(system));
}

std::vector<StepCase (*)()> step_cases() {
  return {&spatial_slider_crank, &car_axis, &sundials_slider_crank, &andrews_mechanism, &heavy_top, &flexible_pendulum};
}

}  // namespace espalier::dynamics
