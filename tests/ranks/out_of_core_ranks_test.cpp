// Ranks whose devices have too little memory for the factor. The truth is one process with the same devices: the same
// bits. The devices are the host's, behind a backend that has no memory for anything in core.
#include <gtest/gtest.h>

#include <cstring>
#include <mutex>
#include <string>
#include <vector>

#include "complex_system.hpp"
#include "device/registry.hpp"
#include "espalier/espalier.hpp"
#include "espalier/nodes.hpp"
#include "matrix/generators/generate.hpp"
#include "on_threads.hpp"
#include "reference/reference.hpp"
#include "solver/session/session_calls.hpp"
#include "solver/solution/solution.hpp"

namespace espalier::ranks {
namespace out_of_core_ranks_test {

class NarrowBackend final : public device::Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "narrow"; }
  [[nodiscard]] std::string_view noun() const override { return "narrow device"; }
  [[nodiscard]] device::FoundDevices find() const override { return {names, {}}; }
  [[nodiscard]] device::Limits limits() const override {
    device::Limits limits;
    limits.most_devices = 4;
    limits.own_memory = limits.ranks = true;
    return limits;
  }
  [[nodiscard]] const plan::MachineModel& model(const plan::Machine& machine) const override { return machine.host; }
  [[nodiscard]] device::PredictedTime predict(const analysis::AssemblyTree&, const device::PlanWish&) const override {
    return {};
  }
  [[nodiscard]] plan::PlanOptions plan_options(const device::PlanWish& wish) const override {
    return host().plan_options(wish);
  }
  [[nodiscard]] Offset executor_bytes(const plan::Plan& plan, Kind kind, Precision precision,
                                      int threads) const override {
    return host().executor_bytes(plan, kind, precision, threads);
  }
  [[nodiscard]] device::DeviceRates measure(int device) const override {
    return {device == 0 ? 1.0 : speed_of_others, 1, {}};
  }
  [[nodiscard]] Offset free_bytes(int) const override { return free; }
  [[nodiscard]] std::unique_ptr<device::Executor<double>> make_executor(const device::Job&,
                                                                        device::Scalar<double>) const override {
    throw Error(StatusCode::out_of_memory, "nothing fits");
  }
  [[nodiscard]] std::unique_ptr<device::Executor<float>> make_executor(const device::Job&,
                                                                       device::Scalar<float>) const override {
    throw Error(StatusCode::out_of_memory, "nothing fits");
  }
  [[nodiscard]] const out_of_core::Factory* out_of_core() const override { return host().out_of_core(); }

  std::vector<std::string> names = {"narrow", "narrow", "narrow"};
  double speed_of_others = 1;  // of the first one's
  Offset free = 0;

 private:
  static const device::Backend& host() { return device::registry().host(); }
};

SparseMatrix generated(const std::vector<std::string>& words) {
  return matrix::generate(matrix::parse_generator(words));
}

// Everything that a user sees of one system.
struct Answer {
  FactorResult factor;
  SolveResult solve;
  std::vector<double> x;
};

constexpr Index kColumns = 2;

solver::GivenMatrix given_of(const SparseMatrix& a) { return a.view(); }
solver::GivenMatrix given_of(const ComplexSparseMatrix& a) { return solver::given(a.view()); }

// Matrix: of real or complex numbers, which are passed as pairs of doubles.
template <class Matrix>
Answer answer_of(solver::Session& s, const Matrix& matrix) {
  const solver::GivenMatrix a = given_of(matrix);
  Answer r;
  r.factor.status = solver::analysis_by(s, [&] { s.analyze_given(a); }).status;
  if (!r.factor.status.ok()) return r;
  for (int round = 0; round < 2; ++round) {
    r.factor = solver::factor_by(s, [&](solver::Factor& f) { f.factorize(a.a.values); });
    if (!r.factor.status.ok()) return r;
  }
  const std::vector<double> b = reference::random_vector(s.current().doubles() * kColumns, 5);
  r.x.resize(b.size());
  r.solve = solver::solve_by(s, [&] {
    return solver::solve(*s.factor, {b.data(), r.x.data(), kColumns, false}, s.context);
  });
  return r;
}

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

