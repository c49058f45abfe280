// Restart files and the files of a run that goes on. Truth: a file that is not what was written is refused, whatever
// bit differs; what a run did stays until another has done it again.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "base/checksum.hpp"
#include "dynamics/model/model_common.hpp"
#include "dynamics/output/csv.hpp"
#include "dynamics/output/vtu.hpp"
#include "rounds.hpp"

namespace espalier::dynamics {
namespace restart_file_test {

void store(const std::string& path, const std::string& content) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
}

class RestartFiles : public testing::Test {
 protected:
  void SetUp() override {
    options_.out = folder_.path();
    static_cast<void>(simulated(kPendulum, options_));
    path_ = folder_.path() + "/state.restart";
    content_ = content_of(path_);
    options_ = {};
    options_.restart = path_;
    options_.until = 1.1;
  }
  /// Status and notices of loading a model with this restart file.
  std::pair<Status, std::vector<std::string>> load(const std::string& text) {
    Simulation s(options_);
    const Status status = s.load_text(text, "model.toml");
    return {status, s.summary().notices};
  }
  ScratchFolder folder_;
  SimulationOptions options_;
  std::string path_, content_;
};

TEST_F(RestartFiles, EveryFlippedBitIsSeen) {
  EXPECT_TRUE(load(kPendulum).first.ok());
  std::mt19937 random(15);
  std::vector<std::size_t> bits;
  for (std::size_t bit = 0; bit < 8U * 64; bit += espalier::test::rounds(1, 5))
    bits.push_back(bit);  // the head, and some anywhere
  for (int k = 0; k < espalier::test::rounds(300, 60); ++k) bits.push_back(random() % (8 * content_.size()));
  for (const std::size_t bit : bits) {
    std::string damaged = content_;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
    store(path_, damaged);
    const Status status = load(kPendulum).first;
    EXPECT_EQ(status.code, StatusCode::invalid_input) << "bit " << bit;
    EXPECT_NE(status.message.find(path_), std::string::npos) << status.message;
  }
}

TEST_F(RestartFiles, EveryLengthIsSeen) {
  for (std::size_t size = 0; size < content_.size(); size += 1 + size / 16) {
    store(path_, content_.substr(0, size));
    EXPECT_EQ(load(kPendulum).first.code, StatusCode::invalid_input) << size;
  }
  store(path_, content_ + "more");
  EXPECT_EQ(load(kPendulum).first.code, StatusCode::invalid_input);
}

/// The head says which layout it is; those before this one, and one to come, with checksums that fit, are told.
TEST_F(RestartFiles, OtherLayoutsAreRefusedByTheirNumber) {
  for (const char other : {'1', '2', '3', '5'}) {
    std::string content = content_;
    content[content.find("RST-") + 4] = other;
    store(path_, content);
    const Status status = load(kPendulum).first;
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    for (const std::string& says :
         {std::string("ESPALIER-RST-") + other, std::string("reads ESPALIER-RST-4"), std::string("run again"), path_})
      EXPECT_NE(status.message.find(says), std::string::npos) << status.message;
  }
  store(path_, "ESPALIER-RST-");  // not even a number
  EXPECT_EQ(load(kPendulum).first.code, StatusCode::invalid_input);
}

/// Numbers that no run writes, with a checksum that fits: nothing crashes, and infinities are refused.
TEST_F(RestartFiles, NumbersThatNoRunWrites) {
  std::uint64_t numbers = 0;
  std::memcpy(&numbers, content_.data() + 32, 8);
  const auto set_number = [&](std::size_t index, double value) {
    std::string crafted = content_;
    std::memcpy(crafted.data() + content_.size() - 8 * (numbers - index), &value, 8);
    const std::uint64_t sum = base::checksum(crafted.data() + 24, crafted.size() - 24);
    std::memcpy(crafted.data() + 16, &sum, 8);
    store(path_, crafted);
  };
  constexpr std::size_t kState = 17, kStateEnd = kState + 1 + 7 + 6 + 6 + 5;  // behind the counts: t, q, v, a, lambda
  ASSERT_GT(numbers, kStateEnd);
  for (std::size_t k = 0; k < numbers; k += espalier::test::rounds(1, 3)) {
    set_number(k, std::numeric_limits<double>::quiet_NaN());
    const Status status = load(kPendulum).first;
    if (k >= kState && k < kStateEnd) {
      EXPECT_EQ(status.code, StatusCode::invalid_input) << k;
    }
    for (const double value : {1e300, -1e300, 0.5, -1.0}) {
      set_number(k, value);
      static_cast<void>(load(kPendulum));
    }
  }
}

TEST_F(RestartFiles, AnotherModelIsRefusedAndTheChangesAreListed) {
  const std::string heavier = replaced(kPendulum, "mass = 2", "mass = 3");
  const auto [refused, none] = load(heavier);
  EXPECT_EQ(refused.code, StatusCode::invalid_input);
  for (const char* says : {"another model", "bodies.bob.mass: 2 then, 3 now", "--accept-changes"})
    EXPECT_NE(refused.message.find(says), std::string::npos) << refused.message;
  EXPECT_EQ(refused.message.find("bodies.bob.position"), std::string::npos) << "only what differs";
  options_.accept_changes = true;
  const auto [accepted, notices] = load(heavier);
  EXPECT_TRUE(accepted.ok()) << accepted.message;
  EXPECT_EQ(notices, std::vector<std::string>{"accepted: bodies.bob.mass: 2 then, 3 now"});
  // Another joint makes another state: no option lets that pass.
  EXPECT_EQ(load(kPendulum + "[bodies.more]\ntype = \"rigid\"\nmass = 1\nbox = [1, 1, 1]\n").first.code,
            StatusCode::invalid_input);
}

TEST_F(RestartFiles, WhatIsNotTheModelMayChange) {
  const std::string freely = replaced(kPendulum, "end = 1", "end = 3") +
                             "[output]\ncsv_interval = 0.5\nquantities = [\"bob.velocity\"]\n[solver]\nthreads = 1\n";
  const auto [status, notices] = load("title = \"another\"\n" + freely);
  EXPECT_TRUE(status.ok()) << status.message;
  EXPECT_TRUE(notices.empty());
}

TEST_F(RestartFiles, ParametersCountWhereTheyAreUsed) {
  const std::string with = replaced(kPendulum, "mass = 2", "mass = \"m\"") + "[parameters]\nm = 2\nunused = 1\n";
  options_ = {};
  options_.out = folder_.path();
  static_cast<void>(simulated(with, options_));
  options_.restart = path_;
  options_.until = 1.1;
  EXPECT_TRUE(load(replaced(with, "unused = 1", "unused = 2")).first.ok());
  const Status status = load(replaced(with, "m = 2", "m = 2.5")).first;
  EXPECT_NE(status.message.find("bodies.bob.mass: \"m\"; m = 2 then, \"m\"; m = 2.5 now"), std::string::npos)
      << status.message;
}

TEST_F(RestartFiles, ARunAtItsEndIsDoneAgainWithoutAStep) {
  options_.until.reset();
  options_.out = folder_.path();
  const std::string csv = content_of(folder_.path() + "/quantities.csv");
  const Simulation again = simulated(kPendulum, options_);
  EXPECT_EQ(again.summary().t_begin, 1);
  EXPECT_EQ(again.summary().t_end, 1);
  EXPECT_EQ(content_of(folder_.path() + "/quantities.csv"), csv);
  EXPECT_EQ(content_of(path_), content_);
}

/// While a constant step of order 4 still finds its first points: the same bits, and no loss of order.
TEST(RestartInFirstPoints, GoesOnWithTheSameBits) {
  const std::string truth = replaced(kPendulum, "end = 1", "end = 0.2");
  const std::string constant = truth + "step = 0.01\norder = 4\n[output]\nrestart_interval = 0\n";
  const ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path();
  const Simulation whole = simulated(constant, options);
  options.set = {"integrator.steps=2"};
  static_cast<void>(simulated(constant, options));
  options.restart = folder.path() + "/state.restart";
  options.set = {};
  const Simulation parts = simulated(constant, options);
  EXPECT_EQ(parts.summary().t_begin, 0.02);
  EXPECT_EQ(parts.value("bob.position.y"), whole.value("bob.position.y"));
  // The formula's own error is 1e-6 here; a third step of order 1 alone would leave 1e-3.
  const double y = simulated(replaced(constant, "restart_interval = 0", "")).value("bob.position.y");
  EXPECT_NEAR(parts.value("bob.position.y"), y, 1e-7);
  EXPECT_NEAR(simulated(truth).value("bob.position.y"), y, 2e-6);
}

/// A table of one column, the time again.
class Table {
 public:
  Table(const std::string& path, double keep_until)
      : csv_(path, {{"x", [](const StateView& s) { return 2 * s.t; }}}, keep_until) {}
  void write(double t) {
    StateView state;
    state.t = t;
    csv_.write(state);
  }
  CsvWriter& csv() { return csv_; }

