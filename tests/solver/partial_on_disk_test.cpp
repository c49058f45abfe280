// Factorizations out of core, and with a factor on disk, of which only what has changed is made. Truth: the bits of a
// solver with the same options that makes everything; the independent residual; the folder, which must be empty.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "solver/changed_values.hpp"

namespace espalier {
namespace partial_on_disk_test {

using namespace changed_values;
namespace fs = std::filesystem;

class PartialOnDisk : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "espalier-partial-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override {
    EXPECT_TRUE(fs::is_empty(folder_));
    fs::remove_all(folder_);
  }
  // The disk: three tenths of what all takes in core; else a device of the host with so much of it.
  template <class AnySolver, class Matrix>
  Options small(Kind kind, Precision precision, bool disk, const Matrix& a) {
    Options o = bare(false);
    o.kind = kind;
    o.precision = precision;
    o.threads = 2;
    o.device = disk ? "cpu" : "host:1";
    AnySolver probe(o);
    const Offset whole = probe.analyze(a).predicted_bytes;
    o.partial_refactorization = true;
    for (double part = 0.2;; part *= 1.25) {
      const auto bytes = static_cast<Offset>(part * static_cast<double>(whole));
      (disk ? o.host_memory_bytes : o.device_memory_bytes) = bytes;
      if (disk) o.scratch = folder_;
      AnySolver s(o);
      if ((s.analyze(a).status.ok() && s.factorize(a).status.ok()) || part > 4) return o;
    }
  }

  std::string folder_;
};

TEST_F(PartialOnDisk, HasTheBitsOfAWholeOne) {
  BudgetTally tally;
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu})
    for (const Precision precision : {Precision::fp64, Precision::fp32, Precision::mixed})
      for (const bool disk : {false, true}) {
        const SparseMatrix a = elasticity(kind == Kind::lu ? 6 : 8);
        SCOPED_TRACE("kind " + std::to_string(static_cast<int>(kind)) + ", precision " +
                     std::to_string(static_cast<int>(precision)) + (disk ? ", disk" : ", memory"));
        const Options o = small<Solver>(kind, precision, disk, a);
        follow_beside_new<Solver>(o, a, 1 + static_cast<unsigned>(precision), 6, tally);
        if (HasFailure()) return;
      }
  EXPECT_GT(tally.some, 10);
  EXPECT_GT(tally.out_of_core, 50);
}

TEST_F(PartialOnDisk, OfComplexSystemsToo) {
  BudgetTally tally;
  const SparseMatrix gyroscopic =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"gyroscopic", "6"}));
  for (const Storage storage : {Storage::symmetric_lower, Storage::hermitian_lower, Storage::general})
    for (const bool disk : {false, true}) {
      SCOPED_TRACE("storage " + std::to_string(static_cast<int>(storage)) + (disk ? ", disk" : ", memory"));
      const ComplexSparseMatrix a = turned(storage == Storage::general ? gyroscopic : elasticity(7), storage);
      follow_beside_new<ComplexSolver>(small<ComplexSolver>(Kind::automatic, Precision::fp64, disk, a), a, 3, 5, tally);
      if (HasFailure()) return;
    }
  EXPECT_GT(tally.some, 3);
  EXPECT_GT(tally.out_of_core, 10);
}

// A limit of file sizes stands for a full disk, in the middle of a run that makes a part.
TEST_F(PartialOnDisk, AFullDiskLeavesNoOldFactor) {
  const SparseMatrix a = elasticity(12);
  const Options o = small<Solver>(Kind::llt, Precision::fp64, true, a);
  Solver s(o), whole(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(whole.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  std::vector<double> values = a.values;
  const std::vector<double> b(static_cast<std::size_t>(a.rows), 1.0);
  int refused = 0;
  for (const rlim_t bytes : {rlim_t{0}, rlim_t{1} << 16, rlim_t{1} << 20, rlim_t{1} << 22}) {
    values[static_cast<std::size_t>(17 * bytes % values.size())] *= 1.25;
    rlimit before{};
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
    const rlimit less{bytes, before.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &less), 0);
    const FactorResult f = s.refactorize(values);
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    std::vector<double> x(b.size()), y(b.size());
    if (!f.status.ok()) {
      ++refused;
      EXPECT_EQ(f.status.code, StatusCode::out_of_memory);
      EXPECT_NE(f.status.message.find(folder_), std::string::npos) << f.status.message;
      EXPECT_NE(s.state(), Solver::State::factorized);
      const FactorResult again = s.refactorize(values);
      ASSERT_TRUE(again.status.ok()) << again.status.message;
      EXPECT_EQ(again.work_share, 1);
    }
    ASSERT_TRUE(whole.analyze(a).status.ok());
    ASSERT_TRUE(whole.refactorize(values).status.ok());
    ASSERT_TRUE(s.solve(b, x).status.ok());
    ASSERT_TRUE(whole.solve(b, y).status.ok());
    EXPECT_TRUE(same_bits(x, y));
  }
  EXPECT_GT(refused, 0) << "nothing had to be written";
}

TEST_F(PartialOnDisk, ADeathInAPartialRunLeavesNothingBehind) {
  const SparseMatrix a = elasticity(12);
  const Options o = small<Solver>(Kind::llt, Precision::fp64, true, a);
  for (const int microseconds : {0, 3000, 20000}) {
    int ready[2];
    ASSERT_EQ(::pipe(ready), 0);
    const pid_t child = ::fork();
    if (child == 0) {
      Solver s(o);
      (void)s.analyze(a);
      (void)s.factorize(a);
      std::vector<double> values = a.values;
      for (std::size_t k = 0;; k = (k + 101) % values.size()) {
        values[k] *= 1.001;
        if (!s.refactorize(values).status.ok()) ::_exit(1);
        (void)!::write(ready[1], "x", 1);
      }
    }
    char c = 0;
    ASSERT_EQ(::read(ready[0], &c, 1), 1);
    ::usleep(static_cast<useconds_t>(microseconds));
    ::kill(child, SIGKILL);
    int how = 0;
    ASSERT_EQ(::waitpid(child, &how, 0), child);
    EXPECT_TRUE(WIFSIGNALED(how) && WTERMSIG(how) == SIGKILL);
    EXPECT_TRUE(fs::is_empty(folder_));
    ::close(ready[0]);
    ::close(ready[1]);
  }
}

// The budget is kept, and what the analysis has said of the disk is about what comes.
TEST_F(PartialOnDisk, KeepsItsBudgetAndItsPrediction) {
  const SparseMatrix a = elasticity(14);
  const Options o = small<Solver>(Kind::llt, Precision::fp64, true, a);
  Solver s(o);
  const AnalysisResult r = s.analyze(a);
  ASSERT_TRUE(r.status.ok());
  const FactorResult whole = s.factorize(a);
  ASSERT_TRUE(whole.status.ok());
  EXPECT_LE(whole.peak_host_bytes, o.host_memory_bytes);
  const auto written = [](const FactorResult& f) { return static_cast<double>(f.devices.front().disk_written_bytes); };
  EXPECT_GT(written(whole), 0);
  EXPECT_NEAR(written(whole), static_cast<double>(r.predicted_disk_written_bytes), 0.25 * written(whole));
  std::vector<double> values = a.values;
  values.front() *= 1.5;
  const FactorResult part = s.refactorize(values);
  ASSERT_TRUE(part.status.ok());
  EXPECT_LT(part.work_share, 1);
  EXPECT_LT(written(part), written(whole));
  EXPECT_LE(part.peak_host_bytes, o.host_memory_bytes);
}

}  // namespace partial_on_disk_test
}  // namespace espalier
