// Factors on disk, by the solver's options. Truth: the independent residual, the answer in core, the budget, the bits
// of another run, and the folder, which must be empty.
#include <sys/resource.h>

#include <filesystem>

#include "espalier/solve_rows.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace {

namespace fs = std::filesystem;

class ScratchFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "espalier-scratch-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override {
    EXPECT_TRUE(!fs::exists(folder_) || fs::is_empty(folder_));
    fs::remove_all(folder_);
  }
  [[nodiscard]] Options options(Kind kind, Precision precision, Offset budget, int threads = 2) const {
    Options o;
    o.device = "cpu";
    o.kind = kind;
    o.precision = precision;
    o.threads = threads;
    o.host_memory_bytes = budget;
    o.scratch = folder_;
    o.required_backward_error = precision == Precision::fp32 ? 1e-5 : 1e-10;
    return o;
  }
  // What it takes in core.
  static Offset in_core(const SparseMatrix& a, Options o) {
    o.host_memory_bytes = 0;
    o.scratch.clear();
    Solver s(o);
    return s.analyze(a).predicted_bytes;
  }

  std::string folder_;
};

struct Written {
  std::vector<double> x;
  Offset bytes = 0;
};

Written run(const SparseMatrix& a, const Options& o) {
  Written w;
  Solver s(o);
  const AnalysisResult analysis = s.analyze(a);
  EXPECT_TRUE(analysis.status.ok()) << analysis.status.message;
  const FactorResult f = s.factorize(a);
  EXPECT_TRUE(f.status.ok()) << f.status.message;
  if (!f.status.ok()) return w;
  EXPECT_LE(f.peak_host_bytes, o.host_memory_bytes);
  for (const DeviceReport& d : f.devices) w.bytes += d.disk_written_bytes;
  EXPECT_GT(analysis.predicted_disk_bytes, 0);
  const std::vector<double> b = reference::random_vector(a.rows, 3);
  w.x.resize(b.size());
  const SolveResult r = s.solve(b, w.x);
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_LE(reference::backward_error(a, b, w.x), o.precision == Precision::fp32 ? 1e-5 : 1e-13);
  std::vector<double> again(b.size());
  EXPECT_TRUE(s.refactorize(a.values).status.ok());
  EXPECT_TRUE(s.solve(b, again).status.ok());
  EXPECT_EQ(again, w.x);
  return w;
}

TEST_F(ScratchFolder, AnyBudgetKindAndPrecisionSolves) {
  const std::vector<std::pair<std::vector<std::string>, Kind>> systems{{{"elasticity", "14"}, Kind::llt},
                                                                       {{"elasticity", "12"}, Kind::ldlt},
                                                                       {{"kkt", "14", "8", "3", "3"}, Kind::ldlt},
                                                                       {{"gyroscopic", "11"}, Kind::lu}};
  // Where trees are cut is decided by rates that this machine shows, so that some of the budgets may be enough, or
  // none.
  int written = 0;
  for (const auto& [words, kind] : systems) {
    const SparseMatrix a = test::generated(words);
    for (const Precision precision : {Precision::fp64, Precision::fp32}) {
      const Offset whole = in_core(a, options(kind, precision, 0));
      for (const double part : {0.85, 0.6}) {
        SCOPED_TRACE(words[0] + ", a part of " + std::to_string(part));
        const auto budget = static_cast<Offset>(part * static_cast<double>(whole));
        Solver probe(options(kind, precision, budget));
        if (!probe.analyze(a).status.ok() || !probe.factorize(a).status.ok()) {
          const Status refused = probe.factorize(a).status;
          EXPECT_EQ(refused.code, StatusCode::out_of_memory);
          EXPECT_NE(refused.message.find("budget"), std::string::npos) << refused.message;
          continue;
        }
        const Written w = run(a, options(kind, precision, budget));
        std::vector<double> x(w.x.size());
        EXPECT_TRUE(probe.solve(reference::random_vector(a.rows, 3), x).status.ok());
        EXPECT_EQ(x, w.x) << "another run";
        if (w.bytes > 0) ++written;
      }
    }
  }
  EXPECT_GT(written, 0) << "nothing went to the disk";
}

