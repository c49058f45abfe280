// The small files of the shared collection, many of them nasty on purpose: each is solved with a normwise backward
// error of at most 1e-14, or refused with a reason; the inertia is that of the dense eigenvalues.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "espalier/espalier.hpp"
#include "matrix/read.hpp"
#include "reference/reference.hpp"

namespace espalier {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kLargestFile = 200000;
constexpr Index kLargestDense = 500;

std::vector<fs::path> small_files() {
  std::vector<fs::path> files;
  const fs::path data = ESPALIER_SHARED_DATA;
  if (!fs::exists(data)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(data))
    if (entry.is_regular_file() && entry.path().extension() == ".mtx" && entry.file_size() <= kLargestFile)
      files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

TEST(Collection, SmallFilesAreSolvedOrRefusedWithAReason) {
  const auto files = small_files();
  if (files.empty()) GTEST_SKIP() << ESPALIER_SHARED_DATA << " is absent";
  int solved = 0, refused = 0;
  for (const fs::path& file : files) {
    SCOPED_TRACE(file.string());
    const SparseMatrix a = matrix::read_matrix(file.string());
    Options o;
    o.threads = 2;
    Solver s(o);
    Status status = s.analyze(a).status;
    if (status.ok()) status = s.factorize(a).status;
    if (!status.ok()) {
      ++refused;
      const bool shape = a.rows != a.cols && status.code == StatusCode::invalid_input;
      EXPECT_TRUE(shape || status.code == StatusCode::singular) << status.message;
      EXPECT_TRUE(shape || status.row >= 0) << "names no row: " << status.message;
      continue;
    }
    const std::vector<double> b(static_cast<std::size_t>(a.rows), 1.0);
    std::vector<double> x(b.size());
    const SolveResult r = s.solve(b, x);
    EXPECT_TRUE(r.status.ok()) << r.status.message;
    EXPECT_LE(reference::backward_error(a, b, x), 1e-14);
    ++solved;
  }
  EXPECT_GT(solved, 0);
  RecordProperty("solved", solved);
  RecordProperty("refused", refused);
}

TEST(Collection, InertiaIsThatOfTheEigenvalues) {
  const auto files = small_files();
  if (files.empty()) GTEST_SKIP() << ESPALIER_SHARED_DATA << " is absent";
  int compared = 0;
  for (const fs::path& file : files) {
    const fs::path claim = fs::path(file).replace_extension(".json");
    if (!fs::exists(claim)) continue;
    const SparseMatrix a = matrix::read_matrix(file.string());
    if (!a.symmetric() || a.rows > kLargestDense) continue;
    // Only where eigenvalues say clearly what is zero: none between the two tolerances.
    const reference::Signs strict = reference::signs(a, 1e-15 * a.rows), loose = reference::signs(a, 1e-9);
    if (strict.zero != loose.zero) continue;
    SCOPED_TRACE(file.string());
    for (const bool matching : {true, false}) {
      Options o;
      o.threads = 2;
      o.kind = Kind::ldlt;
      o.matching = matching;
      Solver s(o);
      const AnalysisResult analysis = s.analyze(a);
      if (analysis.status.code == StatusCode::singular) {
        EXPECT_GT(strict.zero, 0) << analysis.status.message;
        continue;
      }
      ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
      const FactorResult f = s.factorize(a);
      EXPECT_EQ(f.inertia.positive, strict.positive) << "matching " << matching << ' ' << f.status.message;
      EXPECT_EQ(f.inertia.negative, strict.negative) << "matching " << matching << ' ' << f.status.message;
      EXPECT_EQ(f.inertia.zero, strict.zero) << "matching " << matching << ' ' << f.status.message;
      ++compared;
    }
  }
  EXPECT_GT(compared, 0);
}

}  // namespace
}  // namespace espalier