void expect_same(const Answer& found, const Answer& truth) {
  EXPECT_EQ(found.factor.status.code, truth.factor.status.code) << found.factor.status.message;
  EXPECT_EQ(found.factor.inertia.negative, truth.factor.inertia.negative);
  EXPECT_EQ(found.factor.rank, truth.factor.rank);
  EXPECT_EQ(found.factor.two_by_two, truth.factor.two_by_two);
  EXPECT_EQ(found.factor.delayed, truth.factor.delayed);
  EXPECT_EQ(found.factor.determinant_log, truth.factor.determinant_log);
  EXPECT_EQ(found.factor.dependent_rows, truth.factor.dependent_rows);
  EXPECT_EQ(found.solve.status.code, truth.solve.status.code) << found.solve.status.message;
  EXPECT_EQ(found.solve.backward_error, truth.solve.backward_error);
  EXPECT_TRUE(same_bits(found.x, truth.x));
}

class OutOfCoreRanks : public testing::Test {
 protected:
  // What `part` of the plan's memory is.
  template <class Matrix>
  Offset bytes_of(const Matrix& a, Options options, double part) {
    options.device = "narrow:0";
    solver::Session s(options, registry_);
    s.analyze(given_of(a));
    return static_cast<Offset>(part * static_cast<double>(s.current().plan.memory.size) * sizeof(double));
  }
  template <class Matrix>
  Answer of_one_process(const Matrix& a, Options options, const std::string& devices) {
    options.device = devices;
    options.threads = 2;
    solver::Session s(options, registry_);
    return answer_of(s, a);
  }
  // On every rank; `more` changes its options.
  template <class Matrix>
  std::vector<Answer> of_ranks(const Matrix& a, const Options& given, int count, const Faults& faults = {},
                               const std::function<void(const Ranks&, Options&)>& more = {}, double patience = 60) {
    std::vector<Answer> all(static_cast<std::size_t>(count));
    on_threads(
        count, faults,
        [&](const Ranks& ranks) {
          Options options = given;
          options.device = "narrow:all";
          options.threads = 1;
          if (more) more(ranks, options);
          solver::Session s(ranks, options, registry_);
          all[static_cast<std::size_t>(ranks.rank())] = answer_of(s, a);
        },
        patience);
    return all;
  }
  template <class Matrix>
  void expect_bits_of_one(const Matrix& a, const Options& options = {}, double part = 0.5) {
    narrow_.free = bytes_of(a, options, part);
    for (const int count : {2, 3}) {
      SCOPED_TRACE(std::to_string(count) + " ranks");
      const Answer truth = of_one_process(a, options, count == 2 ? "narrow:0,1" : "narrow:all");
      ASSERT_NE(truth.factor.status.code, StatusCode::out_of_memory) << truth.factor.status.message;
      Offset streamed = 0;
      for (const DeviceReport& d : truth.factor.devices) streamed += d.streamed_out_bytes;
      ASSERT_GT(streamed, 0) << "it fits: nothing is tested";
      for (const Answer& found : of_ranks(a, options, count)) expect_same(found, truth);
    }
  }

  NarrowBackend narrow_;
  const device::Registry registry_{{&device::registry().host(), &narrow_}, {}};
};

TEST_F(OutOfCoreRanks, HaveTheBitsOfOneProcess) {
  expect_bits_of_one(generated({"elasticity", "6", "5", "5"}));
  expect_bits_of_one(generated({"kkt", "2", "6", "4", "4"}));
  expect_bits_of_one(generated({"gyroscopic", "5", "5", "4"}));
}

TEST_F(OutOfCoreRanks, MixedPrecisionAndSingularMatrices) {
  Options options;
  options.precision = Precision::mixed;
  expect_bits_of_one(generated({"elasticity", "6", "5", "5"}), options);
  options.precision = Precision::fp64;
  options.singular = SingularMatrix::report;
  expect_bits_of_one(generated({"kkt-redundant", "3", "2", "4", "2", "2"}), options, 1.1);  // as little as there can be
}

TEST_F(OutOfCoreRanks, ComplexSystems) {
  const SparseMatrix definite = generated({"elasticity", "5", "4", "4"});
  expect_bits_of_one(complex_of(definite, Storage::symmetric_lower));
  expect_bits_of_one(complex_of(definite, Storage::hermitian_lower));
  expect_bits_of_one(complex_of(generated({"gyroscopic", "4", "4", "4"}), Storage::general));
}

