// Complex systems against Eigen's dense algebra, against the real system of twice the size, and against themselves:
// kinds, storages, transposes, several right-hand sides, devices, budgets, verdicts and refusals, in all forms.
#include "espalier/factor_file.hpp"
#include "solver/complex_common.hpp"

namespace espalier {
namespace complex_test {

using test::Dense;
using test::expect_solutions;
using test::kEps;
using test::op;
using test::random_columns;
using test::random_dense;
using test::Sort;
using test::sparse;
using test::Value;

// @param known  whether the phase is
void expect_determinant(const ComplexFactorResult& r, const Dense& a, bool known) {
  const Eigen::PartialPivLU<Dense> lu(a);
  double log = 0;
  Value phase = lu.permutationP().determinant();
  for (Index i = 0; i < a.rows(); ++i) {
    const Value pivot = lu.matrixLU()(i, i);
    log += std::log(std::abs(pivot));
    phase *= pivot / std::abs(pivot);
  }
  EXPECT_NEAR(r.determinant_log, log, 1e-9 * std::max(1.0, std::abs(log)));
  if (known) {
    EXPECT_LE(std::abs(r.determinant_phase - phase), 1e-9);
  } else {
    EXPECT_TRUE(std::isnan(r.determinant_phase.real()) && std::isnan(r.determinant_phase.imag()));
  }
}

struct Case {
  Sort sort;
  Storage storage;
  Kind wish, kind;
};
const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {Sort::symmetric, Storage::symmetric_lower, Kind::automatic, Kind::ldlt},
      {Sort::symmetric, Storage::symmetric_upper, Kind::automatic, Kind::ldlt},
      {Sort::symmetric, Storage::symmetric_both, Kind::ldlt, Kind::ldlt},
      {Sort::symmetric, Storage::general, Kind::automatic, Kind::ldlt},
      {Sort::symmetric, Storage::symmetric_lower, Kind::lu, Kind::lu},
      {Sort::hermitian, Storage::hermitian_lower, Kind::automatic, Kind::ldlt},
      {Sort::hermitian, Storage::hermitian_upper, Kind::ldlt, Kind::ldlt},
      {Sort::hermitian, Storage::hermitian_both, Kind::automatic, Kind::ldlt},
      {Sort::hermitian, Storage::general, Kind::automatic, Kind::ldlt},
      {Sort::hermitian, Storage::hermitian_upper, Kind::lu, Kind::lu},
      {Sort::hermitian, Storage::hermitian_both, Kind::lu, Kind::lu},
      {Sort::definite, Storage::hermitian_lower, Kind::automatic, Kind::llt},
      {Sort::definite, Storage::hermitian_upper, Kind::llt, Kind::llt},
      {Sort::definite, Storage::general, Kind::automatic, Kind::llt},
      {Sort::definite, Storage::hermitian_both, Kind::ldlt, Kind::ldlt},
      {Sort::general, Storage::general, Kind::automatic, Kind::lu},
  };
  return all;
}

class ComplexForms : public test::InForms {};

TEST_P(ComplexForms, AreSolvedAsDenseOnesAre) {
  for (const Case& c : cases())
    for (const Index n : {1, 2, 3, 17, 90, 260}) {
      if (n > 90 && options().device == "reference") continue;  // the textbook takes its time
      for (const unsigned seed : {1U, 2U}) {
        if (n == 1 && (c.sort != Sort::definite || c.storage == Storage::general)) continue;  // a zero, or real
        const Dense a = random_dense(n, c.sort, seed);
        const Eigen::JacobiSVD<Dense> svd(n > 20 ? Dense(Dense::Identity(1, 1)) : a);
        if (svd.singularValues().minCoeff() < 1e-6) continue;
        SCOPED_TRACE(testing::Message() << "n = " << n << ", seed " << seed << ", storage "
                                        << static_cast<int>(c.storage) << ", kind " << static_cast<int>(c.kind));
        Options options = this->options();
        options.kind = c.wish;
        options.threads = 2;
        ComplexSolver solver(options);
        const ComplexSparseMatrix s = sparse(a, c.storage);
        const AnalysisResult analysis = solver.analyze(s);
        ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
        EXPECT_TRUE(analysis.kind == c.kind || n <= 3);
        const ComplexFactorResult r = solver.factorize(s);
        ASSERT_TRUE(r.status.ok()) << r.status.message;
        EXPECT_EQ(r.rank, n);
        expect_solutions(solver, a);
        expect_determinant(r, a, !real() || (r.inertia.negative >= 0 && analysis.kind != Kind::lu));
        EXPECT_EQ(solver.values().size(), s.values.size());
        if (c.sort == Sort::general || c.sort == Sort::symmetric || c.kind == Kind::lu) {
          EXPECT_EQ(r.inertia.negative, -1);
          continue;
        }
        const Eigen::SelfAdjointEigenSolver<Dense> eigen(a, Eigen::EigenvaluesOnly);
        EXPECT_EQ(r.inertia.negative, (eigen.eigenvalues().array() < 0).count());
        EXPECT_EQ(r.inertia.positive, (eigen.eigenvalues().array() > 0).count());
        EXPECT_EQ(r.inertia.zero, 0);
      }
    }
}
INSTANTIATE_TEST_SUITE_P(All, ComplexForms, ::testing::ValuesIn(test::kForms), test::name_of_form);

