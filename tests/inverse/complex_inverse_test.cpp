// Truth: dense complex inverses by Eigen, in every form in which complex systems are factorized.
#include "espalier/inverse.hpp"
#include "solver/complex_common.hpp"

namespace espalier::test {

namespace {

struct InForm {
  explicit InForm(bool real) {
    if (real) form.emplace();
  }
  std::optional<AsRealForm> form;
};

}  // namespace

TEST(ComplexInverse, RandomSystemsAgreeWithDenseInverses) {
  int compared = 0;
  for (int run = 0; run < 160; ++run) {
    const Sort sort = static_cast<Sort>(run % 4);
    const bool real = run / 4 % 2 == 1;
    const Index n = run < 8 ? 1 : 2 + run * 7 % 60;
    if (n == 1 && sort != Sort::definite) continue;
    Dense a = random_dense(n, sort, static_cast<unsigned>(run));
    const Storage storages[] = {Storage::symmetric_lower, Storage::symmetric_upper, Storage::hermitian_lower,
                                Storage::hermitian_upper};
    const Storage storage = sort == Sort::general     ? Storage::general
                            : sort == Sort::symmetric ? storages[run / 8 % 2]
                                                      : storages[2 + run / 8 % 2];
    const Dense inverse = a.inverse();
    const double condition = a.cwiseAbs().colwise().sum().maxCoeff() * inverse.cwiseAbs().colwise().sum().maxCoeff();
    if (!(condition < 1e8)) continue;
    SCOPED_TRACE("run " + std::to_string(run) + ", n " + std::to_string(n));
    const InForm form(real);
    Options o;
    o.threads = 1 + run % 3;
    o.max_block_size = run % 5 == 0 ? 8 : 0;
    if (run % 7 == 0) o.kind = Kind::lu;
    ComplexSolver s(o);
    const ComplexSparseMatrix m = sparse(a, storage);
    ASSERT_TRUE(s.analyze(m).status.ok());
    ASSERT_TRUE(s.factorize(m).status.ok());
    const double limit = 200 * condition * kEps * inverse.cwiseAbs().maxCoeff();
    for (const Transpose t : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
      const Dense truth = op(inverse, t);
      std::vector<Value> x(m.values.size());
      const InverseResult r = selected_inverse(s, m, x, t);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      for (Index j = 0; j < n; ++j)
        for (auto q = static_cast<std::size_t>(m.col_ptr[static_cast<std::size_t>(j)]);
             q < static_cast<std::size_t>(m.col_ptr[static_cast<std::size_t>(j) + 1]); ++q)
          EXPECT_LE(std::abs(x[q] - truth(m.row_ind[q], j)), limit) << static_cast<int>(t);
      if (t != Transpose::no) {
        EXPECT_EQ(r.solved, 0);
      }
    }
    std::vector<Value> diagonal(static_cast<std::size_t>(n));
    ASSERT_TRUE(inverse_diagonal(s, diagonal).status.ok());
    for (Index i = 0; i < n; ++i) EXPECT_LE(std::abs(diagonal[static_cast<std::size_t>(i)] - inverse(i, i)), limit);
    const ComplexTraceResult trace = trace_of_inverse(s, m);
    ASSERT_TRUE(trace.status.ok()) << trace.status.message;
    EXPECT_LE(std::abs(trace.trace - Value(n)), 100 * condition * kEps * n);
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

TEST(ComplexInverse, SinglePrecision) {
  for (const bool real : {false, true}) {
    const InForm form(real);
    const Dense a = random_dense(40, Sort::definite, 3), inverse = a.inverse();
    const ComplexSparseMatrix m = sparse(a, Storage::hermitian_lower);
    Options o;
    o.precision = Precision::fp32;
    ComplexSolver s(o);
    ASSERT_TRUE(s.analyze(m).status.ok());
    ASSERT_TRUE(s.factorize(m).status.ok());
    std::vector<Value> x(40);
    const InverseResult r = inverse_diagonal(s, x);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    EXPECT_GT(r.error, 1e-9);
    EXPECT_LE(r.error, 1e-5);
    for (Index i = 0; i < 40; ++i)
      EXPECT_LE(std::abs(x[static_cast<std::size_t>(i)] - inverse(i, i)), 1e-5 * std::abs(inverse(i, i)));
  }
}

}  // namespace espalier::test
