// Complex systems as real ones of twice the size. Truth: the dense block matrix, and the same solver with kernels for
// complex numbers, over random structures, singular and badly scaled systems, precisions, devices, budgets and files.
#include "solver/analysis/real_form.hpp"

#include "analysis/ordering.hpp"
#include "analysis/verify.hpp"
#include "solve/residual.hpp"
#include "solver/complex_common.hpp"
#include "solver/fake_backend.hpp"
#include "solver/session/session.hpp"

namespace espalier::solver {
namespace real_form_test {

using test::AsRealForm;
using test::Dense;
using test::random_columns;
using test::random_dense;
using test::Sort;
using test::sparse;
using test::Value;

const std::vector<std::pair<Sort, Storage>>& sorts() {
  static const std::vector<std::pair<Sort, Storage>> all = {
      {Sort::symmetric, Storage::symmetric_lower}, {Sort::symmetric, Storage::symmetric_upper},
      {Sort::symmetric, Storage::symmetric_both},  {Sort::hermitian, Storage::hermitian_lower},
      {Sort::hermitian, Storage::hermitian_upper}, {Sort::hermitian, Storage::hermitian_both},
      {Sort::definite, Storage::hermitian_lower},  {Sort::general, Storage::general}};
  return all;
}

// The block matrix of the stored entries.
Eigen::MatrixXd blocks_of(const ComplexSparseMatrix& s, bool hermitian) {
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(2 * s.rows, 2 * s.rows);
  const bool lower = s.storage == Storage::symmetric_lower || s.storage == Storage::hermitian_lower;
  const bool upper = s.storage == Storage::symmetric_upper || s.storage == Storage::hermitian_upper;
  for (Index c = 0; c < s.cols; ++c)
    for (auto q = static_cast<std::size_t>(s.col_ptr[c]); q < static_cast<std::size_t>(s.col_ptr[c + 1]); ++q) {
      const Value v = s.values[q];
      Eigen::Matrix2d block;
      block << v.real(), -v.imag(), v.imag(), v.real();
      if (!hermitian) block.row(1) *= -1;
      if (s.row_ind[q] == c && lower) block(0, 1) = 0;
      if (s.row_ind[q] == c && upper) block(1, 0) = 0;
      m.block<2, 2>(2 * s.row_ind[q], 2 * c) = block;
    }
  return m;
}

TEST(RealForm, HasTheBlocksOfTheEntriesAndAValidTree) {
  base::ThreadPool pool(2);
  for (const auto& [sort, storage] : sorts())
    for (const Index n : {1, 2, 40}) {
      SCOPED_TRACE(testing::Message() << static_cast<int>(storage) << ", n = " << n);
      const ComplexSparseMatrix s = sparse(random_dense(n, sort, 3), storage);
      const Kind kind = sort == Sort::general ? Kind::lu : Kind::ldlt;
      const PreparedMatrix p = prepare_matrix(given(s), kind, pool);
      const auto rows = solve::ResidualOperator::rows_of(p.a, pool);
      analysis::AssemblyTree tree =
          analysis::build_tree(analysis::graph_of(p.a, pool, p.row_of_col, rows.get()), {}, pool);
      const analysis::AssemblyTree two = doubled(tree);
      const auto form = make_real_form(p, std::move(tree), pool);
      EXPECT_EQ(analysis::verify_tree(analysis::graph_of(form->a, pool, form->row_of_col, &form->rows), two), "");
      const MatrixView a = form->a;
      std::vector<double> values(static_cast<std::size_t>(a.nonzeros()));
      real_values(*form, p.a, s.values.data(), values.data(), pool);
      Eigen::MatrixXd found = Eigen::MatrixXd::Zero(2 * n, 2 * n);
      for (Index c = 0; c < a.cols; ++c)
        for (auto q = static_cast<std::size_t>(a.col_ptr[c]); q < static_cast<std::size_t>(a.col_ptr[c + 1]); ++q)
          found(a.row_ind[q], c) += values[q];
      EXPECT_EQ(found, blocks_of(s, storage >= Storage::hermitian_lower));
    }
}

// What a caller sees of one system.
struct Answer {
  ComplexFactorResult factor;
  SolveResult solve;
  double condition = 0;
  Dense x;
};

Answer answer_of(ComplexSolver& solver, const ComplexSparseMatrix& s, const Dense& b,
                 Transpose transpose = Transpose::no) {
  Answer r;
  r.factor = solver.refactorize(s.values);
  if (!r.factor.status.ok()) return r;
  r.x = Dense(b.rows(), b.cols());
  const auto size = static_cast<std::size_t>(b.size());
  r.solve = solver.solve({b.data(), size}, {r.x.data(), size}, static_cast<Index>(b.cols()), transpose);
  r.condition = solver.condition_estimate().estimate;
  return r;
}

ComplexSolver analyzed(const ComplexSparseMatrix& s, const Options& options, bool real) {
  std::optional<AsRealForm> form;
  if (real) form.emplace();
  ComplexSolver solver(options);
  const AnalysisResult r = solver.analyze(s);
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  return solver;
}

// D A D, or D A of a general matrix, with scales of 40 decades.
Dense badly_scaled(const Dense& a, Sort sort, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> decades(-20, 20);
  const Eigen::VectorXd d = Eigen::VectorXd::NullaryExpr(a.rows(), [&] { return std::pow(10.0, decades(random)); });
  return sort == Sort::general ? Dense(d.asDiagonal() * a) : Dense(d.asDiagonal() * a * d.asDiagonal());
}

TEST(RealForm, AnswersAsKernelsForComplexNumbersDo) {
  for (const auto& [sort, storage] : sorts())
    for (const unsigned seed : {1U, 2U, 3U})
      for (const bool scaled : {false, true}) {
        SCOPED_TRACE(testing::Message() << static_cast<int>(storage) << ", seed " << seed << ", scaled " << scaled);
        const Index n = 20 + 45 * static_cast<Index>(seed);
        const Dense plain = random_dense(n, sort, seed);
        const Dense a = scaled ? badly_scaled(plain, sort, seed) : plain, b = random_columns(n, 2, seed);
        const ComplexSparseMatrix s = sparse(a, storage);
        Options options;
        options.threads = 2;
        options.rescale = seed == 3 ? Rescale::on : Rescale::off;
        ComplexSolver native = analyzed(s, options, false), real = analyzed(s, options, true);
        const double analyses = real.analysis().seconds;
        for (const double turn : {1.0, 0.5}) {  // the second factorization makes no analysis
          ComplexSparseMatrix now = s;
          for (std::size_t q = 0; q < now.values.size(); ++q)
            now.values[q] *= q % 3 == 0 && storage < Storage::hermitian_lower ? Value(turn, turn - 1) : turn;
          if (sort == Sort::general || storage != Storage::symmetric_both || turn == 1) {
            const Answer truth = answer_of(native, now, b), found = answer_of(real, now, b);
            ASSERT_TRUE(found.factor.status.ok()) << found.factor.status.message;
            EXPECT_EQ(found.factor.rank, truth.factor.rank);
            EXPECT_EQ(found.factor.inertia.negative, truth.factor.inertia.negative);
            EXPECT_EQ(found.factor.inertia.positive, truth.factor.inertia.positive);
            EXPECT_NEAR(found.factor.determinant_log, truth.factor.determinant_log,
                        1e-9 * std::max(1.0, std::abs(truth.factor.determinant_log)));
            EXPECT_LE(found.solve.backward_error, 1e-15);
            EXPECT_NEAR(found.condition / truth.condition, 1, scaled ? 1e-2 : 1e-6);
            if (!scaled) {
              EXPECT_LE((found.x - truth.x).norm(), 1e-15 * truth.condition * truth.x.norm());
            }
          }
        }
        EXPECT_EQ(real.analysis().seconds, analyses);
        EXPECT_EQ(real.analysis().kind, native.analysis().kind);
        EXPECT_EQ(real.analysis().device, native.analysis().device + "; as a real system of twice the size");
        // Twice the work of kernels for complex numbers.
        if (real.analysis().kind == Kind::lu) {
          EXPECT_NEAR(real.analysis().flops / native.analysis().flops, 2, 0.2);
        }
      }
}

TEST(RealForm, PrecisionsReachWhatTheyPromise) {
  for (const auto& [sort, storage] : sorts())
    for (const Precision precision : {Precision::fp32, Precision::mixed, Precision::automatic}) {
      const Index n = 150;
      const Dense a = random_dense(n, sort, 4), b = random_columns(n, 3, 1);
      const ComplexSparseMatrix s = sparse(a, storage);
      Options options;
      options.precision = precision;
      options.required_backward_error = precision == Precision::fp32 ? 1e-4 : 1e-10;
      ComplexSolver solver = analyzed(s, options, true);
      const Answer r = answer_of(solver, s, b);
      ASSERT_TRUE(r.factor.status.ok()) << r.factor.status.message;
      EXPECT_TRUE(r.solve.status.ok()) << static_cast<int>(storage) << ": " << r.solve.status.message;
      EXPECT_LE((b - a * r.x).norm(), (precision == Precision::fp32 ? 1e-4 : 1e-13) * a.norm() * r.x.norm());
    }
}

TEST(RealForm, SeveralDevicesAndStreaming) {
  for (const auto& [sort, storage] : sorts()) {
    if (storage == Storage::symmetric_upper || storage == Storage::hermitian_both) continue;
    const Index n = 500;
    const Dense a = random_dense(n, sort, 31), b = random_columns(n, 1, 2);
    const ComplexSparseMatrix s = sparse(a, storage);
    for (const auto& [device, bytes] :
         {std::pair<const char*, Offset>("host:2", 0), {"host:1", 4 << 20}, {"host:2", 4 << 20}}) {
      SCOPED_TRACE(testing::Message() << static_cast<int>(storage) << " " << device << " " << bytes);
      Options options;
      options.device = device;
      options.device_memory_bytes = bytes;
      options.threads = 2;
      ComplexSolver solver = analyzed(s, options, true);
      for (const Transpose transpose : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
        const Answer r = answer_of(solver, s, b, transpose);
        ASSERT_TRUE(r.factor.status.ok()) << r.factor.status.message;
        EXPECT_EQ(r.factor.devices.size(), device[5] == '2' ? 2U : 1U);
        if (sort == Sort::general && bytes > 0) {
          EXPECT_GT(r.factor.devices.front().streamed_in_bytes, 0);
        }
        EXPECT_LE((b - test::op(a, transpose) * r.x).norm(), 1e-14 * a.norm() * r.x.norm());
      }
    }
  }
}

// Rank, inertia and null vectors of singular matrices of all sorts, of which pivots vanish in any number.
TEST(RealForm, JudgesSingularMatricesAsTheComplexOne) {
  for (const auto& [sort, storage] : sorts()) {
    if (sort == Sort::definite) continue;
    for (unsigned seed = 1; seed <= 6; ++seed) {
      SCOPED_TRACE(testing::Message() << static_cast<int>(storage) << ", seed " << seed);
      const Index n = 40, zeros = 1 + static_cast<Index>(seed % 3);
      Dense a = random_dense(n, sort, seed);
      Dense f = Dense::Identity(n, n);  // the last unknowns are combinations of others, in rows and columns
      for (Index k = n - zeros; k < n; ++k) {
        f(k, k) = 0;
        f(k - zeros, k) = Value(0.5, -2.0 - k);
        f(0, k) = Value(0, 1);
      }
      a = (sort == Sort::hermitian ? Dense(f.adjoint()) : Dense(f.transpose())) * a * f;
      const ComplexSparseMatrix s = sparse(a, storage);
      Options options;
      ComplexSolver strict = analyzed(s, options, true);
      const ComplexFactorResult refused = strict.factorize(s);
      EXPECT_EQ(refused.status.code, StatusCode::singular);
      EXPECT_EQ(refused.rank, n - zeros);
      EXPECT_EQ(refused.determinant_phase, Value(0));
      options.singular = SingularMatrix::report;
      ComplexSolver solver = analyzed(s, options, true), native = analyzed(s, options, false);
      const ComplexFactorResult r = solver.factorize(s), truth = native.factorize(s);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_EQ(r.rank, n - zeros);
      EXPECT_EQ(r.inertia.negative, truth.inertia.negative);
      EXPECT_EQ(r.inertia.positive, truth.inertia.positive);
      EXPECT_EQ(r.dependent_rows.size(), static_cast<std::size_t>(zeros));
      expect_null_space(r, a, sort, zeros);
      // A consistent system is solved.
      const Dense b = a * random_columns(n, 1, 7);
      const Answer solved = answer_of(solver, s, b);
      EXPECT_LE((b - a * solved.x).norm(), 1e-9 * (a.norm() * solved.x.norm() + b.norm()));
    }
  }
}

TEST(RealForm, FilesAndClonesAreThoseOfTheComplexSystem) {
  const std::string path = ::testing::TempDir() + "real_form_analysis.bin";
  for (const auto& [sort, storage] : sorts())
    for (const bool saved_as_real : {false, true}) {
      const Index n = 90;
      const Dense a = random_dense(n, sort, 12), b = random_columns(n, 1, 3);
      const ComplexSparseMatrix s = sparse(a, storage);
      ComplexSolver first = analyzed(s, {}, saved_as_real);
      ASSERT_TRUE(first.factorize(s).status.ok());
      ASSERT_TRUE(first.save_analysis(path).ok());
      std::optional<AsRealForm> form;
      if (!saved_as_real) form.emplace();
      ComplexSolver other;
      const AnalysisResult loaded = other.load_analysis(path, s);
      ASSERT_TRUE(loaded.status.ok()) << loaded.status.message;
      ComplexSolver clone = other.clone(1);
      for (ComplexSolver* solver : {&other, &clone}) {
        const Answer r = answer_of(*solver, s, b);
        ASSERT_TRUE(r.factor.status.ok()) << r.factor.status.message;
        EXPECT_LE((b - a * r.x).norm(), 1e-14 * a.norm() * r.x.norm());
      }
    }
}

// Devices without complex numbers: named ones take the real form, and so do those that are predicted to be faster.
TEST(RealForm, IsTakenWhereADeviceHasNoComplexNumbers) {
  test::FakeBackend fake;
  device::Registry registry;
  registry.backends = {&device::registry().host(), &fake};
  const Dense a = random_dense(60, Sort::hermitian, 2);
  const ComplexSparseMatrix s = sparse(a, Storage::hermitian_lower);
  const std::span<const double> values(reinterpret_cast<const double*>(s.values.data()), 2 * s.values.size());
  for (const bool works : {true, false})
    for (const char* device : {"auto", "fake:0", "cpu"}) {
      fake.works = works;
      fake.asked = 0;
      Options options;
      options.device = device;
      Session session(options, registry);
      session.analyze(given(s));
      const bool on_fake = std::string(device) != "cpu";
      EXPECT_EQ(session.current().system->real_form != nullptr, on_fake);
      EXPECT_EQ(session.current().device.backend == &fake, on_fake);
      EXPECT_EQ(session.current().n(), 60);
      if (!works && std::string(device) == "fake:0") {
        EXPECT_THROW(session.factor->factorize(values), Error);
        continue;
      }
      session.factor->factorize(values);
      EXPECT_TRUE(session.factor->result().status.ok());
      EXPECT_EQ(fake.asked > 0, on_fake);
      const Eigen::SelfAdjointEigenSolver<Dense> eigen(a, Eigen::EigenvaluesOnly);
      EXPECT_EQ(session.factor->result().inertia.negative, (eigen.eigenvalues().array() < 0).count());
    }
}

TEST(RealForm, AWishThatIsNotUnderstoodIsRefused) {
  const ComplexSparseMatrix s = sparse(random_dense(9, Sort::definite, 1), Storage::hermitian_lower);
  ::setenv("ESPALIER_COMPLEX_FORM", "imaginary", 1);
  ComplexSolver solver;
  const AnalysisResult r = solver.analyze(s);
  ::unsetenv("ESPALIER_COMPLEX_FORM");
  EXPECT_EQ(r.status.code, StatusCode::invalid_input);
  EXPECT_NE(r.status.message.find("ESPALIER_COMPLEX_FORM: 'imaginary'"), std::string::npos) << r.status.message;
}

// GPUs: in core, streamed, several of them.
class ComplexOnGpu : public test::OnGpu {};

struct GpuRun {
  Status status;
  Offset peak_bytes = 0, streamed_bytes = 0;
};

// All transposes; a failure other than for want of memory is one of the test.
GpuRun run_on_gpu(const Dense& a, Storage storage, const std::string& device, Offset bytes, Precision precision) {
  const auto n = static_cast<Index>(a.rows());
  const Dense b = random_columns(n, 4, 2);
  const ComplexSparseMatrix s = sparse(a, storage);
  Options options;
  options.device = device;
  options.device_memory_bytes = bytes;
  options.precision = precision;
  ComplexSolver solver(options);
  EXPECT_TRUE(solver.analyze(s).status.ok());
  EXPECT_NE(solver.analysis().device.find("GPU"), std::string::npos) << solver.analysis().device;
  GpuRun run;
  for (const Transpose transpose : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
    const Answer r = answer_of(solver, s, b, transpose);
    run.status = r.factor.status;
    if (bytes > 0 && run.status.code == StatusCode::out_of_memory) return run;
    EXPECT_TRUE(run.status.ok()) << run.status.message;
    if (!run.status.ok()) return run;
    EXPECT_EQ(r.factor.rank, n);
    EXPECT_LE((b - test::op(a, transpose) * r.x).norm(), 1e-13 * a.norm() * r.x.norm());
    for (const DeviceReport& d : r.factor.devices) {
      run.peak_bytes = std::max(run.peak_bytes, d.peak_bytes);
      run.streamed_bytes += d.streamed_in_bytes;
    }
  }
  return run;
}

TEST_F(ComplexOnGpu, GpusInCoreAndStreamed) {
  const std::size_t gpus = device::registry().find("gpu")->find().names.size();
  for (const auto& [sort, storage] : sorts())
    for (const std::string device : {"gpu:0", "gpu:0,1"})
      for (const Precision precision : {Precision::fp64, Precision::mixed}) {
        if (device == "gpu:0,1" && gpus < 2) continue;
        SCOPED_TRACE(testing::Message() << static_cast<int>(storage) << " " << device << " "
                                        << static_cast<int>(precision));
        const Dense a = random_dense(1200, sort, 31);
        const GpuRun in_core = run_on_gpu(a, storage, device, 0, precision);
        ASSERT_GT(in_core.peak_bytes, 0);
        GpuRun streamed;
        for (const Offset eighths : {4, 6, 7}) {  // the least budget depends on the largest front
          streamed = run_on_gpu(a, storage, device, in_core.peak_bytes / 8 * eighths, precision);
          if (streamed.status.ok()) break;
        }
        EXPECT_TRUE(streamed.status.ok()) << streamed.status.message;
        EXPECT_GT(streamed.streamed_bytes, 0);
      }
}

}  // namespace real_form_test
}  // namespace espalier::solver