TEST_P(ComplexForms, ReturnsTheValuesThatItWasGiven) {
  for (const Case& c : cases()) {
    const ComplexSparseMatrix s = sparse(random_dense(30, c.sort, 3), c.storage);
    Options options = this->options();
    options.kind = c.wish;
    ComplexSolver solver(options);
    ASSERT_TRUE(solver.analyze(s).status.ok());
    ASSERT_TRUE(solver.factorize(s).status.ok());
    EXPECT_EQ(solver.values(), s.values);
  }
}

TEST(ComplexSolver, AgreesWithTheRealSystemOfTwiceTheSize) {
  const Index n = 120;
  const Dense a = random_dense(n, Sort::general, 9);
  Eigen::MatrixXd twice(2 * n, 2 * n);
  twice << a.real(), -a.imag(), a.imag(), a.real();
  SparseMatrix s;
  s.rows = s.cols = 2 * n;
  s.col_ptr.push_back(0);
  for (Index j = 0; j < 2 * n; ++j) {
    for (Index i = 0; i < 2 * n; ++i)
      if (twice(i, j) != 0) {
        s.row_ind.push_back(i);
        s.values.push_back(twice(i, j));
      }
    s.col_ptr.push_back(static_cast<Offset>(s.row_ind.size()));
  }
  const Dense b = random_columns(n, 1, 4);
  Dense x(n, 1);
  ComplexSolver complex;
  const ComplexSparseMatrix c = sparse(a, Storage::general);
  ASSERT_TRUE(complex.analyze(c).status.ok());
  const ComplexFactorResult fc = complex.factorize(c);
  ASSERT_TRUE(fc.status.ok());
  ASSERT_TRUE(complex.solve({b.data(), 120}, {x.data(), 120}).status.ok());
  Solver real;
  ASSERT_TRUE(real.analyze(s).status.ok());
  const FactorResult fr = real.factorize(s);
  ASSERT_TRUE(fr.status.ok());
  Eigen::VectorXd rhs(2 * n), y(2 * n);
  rhs << b.real(), b.imag();
  ASSERT_TRUE(real.solve({rhs.data(), 240}, {y.data(), 240}).status.ok());
  const double condition = real.condition_estimate().estimate;
  EXPECT_LE((x.real() - y.head(n)).norm() + (x.imag() - y.tail(n)).norm(), 100 * kEps * condition * x.norm());
  EXPECT_NEAR(fr.determinant_log, 2 * fc.determinant_log, 1e-9 * std::abs(fr.determinant_log));
  // The 1-norm of the large matrix is between that of the complex one and twice that.
  EXPECT_GE(complex.condition_estimate().estimate, condition / 8);
  EXPECT_LE(complex.condition_estimate().estimate, condition * 8);
}

TEST_P(ComplexForms, EstimatesTheCondition) {
  for (const Sort sort : {Sort::general, Sort::symmetric, Sort::hermitian}) {
    const Dense a = random_dense(60, sort, 21);
    const Dense inverse = a.inverse();
    const double exact = a.cwiseAbs().colwise().sum().maxCoeff() * inverse.cwiseAbs().colwise().sum().maxCoeff();
    ComplexSolver solver = this->solver();
    const ComplexSparseMatrix s = sparse(a, Storage::general);
    ASSERT_TRUE(solver.analyze(s).status.ok());
    ASSERT_TRUE(solver.factorize(s).status.ok());
    const double estimate = solver.condition_estimate().estimate;
    EXPECT_LE(estimate, exact * (1 + 1e-9));
    EXPECT_GE(estimate, exact / 5);
  }
}

