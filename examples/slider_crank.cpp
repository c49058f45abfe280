// A rigid slider-crank written against the generic layer: masses, forces, constraints, and nothing else.
// Coordinates q = [crank angle, rod centre x, rod centre y, rod angle, slider x]; four constraints close the mechanism.
#include <cmath>
#include <cstdio>

#include "espalier/dae.hpp"

using Numbers = std::span<const double>;
using Out = std::span<double>;

int main() {
  constexpr double crank = 0.15, rod = 0.30;  // lengths, m
  constexpr double crank_inertia = 0.00272, rod_mass = 0.151, rod_inertia = 0.00113, slider_mass = 0.0756, g = 9.81;

  espalier::DaeFunctions f;
  f.coordinates = 5;
  f.constraints = 4;
  f.mass = [](Numbers, espalier::MatrixEntries m) {
    m(0, 0) = crank_inertia;
    m(1, 1) = m(2, 2) = rod_mass;
    m(3, 3) = rod_inertia;
    m(4, 4) = slider_mass;
  };
  f.force = [](double, Numbers, Numbers, Out out) { out[2] = -rod_mass * g; };
  f.constraint = [](double, Numbers q, Out phi) {  // the rod's ends sit on the crank pin and on the slider
    phi[0] = q[1] - rod / 2 * std::cos(q[3]) - crank * std::cos(q[0]);
    phi[1] = q[2] - rod / 2 * std::sin(q[3]) - crank * std::sin(q[0]);
    phi[2] = q[1] + rod / 2 * std::cos(q[3]) - q[4];
    phi[3] = q[2] + rod / 2 * std::sin(q[3]);
  };
  // Derivatives may be left out; given ones are faster and exact.
  f.constraint_jacobian = [](double, Numbers q, espalier::MatrixEntries j) {
    const double s = rod / 2 * std::sin(q[3]), c = rod / 2 * std::cos(q[3]);
    j(0, 0) = crank * std::sin(q[0]), j(0, 1) = 1, j(0, 3) = s;
    j(1, 0) = -crank * std::cos(q[0]), j(1, 2) = 1, j(1, 3) = -c;
    j(2, 1) = 1, j(2, 3) = -s, j(2, 4) = -1;
    j(3, 2) = 1, j(3, 3) = c;
  };
  f.constraint_gamma = [](double, Numbers q, Numbers v, Out gamma) {
    const double s = rod / 2 * std::sin(q[3]) * v[3] * v[3], c = rod / 2 * std::cos(q[3]) * v[3] * v[3];
    gamma[0] = -c - crank * std::cos(q[0]) * v[0] * v[0];
    gamma[1] = -s - crank * std::sin(q[0]) * v[0] * v[0];
    gamma[2] = c;
    gamma[3] = s;
  };
  f.energy = [](const espalier::StateView& s) {
    const double k = crank_inertia * s.v[0] * s.v[0] + rod_mass * (s.v[1] * s.v[1] + s.v[2] * s.v[2]) +
                     rod_inertia * s.v[3] * s.v[3] + slider_mass * s.v[4] * s.v[4];
    return espalier::Energy{k / 2, rod_mass * g * s.q[2]};
  };

  espalier::DaeOptions options;
  options.relative = options.absolute = 1e-9;
  espalier::Dae dae(f, options);
  const double q[] = {0.3, 0.3, 0.02, -0.15, 0.44}, v[] = {150, 0, 0, 0, 0};  // roughly: start() makes them consistent
  espalier::Status status = dae.start(0, q, v);
  if (status.ok()) std::printf("Jacobians against differences: %.1e\n", dae.check_jacobians().largest());
  const double start = status.ok() ? dae.energy().total() : 0;
  for (int k = 1; k <= 10 && status.ok(); ++k) {
    status = dae.integrate(0.01 * k);
    const espalier::StateView s = dae.state();
    std::printf("t %.2f  crank %9.5f rad  slider %.6f m  pin force %8.2f N  energy change %.1e J\n", s.t, s.q[0],
                s.q[4], std::hypot(s.lambda[0], s.lambda[1]), dae.energy().total() - start);
  }
  if (!status.ok()) {
    std::fprintf(stderr, "%s\n", status.message.c_str());
    return 1;
  }
  const espalier::DaeSummary run = dae.summary();
  std::printf("%ld steps, %ld factorizations, constraints within %.1e\n", run.steps, run.factorizations,
              run.largest_position);
  return run.largest_position < 1e-10 && std::fabs(dae.energy().total() - start) < 1e-4 * start ? 0 : 1;
}
