// Factorizations out of core, and with a factor on disk, of which only what has changed is made. Truth: the bits of a
// solver with the same options that makes everything; the independent residual; the folder, which must be empty.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <tuple>

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

struct OnDiskTally {
  int some = 0, moved = 0, out_of_core = 0;
};

// A solver that follows changes beside new ones, which make everything. Where pivots have moved the plan is another,
// since it knows what came before.
template <class AnySolver, class Matrix>
void follow(const Options& options, const Matrix& a, unsigned seed, int rounds, OnDiskTally& tally) {
  using T = typename std::decay_t<decltype(a.values)>::value_type;
  std::mt19937 random(seed);
  AnySolver partial(options);
  ASSERT_TRUE(partial.analyze(a).status.ok());
  std::vector<T> now = a.values;
  const std::vector<T> b(static_cast<std::size_t>(a.rows), T(1));
  for (int round = 0; round < rounds; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    const auto p = partial.refactorize(now);
    AnySolver fresh(options);
    ASSERT_TRUE(fresh.analyze(a).status.ok());
    const auto f = fresh.refactorize(now);
    ASSERT_EQ(f.work_share, 1);
    if (p.delayed > 0 || f.delayed > 0) {
      ++tally.moved;
      return;
    }
    ASSERT_EQ(p.status.code, f.status.code) << p.status.message << " / " << f.status.message;
    EXPECT_TRUE(!p.status.ok() || p.whole_reason.empty()) << p.whole_reason;
    EXPECT_EQ(p.inertia.negative, f.inertia.negative);
    EXPECT_EQ(p.rank, f.rank);
    EXPECT_EQ(p.perturbed, f.perturbed);
    EXPECT_EQ(p.two_by_two, f.two_by_two);
    EXPECT_EQ(p.determinant_log, f.determinant_log);
    tally.some += p.work_share > 0 && p.work_share < 1 ? 1 : 0;
    if (p.status.ok()) {
      tally.out_of_core += !p.devices.empty() && p.devices.front().streamed_out_bytes > 0 ? 1 : 0;
      for (const Transpose t : {Transpose::no, Transpose::yes}) {
        std::vector<T> x(b.size()), y(b.size());
        ASSERT_TRUE(partial.solve(b, x, 1, t).status.ok());
        ASSERT_TRUE(fresh.solve(b, y, 1, t).status.ok());
        ASSERT_TRUE(same_bits(x, y)) << "of share " << p.work_share;
      }
    }
    change_values(now, a.values, random);
  }
}

TEST_F(PartialOnDisk, HasTheBitsOfAWholeOne) {
  OnDiskTally tally;
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu})
    for (const Precision precision : {Precision::fp64, Precision::fp32, Precision::mixed})
      for (const bool disk : {false, true}) {
        const SparseMatrix a = elasticity(kind == Kind::lu ? 6 : 8);
        SCOPED_TRACE("kind " + std::to_string(static_cast<int>(kind)) + ", precision " +
                     std::to_string(static_cast<int>(precision)) + (disk ? ", disk" : ", memory"));
        const Options o = small<Solver>(kind, precision, disk, a);
        follow<Solver>(o, a, 1 + static_cast<unsigned>(precision), 6, tally);
        if (HasFailure()) return;
      }
  EXPECT_GT(tally.some, 10);
  EXPECT_GT(tally.out_of_core, 50);
}

// With imaginary parts off the diagonal, of a symmetric matrix on it as well.
ComplexSparseMatrix turned(const SparseMatrix& real, Storage storage) {
  ComplexSparseMatrix a;
  a.rows = real.rows;
  a.cols = real.cols;
  a.col_ptr = real.col_ptr;
  a.row_ind = real.row_ind;
  a.storage = storage;
  for (Index c = 0; c < a.cols; ++c)
    for (auto q = static_cast<std::size_t>(a.col_ptr[c]); q < static_cast<std::size_t>(a.col_ptr[c + 1]); ++q) {
      const double v = real.values[q];
      a.values.emplace_back(v, storage == Storage::hermitian_lower && a.row_ind[q] == c ? 0.0 : 0.02 * v);
    }
  return a;
}

TEST_F(PartialOnDisk, OfComplexSystemsToo) {
  OnDiskTally tally;
  const SparseMatrix gyroscopic =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"gyroscopic", "6"}));
  for (const Storage storage : {Storage::symmetric_lower, Storage::hermitian_lower, Storage::general})
    for (const bool disk : {false, true}) {
      SCOPED_TRACE("storage " + std::to_string(static_cast<int>(storage)) + (disk ? ", disk" : ", memory"));
      const ComplexSparseMatrix a = turned(storage == Storage::general ? gyroscopic : elasticity(7), storage);
      follow<ComplexSolver>(small<ComplexSolver>(Kind::automatic, Precision::fp64, disk, a), a, 3, 5, tally);
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
