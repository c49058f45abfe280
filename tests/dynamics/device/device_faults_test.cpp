// Calls of CUDA refused in turn while integrators have their vectors on a GPU. Truth: the run of the host, which goes
// on with what the GPU does not do.
#include <gtest/gtest.h>

#include <memory>

#include "dynamics/device/device_run.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "solver/gpu/refused_calls.hpp"

namespace espalier::dynamics {
namespace {

using espalier::test::Attempt;
using espalier::test::Refusals;
using test::Course;
using test::kSmallEngine;
using test::Place;
using test::RunResult;

class DeviceFaults : public espalier::test::RefusedCalls {
 protected:
  /// @param run  of a Course
  template <class Run>
  static void refuse(const Run& run, double tolerance) {
    const RunResult truth = run(Course{.place = Place::host});
    int host_went_on = 0;
    const Refusals told = espalier::test::refuse_some(
        [&]() -> Attempt {
          auto found = std::make_shared<RunResult>();
          return {[&, found] {
                    try {
                      *found = run(Course{.place = Place::gpu});
                    } catch (const Error& e) {
                      return e.status();
                    }
                    if (const char* refused = device::cuda::call_faults().refused;
                        refused != nullptr && !found->notice.empty()) {
                      ++host_went_on;
                      const Status told_of{StatusCode::device_error, found->notice, -1};
                      EXPECT_TRUE(espalier::test::names_the_call(told_of, refused) ||
                                  found->notice.find("memory") != std::string::npos)
                          << found->notice;
                    }
                    return Status{};
                  },
                  [&, found] { expect_same(*found, truth, tolerance); }};
        },
        100);
    EXPECT_GT(told.tried, 50);
    EXPECT_GT(host_went_on, told.tried / 4);
    testing::Test::RecordProperty("refused", std::to_string(told.tried));
    testing::Test::RecordProperty("errors", std::to_string(told.errors));
  }

  static std::unique_ptr<model::Mechanism> engine() { return test::built_from("engine.toml", kSmallEngine, 1); }
};

TEST_F(DeviceFaults, BdfGoesOnOnTheHost) {
  BdfOptions options;
  options.max_order = 3;
  options.relative = 1e-5;
  options.absolute = 1e-9;
  options.absolute_velocity = 1e-6;
  refuse(
      [&](const Course& course) {
        return test::run_there(engine, 1e-6, course,
                               [&](Equations& equations) { return BdfIntegrator(equations, options); });
      },
      1e-6);
}

TEST_F(DeviceFaults, GeneralizedAlphaGoesOnOnTheHost) {
  AlphaOptions options;
  options.step = 1e-6;
  refuse(
      [&](const Course& course) {
        return test::run_there(engine, 6e-6, course,
                               [&](Equations& equations) { return GeneralizedAlpha(equations, options); });
      },
      1e-6);
}

}  // namespace
}  // namespace espalier::dynamics
