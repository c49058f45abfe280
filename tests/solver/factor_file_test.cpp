// Saved factors. Truth: the bits of solutions of the solver that was saved, the independent residual, and the file
// itself, of which every sort of byte is changed.
#include "espalier/factor_file.hpp"

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "solver/solver_common.hpp"

namespace espalier {
namespace {

namespace fs = std::filesystem;

class FactorFile : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "espalier-factor-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
    path_ = folder_ + "/factor";
  }
  void TearDown() override { fs::remove_all(folder_); }

  static std::vector<double> solved(Solver& s, const SparseMatrix& a, Transpose transpose = Transpose::no) {
    const std::vector<double> b = reference::random_vector(a.rows, 9);
    std::vector<double> x(b.size());
    EXPECT_TRUE(s.solve(b, x, 1, transpose).status.ok());
    return x;
  }
  // A factor of the matrix, on file.
  Solver saved(const SparseMatrix& a, Options options) {
    Solver s(std::move(options));
    EXPECT_TRUE(s.analyze(a).status.ok());
    EXPECT_TRUE(s.factorize(a).status.ok());
    const Status status = save_factor(s, path_);
    EXPECT_TRUE(status.ok()) << status.message;
    return s;
  }
  [[nodiscard]] std::vector<char> bytes() const {
    std::ifstream in(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void write(const std::vector<char>& bytes) const {
    std::ofstream(path_, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  void expect_refused(const std::string& what) const {
    const LoadedFactor loaded = load_factor(path_, test::two_threads());
    EXPECT_EQ(loaded.result.status.code, StatusCode::invalid_input) << what;
    EXPECT_NE(loaded.result.status.message.find(path_), std::string::npos) << loaded.result.status.message;
    EXPECT_FALSE(loaded.restored);
  }

  std::string folder_, path_;
};

TEST_F(FactorFile, ALoadedFactorSolvesToTheSameBits) {
  const std::vector<std::pair<std::vector<std::string>, Kind>> systems{
      {{"elasticity", "7"}, Kind::llt}, {{"kkt", "6", "4", "3", "3"}, Kind::ldlt}, {{"gyroscopic", "6"}, Kind::lu}};
  for (const auto& [words, kind] : systems)
    for (const Precision precision : {Precision::fp64, Precision::fp32, Precision::mixed}) {
      const SparseMatrix a = test::generated(words);
      Options options;
      options.device = "cpu";
      options.kind = kind;
      options.precision = precision;
      options.threads = 1;
      options.required_backward_error = 1e-5;  // of FP32
      Solver before = saved(a, options);
      Options others;
      others.device = "cpu";
      others.threads = 3;
      others.required_backward_error = 1e-5;
      LoadedFactor after = load_factor(path_, others);
      ASSERT_TRUE(after.result.status.ok()) << after.result.status.message;
      EXPECT_TRUE(after.restored) << words[0];
      EXPECT_EQ(after.solver.analysis().kind, before.analysis().kind);
      EXPECT_EQ(solved(after.solver, a), solved(before, a)) << words[0];
      EXPECT_EQ(solved(after.solver, a, Transpose::yes), solved(before, a, Transpose::yes)) << words[0];
      // It goes on as any other.
      EXPECT_TRUE(after.solver.refactorize(after.solver.values()).status.ok());
      EXPECT_EQ(solved(after.solver, a), solved(before, a)) << words[0];
    }
}

// Fronts of another layout: the numbers of the file do not fit, and are made again.
TEST_F(FactorFile, WhatDoesNotFitIsMadeAgain) {
  const SparseMatrix a = test::generated({"elasticity", "7"});
  Options options = test::two_threads();
  options.device = "cpu";
  Solver before = saved(a, options);
  options.max_block_size = 16;
  LoadedFactor after = load_factor(path_, options);
  ASSERT_TRUE(after.result.status.ok()) << after.result.status.message;
  EXPECT_FALSE(after.restored);
  test::expect_small_error(after.solver, a);
}

TEST_F(FactorFile, EveryDamageIsFound) {
  const SparseMatrix a = test::generated({"plate", "6", "6"});
  Options options = test::two_threads();
  options.device = "cpu";
  (void)saved(a, options);
  const std::vector<char> good = bytes();
  ASSERT_GT(good.size(), 1000U);
  std::vector<std::size_t> places;
  for (std::size_t k = 0; k < 160; ++k) places.push_back(k);  // heads, sizes, first numbers
  for (std::size_t k = 160; k < good.size(); k += 1 + good.size() / 200) places.push_back(k);
  for (std::size_t k = 1; k <= 16; ++k) places.push_back(good.size() - k);
  for (const std::size_t place : places)
    for (const int mask : {0x01, 0x80}) {
      std::vector<char> bad = good;
      bad[place] = static_cast<char>(bad[place] ^ mask);
      write(bad);
      expect_refused("byte " + std::to_string(place));
    }
  for (std::size_t size = 0; size < good.size(); size += 1 + good.size() / 60) {
    write({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)});
    expect_refused("cut at " + std::to_string(size));
  }
  std::vector<char> longer = good;
  longer.push_back(0);
  write(longer);
  expect_refused("a byte more");
  write(std::vector<char>(5000, 'x'));
  expect_refused("of something else");
  write(good);
  EXPECT_TRUE(load_factor(path_, options).result.status.ok());
}

TEST_F(FactorFile, ANewerVersionAndOtherFilesAreNamed) {
  const SparseMatrix a = test::generated({"plate", "6", "6"});
  (void)saved(a, test::two_threads());
  std::vector<char> newer = bytes();
  newer[8] = 2;
  write(newer);
  const Status status = load_factor(path_).result.status;
  EXPECT_NE(status.message.find("newer program"), std::string::npos) << status.message;
  EXPECT_EQ(load_factor(folder_ + "/missing").result.status.code, StatusCode::invalid_input);
  EXPECT_EQ(load_factor(folder_).result.status.code, StatusCode::invalid_input);
  Solver s(test::two_threads());
  EXPECT_THROW((void)save_factor(s, path_), std::logic_error);
}

// What stood under the name stays until the new file is whole.
TEST_F(FactorFile, AFileThatCannotBeWrittenLeavesTheOldOne) {
  const SparseMatrix a = test::generated({"plate", "6", "6"});
  Solver s = saved(a, test::two_threads());
  const std::vector<char> good = bytes();
  EXPECT_EQ(save_factor(s, folder_ + "/missing/factor").code, StatusCode::invalid_input);
  EXPECT_EQ(save_factor(s, folder_ + "/factor.gz").code, StatusCode::invalid_input);
  EXPECT_EQ(bytes(), good);
  EXPECT_TRUE(save_factor(s, path_).ok());
  EXPECT_EQ(bytes().size(), good.size());
}

}  // namespace
}  // namespace espalier