// Each rank says what its own device may take; the sides are those of one process that gives a list.
TEST_F(OutOfCoreRanks, BudgetsAreTheirOwn) {
  const SparseMatrix a = generated({"elasticity", "6", "5", "5"});
  const Offset need = bytes_of(a, {}, 1);
  narrow_.free = need;
  Options both;
  both.device_memory_each_bytes = {need / 2, need / 4};
  const Answer truth = of_one_process(a, both, "narrow:0,1");
  const auto own = [&](const Ranks& ranks, Options& o) {
    o.device_memory_bytes = ranks.rank() == 0 ? need / 2 : need / 4;
  };
  for (const Answer& found : of_ranks(a, {}, 2, {}, own)) {
    expect_same(found, truth);
    ASSERT_EQ(found.factor.devices.size(), 2U);
    for (std::size_t d = 0; d < 2; ++d) {
      EXPECT_EQ(found.factor.devices[d].peak_bytes, truth.factor.devices[d].peak_bytes);
      EXPECT_LE(found.factor.devices[d].peak_bytes, both.device_memory_each_bytes[d]);
      EXPECT_GT(found.factor.devices[d].streamed_out_bytes, 0);
    }
  }
}

// Unequal ones get unequal parts, as in one process.
TEST_F(OutOfCoreRanks, UnequalDevices) {
  const SparseMatrix a = generated({"elasticity", "7", "6", "6"});
  narrow_.names = {"narrow", "narrower"};
  narrow_.free = bytes_of(a, {}, 0.6);
  const Answer equal = of_one_process(a, {}, "narrow:0,1");
  narrow_.speed_of_others = 0.3;
  const Answer truth = of_one_process(a, {}, "narrow:0,1");
  const auto moved = [](const Answer& r) { return r.factor.devices.at(1).streamed_out_bytes; };
  ASSERT_LT(moved(truth), moved(equal)) << "speeds do not matter: nothing is tested";
  for (const Answer& found : of_ranks(a, {}, 2)) {
    expect_same(found, truth);
    EXPECT_EQ(moved(found), moved(truth));
  }
  narrow_.speed_of_others = 0.1;  // one process leaves it out, ranks cannot
  std::mutex mutex;
  std::string log;
  const auto logged = [&](const Ranks& ranks, Options& o) {
    if (ranks.rank() != 1) return;
    o.log = [&](const std::string& line) {
      const std::lock_guard lock(mutex);
      log += line;
    };
  };
  for (const Answer& found : of_ranks(a, {}, 2, {}, logged)) {
    EXPECT_LE(found.solve.backward_error, 1e-14);
    EXPECT_EQ(found.factor.devices.size(), 2U);
  }
  EXPECT_NE(log.find("rank 1 on host"), std::string::npos) << log;
  EXPECT_NE(log.find("10 % of the speed of the fastest"), std::string::npos) << log;
}

// Below what streaming needs: the same error on all ranks. Where the choice was ours, their hosts take over.
TEST_F(OutOfCoreRanks, TooLittleForAnything) {
  const SparseMatrix a = generated({"elasticity", "5", "4", "4"});
  narrow_.free = 4096;
  const std::vector<Answer> refused = of_ranks(a, {}, 3);
  for (const Answer& found : refused) {
    EXPECT_EQ(found.factor.status.code, StatusCode::out_of_memory);
    EXPECT_EQ(found.factor.status.message, refused.front().factor.status.message);
  }
  Options host;
  const Answer truth = of_one_process(a, host, "cpu");
  const auto ours = [](const Ranks&, Options& o) { o.device = "auto"; };
  for (const Answer& found : of_ranks(a, {}, 3, {}, ours)) expect_same(found, truth);
}

