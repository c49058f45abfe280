// FMUs in a model: what they tell drives forces, and what they are told are quantities.
#include <gtest/gtest.h>

#include <cmath>

#include "espalier/dynamics.hpp"
#include "espalier/sensitivities.hpp"
#include "fmus.hpp"

namespace espalier::fmi {
namespace {

/// A mass of 2 on a line, pushed by what the FMU tells: y follows 4 with a lag of 0.1.
std::string pushed(const std::string& controller) {
  return R"(
[bodies.m]
type = "point"
mass = 2
[forces.push]
type = "load"
a = "m"
force = ["valve.y", 0, 0]
[controllers.valve]
type = "fmu"
)" + controller +
         R"(
[integrator]
end = 1
method = "generalized-alpha"
step = 0.002
[output]
quantities = ["m.position.x", "m.velocity.x", "valve.y", "valve.count"]
)";
}

class FmuInModel : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override { write_file(folder_ / "lag.fmu", lag_fmu(GetParam())); }
  void message(const std::string& text, const std::string& what) const {
    Simulation s;
    Status status = s.load_text(text, folder_ / "model.toml");
    if (status.ok()) status = s.run();
    EXPECT_NE(status.message.find(what), std::string::npos) << status.message;
  }
  TestFolder folder_;
};

TEST_P(FmuInModel, DrivesAForceThatIsHeldBetweenExchanges) {
  const double step = 0.01, lag = 0.1, gain = 2;
  Simulation s;
  const Status status = s.load_text(pushed("file = \"lag.fmu\"\nstep = 0.01\ninputs = { u = \"2\" }\n"
                                           "start = { gain = 2, T = 0.1 }"),
                                    folder_ / "model.toml");
  ASSERT_TRUE(status.ok()) << status.message;
  ASSERT_TRUE(s.run().ok());
  // y_k = 4 (1 - exp(-k step / lag)) from t_k on; the last exchange before the end is at 0.99.
  double x = 0, v = 0;
  for (int k = 0; k < 100; ++k) {
    const double a = gain * 2 * (1 - std::exp(-k * step / lag)) / 2;
    x += v * step + a * step * step / 2;
    v += a * step;
  }
  EXPECT_NEAR(s.value("m.velocity.x"), v, 2e-3 * v);
  EXPECT_NEAR(s.value("m.position.x"), x, 5e-3 * x);
  EXPECT_NEAR(s.value("valve.y"), 4 * (1 - std::exp(-9.9)), 1e-13);
  EXPECT_EQ(s.value("valve.count"), 99);
}

// The FMU as a damper with a lag; the same in expressions cannot be written without a state, so the truth is the pair
// of differential equations, and the error falls with the step of the exchange.
TEST_P(FmuInModel, ClosesALoopWithFirstOrder) {
  const auto final_position = [&](double step) {
    Simulation s;
    std::string text =
        pushed(fmt::format("file = \"lag.fmu\"\nstep = {}\n"
                           "inputs = {{ u = \"1 - 3*m.position.x - m.velocity.x\" }}\n"
                           "start = {{ gain = 4, T = 0.05 }}",
                           step));
    const Status status = s.load_text(text, folder_ / "model.toml");
    EXPECT_TRUE(status.ok()) << status.message;
    EXPECT_TRUE(s.run().ok());
    return s.value("m.position.x");
  };
  double x = 0, v = 0, y = 0;  // by the classical method of Runge and Kutta
  const auto rate = [](double p, double q, double r, double out[3]) {
    out[0] = q;
    out[1] = r / 2;
    out[2] = (4 * (1 - 3 * p - q) - r) / 0.05;
  };
  const double h = 1e-4;
  for (int k = 0; k < 10000; ++k) {
    double a[3], b[3], c[3], d[3];
    rate(x, v, y, a);
    rate(x + h / 2 * a[0], v + h / 2 * a[1], y + h / 2 * a[2], b);
    rate(x + h / 2 * b[0], v + h / 2 * b[1], y + h / 2 * b[2], c);
    rate(x + h * c[0], v + h * c[1], y + h * c[2], d);
    x += h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0]);
    v += h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1]);
    y += h / 6 * (a[2] + 2 * b[2] + 2 * c[2] + d[2]);
  }
  const double coarse = std::abs(final_position(0.02) - x), fine = std::abs(final_position(0.01) - x);
  EXPECT_LT(coarse, 0.05);
  EXPECT_LT(fine, 0.65 * coarse);
  EXPECT_GT(fine, 0.35 * coarse);
}

