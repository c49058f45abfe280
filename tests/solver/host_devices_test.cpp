// Option device = host:N and host:N,M through the public interface. Truth: the same system on one device with one
// thread, bit by bit; N and M as asked for.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "reference/reference.hpp"

namespace espalier {
namespace host_devices_test {

SparseMatrix generated(std::vector<std::string> words) { return matrix::generate(matrix::parse_generator(words)); }

Options on(const std::string& device, Precision precision = Precision::fp64) {
  Options o;
  o.device = device;
  o.precision = precision;
  o.threads = 1;
  return o;
}

std::vector<double> solved(Solver& s, const SparseMatrix& a) {
  const AnalysisResult analysis = s.analyze(a);
  EXPECT_TRUE(analysis.status.ok()) << analysis.status.message;
  const FactorResult factor = s.factorize(a);
  EXPECT_TRUE(factor.status.ok()) << factor.status.message;
  const std::vector<double> b = reference::random_vector(a.cols, 3);
  std::vector<double> x(b.size());
  EXPECT_TRUE(s.solve(b, x).status.ok());
  return x;
}

TEST(SolverHostDevices, GiveTheBitsOfOneDevice) {
  const std::vector<std::vector<std::string>> systems{
      {"elasticity", "7"}, {"kkt", "5", "3", "3", "3"}, {"gyroscopic", "6"}};
  for (const auto& words : systems) {
    const SparseMatrix a = generated(words);
    for (const Precision precision : {Precision::fp64, Precision::mixed}) {
      Solver one(on("cpu", precision));
      const std::vector<double> x = solved(one, a);
      for (const std::string device : {"host:1", "host:2", "host:3,2", "host:5,1"}) {
        SCOPED_TRACE(words.front() + " on " + device);
        Solver many(on(device, precision));
        const std::vector<double> y = solved(many, a);
        EXPECT_EQ(std::memcmp(x.data(), y.data(), x.size() * sizeof(double)), 0);
        const FactorResult again = many.refactorize(a.values);
        ASSERT_TRUE(again.status.ok());
        ASSERT_EQ(static_cast<char>('0' + again.devices.size()), device[5]);
        for (const DeviceReport& d : again.devices) {
          EXPECT_GE(d.busy_seconds, 0);
          EXPECT_GE(d.waiting_seconds, 0);
          EXPECT_GT(d.peak_bytes, 0);
          EXPECT_LE(d.idle_fraction, 1);
        }
      }
    }
  }
}

// A pass over a factor out of core costs too much to mend roundings; who asks for it gets it.
// With an FP32 factor no solution counts as good enough before rounding is reached.
TEST(SolverHostDevices, OutOfCoreMixedPrecisionReachesRounding) {
  for (const auto& words : std::vector<std::vector<std::string>>{
           {"elasticity", "9"}, {"plate", "40", "40"}, {"kkt", "3", "8", "4", "4"}, {"poisson", "14"}}) {
    SCOPED_TRACE(words.front());
    const SparseMatrix a = generated(words);
    const std::vector<double> b = reference::random_vector(a.cols, 5);
    std::vector<double> x(b.size());
    Options o = on("host:2");
    o.precision = Precision::mixed;
    Solver in_core(o);
    ASSERT_TRUE(in_core.analyze(a).status.ok());
    o.device_memory_bytes = in_core.factorize(a).devices.front().peak_bytes / 2;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_GT(s.factorize(a).devices.front().streamed_out_bytes, 0);
    const SolveResult r = s.solve(b, x);
    ASSERT_TRUE(r.status.ok());
    EXPECT_LE(r.backward_error, 4.5e-16);
  }
}

TEST(SolverHostDevices, OutOfCoreOnePassIsEnough) {
  const SparseMatrix a = generated({"elasticity", "9"});
  const std::vector<double> b = reference::random_vector(a.cols, 3);
  std::vector<double> x(b.size());
  Options o = on("host:2");
  Solver in_core(o);
  ASSERT_TRUE(in_core.analyze(a).status.ok());
  const FactorResult all = in_core.factorize(a);
  const SolveResult refined = in_core.solve(b, x);
  EXPECT_GT(refined.refinement_steps, 0);
  o.device_memory_bytes = all.devices.front().peak_bytes / 2;
  for (const bool asked : {false, true}) {
    if (asked) o.refinement_target = 0;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_GT(s.factorize(a).devices.front().streamed_out_bytes, 0);
    const SolveResult r = s.solve(b, x);
    ASSERT_TRUE(r.status.ok());
    EXPECT_EQ(r.refinement_steps > 0, asked);
    EXPECT_LE(r.backward_error, 1e-14);
    if (asked) {
      EXPECT_LE(r.componentwise_error, 2 * refined.componentwise_error);
    }
  }
}

TEST(SolverHostDevices, AnyBudgetSolvesAndOneBelowTheFloorIsNamed) {
  const SparseMatrix a = generated({"elasticity", "9"});
  const std::vector<double> b = reference::random_vector(a.cols, 3);
  for (const std::string device : {"host:1,2", "host:2,1", "host:3,1"}) {
    SCOPED_TRACE(device);
    Options o = on(device);
    o.max_block_size = 16;
    Solver in_core(o);
    const std::vector<double> x = solved(in_core, a);
    const FactorResult all = in_core.factorize(a);
    EXPECT_EQ(all.devices[0].streamed_out_bytes, 0);
    Offset need = 0;
    for (const DeviceReport& d : all.devices) need = std::max(need, d.peak_bytes);
    const std::size_t count = all.devices.size();
    for (const Offset part : {2, 5}) {
      o.device_memory_bytes = need / part;
      o.device_memory_each_bytes.clear();
      if (part == 5 && count > 1) {  // budgets that differ
        for (std::size_t d = 0; d < count; ++d)
          o.device_memory_each_bytes.push_back(need / (3 + 2 * static_cast<Offset>(d)));
      }
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      const FactorResult factor = s.factorize(a);
      ASSERT_TRUE(factor.status.ok()) << factor.status.message;
      ASSERT_EQ(factor.devices.size(), count);
      Offset out = 0;
      for (std::size_t d = 0; d < count; ++d) {
        const DeviceReport& report = factor.devices[d];
        EXPECT_LE(report.peak_bytes, o.device_memory_each_bytes.empty() ? need / part : o.device_memory_each_bytes[d]);
        EXPECT_EQ(report.peak_bytes, report.predicted_peak_bytes);
        EXPECT_GT(report.link_seconds, 0);
        out += report.streamed_out_bytes;
      }
      EXPECT_GE(out, 8 * s.analysis().nonzeros_factor);
      std::vector<double> y(b.size());
      const SolveResult r = s.solve(b, y);
      ASSERT_TRUE(r.status.ok());
      EXPECT_LE(r.backward_error, 1e-14);
    }
    o.device_memory_bytes = 1000;
    o.device_memory_each_bytes.clear();
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    const FactorResult factor = s.factorize(a);
    EXPECT_EQ(factor.status.code, StatusCode::out_of_memory) << factor.status.message;
  }
}

TEST(SolverHostDevices, BudgetsAreOneForAllOrOneForEach) {
  const SparseMatrix a = generated({"elasticity", "3"});
  Options o = on("host:2,1");
  o.device_memory_each_bytes = {Offset{1} << 30, Offset{1} << 30};
  EXPECT_TRUE(Solver(o).analyze(a).status.ok());
  o.device_memory_each_bytes.push_back(Offset{1} << 30);
  const AnalysisResult r = Solver(o).analyze(a);
  EXPECT_EQ(r.status.code, StatusCode::invalid_input);
  EXPECT_NE(r.status.message.find("3 budgets"), std::string::npos) << r.status.message;
}

TEST(SolverHostDevices, TextsThatNameNoDevicesAreRefused) {
  const SparseMatrix a = generated({"elasticity", "2"});
  for (const std::string device : {"host:", "host:0", "host:2,0", "host:2,3,4", "host:-1", "host:2x", "host:9999,9"}) {
    Solver s(on(device));
    EXPECT_EQ(s.analyze(a).status.code, StatusCode::invalid_input) << device;
  }
}

TEST(SolverHostDevices, TraceHasATrackForEveryThreadOfEveryDevice) {
  const SparseMatrix a = generated({"elasticity", "6"});
  Options o = on("host:3,2");
  o.record_timeline = true;
  Solver s(o);
  (void)solved(s, a);
  const auto path =
      std::filesystem::temp_directory_path() / ("espalier_devices_" + std::to_string(::getpid()) + ".json");
  ASSERT_TRUE(s.write_trace(path.string()).ok());
  std::ifstream file(path);
  const auto trace = nlohmann::json::parse(file);
  std::filesystem::remove(path);
  std::set<int> devices;
  std::set<std::pair<int, int>> threads;
  for (const auto& e : trace["traceEvents"]) {
    if (e["ph"] != "M") continue;
    if (e["name"] == "process_name") devices.insert(e["pid"].get<int>());
    if (e["name"] == "thread_name") threads.insert({e["pid"].get<int>(), e["tid"].get<int>()});
  }
  EXPECT_EQ(devices.size(), 3U);
  EXPECT_EQ(threads.size(), 6U);
}

}  // namespace host_devices_test
}  // namespace espalier