TEST_F(ScratchFolder, FullAndMissingFoldersAreErrorsAndTheSolverGoesOn) {
  const SparseMatrix a = test::generated({"elasticity", "14"});
  const Offset whole = in_core(a, options(Kind::llt, Precision::fp64, 0));
  const Options o = options(Kind::llt, Precision::fp64, whole * 6 / 10);
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit less{1 << 20, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &less), 0);
  const FactorResult full = s.refactorize(a.values);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_EQ(full.status.code, StatusCode::out_of_memory);
  EXPECT_NE(full.status.message.find(folder_), std::string::npos) << full.status.message;
  EXPECT_TRUE(s.refactorize(a.values).status.ok());
  test::expect_small_error(s, a);
  fs::remove_all(folder_);  // the file has no name: it does not miss the folder
  EXPECT_TRUE(s.refactorize(a.values).status.ok());
  test::expect_small_error(s, a);
  Solver late(o);
  ASSERT_TRUE(late.analyze(a).status.ok());
  const FactorResult missing = late.factorize(a);
  EXPECT_EQ(missing.status.code, StatusCode::invalid_input);
  EXPECT_NE(missing.status.message.find(folder_), std::string::npos) << missing.status.message;
}

// What a refusal names, a little below it, and what the analysis says of both.
TEST_F(ScratchFolder, TheBudgetThatIsNamedDoes) {
  const std::vector<std::pair<std::vector<std::string>, Kind>> systems{
      {{"elasticity", "14"}, Kind::llt}, {{"kkt", "12", "8", "3", "3"}, Kind::ldlt}, {{"gyroscopic", "9"}, Kind::lu}};
  for (const auto& [words, kind] : systems)
    for (const bool partial : {false, true}) {
      SCOPED_TRACE(words[0] + (partial ? ", fronts are kept" : ""));
      const SparseMatrix a = test::generated(words);
      Options o = options(kind, Precision::fp64, 0);
      o.partial_refactorization = partial;
      o.host_memory_bytes = in_core(a, o) / 12;
      const auto named = [&] {
        Solver s(o);
        EXPECT_GT(s.analyze(a).predicted_bytes, o.host_memory_bytes);
        const std::string said = s.factorize(a).status.message;
        const std::size_t end = said.find(" bytes would do");
        EXPECT_NE(end, std::string::npos) << said;
        return end == std::string::npos ? Offset{0} : std::stoll(said.substr(said.rfind(' ', end - 1) + 1));
      };
      const Offset least = named();
      o.host_memory_bytes = least - least / 16;
      const Offset again = named();
      EXPECT_NEAR(static_cast<double>(again), static_cast<double>(least), 0.1 * static_cast<double>(least));
      o.host_memory_bytes = again;
      Solver s(o);
      EXPECT_LE(s.analyze(a).predicted_bytes, again);
      const FactorResult f = s.factorize(a);
      EXPECT_TRUE(f.status.ok()) << f.status.message;
      EXPECT_LE(f.peak_host_bytes, again);
      test::expect_small_error(s, a);
    }
}

// A few unknowns need a part of the file.
TEST_F(ScratchFolder, RowsAreThoseOfAWholeSolution) {
  const SparseMatrix a = test::generated({"elasticity", "14"});
  const Offset whole = in_core(a, options(Kind::llt, Precision::fp64, 0));
  Solver s(options(Kind::llt, Precision::fp64, whole * 6 / 10));
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  const std::vector<Offset> ptr{0, 1};
  const std::vector<Index> row{5}, wanted{0, 7, a.rows - 1};
  const std::vector<double> value{1.0};
  std::vector<double> few(wanted.size()), b(static_cast<std::size_t>(a.rows)), x(b.size());
  const SolveRowsResult r = solve_rows(s, SparseColumns{ptr, row, value}, wanted, few);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  b[5] = 1;
  ASSERT_TRUE(s.solve(b, x).status.ok());
  double largest = 0;
  for (const double v : x) largest = std::max(largest, std::abs(v));
  for (std::size_t k = 0; k < wanted.size(); ++k) EXPECT_NEAR(few[k], x[wanted[k]], 1e-10 * largest);
}

}  // namespace
}  // namespace espalier
