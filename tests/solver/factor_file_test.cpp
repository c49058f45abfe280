// Saved factors. Truth: the bits of solutions of the solver that was saved, the independent residual, and the file
// itself, of which every sort of byte is changed.
#include "espalier/factor_file.hpp"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <complex>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "reference/saddle_points.hpp"
#include "rounds.hpp"
#include "solver/complex_common.hpp"
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

// Kinds, storages, precisions; the right-hand sides in several columns.
TEST_F(FactorFile, ComplexFactorsSolveToTheSameBits) {
  using Value = std::complex<double>;
  const Index n = 60;
  struct Case {
    test::Sort sort;
    Storage storage;
    Kind kind;
  };
  const std::vector<Case> cases{{test::Sort::definite, Storage::hermitian_lower, Kind::llt},
                                {test::Sort::definite, Storage::hermitian_upper, Kind::automatic},
                                {test::Sort::hermitian, Storage::hermitian_both, Kind::ldlt},
                                {test::Sort::hermitian, Storage::general, Kind::automatic},
                                {test::Sort::hermitian, Storage::hermitian_lower, Kind::lu},
                                {test::Sort::symmetric, Storage::symmetric_lower, Kind::ldlt},
                                {test::Sort::symmetric, Storage::general, Kind::automatic},
                                {test::Sort::general, Storage::general, Kind::lu}};
  int number = 0;
  for (const auto& [sort, storage, kind] : cases)
    for (const Precision precision : {Precision::fp64, Precision::mixed}) {
      SCOPED_TRACE(testing::Message() << "case " << number << ", precision " << static_cast<int>(precision));
      const test::Dense dense = test::random_dense(n, sort, static_cast<unsigned>(++number));
      const ComplexSparseMatrix a = test::sparse(dense, storage);
      Options o;
      o.device = "cpu";
      o.kind = kind;
      o.precision = precision;
      o.threads = 1;
      ComplexSolver before(o);
      ASSERT_TRUE(before.analyze(a).status.ok());
      const ComplexFactorResult factor = before.factorize(a);
      ASSERT_TRUE(factor.status.ok()) << factor.status.message;
      ASSERT_TRUE(save_factor(before, path_).ok());
      EXPECT_TRUE(is_complex_factor(path_));
      Options others;
      others.device = "cpu";
      others.threads = 3;
      LoadedComplexFactor after = load_complex_factor(path_, others);
      ASSERT_TRUE(after.result.status.ok()) << after.result.status.message;
      EXPECT_TRUE(after.restored);
      EXPECT_EQ(after.solver.analysis().kind, before.analysis().kind);
      EXPECT_EQ(after.result.inertia.negative, factor.inertia.negative);
      EXPECT_EQ(after.result.determinant_phase, factor.determinant_phase);
      EXPECT_EQ(after.solver.state(), Solver::State::factorized);
      std::vector<Value> b(static_cast<std::size_t>(3 * n)), x(b.size()), y(b.size());
      for (std::size_t k = 0; k < b.size(); ++k) b[k] = {std::sin(1.0 + k), std::cos(2.0 * k)};
      for (const Transpose how : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
        EXPECT_TRUE(before.solve(b, x, 3, how).status.ok());
        EXPECT_TRUE(after.solver.solve(b, y, 3, how).status.ok());
        EXPECT_EQ(x, y) << static_cast<int>(how);
        const Eigen::Map<const test::Dense> solution(y.data(), n, 3), right(b.data(), n, 3);
        const test::Dense op = how == Transpose::no    ? dense
                               : how == Transpose::yes ? test::Dense(dense.transpose())
                                                       : test::Dense(dense.adjoint());
        EXPECT_LE((op * solution - right).norm(), 1e-12 * (op.norm() * solution.norm() + right.norm()));
      }
      // It goes on as any other, and the matrix is the one that was saved.
      const ComplexSparseMatrix own = factorized_matrix(after.solver);
      EXPECT_TRUE(after.solver.has_pattern(own));
      EXPECT_TRUE(after.solver.factorize(own).status.ok());
      EXPECT_TRUE(after.solver.solve(b, y, 3, Transpose::conjugate).status.ok());
      EXPECT_EQ(x, y);
    }
}