// Two ranks of one device, and ranks that are machines of their own: what the first one sees is taken, once.
TEST_F(OutOfCoreRanks, TheFirstOneSeesFewerDevices) {
  const SparseMatrix a = generated({"elasticity", "6", "5", "5"});
  narrow_.free = bytes_of(a, {}, 0.5);
  narrow_.names = {"narrow"};
  for (const Answer& found : of_ranks(a, {}, 2)) {
    EXPECT_TRUE(found.factor.status.ok()) << found.factor.status.message;
    EXPECT_LE(found.solve.backward_error, 1e-14);
    EXPECT_EQ(found.factor.devices.size(), 1U);
  }
  narrow_.names = {"narrow", "narrow"};
  const auto alone = [](const Ranks& ranks, Options&) { set_nodes(ranks, Nodes::process); };
  for (const Answer& found : of_ranks(a, {}, 2, {}, alone)) {
    EXPECT_LE(found.solve.backward_error, 1e-14);
    EXPECT_EQ(found.factor.devices.size(), 1U);
  }
}

// The truth on GPUs is one process with both of them.
TEST(OutOfCoreRanksOnGpus, HaveTheBitsOfOneProcess) {
  const device::Backend* gpu = device::registry().find("gpu");
  const std::size_t gpus = gpu == nullptr ? 0 : gpu->find().names.size();
  if (gpus < 2) GTEST_SKIP() << "two GPUs are needed, " << gpus << " can be used";
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {"elasticity", "20", "16", "16"}, {"kkt", "3", "12", "8", "8"}, {"gyroscopic", "14", "12", "12"}}) {
    SCOPED_TRACE(words.front());
    const SparseMatrix a = generated(words);
    Options options;
    options.device = "gpu:0,1";
    Solver in_core(options);
    ASSERT_TRUE(in_core.analyze(a).status.ok());
    const FactorResult whole = in_core.factorize(a);
    ASSERT_TRUE(whole.status.ok()) << whole.status.message;
    options.device_memory_bytes = whole.devices.at(0).peak_bytes / 2;
    const std::vector<double> b = reference::random_vector(a.rows, 5);
    std::vector<double> x(b.size());
    Solver alone(options);
    ASSERT_TRUE(alone.analyze(a).status.ok());
    const FactorResult truth = alone.factorize(a);
    ASSERT_TRUE(truth.status.ok()) << truth.status.message;
    ASSERT_GT(truth.devices.at(0).streamed_out_bytes, 0);
    ASSERT_TRUE(alone.solve(b, x).status.ok());
    on_threads(2, {}, [&](const Ranks& ranks) {
      Solver solver(ranks, options);
      ASSERT_TRUE(solver.analyze(a).status.ok());
      const FactorResult found = solver.factorize(a);
      ASSERT_TRUE(found.status.ok()) << found.status.message;
      EXPECT_EQ(found.determinant_log, truth.determinant_log);
      EXPECT_EQ(found.inertia.negative, truth.inertia.negative);
      ASSERT_EQ(found.devices.size(), 2U);
      EXPECT_GT(found.devices[0].streamed_out_bytes, 0);
      std::vector<double> y(b.size());
      EXPECT_TRUE(solver.solve(b, y).status.ok());
      if (ranks.rank() == 0) {
        EXPECT_TRUE(same_bits(y, x));
      }
    });
  }
}

TEST_F(OutOfCoreRanks, ADeadRankEndsTheCall) {
  const SparseMatrix a = generated({"elasticity", "5", "4", "4"});
  narrow_.free = bytes_of(a, {}, 0.6);
  int dead = 0;
  for (const int victim : {0, 1})
    for (const std::int64_t at : {9, 16, 23}) {
      SCOPED_TRACE(std::to_string(victim) + " dies at message " + std::to_string(at));
      Faults faults;
      faults.dead_rank = victim;
      faults.dies_at = at;
      faults.deaths_are_told = at != 16;
      const std::vector<Answer> ends = of_ranks(a, {}, 2, faults, {}, 0.5);
      const Answer& end = ends[static_cast<std::size_t>(1 - victim)];
      const Status& status = end.factor.status.ok() ? end.solve.status : end.factor.status;
      if (status.ok()) continue;  // it lived through all of it
      ++dead;
      EXPECT_EQ(status.code, StatusCode::device_error);
      EXPECT_NE(status.message.find("rank " + std::to_string(victim)), std::string::npos) << status.message;
    }
  EXPECT_GE(dead, 4);
}

}  // namespace out_of_core_ranks_test
}  // namespace espalier::ranks
