// The trace of a run, read back by another parser. Truth: the summary, which counts and times the same phases.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace trace_test {

const std::string kSwing = R"toml(gravity = [0, 0, -10]
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.2, lz = 0.2, divisions = [4, 1, 1] }
material = { young = 1e6, poisson = 0.3, density = 1000 }
[joints.wall]
type = "fixed"
a = { body = "ground", point = [0, 0.1, 0.1] }
b = { body = "block", face = "x0" }
[integrator]
relative = 1e-3
absolute = 1e-5
end = 0.05
[output]
quantities = ["block.position.z"]
)toml";

struct Sums {
  long count = 0;
  double seconds = 0;
  long last_number = 0;
};

std::map<std::string, Sums> read(const std::filesystem::path& path) {
  std::ifstream in(path);
  const nlohmann::json j = nlohmann::json::parse(in);
  std::map<std::string, Sums> sums;
  for (const auto& e : j.at("traceEvents")) {
    if (e.at("ph") != "X") continue;
    Sums& s = sums[e.at("name")];
    ++s.count;
    s.seconds += 1e-6 * e.at("dur").get<double>();
    s.last_number = e.at("args").value("number", 0L);
  }
  return sums;
}

TEST(Trace, HasThePhasesThatTheSummaryCounts) {
  const auto folder = std::filesystem::temp_directory_path() / ("espalier_trace_test_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  SimulationOptions options;
  options.record_timeline = true;
  Simulation simulation(options);
  ASSERT_TRUE(simulation.load_text(kSwing, "swing.toml").ok());
  ASSERT_TRUE(simulation.run().ok());
  const std::string path = (folder / "trace.json").string();
  ASSERT_TRUE(simulation.write_trace(path).ok());
  auto sums = read(path);
  const SimulationSummary& s = simulation.summary();
  EXPECT_EQ(sums["step"].count, s.steps);
  EXPECT_EQ(sums["step"].last_number, s.steps);
  EXPECT_EQ(sums["forces"].count, s.residuals);
  EXPECT_EQ(sums["tangents"].count, s.tangents);
  EXPECT_EQ(sums["factorization"].count + sums["analysis, factorization"].count, s.factorizations);
  EXPECT_GE(sums["output"].count, s.steps);
  const double assembly = sums["forces"].seconds + sums["constraints"].seconds + sums["tangents"].seconds;
  EXPECT_NEAR(assembly, s.phases.assembly, 1e-6 * static_cast<double>(s.residuals + 10 * s.tangents + 1000));
  EXPECT_NEAR(sums["solve"].seconds, s.phases.solve, 1e-4 * s.phases.solve + 1e-4);
  EXPECT_EQ(simulation.write_trace("/nonexistent/folder/trace.json").code, StatusCode::invalid_input);
  std::filesystem::remove_all(folder);
}

TEST(Trace, ARunThatKeepsNoneSaysSo) {
  Simulation simulation;
  ASSERT_TRUE(simulation.load_text(kSwing, "swing.toml").ok());
  EXPECT_THROW((void)simulation.write_trace("unused"), std::logic_error);
}

}  // namespace trace_test
}  // namespace espalier::dynamics
