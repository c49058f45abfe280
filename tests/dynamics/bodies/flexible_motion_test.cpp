// Free flexible bodies in motion: momentum, angular momentum and energy are conserved.
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/meshers/parts.hpp"
#include "dynamics/parameters.hpp"

namespace espalier::dynamics {
namespace {

struct DriftOfNodes {
  double momentum = 0, angular_momentum = 0, energy = 0;  // relative
  double strain_energy = 0;                               // largest seen, relative to the kinetic energy
};

// A soft block that is thrown and tumbles about all three axes; it starts unstrained, so it stretches and swings.
DriftOfNodes tumble(SolidLaw law, double tolerance) {
  AssembledSystem system;
  auto owned = make_solid_body("block", make_block({3, 2, 1}, 3, 2, 1, ElementType::hex8), {law, 2e5, 0.3, 1000});
  owned->set_initial_motion({1, 0, 0, 0, 1, 0, 0, 0, 1}, {-1.5, -1, -0.5}, {1, -2, 0.5}, {1, 2, 3});
  FlexibleBody& body = system.add(std::move(owned));
  system.finish();
  Equations equations(system);
  State s(system.sizes());
  system.initial(s.q, s.v);
  make_consistent(equations, s);
  BdfOptions options;
  options.relative = options.absolute = tolerance;
  BdfIntegrator bdf(equations, options);
  bdf.start(s);
  const MassProperties before = body.mass_properties(s.q, s.v);
  const Energy energy = system.energy(s.view());
  DriftOfNodes drift;
  bdf.integrate(0.3, [&](const StepReport&) {
    drift.strain_energy = std::max(drift.strain_energy, system.energy(bdf.state().view()).potential / energy.kinetic);
    return true;
  });
  // Angular momentum about the centre of mass, which flies on a straight line.
  const MassProperties after = body.mass_properties(bdf.state().q, bdf.state().v);
  double momentum = 0, angular = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    momentum = std::max(momentum, std::abs(before.momentum[i]));
    angular = std::max(angular, std::abs(before.angular_momentum[i]));
  }
  for (std::size_t i = 0; i < 3; ++i) {
    drift.momentum = std::max(drift.momentum, std::abs(after.momentum[i] - before.momentum[i]) / momentum);
    drift.angular_momentum =
        std::max(drift.angular_momentum, std::abs(after.angular_momentum[i] - before.angular_momentum[i]) / angular);
  }
  drift.energy = std::abs(system.energy(bdf.state().view()).total() - energy.total()) / energy.total();
  return drift;
}

class FreeFlight : public testing::TestWithParam<SolidLaw> {};

TEST_P(FreeFlight, ConservesMomentaAndEnergy) {
  const DriftOfNodes coarse = tumble(GetParam(), 1e-5), fine = tumble(GetParam(), 1e-7);
  EXPECT_GT(fine.strain_energy, 1e-3);  // it does deform
  // Linear momentum is a linear invariant, which every BDF keeps to round-off (sums over 72 coordinates, a few hundred
  // steps); the others follow the tolerance. Measured with the fine one: 1.3e-8 and 1.2e-7.
  EXPECT_LT(coarse.momentum, 1e-12);
  EXPECT_LT(fine.momentum, 1e-12);
  EXPECT_LT(fine.angular_momentum, 1e-7);
  EXPECT_LT(fine.energy, 1e-6);
  EXPECT_LT(fine.angular_momentum, 0.2 * coarse.angular_momentum);
  EXPECT_LT(fine.energy, 0.2 * coarse.energy);
}

INSTANTIATE_TEST_SUITE_P(Laws, FreeFlight, testing::Values(SolidLaw::st_venant_kirchhoff, SolidLaw::neo_hookean));

}  // namespace
}  // namespace espalier::dynamics