// On the devices of several on the host, and where complex systems are factorized as real ones.
TEST_F(FactorFile, OtherFormsAreMadeAgainOrTaken) {
  const test::Dense dense = test::random_dense(40, test::Sort::hermitian, 3);
  const ComplexSparseMatrix a = test::sparse(dense, Storage::hermitian_lower);
  const auto solved_by = [&](ComplexSolver& s) {
    std::vector<std::complex<double>> b(40, {1, 2}), x(40);
    EXPECT_TRUE(s.solve(b, x).status.ok());
    const Eigen::Map<const Eigen::VectorXcd> solution(x.data(), 40);
    EXPECT_LE((dense * solution - Eigen::VectorXcd::Constant(40, {1, 2})).norm(), 1e-11);
  };
  for (const char* from : {"cpu", "host:2"})
    for (const char* to : {"cpu", "host:2"}) {
      Options o = test::two_threads();
      o.device = from;
      ComplexSolver before(o);
      ASSERT_TRUE(before.analyze(a).status.ok());
      ASSERT_TRUE(before.factorize(a).status.ok());
      ASSERT_TRUE(save_factor(before, path_).ok());
      o.device = to;
      LoadedComplexFactor after = load_complex_factor(path_, o);
      ASSERT_TRUE(after.result.status.ok()) << from << to << after.result.status.message;
      solved_by(after.solver);
    }
  const test::AsRealForm real_form;
  Options o = test::two_threads();
  o.device = "cpu";
  LoadedComplexFactor after = load_complex_factor(path_, o);
  ASSERT_TRUE(after.result.status.ok()) << after.result.status.message;
  EXPECT_FALSE(after.restored);
  solved_by(after.solver);
  ASSERT_TRUE(save_factor(after.solver, path_).ok());
  LoadedComplexFactor again = load_complex_factor(path_, o);
  ASSERT_TRUE(again.result.status.ok()) << again.result.status.message;
  solved_by(again.solver);
}

// The numbers of a factor are those of a matrix in a scaling, which goes along, whatever the options of those who load
// it.
TEST_F(FactorFile, TheScalingOfTheNumbersComesAlong) {
  const std::vector<std::pair<SparseMatrix, Kind>> systems{
      {reference::random_system(80, 4, reference::Values::positive, 3), Kind::llt},
      {reference::random_system(80, 4, reference::Values::indefinite, 4), Kind::ldlt},
      {reference::random_system(80, 4, reference::Values::general, 5), Kind::lu}};
  for (const auto& [a, kind] : systems)
    for (const Rescale of_saver : {Rescale::off, Rescale::on, Rescale::equilibration})
      for (const Rescale of_loader : {Rescale::off, Rescale::on, Rescale::equilibration})
        for (const Precision precision : {Precision::fp64, Precision::fp32}) {
          Options o = test::two_threads();
          o.device = "cpu";
          o.kind = kind;
          o.precision = precision;
          o.rescale = of_saver;
          o.refinement_steps = 0;
          o.required_backward_error = std::numeric_limits<double>::infinity();
          Solver before(o);
          ASSERT_TRUE(before.analyze(a).status.ok());
          SparseMatrix other = a;  // D A D, far from the values of the analysis
          for (Index c = 0; c < a.cols; ++c)
            for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
              other.values[static_cast<std::size_t>(q)] *=
                  std::ldexp(1.0, c % 7 + a.row_ind[static_cast<std::size_t>(q)] % 7);
          ASSERT_TRUE(before.factorize(other).status.ok());
          ASSERT_TRUE(save_factor(before, path_).ok());
          o.rescale = of_loader;
          LoadedFactor after = load_factor(path_, o);
          ASSERT_TRUE(after.result.status.ok()) << after.result.status.message;
          EXPECT_TRUE(after.restored);
          EXPECT_EQ(solved(after.solver, other), solved(before, other))
              << static_cast<int>(kind) << static_cast<int>(of_saver) << static_cast<int>(of_loader);
          EXPECT_EQ(after.result.determinant_log, before.factorize(other).determinant_log);
          EXPECT_TRUE(after.solver.factorize(a).status.ok());
          const std::vector<double> b(80, 1.0);
          std::vector<double> x(80);
          EXPECT_TRUE(after.solver.solve(b, x).status.ok());
          EXPECT_LE(reference::backward_error(a, b, x), precision == Precision::fp64 ? 1e-10 : 1e-2);
        }
}