// Same bits for any number of threads and devices; budgets and precisions solve the same systems.
TEST(ComplexSolver, ThreadsDevicesAndBudgetsDoNotMatter) {
  for (const auto& [sort, storage] :
       {std::pair(Sort::symmetric, Storage::symmetric_lower), std::pair(Sort::hermitian, Storage::hermitian_lower),
        std::pair(Sort::definite, Storage::hermitian_upper), std::pair(Sort::general, Storage::general)}) {
    const Index n = 700;
    const Dense a = random_dense(n, sort, 31);
    const ComplexSparseMatrix s = sparse(a, storage);
    const Dense b = random_columns(n, 1, 2);
    const auto options_of = [](const std::string& device, int threads, Offset bytes, Precision precision) {
      Options options;
      options.device = device;
      options.threads = threads;
      options.device_memory_bytes = bytes;
      options.precision = precision;
      return options;
    };
    const auto solve = [&](const Options& options) {
      ComplexSolver solver(options);
      EXPECT_TRUE(solver.analyze(s).status.ok());
      const ComplexFactorResult r = solver.factorize(s);
      EXPECT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_EQ(options.device_memory_bytes > 0, !r.devices.empty() && r.devices.front().streamed_in_bytes > 0);
      Dense x(n, 1);
      const SolveResult solved = solver.solve({b.data(), 700}, {x.data(), 700});
      EXPECT_TRUE(solved.status.ok()) << solved.status.message;
      EXPECT_LE((b - a * x).norm(), (options.precision == Precision::fp32 ? 1e-5 : 1e-14) * a.norm() * x.norm())
          << options.device;
      return x;
    };
    // The least budget that does, which depends on the sort of the matrix.
    const auto least_budget = [&] {
      constexpr Offset kStep = Offset{1} << 18;
      for (Offset bytes = kStep; bytes < 64 * kStep; bytes += kStep) {
        ComplexSolver solver(options_of("host:1", 2, bytes, Precision::fp64));
        if (solver.analyze(s).status.ok() && solver.factorize(s).status.ok()) return bytes;
      }
      ADD_FAILURE() << "no budget is enough";
      return Offset{0};
    };
    const Dense one = solve(options_of("cpu", 1, 0, Precision::fp64));
    EXPECT_EQ(solve(options_of("cpu", 3, 0, Precision::fp64)), one);
    EXPECT_EQ(solve(options_of("host:2", 2, 0, Precision::fp64)), one);
    (void)solve(options_of("host:1", 2, least_budget(), Precision::fp64));
    (void)solve(options_of("cpu", 2, 0, Precision::mixed));
    (void)solve(options_of("cpu", 2, 0, Precision::fp32));
  }
}

