// Every Matrix Market file of the shared collection, against the table INDEX.md that was made by another reader.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "matrix/helpers.hpp"
#include "matrix/norms.hpp"
#include "matrix/read.hpp"
#include "matrix/transform.hpp"
#include "matrix/triplets.hpp"
#include "matrix/validate.hpp"
#include "places.hpp"

namespace espalier::matrix {
namespace shared_data_test {

namespace fs = std::filesystem;

// A row of the table: | `path` | bytes | n | entries stored | nonzeros, full matrix | MatrixMarket kind | ...
struct Claim {
  std::int64_t n = 0, stored = 0, full = 0;
  std::string kind;
};

std::map<std::string, Claim> read_index(const fs::path& path) {
  std::map<std::string, Claim> claims;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::vector<std::string> cells;
    std::stringstream cut(line);
    for (std::string cell; std::getline(cut, cell, '|');) {
      cell.erase(std::remove_if(cell.begin(), cell.end(), [](char c) { return c == '`' || c == ','; }), cell.end());
      const auto begin = cell.find_first_not_of(' ');
      cells.push_back(begin == std::string::npos ? "" : cell.substr(begin, cell.find_last_not_of(' ') - begin + 1));
    }
    const bool matrix = cells.size() > 6 && cells[1].find(".mtx") != std::string::npos;
    if (matrix) claims[cells[1]] = {std::stoll(cells[3]), std::stoll(cells[4]), std::stoll(cells[5]), cells[6]};
  }
  return claims;
}

// Entries of the full matrix that are not zero.
std::int64_t nonzeros_in_full(const SparseMatrix& a) {
  const SparseMatrix full = to_general(a);
  return std::count_if(full.values.begin(), full.values.end(), [](double v) { return v != 0; });
}

TEST(SharedData, EveryMatrixAgreesWithTheIndex) {
  const fs::path data = test::shared_data();
  if (!fs::exists(data / "INDEX.md")) GTEST_SKIP() << data << " is absent";
  const auto claims = read_index(data / "INDEX.md");
  std::size_t files = 0, compared = 0;
  for (const auto& entry : fs::recursive_directory_iterator(data)) {
    const std::string name = fs::relative(entry.path(), data).string();
    if (!entry.is_regular_file() || name.find(".mtx") == std::string::npos) continue;
    ++files;
    SCOPED_TRACE(name);
    SparseMatrix a;
    ASSERT_NO_THROW(a = read_matrix(entry.path().string())) << name;
    validate(a);
    EXPECT_TRUE(is_sorted_unique(a));
    const auto claim = claims.find(name);
    if (claim == claims.end()) continue;
    ++compared;
    EXPECT_EQ(a.rows, claim->second.n);
    EXPECT_EQ(a.nonzeros(), claim->second.stored);
    EXPECT_EQ(nonzeros_in_full(a), claim->second.full);
    EXPECT_EQ(a.symmetric(), claim->second.kind.find("symmetric") != std::string::npos);
  }
  EXPECT_EQ(files, 181u);
  EXPECT_GE(compared, 100u);
}

// Truth: SPD matrices stored as general ones are found to be symmetric (INDEX.md: superlu_g20 is SPD).
TEST(SharedData, SymmetryOfAGeneralFileIsFound) {
  const fs::path file = test::shared_data() / "unsym/superlu_g20.mtx";
  if (!fs::exists(file)) GTEST_SKIP() << file << " is absent";
  const auto a = read_matrix(file.string());
  EXPECT_EQ(a.storage, Storage::general);
  EXPECT_TRUE(values_are_symmetric(a));
}

}  // namespace shared_data_test
}  // namespace espalier::matrix