// A real form is saved with the order of its complex system, which knows of no moved pivots. Fronts of the same sizes
// may then have other unknowns.
TEST_F(FactorFile, PivotsThatWereMovedInARealFormAreNotTakenForOthers) {
  const test::AsRealForm as_real_form;
  int moved = 0;
  for (std::uint64_t seed = 80; seed <= 150; ++seed) {
    SCOPED_TRACE(seed);
    const auto n = static_cast<Index>(150 + seed);
    ComplexSparseMatrix a = reference::turned(reference::saddle_point(n, 1 + n / 5, seed), false, seed);
    Options options = test::two_threads();
    options.precision = Precision::mixed;
    options.rescale = Rescale::on;
    options.refinement_steps = 0;
    options.required_backward_error = std::numeric_limits<double>::infinity();  // as the factor gives it
    bool moves = false;
    options.log = [&](const std::string& line) { moves = moves || line.find("later front") != std::string::npos; };
    ComplexSolver s(options);
    ASSERT_TRUE(s.analyze(a).status.ok());
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> size(0.4, 2.5);
    for (int k = 0; k < 4; ++k) {  // values that the scaling of the first ones does not suit
      std::vector<double> d(static_cast<std::size_t>(a.rows));
      for (double& v : d) v = size(random);
      for (std::size_t j = 0; j < d.size(); ++j)
        for (auto q = static_cast<std::size_t>(a.col_ptr[j]); q < static_cast<std::size_t>(a.col_ptr[j + 1]); ++q)
          a.values[q] *= d[static_cast<std::size_t>(a.row_ind[q])] * d[j];
      (void)s.factorize(a);
    }
    if (s.state() != ComplexSolver::State::factorized || !moves) continue;
    ++moved;
    ASSERT_TRUE(save_factor(s, path_).ok());
    LoadedComplexFactor loaded = load_complex_factor(path_, options);
    if (!loaded.result.status.ok()) continue;  // FP32 may not do for it in the order of before
    test::Dense whole = test::Dense::Zero(a.rows, a.rows);
    for (Index j = 0; j < a.rows; ++j)
      for (Offset q = a.col_ptr[j]; q < a.col_ptr[j + 1]; ++q)
        whole(a.row_ind[q], j) = whole(j, a.row_ind[q]) = a.values[q];
    const Eigen::VectorXcd b = Eigen::VectorXcd::Ones(a.rows);
    Eigen::VectorXcd x(a.rows), y(a.rows);
    const auto list = [&](Eigen::VectorXcd& v) { return std::span(v.data(), static_cast<std::size_t>(v.size())); };
    Eigen::VectorXcd copy = b;
    ASSERT_TRUE(s.solve(list(copy), list(x)).status.ok() && loaded.solver.solve(list(copy), list(y)).status.ok());
    const double error = (b - whole * y).norm() / (whole.norm() * y.norm());
    EXPECT_LE(error, std::max(1e-4, 10 * (b - whole * x).norm() / (whole.norm() * x.norm()))) << loaded.restored;
  }
  EXPECT_GT(moved, 0);
}

