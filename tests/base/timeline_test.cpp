// The trace is JSON that says what was recorded; read back by another parser.
#include "base/timeline.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::base {
namespace {

nlohmann::json written(const Timeline& t) {
  const auto path = std::filesystem::temp_directory_path() / ("espalier_trace_" + std::to_string(::getpid()));
  t.write(path.string());
  std::ifstream in(path);
  nlohmann::json j = nlohmann::json::parse(in);
  std::filesystem::remove(path);
  return j;
}

TEST(Timeline, WritesWhatWasRecorded) {
  Timeline t;
  EXPECT_EQ(written(t).at("traceEvents").size(), 0U);
  const int a = t.add_track("host \"fast\" \\ 2 threads", "thread\n0");
  const int b = t.add_track("host \"fast\" \\ 2 threads", "thread 1");
  const int c = t.add_track("other", "thread 1");
  EXPECT_EQ(t.add_track("other", "thread 1"), c) << "a track is added once";
  EXPECT_NE(a, b);
  t.record(b, {"panel", 3, 4, 5, 10.5, 10.75, 1e9, 4096, 0.125});
  t.record(c, {"diagonal", 1, 2, 2, 10.0, 11.0, 0, 0});
  for (int k = 0; k < 20000; ++k) t.record(a, {"range", k, 0, 0, 11, 12, 0, 0});  // beyond one block of output
  const nlohmann::json j = written(t);
  int events = 0;
  std::string device;
  for (const auto& e : j.at("traceEvents")) {
    if (e.at("ph") == "M" && e.at("name") == "process_name" && e.at("pid") == 0) device = e.at("args").at("name");
    if (e.at("ph") != "X") continue;
    ++events;
    if (e.at("name") != "panel") continue;
    EXPECT_EQ(e.at("tid"), b);
    EXPECT_NEAR(e.at("ts").get<double>(), 0.5e6, 1e-3);  // microseconds since the first event
    EXPECT_NEAR(e.at("dur").get<double>(), 0.25e6, 1e-3);
    EXPECT_EQ(e.at("args").at("front"), 3);
    EXPECT_EQ(e.at("args").at("row"), 4);
    EXPECT_EQ(e.at("args").at("col"), 5);
    EXPECT_EQ(e.at("args").at("bytes"), 4096);
    EXPECT_NEAR(e.at("args").at("waited").get<double>(), 0.125e6, 1e-3);
  }
  EXPECT_EQ(events, 20002);
  EXPECT_EQ(device, "host \"fast\" \\ 2 threads");
  t.clear();
  EXPECT_EQ(written(t).at("traceEvents").size(), 5U);  // names of two devices and three tracks
}

TEST(Timeline, PhasesSayTheirNumberAlone) {
  Timeline t;
  TimelineEvent step{.kind = "step", .begin = 1, .end = 2};
  t.record(t.add_track("host", "steps"), step);
  step.number = 7;
  t.record(t.add_track("host", "steps"), step);
  std::vector<nlohmann::json> arguments;
  const nlohmann::json j = written(t);
  for (const auto& e : j.at("traceEvents"))
    if (e.at("ph") == "X") arguments.push_back(e.at("args"));
  ASSERT_EQ(arguments.size(), 2U);
  EXPECT_TRUE(arguments[0].empty());
  EXPECT_EQ(arguments[1], nlohmann::json({{"number", 7}}));
}

TEST(Timeline, AnUnwritableFileIsAnError) {
  const Timeline t;
  EXPECT_THROW(t.write("/nonexistent/folder/trace.json"), Error);
  if (std::filesystem::exists("/dev/full")) {
    Timeline full;
    full.record(full.add_track("d", "t"), {});
    EXPECT_THROW(full.write("/dev/full"), Error);
  }
}

}  // namespace
}  // namespace espalier::base
