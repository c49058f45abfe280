// Allocations of short runs of models fail, one in each run: those of operator new, and those of malloc(), by which
// Eigen takes its own. A status says so, or the result is right; nothing is left behind; the same call works again.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "espalier/dynamics.hpp"
#include "espalier/model_harmonic.hpp"
#include "espalier/model_modes.hpp"
#include "espalier/sensitivities.hpp"
#include "refused_allocations.hpp"
#include "rounds.hpp"

// What the linker puts in the place of malloc() and its like in all that is linked into this program (--wrap).
extern "C" {
void* __real_malloc(std::size_t bytes);
void* __real_calloc(std::size_t count, std::size_t bytes);
void* __real_realloc(void* p, std::size_t bytes);
void* __wrap_malloc(std::size_t bytes) { return espalier::test::refused(bytes) ? nullptr : __real_malloc(bytes); }
void* __wrap_calloc(std::size_t count, std::size_t bytes) {
  return espalier::test::refused(count * bytes) ? nullptr : __real_calloc(count, bytes);
}
void* __wrap_realloc(void* p, std::size_t bytes) {
  return espalier::test::refused(bytes) ? nullptr : __real_realloc(p, bytes);
}
}

namespace espalier {
namespace memory_test {

[[maybe_unused]] const bool counted_once = (test::plain_malloc = __real_malloc, true);

using test::allocations;
using test::allocations_left;
using test::held;
using test::kNever;

const std::string kPendulum = R"(
gravity = [0, 0, -9.81]
[integrator]
end = 0.02
[bodies.bob]
type = "rigid"
mass = 1
inertia = [0.1, 0.1, 0.1]
position = [1, 0, 0]
[joints.hinge]
type = "revolute"
a = { body = "ground", axis = [0, 1, 0] }
b = { body = "bob", point = [-1, 0, 0], axis = [0, 1, 0] }
[forces.spring]
type = "spring"
a = { body = "ground", point = [0, 0, 2] }
b = { body = "bob" }
stiffness = 30
damping = 0.5
[output]
quantities = ["bob.position.x", "hinge.force.z"]
)";

const std::string kBar = R"(
gravity = [0, 0, -9.81]
[bodies.bar]
type = "solid"
mesh = { part = "block", lx = 0.4, ly = 0.1, lz = 0.1, divisions = [2, 1, 1] }
material = { young = 2e9, poisson = 0.3, density = 1500 }
damping = { stiffness = 1e-4 }
[markers]
root = { body = "bar", face = "x0" }
tip = { body = "bar", face = "x1" }
[joints.wall]
type = "fixed"
a = { body = "ground", point = [0, 0.05, 0.05] }
b = "root"
[forces.push]
type = "load"
a = "tip"
force = [0, 0, -200]
[output]
quantities = ["tip.position.z", "wall.force.z"]
)";

const std::string kSwing = kBar + "[integrator]\nmethod = \"generalized-alpha\"\nstep = 1e-3\nend = 3e-3\n";
const std::string kStatics = kBar + "[statics]\n";
const std::string kModes = kBar + "[initial]\nmodes = 3\n";
const std::string kHarmonic = kBar + R"([harmonic]
from = 10
to = 40
points = 3
loads = ["push"]
quantities = ["tip.position.z"]
)";

/// A body that is reduced to four modes, a cable on it, and a ball in contact. (Two or three would cut pairs of equal
/// modes, of which any may be taken.)
const std::string kMany = R"(
gravity = [0, 0, -9.81]
[integrator]
method = "generalized-alpha"
step = 2e-4
end = 2e-3
[bodies.bar]
type = "solid"
mesh = { part = "block", lx = 0.4, ly = 0.1, lz = 0.07, divisions = [2, 1, 1] }
material = { young = 2e9, poisson = 0.3, density = 1500 }
reduce = { modes = 4 }
[bodies.cable]
type = "cable"
start = [0.4, 0.05, 0.035]
end = [0.8, 0.05, 0.035]
elements = 2
axial = 1e4
bending = 0.5
mass_per_length = 0.3
[bodies.ball]
type = "rigid"
mass = 0.2
inertia = [1e-3, 1e-3, 1e-3]
position = [0.2, 0.05, 0.1499]
[surfaces.skin]
body = "ball"
shape = "sphere"
radius = 0.05
[surfaces.floor]
body = "ground"
shape = "plane"
point = [0, 0, 0.1]
normal = [0, 0, 1]
[contacts.touch]
surfaces = ["skin", "floor"]
stiffness = 1e6
[joints.wall]
type = "fixed"
a = { body = "ground", point = [0, 0.05, 0.035] }
b = { body = "bar", face = "x0" }
[joints.knot]
type = "spherical"
a = { body = "bar", face = "x1" }
b = { body = "cable", node = 1 }
[output]
quantities = ["ball.position.z", "knot.force.z", "energy.total"]
)";