TEST_P(ComplexForms, SingularMatricesAreReported) {
  for (const auto& [sort, storage] :
       {std::pair(Sort::symmetric, Storage::symmetric_lower), std::pair(Sort::hermitian, Storage::hermitian_lower),
        std::pair(Sort::general, Storage::general)})
    for (const Index zeros : {1, 3}) {
      const Index n = 80;
      Dense a = random_dense(n, sort, 41);
      // Unknowns k and n - 1 - k are combined with the same complex factor in rows and columns.
      const Value factor(0.5, -2);
      for (Index k = 0; k < zeros; ++k) {
        const Index from = 2 * k + 1, to = n - 1 - k;
        const Dense keep = [&] {
          Dense d = Dense::Identity(n, n);
          d(to, to) = 0;
          return d;
        }();
        const Dense reduced = keep * a * keep;  // row and column `to` gone ...
        const Dense f = keep + factor * Dense::Identity(n, n).col(from) * Dense::Identity(n, n).row(to);
        a = (sort == Sort::hermitian ? Dense(f.adjoint()) : Dense(f.transpose())) * reduced *
            f;  // ... dependent ones come
      }
      Options options = this->options();
      ComplexSolver strict(options);
      const ComplexSparseMatrix s = sparse(a, storage);
      ASSERT_TRUE(strict.analyze(s).status.ok());
      const ComplexFactorResult refused = strict.factorize(s);
      EXPECT_EQ(refused.status.code, StatusCode::singular) << refused.status.message;
      EXPECT_EQ(refused.rank, n - zeros);
      options.singular = SingularMatrix::report;
      ComplexSolver solver(options);
      ASSERT_TRUE(solver.analyze(s).status.ok());
      const ComplexFactorResult r = solver.factorize(s);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_EQ(r.rank, n - zeros);
      EXPECT_EQ(r.determinant_phase, Value(0));
      EXPECT_EQ(r.dependent_rows.size(), static_cast<std::size_t>(zeros));
      expect_null_space(r, a, sort, zeros);
      if (sort == Sort::hermitian) {
        const Eigen::SelfAdjointEigenSolver<Dense> eigen(a, Eigen::EigenvaluesOnly);
        EXPECT_EQ(r.inertia.negative, (eigen.eigenvalues().array() < -1e-12 * a.norm()).count());
        EXPECT_EQ(r.inertia.zero, zeros);
      }
    }
}

TEST_P(ComplexForms, ZeroRowsAndStructuralSingularityAreNamed) {
  Dense a = random_dense(20, Sort::general, 3);
  a.row(7).setZero();
  ComplexSparseMatrix s = sparse(a, Storage::general);  // with zeros on the diagonal
  ComplexSolver solver = this->solver();
  ASSERT_TRUE(solver.analyze(s).status.ok());
  const ComplexFactorResult r = solver.factorize(s);
  EXPECT_EQ(r.status.code, StatusCode::singular);
  EXPECT_EQ(r.status.row, 7);
  std::vector<Index> rows;
  std::vector<Value> values;
  std::vector<Offset> ptr(1, 0);
  for (Index j = 0; j < 20; ++j) {
    for (auto q = static_cast<std::size_t>(s.col_ptr[j]); q < static_cast<std::size_t>(s.col_ptr[j + 1]); ++q)
      if (s.row_ind[q] != 7) {
        rows.push_back(s.row_ind[q]);
        values.push_back(s.values[q] == Value(0) ? Value(1) : s.values[q]);
      }
    ptr.push_back(static_cast<Offset>(rows.size()));
  }
  const AnalysisResult structural = solver.analyze(ComplexMatrixView{20, 20, ptr, rows, values, Storage::general});
  EXPECT_EQ(structural.status.code, StatusCode::singular);
  EXPECT_NE(structural.status.message.find("row 7"), std::string::npos) << structural.status.message;
}

TEST_P(ComplexForms, ValuesThatCannotBeAreRefusedWithTheirRow) {
  for (const Value bad :
       {Value(std::numeric_limits<double>::quiet_NaN(), 0), Value(0, std::numeric_limits<double>::infinity())}) {
    ComplexSparseMatrix s = sparse(random_dense(20, Sort::symmetric, 3), Storage::symmetric_lower);
    ComplexSolver solver = this->solver();
    ASSERT_TRUE(solver.analyze(s).status.ok());
    s.values[5] = bad;
    const ComplexFactorResult r = solver.refactorize(s.values);
    EXPECT_EQ(r.status.code, StatusCode::invalid_input);
    EXPECT_EQ(r.status.row, s.row_ind[5]);
    EXPECT_EQ(solver.factorize(s).status.code, StatusCode::invalid_input);
    EXPECT_EQ(solver.analyze(s).status.code, StatusCode::invalid_input);
  }
}

TEST_P(ComplexForms, AHermitianDiagonalIsReal) {
  ComplexSparseMatrix s = sparse(random_dense(20, Sort::definite, 3), Storage::hermitian_lower);
  ComplexSolver solver = this->solver();
  ASSERT_TRUE(solver.analyze(s).status.ok());
  const auto at = static_cast<std::size_t>(s.col_ptr[4]);
  ASSERT_EQ(s.row_ind[at], 4);
  s.values[at] += Value(0, 1e-9);
  for (const Status& status :
       {solver.refactorize(s.values).status, solver.factorize(s).status, solver.analyze(s).status}) {
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    EXPECT_EQ(status.row, 4);
    EXPECT_NE(status.message.find("Hermitian"), std::string::npos);
  }
}

