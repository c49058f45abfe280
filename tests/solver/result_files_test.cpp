// What the solver writes into files: saved analyses and traces. Truths: the factor of the analysis that was not saved,
// files damaged on purpose, the schedule that the trace must show.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "solver/solver_common.hpp"

namespace espalier {
namespace result_files_test {

namespace fs = std::filesystem;
using reference::Values;
using namespace test;

// A file name of this process in the temporary folder, removed at the end.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& name)
      : path_((fs::temp_directory_path() / ("espalier_" + std::to_string(::getpid()) + "_" + name)).string()) {}
  ~TemporaryFile() { fs::remove(path_); }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

std::string bytes_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write_bytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

TEST(SavedAnalysis, GivesTheSameFactorAndSurvivesDamage) {
  for (const Values values : {Values::positive, Values::indefinite, Values::general}) {
    const SparseMatrix a = reference::random_system(90, 5, values, 41);
    const TemporaryFile file("analysis");
    Solver s(two_threads());
    ASSERT_TRUE(s.analyze(a).status.ok());
    const Status saved = s.save_analysis(file.path());
    ASSERT_TRUE(saved.ok()) << saved.message;
    Solver t(two_threads());
    const AnalysisResult loaded = t.load_analysis(file.path(), a);
    ASSERT_TRUE(loaded.status.ok()) << loaded.status.message;
    EXPECT_EQ(loaded.kind, s.analysis().kind);
    EXPECT_EQ(loaded.nonzeros_factor, s.analysis().nonzeros_factor);
    ASSERT_TRUE(s.factorize(a).status.ok());
    ASSERT_TRUE(t.factorize(a).status.ok());
    std::vector<double> b = reference::random_vector(90, 42), x(90), y(90);
    ASSERT_TRUE(s.solve(b, x).status.ok());
    ASSERT_TRUE(t.solve(b, y).status.ok());
    EXPECT_EQ(x, y);

    const std::string good = bytes_of(file.path());
    const auto refused = [&](const std::string& bytes) {
      write_bytes(file.path(), bytes);
      const Status r = t.load_analysis(file.path(), a).status;
      return r.code == StatusCode::invalid_input && r.message.find(file.path()) != std::string::npos &&
             t.state() == Solver::State::empty;
    };
    for (std::size_t n = 0; n < good.size(); n += std::max<std::size_t>(1, good.size() / 50))
      EXPECT_TRUE(refused(good.substr(0, n))) << n << " of " << good.size() << " bytes";
    for (std::size_t n = 0; n < good.size(); n += std::max<std::size_t>(1, good.size() / 150)) {
      std::string bad = good;
      bad[n] = static_cast<char>(bad[n] ^ 0x40);
      EXPECT_TRUE(refused(bad)) << "byte " << n;
    }
    EXPECT_TRUE(refused(good + "x"));
    EXPECT_TRUE(refused("%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 1\n"));
    write_bytes(file.path(), good);
    EXPECT_TRUE(t.load_analysis(file.path(), a).status.ok());
    const SparseMatrix other = reference::random_system(90, 5, values, 43);
    EXPECT_EQ(t.load_analysis(file.path(), other).status.code, StatusCode::invalid_input);
  }
}

TEST(SavedAnalysis, ForeignPathsAndOtherKinds) {
  const SparseMatrix a = reference::random_system(40, 5, Values::positive, 44);
  Solver s(two_threads());
  EXPECT_EQ(s.load_analysis("/nonexistent/analysis", a).status.code, StatusCode::invalid_input);
  EXPECT_EQ(s.load_analysis("/tmp", a).status.code, StatusCode::invalid_input);
  ASSERT_TRUE(s.analyze(a).status.ok());
  EXPECT_EQ(s.save_analysis("/nonexistent/analysis").code, StatusCode::invalid_input);
  const TemporaryFile file("kind");
  ASSERT_TRUE(s.save_analysis(file.path()).ok());
  Options o = two_threads();
  o.kind = Kind::lu;
  EXPECT_EQ(Solver(o).load_analysis(file.path(), a).status.code, StatusCode::invalid_input);
  // The automatic kind keeps its second thought: llt from the file, ldlt once a pivot is negative.
  SparseMatrix indefinite = a;
  for (double& v : indefinite.values) v = v > 1 ? -v : v;
  Solver t(two_threads());
  ASSERT_TRUE(t.load_analysis(file.path(), a).status.ok());
  const FactorResult f = t.factorize(indefinite);
  EXPECT_TRUE(f.status.ok()) << f.status.message;
}

TEST(Trace, OfAFactorizationIsJson) {
  Options o = two_threads();
  o.record_timeline = true;
  Solver s(o);
  const SparseMatrix a = generated({"elasticity", "6"});
  ASSERT_TRUE(s.analyze(a).status.ok());
  for (int round = 0; round < 2; ++round) ASSERT_TRUE(s.factorize(a).status.ok());
  const TemporaryFile file("trace.json");
  ASSERT_TRUE(s.write_trace(file.path()).ok());
  const auto trace = nlohmann::json::parse(bytes_of(file.path()));
  int events = 0, tracks = 0;
  for (const auto& e : trace.at("traceEvents")) {
    events += e.at("ph") == "X" ? 1 : 0;
    tracks += e.at("name") == "thread_name" ? 1 : 0;
  }
  EXPECT_GT(events, 0);
  EXPECT_EQ(tracks, 2);
  EXPECT_EQ(s.write_trace("/nonexistent/trace").code, StatusCode::invalid_input);
}

}  // namespace result_files_test
}  // namespace espalier
