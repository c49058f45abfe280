// Systems that are solved together as one block-diagonal system, here on the host. Truth: single systems, bit by bit;
// and the same batch one by one, where pivots fail, systems are singular or values are none.
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <functional>

#include "batch/batch_common.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier::test {

namespace {

constexpr const char* kAll = "7 of 7 systems were solved in chunks";

TEST(BatchChunks, HaveTheBitsOfSingleSystems) {
  for (const Index chunk : {2, 3, 7})  // the last one is not full, but for 7
    for (const Index n : {1, 3, 50, 200}) {
      SCOPED_TRACE(testing::Message() << "n = " << n << ", chunks of " << chunk);
      const InChunks together(chunk);
      std::string log;
      expect_bits_of_single_systems(reference::random_system(n, 3, reference::Values::positive, 1), Kind::automatic, 7,
                                    chunk == 2 ? 18 : 1, Transpose::no, &log);
      EXPECT_NE(log.find(n == 200 ? "6 of 7 systems" : kAll), std::string::npos) << log;  // of 200, one is indefinite
      log.clear();
      expect_bits_of_single_systems(reference::random_system(n, 3, reference::Values::general, 3), Kind::lu, 7, 2,
                                    chunk == 3 ? Transpose::yes : Transpose::no, &log);
      EXPECT_NE(log.find("systems were solved in chunks"), std::string::npos) << log;
      EXPECT_EQ(log.find("batch: 0 of"), std::string::npos) << log;
    }
}

TEST(BatchChunks, KnowTheInertiaOfConstrainedSystems) {
  const InChunks together(4);
  for (const Index n : {12, 120}) {
    std::string log;
    expect_bits_of_single_systems(constrained_chain(n), Kind::ldlt, 7, 2, Transpose::no, &log);
    EXPECT_NE(log.find(kAll), std::string::npos) << log;
  }
}

// The signs of its pivots tell the inertia of each; where pivots fail, each system moves its own.
TEST(BatchChunks, IndefiniteSystems) {
  const InChunks together(4);
  std::string log;
  expect_bits_of_single_systems(reference::random_system(60, 3, reference::Values::indefinite, 2), Kind::ldlt, 7, 1,
                                Transpose::no, &log);
  EXPECT_NE(log.find(kAll), std::string::npos) << log;
  log.clear();
  expect_bits_of_single_systems(reference::saddle_point(150, 50, 7), Kind::ldlt, 9, 1, Transpose::no, &log);
  EXPECT_NE(log.find("of 9 systems were solved in chunks of 4, the others one by one"), std::string::npos) << log;
}

// What fails ends as it does alone, and its neighbours have the bits that they have alone.
void expect_failures_alone(const SparseMatrix& a, Kind kind, Index chunk) {
  constexpr Index kCount = 12;
  const auto n = static_cast<std::size_t>(a.cols), nonzeros = a.values.size();
  std::vector<double> values = values_of(a, kCount, 1);
  const auto at = [&](Index k) { return values.begin() + static_cast<std::ptrdiff_t>(nonzeros) * k; };
  std::fill_n(at(3), nonzeros, 0.0);  // rank 0
  std::for_each(at(5), at(6), [](double& v) { v = -v; });
  at(8)[2] = std::numeric_limits<double>::quiet_NaN();
  std::for_each(at(9), at(10), [](double& v) { v *= 1e-300; });
  for (Offset q = a.col_ptr[n / 2]; q < a.col_ptr[n / 2 + 1]; ++q) at(10)[q] = 0;  // a column
  std::vector<double> b = reference::random_vector(static_cast<std::int64_t>(n) * kCount, 2);
  b[n + 1] = std::numeric_limits<double>::quiet_NaN();
  b[6 * n] = std::numeric_limits<double>::infinity();
  Batch alone(options_of(kind, 2));
  ASSERT_TRUE(alone.analyze(a).status.ok());
  std::vector<double> x(b.size()), y(b);
  const BatchResult truth = alone.solve(values, b, x, kCount);
  const InChunks together(chunk);
  Batch batch(options_of(kind, 2));
  ASSERT_TRUE(batch.analyze(a).status.ok());
  for (int round = 0; round < 2; ++round) {  // nothing is learned from failures
    y = b;
    const BatchResult found = batch.solve(values, y, y, kCount);
    EXPECT_EQ(found.failed, truth.failed);
    EXPECT_EQ(found.status.message, truth.status.message);
    EXPECT_EQ(std::memcmp(x.data(), y.data(), x.size() * sizeof(double)), 0);
    for (std::size_t k = 0; k < kCount; ++k) {
      SCOPED_TRACE(k);
      const SystemResult &one = truth.systems[k], &now = found.systems[k];
      EXPECT_EQ(now.status.code, one.status.code);
      EXPECT_EQ(now.status.message, one.status.message);
      EXPECT_EQ(now.rank, one.rank);
      EXPECT_EQ(now.inertia.negative, one.inertia.negative);
      EXPECT_EQ(now.inertia.zero, one.inertia.zero);
      EXPECT_EQ(now.refinement_steps, one.refinement_steps);
      EXPECT_EQ(now.backward_error, one.backward_error);
      EXPECT_EQ(now.componentwise_error, one.componentwise_error);
    }
  }
  EXPECT_GE(truth.failed, 4);
}

TEST(BatchChunks, FailuresTouchNobodyElse) {
  for (const Index chunk : {3, 12}) {
    SCOPED_TRACE(chunk);
    expect_failures_alone(reference::random_system(40, 3, reference::Values::positive, 1), Kind::llt, chunk);
    expect_failures_alone(reference::random_system(40, 3, reference::Values::positive, 1), Kind::automatic, chunk);
    expect_failures_alone(constrained_chain(60), Kind::ldlt, chunk);
    expect_failures_alone(reference::random_system(40, 3, reference::Values::general, 3), Kind::lu, chunk);
  }
}

// Among positive definite systems a factorization names one that is none.
TEST(BatchChunks, SomeIndefiniteSystemsLeaveTheOthersTogether) {
  const SparseMatrix a = reference::random_system(20, 3, reference::Values::positive, 1);
  constexpr Index kCount = 64;
  const std::size_t nonzeros = a.values.size();
  std::vector<double> values = values_of(a, kCount, 1);
  for (std::size_t k = 5; k < kCount; k += 10)
    for (std::size_t q = 0; q < nonzeros; ++q) values[k * nonzeros + q] *= -1;
  const std::vector<double> b = reference::random_vector(20 * kCount, 2);
  std::vector<double> x(b.size());
  const InChunks together(kCount);
  Options o = options_of(Kind::llt, 2);
  std::string log;
  o.log = [&](const std::string& line) { log += line; };
  Batch batch(o);
  ASSERT_TRUE(batch.analyze(a).status.ok());
  EXPECT_EQ(batch.solve(values, b, x, kCount).failed, 6);
  EXPECT_NE(log.find("58 of 64 systems were solved in chunks of 64"), std::string::npos) << log;
}

// Two teams share what is more than one chunk; a chunk alone has all threads, and so has a caller's only one.
TEST(BatchChunks, GoThroughTwoTeams) {
  const SparseMatrix a = constrained_chain(60);
  constexpr Index kCount = 20;
  const std::vector<double> values = values_of(a, kCount, 1), b = reference::random_vector(60 * kCount, 2);
  std::vector<double> truth;
  for (const int threads : {1, 2, 5})
    for (const Index chunk : {20, 11, 3}) {
      SCOPED_TRACE(testing::Message() << threads << " threads, chunks of " << chunk);
      const InChunks together(chunk);
      Options o = options_of(Kind::ldlt, threads);
      std::string log;
      o.log = [&](const std::string& line) { log = line; };
      Batch batch(o);
      ASSERT_TRUE(batch.analyze(a).status.ok());
      for (const Index count : {kCount, Index{5}, kCount}) {  // teams stay from call to call
        std::vector<double> x(static_cast<std::size_t>(60 * count));
        const std::size_t nonzeros = a.values.size() * static_cast<std::size_t>(count);
        const BatchResult r = batch.solve(std::span(values).first(nonzeros), std::span(b).first(x.size()), x, count);
        ASSERT_TRUE(r.status.ok()) << r.status.message;
        if (truth.empty()) truth = x;
        EXPECT_TRUE(std::equal(x.begin(), x.end(), truth.begin()));
        if (count == kCount) {
          EXPECT_NE(log.find(threads == 1 || chunk == 20 ? "teams: 1" : "teams: 2"), std::string::npos) << log;
        }
      }
    }
}

TEST(BatchChunks, OptionsThatJudgeOtherwiseGoOneByOne) {
  const SparseMatrix a = constrained_chain(60);
  const std::vector<double> values = values_of(a, 6, 1), b = reference::random_vector(60 * 6, 2);
  std::vector<double> x(b.size());
  const InChunks together(6);
  const auto log_of = [&](const std::function<void(Options&)>& set) {
    Options o = options_of(Kind::ldlt, 1);
    std::string log;
    o.log = [&](const std::string& line) { log += line; };
    set(o);
    Batch batch(o);
    EXPECT_TRUE(batch.analyze(a).status.ok());
    const BatchResult r = batch.solve(values, b, x, 6);
    EXPECT_TRUE(r.status.ok()) << r.status.message;
    return log;
  };
  const auto uses = [&](const std::function<void(Options&)>& set) {
    return log_of(set).find("6 of 6 systems were solved in chunks") != std::string::npos;
  };
  EXPECT_TRUE(uses([](Options&) {}));
  EXPECT_TRUE(uses([](Options& o) { o.refinement_steps = 0; }));
  EXPECT_TRUE(uses([](Options& o) {
    o.refinement_steps = 0;
    o.required_backward_error = std::numeric_limits<double>::infinity();
  }));
  EXPECT_FALSE(uses([](Options& o) { o.precision = Precision::mixed; }));
  EXPECT_FALSE(uses([](Options& o) { o.rescale = Rescale::on; }));
  EXPECT_FALSE(uses([](Options& o) { o.zero_pivot = 1e-20; }));
  // Without memory for a chunk there is some for single systems.
  EXPECT_NE(log_of([](Options& o) { o.host_memory_bytes = 120000; }).find("0 of 6 systems"), std::string::npos);
}

// Several devices and a factor out of core, of the chunk and of single systems alike.
TEST(BatchChunks, SeveralDevicesAndBudgets) {
  const SparseMatrix a = constrained_chain(300);
  constexpr Index kCount = 12;
  const std::vector<double> values = values_of(a, kCount, 1), b = reference::random_vector(300 * kCount, 2);
  const auto solve = [&](const char* device, Offset bytes) {
    Options o = options_of(Kind::ldlt, 2);
    o.device = device;
    o.device_memory_bytes = bytes;
    std::string log;
    o.log = [&](const std::string& line) { log += line; };
    Batch batch(o);
    EXPECT_TRUE(batch.analyze(a).status.ok());
    std::vector<double> x(b.size());
    const BatchResult r = batch.solve(values, b, x, kCount);
    EXPECT_TRUE(r.status.ok()) << r.status.message;
    EXPECT_EQ(log.find("12 of 12 systems were solved in chunks") != std::string::npos,
              std::getenv("ESPALIER_BATCH_CHUNK") != nullptr)
        << log;
    return x;
  };
  const std::vector<double> truth = solve("cpu", 0);
  const InChunks together(6);
  EXPECT_EQ(solve("cpu", 0), truth);
  EXPECT_EQ(solve("host:2", 0), truth);
  const std::vector<double> streamed = solve("host:1", 450000);
  for (Index k = 0; k < kCount; ++k) {
    const auto slice = [&](const std::vector<double>& v) {
      return std::vector<double>(v.begin() + 300 * k, v.begin() + 300 * (k + 1));
    };
    EXPECT_LE(reference::backward_error(system_of(a, values, k), slice(b), slice(streamed)), 8 * kEps);
  }
}

TEST(BatchChunks, CanBeStoppedAndRefuseAWishThatIsNone) {
  const SparseMatrix a = constrained_chain(200);
  const std::vector<double> values = values_of(a, 20, 1), b = reference::random_vector(200 * 20, 2);
  std::vector<double> x(b.size());
  Options o = options_of(Kind::ldlt, 2);
  bool stop = false;
  o.interrupted = [&] { return stop; };
  o.interrupted_every = 0;
  Batch batch(o);
  ASSERT_TRUE(batch.analyze(a).status.ok());
  const InChunks together(5);
  stop = true;
  EXPECT_EQ(batch.solve(values, b, x, 20).status.code, StatusCode::cancelled);
  stop = false;
  EXPECT_TRUE(batch.solve(values, b, x, 20).status.ok());
  ::setenv("ESPALIER_BATCH_CHUNK", "many", 1);
  const BatchResult refused = batch.solve(values, b, x, 20);
  EXPECT_EQ(refused.status.code, StatusCode::invalid_input);
  EXPECT_NE(refused.status.message.find("ESPALIER_BATCH_CHUNK: 'many'"), std::string::npos) << refused.status.message;
}

class BatchOnGpu : public OnGpu {};

// Chunks and failures on a GPU: backward errors in long double, inertia by zero blocks, neighbours unharmed.
TEST_F(BatchOnGpu, GpuChunksSolveAndNameFailures) {
  const struct {
    SparseMatrix a;
    Kind kind;
  } systems[] = {{reference::random_system(200, 4, reference::Values::positive, 1), Kind::llt},
                 {constrained_chain(500), Kind::ldlt},
                 {reference::random_system(150, 4, reference::Values::general, 3), Kind::lu}};
  for (const auto& [a, kind] : systems) {
    SCOPED_TRACE(testing::Message() << "kind " << static_cast<int>(kind));
    constexpr Index kCount = 300;
    const auto n = static_cast<std::size_t>(a.cols), nonzeros = a.values.size();
    std::vector<double> values = values_of(a, kCount, 1);
    std::fill_n(values.begin() + static_cast<std::ptrdiff_t>(7 * nonzeros), nonzeros, 0.0);
    const std::vector<double> b = reference::random_vector(static_cast<std::int64_t>(2 * n) * kCount, 2);
    std::vector<double> x(b.size());
    Options o = options_of(kind, 0);
    o.device = "gpu:0";
    std::string log;
    o.log = [&](const std::string& line) { log += line + "\n"; };
    Batch batch(o);
    ASSERT_TRUE(batch.analyze(a).status.ok());
    for (int round = 0; round < 2; ++round) {
      const BatchResult r = batch.solve(values, b, x, kCount, 2);
      EXPECT_EQ(r.failed, 1);
      EXPECT_FALSE(r.systems[7].status.ok());
      for (Index k = 0; k < kCount; ++k) {
        if (k == 7) continue;
        const SystemResult& one = r.systems[static_cast<std::size_t>(k)];
        ASSERT_TRUE(one.status.ok()) << k << ": " << one.status.message;
        const auto slice = [&](const std::vector<double>& v) {
          const auto first = v.begin() + static_cast<std::ptrdiff_t>(2 * n) * k;
          return std::vector<double>(first, first + static_cast<std::ptrdiff_t>(2 * n));
        };
        EXPECT_LE(reference::backward_error(system_of(a, values, k), slice(b), slice(x), 2), 8 * kEps);
        if (kind == Kind::ldlt) {
          EXPECT_EQ(one.inertia.negative, a.cols / 6);
        }
      }
    }
    EXPECT_NE(log.find("systems were solved in chunks of"), std::string::npos) << log;
  }
}

// More right-hand sides than are refined at a time, transposed ones, and some that are not finite: those alone fail.
TEST_F(BatchOnGpu, GpuChunksInLanesRefineEachSystemForItself) {
  const struct {
    SparseMatrix a;
    Kind kind;
    Transpose transpose;
  } systems[] = {{constrained_chain(200), Kind::ldlt, Transpose::no},
                 {reference::random_system(150, 4, reference::Values::general, 3), Kind::lu, Transpose::yes}};
  constexpr Index kCount = 150, kColumns = 18;
  const InChunks together(40);
  for (const auto& [a, kind, transpose] : systems) {
    SCOPED_TRACE(testing::Message() << "kind " << static_cast<int>(kind));
    const std::size_t numbers = static_cast<std::size_t>(a.cols) * kColumns;
    const std::vector<double> values = values_of(a, kCount, 1);
    std::vector<double> b = reference::random_vector(static_cast<std::int64_t>(numbers) * kCount, 2);
    b[3 * numbers + 5] = std::numeric_limits<double>::quiet_NaN();
    b[50 * numbers - 1] = std::numeric_limits<double>::infinity();  // of system 49
    std::vector<double> x(b.size());
    Options o = options_of(kind, 4);
    o.device = "gpu:0";
    std::string log;
    o.log = [&](const std::string& line) { log += line + "\n"; };
    Batch batch(o);
    ASSERT_TRUE(batch.analyze(a).status.ok());
    const BatchResult r = batch.solve(values, b, x, kCount, kColumns, transpose);
    EXPECT_EQ(r.failed, 2);
    for (Index k = 0; k < kCount; ++k) {
      const SystemResult& one = r.systems[static_cast<std::size_t>(k)];
      if (k == 3 || k == 49) {
        EXPECT_FALSE(one.status.ok()) << k;
        continue;
      }
      ASSERT_TRUE(one.status.ok()) << k << ": " << one.status.message;
      EXPECT_LE(one.componentwise_error, 1e-15) << k;
      EXPECT_LE(one.refinement_steps, 3) << k;
      const auto slice = [&](const std::vector<double>& v) {
        const auto first = v.begin() + static_cast<std::ptrdiff_t>(numbers) * k;
        return std::vector<double>(first, first + static_cast<std::ptrdiff_t>(numbers));
      };
      EXPECT_LE(
          reference::backward_error(system_of(a, values, k), slice(b), slice(x), kColumns, transpose == Transpose::yes),
          8 * kEps);
    }
    EXPECT_NE(log.find("148 of 150 systems were solved in chunks of 40"), std::string::npos) << log;
    EXPECT_NE(log.find("teams: 2"), std::string::npos) << log;
  }
}

}  // namespace

}  // namespace espalier::test