TEST_P(ComplexForms, KindsThatTheMatrixCannotHaveAreRefused) {
  Options options = this->options();
  options.kind = Kind::llt;
  ComplexSolver llt(options);
  EXPECT_EQ(llt.analyze(sparse(random_dense(9, Sort::symmetric, 1), Storage::symmetric_lower)).status.code,
            StatusCode::invalid_input);
  options.kind = Kind::ldlt;
  ComplexSolver ldlt(options);
  EXPECT_EQ(ldlt.analyze(sparse(random_dense(9, Sort::general, 1), Storage::general)).status.code,
            StatusCode::invalid_input);
}

// A symmetric matrix whose imaginary parts vanish at first (a sweep that begins at w = 0) stays symmetric.
TEST_P(ComplexForms, RealValuesGiveRealAnswers) {
  const Index n = 50;
  const Dense complex = random_dense(n, Sort::symmetric, 8);
  const Dense a = complex.real().cast<Value>();
  const ComplexSparseMatrix s = sparse(a, Storage::general);
  ComplexSolver solver = this->solver();
  ASSERT_TRUE(solver.analyze(s).status.ok());
  ASSERT_TRUE(solver.factorize(s).status.ok());
  const Dense b = random_columns(n, 1, 3).real().cast<Value>();
  Dense x(n, 1);
  ASSERT_TRUE(solver.solve({b.data(), 50}, {x.data(), 50}).status.ok());
  EXPECT_EQ(x.imag().norm(), 0);
  SparseMatrix r{n, n, s.col_ptr, s.row_ind, {}, Storage::general};
  for (const Value v : s.values) r.values.push_back(v.real());
  Solver real;
  ASSERT_TRUE(real.analyze(r).status.ok());
  ASSERT_TRUE(real.factorize(r).status.ok());
  const Eigen::VectorXd rhs = b.real();
  Eigen::VectorXd y(n);
  ASSERT_TRUE(real.solve({rhs.data(), 50}, {y.data(), 50}).status.ok());
  EXPECT_LE((x.real() - y).norm(), 1e-14 * real.condition_estimate().estimate * y.norm());
  ComplexSparseMatrix other = s;
  for (std::size_t q = 0; q < other.values.size(); ++q) other.values[q] *= Value(1, 0.25);
  EXPECT_TRUE(solver.refactorize(other.values).status.ok());
}

TEST_P(ComplexForms, AHermitianMatrixThatIsNotPositiveTurnsToLdlt) {
  Dense a = random_dense(60, Sort::definite, 5);
  a(30, 31) = a(31, 30) = 500;
  a(30, 31) *= Value(0, 1);
  a(31, 30) = std::conj(a(30, 31));
  const ComplexSparseMatrix s = sparse(a, Storage::hermitian_lower);
  ComplexSolver solver = this->solver();
  ASSERT_EQ(solver.analyze(s).kind, Kind::llt);
  const ComplexFactorResult r = solver.factorize(s);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_EQ(solver.analysis().kind, Kind::ldlt);
  EXPECT_EQ(r.inertia.negative, 1);
  expect_solutions(solver, a);
}

TEST_P(ComplexForms, DuplicatesAreSummed) {
  const Dense a = random_dense(40, Sort::hermitian, 6);
  ComplexSparseMatrix s = sparse(a, Storage::hermitian_lower), twice;
  twice.rows = twice.cols = 40;
  twice.storage = s.storage;
  twice.col_ptr.push_back(0);
  for (Index j = 0; j < 40; ++j) {
    for (const double part : {0.25, 0.75})
      for (auto q = static_cast<std::size_t>(s.col_ptr[j]); q < static_cast<std::size_t>(s.col_ptr[j + 1]); ++q) {
        twice.row_ind.push_back(s.row_ind[q]);
        twice.values.push_back(part * s.values[q]);
      }
    twice.col_ptr.push_back(static_cast<Offset>(twice.row_ind.size()));
  }
  for (const Kind kind : {Kind::automatic, Kind::lu}) {
    Options options = this->options();
    options.kind = kind;
    ComplexSolver solver(options);
    ASSERT_TRUE(solver.analyze(twice).status.ok());
    ASSERT_TRUE(solver.factorize(twice).status.ok());
    expect_solutions(solver, a);
  }
}