SimulationOptions one_thread() {
  SimulationOptions o;
  o.keep_series = true;
  o.solver = {{"device", "cpu"}, {"threads", "1"}};
  return o;
}

/// What a call has ended with, and its numbers.
struct Told {
  Status status;
  std::vector<double> numbers;
};

Told simulated(const std::string& text) {
  Simulation s(one_thread());
  Status status = s.load_text(text, "model.toml");
  if (status.ok()) status = s.run();
  return {status, status.ok() ? s.series().values : std::vector<double>()};
}

/// A motion that is saved in its middle, and restored in the same object.
Told restored(const std::string& text) {
  Simulation s(one_thread());
  Status status = s.load_text(text, "model.toml");
  if (status.ok()) status = s.step_to(1e-3);
  if (!status.ok()) return {status, {}};
  const std::string state = s.save();
  if (status = s.run(); status.ok()) status = s.restore(state);
  if (status.ok()) status = s.run();
  return {status, status.ok() ? s.series().values : std::vector<double>()};
}

Told modes_of(const std::string& text) {
  const ModelModesResult r = model_modes_of_text(text, "model.toml", "", {0}, 3, one_thread());
  Told told{r.status, {}};
  if (r.status.ok())
    for (const SimulationMode& mode : r.points.front().modes) told.numbers.push_back(mode.frequency);
  return told;
}

Told response_of(const std::string& text) {
  const ModelHarmonicResult r = model_harmonic_of_text(text, "model.toml", one_thread());
  Told told{r.status, {}};
  for (const auto& y : r.response.responses) told.numbers.insert(told.numbers.end(), {y.real(), y.imag()});
  return told;
}

/// The largest over the largest number of the truth. An order of elimination for which there is no memory is replaced
/// by another, which rounds otherwise.
double difference(const std::vector<double>& found, const std::vector<double>& truth) {
  if (found.size() != truth.size()) return 1;
  double most = 0, largest = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double apart = std::abs(found[i] - truth[i]);
    if (!(apart <= most)) most = apart;
    largest = std::max(largest, std::abs(truth[i]));
  }
  return most / largest;
}

struct Case {
  const char* name;
  Told (*run)(const std::string&);
  const std::string& text;
};

const Case kCases[] = {{"pendulum", simulated, kPendulum}, {"swing", simulated, kSwing},
                       {"restart", restored, kSwing},      {"statics", simulated, kStatics},
                       {"modes", modes_of, kModes},        {"harmonic", response_of, kHarmonic},
                       {"many", simulated, kMany}};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class ModelMemory : public testing::TestWithParam<Case> {};

TEST_P(ModelMemory, EveryAllocationThatFailsIsTold) {
  const Case& c = GetParam();
  for (int k = 0; k < 2; ++k) {  // what is made once and kept
    const Told told = c.run(c.text);
    ASSERT_TRUE(told.status.ok()) << told.status.message;
  }
  allocations = 0;
  const Told truth = c.run(c.text);
  const long total = allocations;
  ASSERT_GT(total, 500);
  ASSERT_FALSE(truth.numbers.empty());
  const char* every = std::getenv("ESPALIER_EVERY_ALLOCATION");  // 1: all of them
  const long tried = test::rounds(400L, 60L), step = every != nullptr ? std::atol(every) : std::max(1L, total / tried);
  long failures = 0;
  for (long k = 0; k < total; k += step) {
    const long before = held;
    {
      Told told;
      allocations_left = k;
      try {
        told = c.run(c.text);
      } catch (const std::bad_alloc&) {
        told.status = {StatusCode::out_of_memory, "thrown", -1};
      }
      allocations_left = kNever;
      if (told.status.ok()) {
        EXPECT_LE(difference(told.numbers, truth.numbers), 1e-6) << "allocation " << k << " of " << total;
      } else {
        ++failures;
        EXPECT_EQ(told.status.code, StatusCode::out_of_memory)
            << "allocation " << k << " of " << total << ": " << told.status.message;
        EXPECT_FALSE(told.status.message.empty());
      }
    }
    EXPECT_LE(held - before, 2) << "left behind by allocation " << k << " of " << total;
    if (k % 5 != 0 && !HasFailure()) continue;
    const Told again = c.run(c.text);
    ASSERT_TRUE(again.status.ok()) << "after allocation " << k << ": " << again.status.message;
    ASSERT_EQ(again.numbers, truth.numbers) << "after allocation " << k;
  }
  EXPECT_GT(failures, 20);
  RecordProperty("allocations", std::to_string(total));
}

INSTANTIATE_TEST_SUITE_P(Models, ModelMemory, testing::ValuesIn(kCases),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace memory_test
}  // namespace espalier
