// Bodies and the matrix K on a GPU. Truth: the host.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/at.hpp"
#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/equations.hpp"
#include "dynamics/device/device_common.hpp"
#include "dynamics/elements/elements_common.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/integrators/statics/statics.hpp"
#include "dynamics/meshers/parts.hpp"
#include "dynamics/model/built_model.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier::dynamics {
namespace {

using test::difference;

class DeviceAssemblyTest : public espalier::test::OnGpu {};

std::unique_ptr<LinearSolver> solver_on(const std::string& device, Index unknowns) {
  Options options = newton_options(unknowns);
  options.device = device;
  return make_espalier_solver(options);
}

std::unique_ptr<model::Mechanism> engine(const std::string& formulation, double damping) {
  return test::built_from("engine.toml",
                          {"parameters.unknowns=1200", "bodies.crank.hex8=\"" + formulation + "\"",
                           "bodies.crank.damping.stiffness=" + fmt::format("{:f}", damping),
                           "bodies.crank.damping.mass=" + fmt::format("{:f}", 1e5 * damping)},
                          2);
}

/// Two Equations of one system, the second with its bodies on the GPU. F, W and solutions with K are compared at a few
/// states with a few weights.
template <class Make>
void compare(const Make& make) {
  const auto on_host = make(), on_gpu = make();
  const Sizes sizes = on_host->system.sizes();
  const Index unknowns = sizes.velocity + sizes.constraints;
  Equations host(on_host->system, solver_on("cpu", unknowns)), gpu(on_gpu->system, solver_on("gpu:0", unknowns));
  gpu.set_pool(&on_gpu->pool);
  gpu.allow_device();
  EXPECT_FALSE(gpu.on_device());  // no factor, no device
  for (const unsigned seed : {1U, 2U}) {
    const State s = anywhere(*on_host, seed, 2e-5);
    for (const TangentWeights w : {TangentWeights{1, 1e-4, 1e-8}, TangentWeights{1, 0, 0}, TangentWeights{1, 2e-3, 0},
                                   TangentWeights{0.5, 0, 1e-7}}) {
      std::vector<double> b(static_cast<std::size_t>(unknowns)), x;
      for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::sin(1.0 + static_cast<double>(i) * seed);
      x = b;
      std::vector<double> f(static_cast<std::size_t>(sizes.velocity)), g(f);
      for (Equations* e : {&host, &gpu}) {
        e->evaluate_constraints(s.t, s.q, s.v);
        e->factorize(s.view(), w);
        e->factorize(s.view(), w);  // the first one of the GPU's was assembled on the host
      }
      EXPECT_TRUE(gpu.on_device());
      host.motion(s.view(), f);
      gpu.motion(s.view(), g);
      EXPECT_LT(difference(g, f), 1e-13);
      EXPECT_LT(difference(gpu.kkt().scale(), host.kkt().scale()), 1e-12);
      std::vector<double> sizes_of_rows(f.size(), 0.5), rows(f.size()), rows_there(rows);
      host.kkt().sum_rows_of_w(sizes_of_rows, rows);
      gpu.kkt().sum_rows_of_w(sizes_of_rows, rows_there);
      EXPECT_LT(difference(rows_there, rows), 1e-9);
      EXPECT_LT(difference(gpu.kkt().w_of_factor(), host.kkt().w_of_factor()), 1e-12);
      host.solve(b);
      gpu.solve(x);
      EXPECT_LT(difference(x, b), 1e-8);
      std::vector<double> again(g);
      gpu.motion(s.view(), again);
      EXPECT_EQ(again, g);
    }
  }
}

TEST_F(DeviceAssemblyTest, GivesWhatTheHostGives) {
  for (const char* formulation : {"full", "mean-dilatation", "enhanced"})
    for (const double damping : {0.0, 2e-6}) {
      SCOPED_TRACE(formulation + (", damping " + std::to_string(damping)));
      compare([&] { return engine(formulation, damping); });
    }
}

// Most of W comes from the joints and guides of twelve bodies, which stay on the host.
TEST_F(DeviceAssemblyTest, ManyJointsGiveWhatTheHostGives) {
  compare([] { return test::built_from("chain.toml", {"parameters.unknowns=7000"}, 2); });
}

// No joint declares the diagonal of a rigid body that a spherical joint alone holds.
TEST_F(DeviceAssemblyTest, MassesOfTheHostAreInW) {
  compare([] { return built(test::kTopOnAnArm); });
}

/// The engine under its gas force, at rest. @return where it balances
State balanced(const std::string& device, bool& on_device) {
  const auto mechanism = engine("enhanced", 2e-6);
  const Sizes sizes = mechanism->system.sizes();
  Equations equations(mechanism->system, solver_on(device, sizes.velocity + sizes.constraints));
  equations.set_pool(&mechanism->pool);
  State s(sizes);
  mechanism->system.initial(s.q, s.v);
  equations.allow_device();
  (void)static_equilibrium(equations, s);
  on_device = equations.on_device();
  return s;
}

TEST_F(DeviceAssemblyTest, EquilibriaAgree) {
  bool on_host = true, on_gpu = false;
  const State host = balanced("cpu", on_host), gpu = balanced("gpu:0", on_gpu);
  EXPECT_FALSE(on_host);
  EXPECT_TRUE(on_gpu);
  EXPECT_LT(difference(gpu.q, host.q), 1e-9);
  EXPECT_LT(difference(gpu.lambda, host.lambda), 1e-6);
}

/// Elements of one type, each by itself.
Mesh single_elements(ElementType type, Index count) {
  Mesh mesh;
  const test::Vector x = test::regular_element(type);
  for (Index e = 0; e < count; ++e) {
    std::vector<Index> nodes;
    for (Eigen::Index a = 0; a < x.size(); a += 3) {
      nodes.push_back(static_cast<Index>(mesh.nodes.size()));
      mesh.nodes.push_back({x[a] + 2 * e, x[a + 1], x[a + 2]});
    }
    mesh.add_element(type, nodes);
  }
  return mesh;
}

/// The body somewhere, in motion.
void compare_body(std::unique_ptr<FlexibleBody> owned, double damping) {
  AssembledSystem system;
  FlexibleBody& body = system.add(std::move(owned));
  body.fit_device_always();
  body.set_damping({100 * damping, damping});
  body.set_gravity({0, 0, -9.81});
  system.finish();
  State s(system.sizes());
  system.initial(s.q, s.v);
  for (std::size_t i = 0; i < s.q.size(); ++i) s.q[i] += 0.005 * std::sin(static_cast<double>(3 * i));
  for (std::size_t i = 0; i < s.v.size(); ++i) s.a[i] = s.v[i] = std::cos(static_cast<double>(2 * i));
  std::vector<double> on_host(s.v.size()), on_gpu(s.v.size());
  system.residual(s.view(), on_host);
  const TangentWeights weights{1, 1e-2, 1e-4};
  std::vector<double> w(static_cast<std::size_t>(system.tangent_pattern().nonzeros()));
  system.tangent(s.view(), weights, w);
  Equations equations(system, solver_on("gpu:0", system.sizes().velocity));
  equations.allow_device();
  equations.factorize(s.view(), weights);
  ASSERT_TRUE(body.on_device());
  system.residual(s.view(), on_gpu);
  EXPECT_LT(difference(on_gpu, on_host), 1e-13);
  equations.factorize(s.view(), weights);
  EXPECT_LT(difference(equations.kkt().w_of_factor(), w), 1e-13);
}

void compare_body(const Mesh& mesh, const Material& material, const SolidOptions& options, double damping) {
  SCOPED_TRACE(testing::Message() << shape_of(mesh.type(0)).name << ", " << mesh.element_count() << " elements, law "
                                  << static_cast<int>(material.law) << ", formulation "
                                  << static_cast<int>(options.hex8) << ", damping " << damping);
  compare_body(make_solid_body("body", mesh, material, options), damping);
}

TEST_F(DeviceAssemblyTest, EverySolid) {
  for (const ElementType type : {ElementType::tet4, ElementType::tet10, ElementType::hex8, ElementType::hex20})
    for (const SolidLaw law : {SolidLaw::st_venant_kirchhoff, SolidLaw::neo_hookean})
      for (const double damping : {0.0, 1e-3}) {
        SolidOptions options;
        options.hex8 = law == SolidLaw::neo_hookean ? Hex8Formulation::full : Hex8Formulation::enhanced;
        compare_body(single_elements(type, 37), {law, 2e5, 0.3, 1000}, options, damping);
      }
}

TEST_F(DeviceAssemblyTest, OneElementAndRowsThatAreNotFull) {
  for (const Index across : {1, 3, 5})
    for (const Hex8Formulation form : {Hex8Formulation::full, Hex8Formulation::mean_dilatation})
      for (const double damping : {0.0, 1e-3}) {
        SolidOptions options;
        options.hex8 = form;
        compare_body(make_block({3, 2, 1}, across, 3, across, ElementType::hex8),
                     {SolidLaw::st_venant_kirchhoff, 2e5, 0.3, 1000}, options, damping);
      }
}

// A vertex pushed through the opposite face.
TEST_F(DeviceAssemblyTest, InvertedElementsAreNamed) {
  AssembledSystem system;
  FlexibleBody& body = system.add(make_solid_body("block", make_block({3, 1, 1}, 3, 1, 1, ElementType::hex8),
                                                  {SolidLaw::st_venant_kirchhoff, 2e5, 0.3, 1000}));
  system.finish();
  State s(system.sizes());
  system.initial(s.q, s.v);
  Equations equations(system, solver_on("gpu:0", system.sizes().velocity));
  equations.allow_device();
  equations.factorize(s.view(), {1, 0, 1e-4});
  ASSERT_TRUE(body.on_device());
  std::vector<double> f(s.v.size());
  system.residual(s.view(), f);
  EXPECT_EQ(body.inverted_element(), -1);
  for (std::size_t i = 0; i < s.q.size(); i += 3)
    if (s.q[i] > 2.9) s.q[i] -= 2;
  std::vector<double> on_gpu(f);
  system.residual(s.view(), on_gpu);
  const auto label = body.inverted_element();
  system.leave_device();
  system.residual(s.view(), f);
  EXPECT_EQ(label, body.inverted_element());
  EXPECT_GE(label, 0);
  for (std::size_t i = 0; i < f.size(); ++i) EXPECT_EQ(std::isnan(f[i]), std::isnan(on_gpu[i])) << i;
}

/// A body alone, up to that time, with the vectors of the integrator where K is. @return its state then
State moved_freely(std::unique_ptr<FlexibleBody> owned, const std::string& device, double end, bool& on_device) {
  AssembledSystem system;
  system.add(std::move(owned));
  system.finish();
  Equations equations(system, solver_on(device, system.sizes().velocity));
  State s(system.sizes());
  system.initial(s.q, s.v);
  make_consistent(equations, s);
  BdfOptions options;
  options.relative = options.absolute = 1e-7;
  BdfIntegrator bdf(equations, options);
  bdf.start(s);
  equations.allow_device();
  bdf.integrate(end, [](const StepReport&) { return true; });
  on_device = equations.on_device();
  return bdf.state();
}

/// A soft block that tumbles for 0.05 s. @return its state at the end
State tumbled(const std::string& device, bool& on_device) {
  auto owned = make_solid_body("block", make_block({3, 2, 1}, 4, 3, 2, ElementType::hex8),
                               {SolidLaw::st_venant_kirchhoff, 2e5, 0.3, 1000});
  owned->set_initial_motion({1, 0, 0, 0, 1, 0, 0, 0, 1}, {-1.5, -1, -0.5}, {1, -2, 0.5}, {1, 2, 3});
  owned->set_damping({0, 1e-3});
  return moved_freely(std::move(owned), device, 0.05, on_device);
}

TEST_F(DeviceAssemblyTest, RunsAgree) {
  bool on_host = true, on_gpu = false;
  const State host = tumbled("cpu", on_host), gpu = tumbled("gpu:0", on_gpu), again = tumbled("gpu:0", on_gpu);
  EXPECT_FALSE(on_host);
  EXPECT_TRUE(on_gpu);
  EXPECT_LT(difference(gpu.q, host.q), 1e-9);
  EXPECT_LT(difference(gpu.v, host.v), 1e-7);
  EXPECT_EQ(gpu.q, again.q);
  EXPECT_EQ(gpu.v, again.v);
}

// What faces couple goes over the link: little of the engine's W, most of the chain's, which is no reason to stay.
/// A second step of the engine's Newton iteration, with bodies on the GPUs of the factor.
State after_a_pass(const std::string& device, int gpus) {
  const auto mechanism = engine("enhanced", 2e-6);
  const Sizes sizes = mechanism->system.sizes();
  Equations equations(mechanism->system, solver_on(device, sizes.velocity + sizes.constraints));
  equations.allow_device([](const GpuPlaces& places, base::ThreadPool* pool) {
    auto assembly = make_device_assembly(places, pool);
    assembly->divide_from(0);
    return assembly;
  });
  State s = anywhere(*mechanism, 1, 2e-5);
  equations.evaluate_constraints(s.t, s.q, s.v);
  for (int pass = 0; pass < 2; ++pass) equations.factorize(s.view(), {1, 1e-4, 1e-8});
  EXPECT_EQ(equations.kkt().gpu_places().gpus.size(), static_cast<std::size_t>(gpus));
  std::vector<double> f(at(sizes.velocity));
  equations.motion(s.view(), f);
  const ConstSpan w = equations.kkt().w_of_factor();
  s.v.assign(w.begin(), w.end());
  s.a = f;
  return s;
}

// As many as there are.
TEST_F(DeviceAssemblyTest, GpusShareTheElementsWithTheSameBits) {
  const State one = after_a_pass("gpu:0", 1);
  for (const int gpus : {2, 4, 8}) {
    std::string names = "gpu:0";
    for (int d = 1; d < gpus; ++d) names += "," + std::to_string(d);
    if (!espalier::test::has_gpus(gpus)) break;
    SCOPED_TRACE(names);
    const State several = after_a_pass(names, gpus);
    EXPECT_EQ(several.a, one.a);
    EXPECT_EQ(several.v, one.v);
  }
}

TEST(DeviceAssemblyWithoutGpu, FacesOfTheHostDecide) {
  EXPECT_LT(engine("enhanced", 2e-6)->system.host_share(), 0.8);
  const double chain = test::built_from("chain.toml", {"parameters.unknowns=20000"}, 2)->system.host_share();
  EXPECT_GT(chain, 0.8);
  EXPECT_LT(chain, 0.98);
  AssembledSystem nothing_fits;
  nothing_fits.finish();
  EXPECT_EQ(nothing_fits.host_share(), 1.0);
}

// The launches of a short chain would take longer than its elements.
TEST(DeviceAssemblyWithoutGpu, ShortChainsStayWithTheCores) {
  const auto chain = [](Index elements) {
    return make_cable_body("cable", {0, 0, 0}, {1, 0, 0}, elements, {2e3, 10, 2});
  };
  EXPECT_FALSE(chain(499)->fits_device());
  EXPECT_TRUE(chain(500)->fits_device());
  const auto short_chain = chain(3);
  short_chain->fit_device_always();
  EXPECT_TRUE(short_chain->fits_device());
}

TEST(DeviceAssemblyWithoutGpu, TheHostGoesOn) {
  bool on_device = true;
  (void)tumbled("cpu", on_device);
  EXPECT_FALSE(on_device);
  on_device = true;
  EXPECT_GT(max_norm(balanced("cpu", on_device).lambda), 0);
  EXPECT_FALSE(on_device);
}

TEST_F(DeviceAssemblyTest, EveryHexahedron) {
  for (const Hex8Formulation form :
       {Hex8Formulation::full, Hex8Formulation::mean_dilatation, Hex8Formulation::enhanced, Hex8Formulation::shell})
    for (const SolidLaw law : {SolidLaw::st_venant_kirchhoff, SolidLaw::neo_hookean})
      for (const double damping : {0.0, 1e-3}) {
        SolidOptions options;
        options.hex8 = form;
        compare_body(make_block({3, 2, 1}, 5, 3, 3, ElementType::hex8), {law, 2e5, 0.3, 1000}, options, damping);
      }
}

/// A tenth of a cylinder, 0.1 thick.
std::unique_ptr<FlexibleBody> curved_shell(Index along, Index around, SolidLaw law) {
  std::vector<Point> positions, directors;
  std::vector<std::array<Index, 4>> quads;
  for (Index i = 0; i <= along; ++i)
    for (Index k = 0; k <= around; ++k) {
      const double angle = 0.6 * k / around;
      directors.push_back({0, std::sin(angle), std::cos(angle)});
      positions.push_back({2.0 * i / along, 5 * std::sin(angle), 5 * std::cos(angle)});
      const Index n = i * (around + 1) + k;
      if (i < along && k < around) quads.push_back({n, n + around + 1, n + around + 2, n + 1});
    }
  return make_shell_body("shell", positions, directors, quads, {law, 2e5, 0.3, 1000}, 0.1);
}

TEST_F(DeviceAssemblyTest, Shells) {
  for (const Index across : {1, 7})
    for (const SolidLaw law : {SolidLaw::st_venant_kirchhoff, SolidLaw::neo_hookean})
      for (const double damping : {0.0, 1e-3}) {
        SCOPED_TRACE(testing::Message() << across << " across, law " << static_cast<int>(law) << ", damping "
                                        << damping);
        compare_body(curved_shell(across, across, law), damping);
      }
}

std::unique_ptr<FlexibleBody> straight_cable(Index elements) {
  return make_cable_body("cable", {0, 0, 0}, {1.0 * elements, 0, 0}, elements, {2e3, 10, 2});
}

TEST_F(DeviceAssemblyTest, Cables) {
  for (const Index elements : {1, 40})
    for (const double damping : {0.0, 1e-3}) {
      SCOPED_TRACE(testing::Message() << elements << " elements, damping " << damping);
      compare_body(straight_cable(elements), damping);
    }
}

/// A damped body that flies free for 0.02 s.
State flown(std::unique_ptr<FlexibleBody> owned, const std::string& device, bool& on_device) {
  owned->fit_device_always();
  owned->set_damping({0, 1e-3});
  owned->set_gravity({0, 0, -9.81});
  owned->set_initial_motion({1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}, {1, -2, 0.5}, {1, 2, 3});
  return moved_freely(std::move(owned), device, 0.02, on_device);
}

TEST_F(DeviceAssemblyTest, FlightsOfShellsAndCablesAgree) {
  for (const bool shell : {true, false}) {
    const auto make = [&] { return shell ? curved_shell(6, 6, SolidLaw::neo_hookean) : straight_cable(40); };
    bool on_host = true, on_gpu = false;
    const State host = flown(make(), "cpu", on_host), gpu = flown(make(), "gpu:0", on_gpu);
    EXPECT_FALSE(on_host);
    EXPECT_TRUE(on_gpu);
    EXPECT_LT(difference(gpu.q, host.q), 1e-8);
    EXPECT_LT(difference(gpu.v, host.v), 1e-6);
  }
}

}  // namespace
}  // namespace espalier::dynamics
