// Truths: exact power laws; a trace written by hand; a plug-in that spins for a known time.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "espalier/types.hpp"
#include "experiments/bench.hpp"
#include "experiments/fit.hpp"
#include "experiments/timeline.hpp"

namespace espalier::bench {
namespace {

TEST(PowerLaw, FindsTheExponentOfAnExactLaw) {
  for (const double exponent : {-1.0, 0.5, 1.5, 2.0}) {
    std::vector<double> x, y;
    for (double n = 10; n < 1e6; n *= 3) {
      x.push_back(n);
      y.push_back(7 * std::pow(n, exponent));
    }
    const PowerLaw law = fit_power_law(x, y);
    const double eps = 1e-14 * static_cast<double>(x.size());
    EXPECT_NEAR(law.exponent, exponent, eps);
    EXPECT_NEAR(law.factor, 7, 70 * eps);
    EXPECT_NEAR(law.r_squared, 1, eps);
    EXPECT_EQ(law.points, static_cast<int>(x.size()));
  }
}

TEST(PowerLaw, OnePlaceIsNoLaw) {
  EXPECT_EQ(fit_power_law({}, {}).points, 0);
  const PowerLaw law = fit_power_law({5, 5}, {1, 2});
  EXPECT_EQ(law.points, 1);
  EXPECT_EQ(law.exponent, 0);
}

struct TemporaryFile {
  explicit TemporaryFile(const std::string& content) { std::ofstream(path) << content; }
  ~TemporaryFile() { std::remove(path.c_str()); }
  std::string path = testing::TempDir() + "timeline_" + std::to_string(getpid()) + ".json";
};

TEST(Timeline, KeepsGapsAndMergesNeighbours) {
  // Two tasks 0.1 us apart in 1 ms become one interval; 200 us apart they do not.
  const TemporaryFile file(R"({"traceEvents":[
    {"ph":"M","pid":0,"name":"process_name","args":{"name":"device"}},
    {"ph":"M","pid":0,"tid":3,"name":"thread_name","args":{"name":"thread 0"}},
    {"ph":"X","pid":0,"tid":3,"ts":0,"dur":100,"name":"a","args":{}},
    {"ph":"X","pid":0,"tid":3,"ts":100.1,"dur":199.9,"name":"b","args":{"waited":50}},
    {"ph":"X","pid":0,"tid":3,"ts":500,"dur":500,"name":"c","args":{}}]})");
  const nlohmann::json timeline = read_timeline(file.path);
  EXPECT_DOUBLE_EQ(timeline["seconds"].get<double>(), 1e-3);
  ASSERT_EQ(timeline["tracks"].size(), 1U);
  const auto& track = timeline["tracks"][0];
  EXPECT_EQ(track["device"], "device");
  EXPECT_EQ(track["name"], "thread 0");
  ASSERT_EQ(track["busy"].size(), 2U);
  EXPECT_DOUBLE_EQ(track["busy"][0][1].get<double>(), 300e-6);
  EXPECT_DOUBLE_EQ(track["busy"][1][0].get<double>(), 500e-6);
  EXPECT_NEAR(track["busy_seconds"].get<double>(), 749.9e-6, 1e-15);
  EXPECT_NEAR(track["waiting_seconds"].get<double>(), 50e-6, 1e-15);
  EXPECT_EQ(track["waiting"].size(), 2U);
  EXPECT_NEAR(track["waiting"][0].get<double>(), 50e-6, 1e-15);
  EXPECT_EQ(track["waiting"][1].get<double>(), 0);
}

TEST(Timeline, RefusesWhatIsNoTrace) {
  EXPECT_THROW(read_timeline(TemporaryFile("{}").path), Error);
  EXPECT_THROW(read_timeline(TemporaryFile("no json").path), Error);
}

TEST(Overhead, ClockAddsLessThanTwoPercent) {
  Settings settings;
  settings.plan.child.folder = ESPALIER_RIVALS_FOLDER;
  settings.repetitions = 12;
  settings.analyses = 1;
  settings.plan.columns = 1;
  settings.ceilings = false;
  Bench bench("overhead", settings, {});
  // The spin ends at a time, not after an amount of work, so other processes cannot lengthen it by much.
  const TemporaryFile matrix("%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 2\n2 2 3\n");
  const std::string name = matrix.path + ".mtx";
  std::filesystem::copy_file(matrix.path, name, std::filesystem::copy_options::overwrite_existing);
  const auto rows = bench.measure(name, {{"faulty:spin=20000"}});
  std::filesystem::remove(name);
  ASSERT_EQ(rows[0]["outcome"], "ok") << rows[0]["message"];
  const double least = rows[0]["refactorization"]["least"];
  EXPECT_GE(least, 20e-3);
  EXPECT_LE(least, 20e-3 * 1.02);
}

TEST(Bench, LeavesOutWhatThereIsNoTimeFor) {
  Settings settings;
  settings.plan.child.folder = ESPALIER_RIVALS_FOLDER;
  settings.ceilings = false;
  settings.time_seconds = 1e-9;
  Bench bench("peers", settings, {});
  const auto rows = bench.measure("poisson 3", {{"espalier"}, {"faulty"}});
  ASSERT_EQ(rows.size(), 2U);
  for (const auto& row : rows) EXPECT_EQ(row["outcome"], "left out");
}

}  // namespace
}  // namespace espalier::bench