 private:
  CsvWriter csv_;
};

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

TEST(RunGoesOn, TheTableKeepsItsHistoryUntilItIsOvertaken) {
  const ScratchFolder folder;
  const std::string path = folder.path() + "/q.csv";
  {
    Table table(path, kNothing);
    for (const double t : {0.0, 1.0, 2.0, 3.0, 4.0}) table.write(t);
  }
  const std::string whole = content_of(path);
  EXPECT_EQ(whole, "time,x\n0,0\n1,2\n2,4\n3,6\n4,8\n");
  {
    Table table(path, 1.0);
    EXPECT_EQ(content_of(path), whole);  // dies at once
    table.write(1.5);
    EXPECT_EQ(content_of(path), whole);
    table.csv().catch_up();  // a restart file is written
    EXPECT_EQ(content_of(path), "time,x\n0,0\n1,2\n1.5,3\n2,4\n3,6\n4,8\n");
    table.write(3.5);
    table.csv().catch_up();
    EXPECT_EQ(content_of(path), "time,x\n0,0\n1,2\n1.5,3\n3.5,7\n4,8\n");
    table.write(4.0);
    EXPECT_EQ(content_of(path), "time,x\n0,0\n1,2\n1.5,3\n3.5,7\n4,8\n");
    table.write(5.0);
    EXPECT_EQ(content_of(path), "time,x\n0,0\n1,2\n1.5,3\n3.5,7\n4,8\n5,10\n");
    EXPECT_EQ(table.csv().lines(), 6);
  }
  Table table(path, 1.5);
  table.write(2.0);
  table.csv().finish();  // a run that ends earlier than the one before
  EXPECT_EQ(content_of(path), "time,x\n0,0\n1,2\n1.5,3\n2,4\n");
}

TEST(RunGoesOn, ALineThatWasCutOffIsNoLine) {
  const ScratchFolder folder;
  const std::string path = folder.path() + "/q.csv";
  store(path, "time,x\n0,0\n1,2\n2,");
  {
    Table table(path, 9.0);
    EXPECT_EQ(table.csv().kept(), 1.0);
    table.write(2.0);
  }
  EXPECT_EQ(content_of(path), "time,x\n0,0\n1,2\n2,4\n");
  store(path, "time,x\n0,0\n1,2\n2,4");  // whole numbers, but who knows which
  { const Table table(path, 9.0); }
  EXPECT_EQ(content_of(path), "time,x\n0,0\n1,2\n");
  store(path, "time,x");
  { const Table table(path, 9.0); }
  EXPECT_EQ(content_of(path), "time,x\n");
  for (const char* damaged : {"time,x\n0,0\n1\n2,4\n", "time,x\n0,0\nx,2\n2,4\n", "time,x\n1,0\n0,0\n2,4\n"}) {
    store(path, damaged);
    try {
      const Table table(path, 9.0);
      ADD_FAILURE() << damaged;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("q.csv:3:"), std::string::npos) << error.what();
    }
    EXPECT_EQ(content_of(path), damaged);
  }
}

TEST(RunGoesOn, TheSeriesKeepsItsHistoryUntilItIsOvertaken) {
  const ScratchFolder folder;
  const std::string path = folder.path() + "/run.pvd";
  PvdSeries first(path);
  for (const double t : {0.0, 1.0, 2.0, 3.0}) first.add(t, 0);
  const std::string whole = content_of(path);
  PvdSeries second(path);
  EXPECT_EQ(second.resume(1.0), 1.0);
  EXPECT_EQ(second.file_name(0), folder.path() + "/run_0_000002.vtu");
  second.add(2.0, 0);
  EXPECT_EQ(content_of(path), whole);
  second.finish();
  EXPECT_EQ(content_of(path),
            replaced(whole, "    <DataSet timestep=\"3\" part=\"0\" file=\"run_0_000003.vtu\"/>\n", ""));
  PvdSeries none(folder.path() + "/none.pvd");
  EXPECT_FALSE(none.resume(1.0).has_value());
}

}  // namespace restart_file_test
}  // namespace espalier::dynamics