TEST_F(FactorFile, TheSortOfNumbersIsSaid) {
  (void)saved(test::generated({"plate", "6", "6"}), test::two_threads());
  EXPECT_FALSE(is_complex_factor(path_));
  const Status real = load_complex_factor(path_).result.status;
  EXPECT_EQ(real.code, StatusCode::invalid_input);
  EXPECT_NE(real.message.find("its matrix is real"), std::string::npos) << real.message;
  ComplexSolver s(test::two_threads());
  const ComplexSparseMatrix a = test::sparse(test::random_dense(9, test::Sort::general, 1), Storage::general);
  ASSERT_TRUE(s.analyze(a).status.ok());
  EXPECT_THROW((void)save_factor(s, path_), std::logic_error);
  EXPECT_THROW((void)factorized_matrix(s), std::logic_error);
  ASSERT_TRUE(s.factorize(a).status.ok());
  ASSERT_TRUE(save_factor(s, path_).ok());
  const Status complex = load_factor(path_).result.status;
  EXPECT_EQ(complex.code, StatusCode::invalid_input);
  EXPECT_NE(complex.message.find("its matrix is complex"), std::string::npos) << complex.message;
  write(std::vector<char>(20, 'x'));
  EXPECT_THROW((void)is_complex_factor(path_), Error);
}

// A general matrix whose values are symmetric is known as it was given; what is stored twice is summed.
TEST_F(FactorFile, TheMatrixIsThatOfTheSolver) {
  const SparseMatrix lower = test::generated({"elasticity", "3"});
  const SparseMatrix general = reference::stored_as(lower, Storage::general);
  Options options = test::two_threads();
  options.device = "cpu";
  (void)saved(general, options);
  LoadedFactor after = load_factor(path_, options);
  ASSERT_TRUE(after.result.status.ok()) << after.result.status.message;
  EXPECT_EQ(after.storage, Storage::general);
  EXPECT_EQ(after.solver.analysis().kind, Kind::llt);
  EXPECT_TRUE(after.solver.has_pattern(general));
  EXPECT_EQ(factorized_matrix(after.solver).values, general.values);
  EXPECT_TRUE(after.solver.factorize(general).status.ok());
  const SparseMatrix twice = reference::stored_as(lower, Storage::symmetric_lower, true);
  ASSERT_GT(twice.nonzeros(), lower.nonzeros());
  (void)saved(twice, options);
  LoadedFactor summed = load_factor(path_, options);
  ASSERT_TRUE(summed.result.status.ok()) << summed.result.status.message;
  EXPECT_EQ(factorized_matrix(summed.solver).nonzeros(),
            reference::stored_as(lower, Storage::symmetric_lower).nonzeros());
  test::expect_small_error(summed.solver, lower);
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
  for (std::size_t k = 160; k < good.size(); k += 1 + good.size() / espalier::test::rounds(200, 50))
    places.push_back(k);
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

// A limit of file sizes stands for a full disk; a writer that is killed leaves the old file, too.
TEST_F(FactorFile, AFullDiskAndADeathLeaveTheOldFile) {
  const SparseMatrix a = test::generated({"elasticity", "7"});
  Options options = test::two_threads();
  options.device = "cpu";
  (void)saved(a, options);
  const std::vector<char> good = bytes();
  const auto in_child = [&](const auto& body) {
    const pid_t child = ::fork();
    if (child == 0) ::_exit(body() ? 0 : 1);
    int how = 0;
    EXPECT_EQ(::waitpid(child, &how, 0), child);
    return how;
  };
  Solver s(options);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  const int refused = in_child([&] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{good.size() / 2, good.size() / 2};
    if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) return false;
    const Status status = save_factor(s, path_);
    return status.code == StatusCode::invalid_input && status.message.find(path_) != std::string::npos;
  });
  EXPECT_TRUE(WIFEXITED(refused) && WEXITSTATUS(refused) == 0);
  EXPECT_EQ(bytes(), good);
  const int killed = in_child([&] {
    const rlimit limit{good.size() / 2, good.size() / 2};  // SIGXFSZ ends it in the middle of the file
    if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) return false;
    return save_factor(s, path_).ok();
  });
  EXPECT_TRUE(WIFSIGNALED(killed));
  EXPECT_EQ(bytes(), good);
  EXPECT_TRUE(load_factor(path_, options).restored);
  EXPECT_TRUE(save_factor(s, path_).ok());
}

}  // namespace
}  // namespace espalier