// GPUs fill real forms by places in columns: the diagonal of a triangle must stand at its end, wherever the caller has
// it.
TEST_P(ComplexForms, RowsStandInAnyOrder) {
  std::mt19937 random(8);
  for (const auto& [sort, storage] : {std::pair{Sort::hermitian, Storage::hermitian_lower},
                                      {Sort::hermitian, Storage::hermitian_upper},
                                      {Sort::definite, Storage::hermitian_upper},
                                      {Sort::symmetric, Storage::symmetric_lower},
                                      {Sort::symmetric, Storage::symmetric_upper},
                                      {Sort::symmetric, Storage::symmetric_both},
                                      {Sort::general, Storage::general}}) {
    SCOPED_TRACE(static_cast<int>(storage));
    const Dense a = random_dense(60, sort, 16);
    const ComplexSparseMatrix sorted = sparse(a, storage);
    ComplexSparseMatrix s = sorted;
    for (Index j = 0; j < 60; ++j) {
      const auto first = static_cast<std::size_t>(s.col_ptr[j]), end = static_cast<std::size_t>(s.col_ptr[j + 1]);
      std::vector<std::size_t> order(end - first);
      std::iota(order.begin(), order.end(), first);
      std::shuffle(order.begin(), order.end(), random);
      for (std::size_t k = 0; k < order.size(); ++k) {
        s.row_ind[first + k] = sorted.row_ind[order[k]];
        s.values[first + k] = sorted.values[order[k]];
      }
    }
    Options options = this->options();
    options.refinement_steps = 0;
    ComplexSolver solver(options);
    ASSERT_TRUE(solver.analyze(s).status.ok());
    ASSERT_TRUE(solver.factorize(s).status.ok());
    expect_solutions(solver, a, 1e-11);
    ASSERT_TRUE(solver.refactorize(s.values).status.ok());
    expect_solutions(solver, a, 1e-11);
    EXPECT_EQ(solver.values(), s.values);
    const ComplexSparseMatrix f = factorized_matrix(solver);
    for (Index j = 0; j < 60 && storage != Storage::general && storage != Storage::symmetric_both; ++j)
      EXPECT_TRUE(std::is_sorted(f.row_ind.begin() + f.col_ptr[j], f.row_ind.begin() + f.col_ptr[j + 1])) << j;
  }
}

TEST_P(ComplexForms, ClonesAndSavedAnalysesSolve) {
  const Dense a = random_dense(90, Sort::hermitian, 12);
  const ComplexSparseMatrix s = sparse(a, Storage::hermitian_lower);
  ComplexSolver solver = this->solver();
  ASSERT_TRUE(solver.analyze(s).status.ok());
  ComplexSolver clone = solver.clone(1);
  ASSERT_TRUE(clone.refactorize(s.values).status.ok());
  expect_solutions(clone, a);
  const std::string path = ::testing::TempDir() + "complex_analysis.bin";
  ASSERT_TRUE(solver.save_analysis(path).ok());
  ComplexSolver other = this->solver();
  ASSERT_TRUE(other.load_analysis(path, s).status.ok());
  ASSERT_TRUE(other.factorize(s).status.ok());
  expect_solutions(other, a);
}

TEST(ComplexSolver, WrongUseThrows) {
  ComplexSolver solver;
  const std::vector<Value> v(3);
  std::vector<Value> x(3);
  EXPECT_THROW((void)solver.refactorize(v), std::logic_error);
  EXPECT_THROW((void)solver.solve(v, x), std::logic_error);
  const ComplexSparseMatrix s = sparse(random_dense(9, Sort::definite, 1), Storage::hermitian_lower);
  ASSERT_TRUE(solver.analyze(s).status.ok());
  EXPECT_THROW((void)solver.refactorize(v), std::invalid_argument);
  ASSERT_TRUE(solver.factorize(s).status.ok());
  EXPECT_THROW((void)solver.solve(v, x), std::invalid_argument);
  ComplexSparseMatrix wide = s;
  wide.cols = 8;
  wide.col_ptr.resize(9);
  EXPECT_EQ(solver.analyze(wide).status.code, StatusCode::invalid_input);
}

}  // namespace complex_test
}  // namespace espalier
