/// \file
/// Runs of any integrator whose vectors lie on a GPU, a real one or one that is emulated.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>

#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/device/device_common.hpp"
#include "dynamics/device/emulated_device.hpp"
#include "dynamics/device/failing_device.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/integrators/integrator.hpp"

namespace espalier::dynamics::test {

enum class Place { host, emulated, gpu };

/// How a run is to go.
struct Course {
  Place place = Place::emulated;
  int gpus = 1;          ///< that share the bodies; of a real one, which stands for all
  int fails_after = -1;  ///< factorizations on the emulated GPU
  CallsLeft calls{};
  int save_after = -1;   ///< steps: what save() writes is restored
  bool restores = true;  ///< false: the run that was saved goes on
  int copy_after = -1;   ///< steps: the next one is taken once more, from a copy, which goes on
};

struct RunResult {
  State end;
  IntegratorCounts counts;
  int steps_on_device = 0;
  long turns = 0;
  bool on_device_at_end = false;
  std::string notice;
};

/// What the GPU of the present run works with.
struct PresentGpu {
  AssembledSystem* twin = nullptr;  ///< of an emulated one
  int gpus = 1;                     ///< of a real one: see Course
  Index unknowns = 0;
  CallsLeft left;
};
inline PresentGpu present_gpu;

inline std::unique_ptr<DeviceAssembly> make_emulated(const GpuPlaces& places, base::ThreadPool*) {
  return std::make_unique<FailingAssembly>(std::make_unique<EmulatedAssembly>(*present_gpu.twin, places),
                                           present_gpu.left);
}

inline std::unique_ptr<DeviceAssembly> make_real(const GpuPlaces& places, base::ThreadPool* pool) {
  const std::vector<int> repeated(static_cast<std::size_t>(present_gpu.gpus), places.gpus.front());
  auto assembly = make_device_assembly(repeated.size() < 2 ? places : dealt(repeated, present_gpu.unknowns), pool);
  if (assembly != nullptr) assembly->divide_from(0);
  return std::make_unique<FailingAssembly>(std::move(assembly), present_gpu.left);
}

inline std::unique_ptr<LinearSolver> solver_for(const Course& course, Index unknowns) {
  if (course.place == Place::gpu) {
    Options options = newton_options(unknowns);
    options.device = "gpu:0";
    return make_espalier_solver(options);
  }
  auto solver = std::make_unique<EmulatedSolver>(unknowns, course.gpus);
  solver->fail_after(course.fails_after);
  return solver;
}

using Build = std::function<std::unique_ptr<model::Mechanism>()>;

/// From the consistent start to `end`. @param make  an integrator of Equations
template <class Make>
RunResult run_there(const Build& build, double end, const Course& course, const Make& make) {
  const auto mechanism = build(), twin = build();
  for (const auto* m : {mechanism.get(), twin.get()})
    for (const auto& c : m->system.components())
      if (auto* body = dynamic_cast<FlexibleBody*>(c.get())) body->fit_device_always();
  AssembledSystem& system = mechanism->system;
  const Sizes sizes = system.sizes();
  const Index unknowns = sizes.velocity + sizes.constraints;
  present_gpu = {&twin->system, course.gpus, unknowns, course.calls};
  Equations equations(system, solver_for(course, unknowns));
  State s(sizes);
  system.initial(s.q, s.v);
  make_consistent(equations, s);
  using Type = decltype(make(equations));
  auto integrator = std::make_unique<Type>(make(equations));
  integrator->start(s);
  if (course.place != Place::host) equations.allow_device(course.place == Place::gpu ? make_real : make_emulated);
  RunResult result;
  int steps = 0;
  while (integrator->state().t < end) {
    (void)integrator->step(end);
    if (integrator->on_device()) ++result.steps_on_device;
    ++steps;
    if (steps == course.copy_after) {
      auto copy = integrator->clone();
      (void)integrator->step(end);
      integrator.reset(static_cast<Type*>(copy.release()));
    }
    if (steps != course.save_after) continue;
    std::vector<double> saved;
    integrator->save(saved);
    if (!course.restores) continue;
    ConstSpan in = saved;
    integrator->restore(in);
    EXPECT_TRUE(in.empty());
  }
  result.end = integrator->state();
  result.counts = integrator->counts();
  result.turns = equations.counts().turns;
  result.on_device_at_end = integrator->on_device();
  result.notice = equations.device_notice();
  return result;
}

inline const std::vector<std::string> kSmallEngine = {"parameters.unknowns=1000", "parameters.run_up=0.001"};

inline void expect_same(const RunResult& gpu, const RunResult& host, double tolerance) {
  EXPECT_LT(difference(gpu.end.q, host.end.q), tolerance);
  EXPECT_LT(difference(gpu.end.v, host.end.v), 1e2 * tolerance);
  EXPECT_LT(difference(gpu.end.lambda, host.end.lambda), 1e4 * tolerance);
}

/// The GPU fails while the vectors enter it, in the middle of a step, or after one: in each of the first calls, and
/// then in some of those that follow, as long as the run has any.
/// @param run  of a Course @param tolerance  the host begins with another factor, after which steps may differ
template <class Run>
void expect_to_go_on_wherever_it_fails(const Run& run, Place place, double tolerance) {
  constexpr int kEach = 60;
  const RunResult host = run(Course{.place = Place::host});
  int fails = 0;
  for (int calls = 0;; calls += calls < kEach ? 1 : calls / 6) {
    SCOPED_TRACE(calls);
    const RunResult gpu = run(Course{.place = place, .calls = {.all = calls}});
    expect_same(gpu, host, tolerance);
    EXPECT_EQ(gpu.notice.empty(), gpu.on_device_at_end);
    if (gpu.notice.empty() || testing::Test::HasFailure()) break;
    ++fails;
  }
  EXPECT_GT(fails, kEach);
}

}  // namespace espalier::dynamics::test