TEST_P(FmuInModel, GoesBackAndRestarts) {
  const std::string text = pushed("file = \"lag.fmu\"\nstep = 0.01\ninputs = { u = \"1 - m.position.x\" }");
  Simulation s;
  ASSERT_TRUE(s.load_text(text, folder_ / "model.toml").ok());
  ASSERT_TRUE(s.step_to(0.503).ok());
  const std::string state = s.save();
  ASSERT_TRUE(s.step_to(1).ok());
  const double x = s.value("m.position.x"), y = s.value("valve.y");
  ASSERT_TRUE(s.restore(state).ok());
  EXPECT_EQ(s.value("valve.count"), 50);
  ASSERT_TRUE(s.step_to(1).ok());
  EXPECT_EQ(s.value("m.position.x"), x);
  EXPECT_EQ(s.value("valve.y"), y);
  Simulation other;  // in another object, as after the death of a process
  ASSERT_TRUE(other.load_text(text, folder_ / "model.toml").ok());
  ASSERT_TRUE(other.restore(state).ok());
  ASSERT_TRUE(other.step_to(1).ok());
  EXPECT_EQ(other.value("m.position.x"), x);
}

TEST_P(FmuInModel, WithoutStatesARunIsWholeButCannotGoBack) {
  write_file(folder_ / "stateless.fmu", lag_fmu(GetParam(), false));
  Simulation s;
  ASSERT_TRUE(s.load_text(pushed("file = \"stateless.fmu\"\nstep = 0.01"), folder_ / "model.toml").ok());
  ASSERT_TRUE(s.step_to(0.1).ok());
  const std::string state = s.save();
  const Status status = s.restore(state);
  EXPECT_NE(status.message.find("does not give its state"), std::string::npos) << status.message;
}

TEST_P(FmuInModel, EndsTheRun) {
  Simulation s;
  ASSERT_TRUE(s.load_text(pushed("file = \"lag.fmu\"\nstep = 0.01\nstart = { at = 0.5, mischief = \"end\" }"),
                          folder_ / "model.toml")
                  .ok());
  ASSERT_TRUE(s.run().ok());
  EXPECT_EQ(s.summary().stopped_by, "valve");
  EXPECT_NEAR(s.time(), 0.51, 1e-12);
}

TEST_P(FmuInModel, SaysWhatIsWrong) {
  const std::string good = "file = \"lag.fmu\"\nstep = 0.01\n";
  message(pushed(good + "start = { at = 0.5, mischief = \"error\" }"), "the FMU says: a valve broke");
  message(pushed(good + "start = { at = 0.5, mischief = \"nan\" }"), "its output 'y' is nan");
  message(pushed(good + "inputs = { v = \"1\" }"), "has no input 'v'");
  message(pushed(good + "inputs = { enabel = \"1\" }"), "did you mean 'enable'?");
  message(pushed(good + "inputs = { gain = \"1\" }"), "is no input but parameter");
  message(pushed(good + "start = { gian = 1 }"), "did you mean 'gain'?");
  message(pushed(good + "start = { gain = \"much\" }"), "is a number");
  message(pushed(good + "start = { mischief = 1 }"), "is no number");
  message(pushed(good + "outputs = [\"y\", \"cuont\"]"), "did you mean 'count'?");
  message(pushed(good + "outputs = [\"is.high\"]"), "letters, digits and _ only");
  message(pushed(good + "outputs = { high = \"is.high\" }"), "'valve' has no 'y'");
  message(pushed("file = \"lagg.fmu\"\nstep = 0.01"), "lagg.fmu");
  message(pushed("file = \"lag.fmu\"\nstep = 0"), "step");
  message(pushed("file = \"lag.fmu\""), "step");
  message(pushed(good + "stepp = 1"), "did you mean 'step'?");
  message(pushed(good) + "[bodies.valve]\ntype = \"point\"\nmass = 1\n", "the name 'valve' is taken");
  const SensitivityResult r = sensitivities_of_text(pushed(good), folder_ / "model.toml", {{"bodies.m.mass", 0}}, {},
                                                    SensitivityMethod::adjoint);
  EXPECT_NE(r.status.message.find("do not pass FMUs"), std::string::npos) << r.status.message;
}

INSTANTIATE_TEST_SUITE_P(Fmi, FmuInModel, ::testing::Values(2, 3));

}  // namespace
}  // namespace espalier::fmi
