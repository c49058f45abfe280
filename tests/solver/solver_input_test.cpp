// The solver through its public interface: matrices of all sorts, and what is refused. The truth is the dense matrix
// (residual in long double) or known exactly.
#include "solver/solver_common.hpp"

namespace espalier {
namespace solver_input_test {

using reference::Triple;
using reference::Values;
using namespace test;

TEST(SolverInput, EveryStorageWithAndWithoutDuplicatesGivesTheSameAnswer) {
  for (const Values values : {Values::positive, Values::indefinite})
    for (const Storage storage :
         {Storage::general, Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both})
      for (const bool split : {false, true})
        for (const Kind kind : {Kind::automatic, Kind::ldlt, Kind::lu})
          for (const bool matching : {true, false}) {
            SCOPED_TRACE(testing::Message()
                         << "values " << static_cast<int>(values) << " storage " << static_cast<int>(storage)
                         << " split " << split << " kind " << static_cast<int>(kind) << " matching " << matching);
            const SparseMatrix lower = reference::random_system(61, 5, values, 7);
            const SparseMatrix a = reference::stored_as(lower, storage, split);
            Options o = two_threads();
            o.kind = kind;
            o.matching = matching;
            expect_solved(a, o);
          }
}

TEST(SolverInput, GeneralMatricesWithDuplicates) {
  for (const Index n : {1, 2, 3, 7, 8, 9, 63, 200})
    for (const bool split : {false, true}) {
      SCOPED_TRACE(testing::Message() << "n " << n << " split " << split);
      const SparseMatrix a =
          reference::stored_as(reference::random_system(n, 6, Values::general, 8), Storage::general, split);
      expect_solved(a);
      Solver s(two_threads());
      expect_solved(s, a, 3, Transpose::yes);
    }
}

TEST(SolverInput, DuplicatesThatCancelDoNotFlatterTheError) {
  // 1e10 - 1e10 + 1: an error measured with |1e10| + |1e10| would be ten orders too small.
  std::vector<Triple> t;
  for (Index k = 0; k < 20; ++k) {
    t.push_back({k, k, 1e10});
    t.push_back({k, k, 2 - 1e10});
    if (k > 0) t.push_back({k, k - 1, -0.9});
  }
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    Options o = two_threads();
    o.kind = kind;
    expect_solved(reference::from_triples(20, t, Storage::symmetric_lower), o);
  }
}

TEST(SolverInput, StorageThatDoesNotExistIsRefused) {
  SparseMatrix a = diagonal({1, 2});
  a.storage = static_cast<Storage>(9);
  const AnalysisResult r = Solver(two_threads()).analyze(a);
  EXPECT_EQ(r.status.code, StatusCode::invalid_input);
  EXPECT_NE(r.status.message.find("storage 9"), std::string::npos) << r.status.message;
}

TEST(SolverInput, ExplicitZerosAndOneByOne) {
  expect_solved(reference::from_triples(1, {{0, 0, -4}}, Storage::general));
  expect_solved(reference::from_triples(1, {{0, 0, 1e-300}}, Storage::symmetric_upper));
  expect_solved(reference::from_triples(
      4, {{0, 0, 0}, {1, 0, 3}, {2, 0, 0}, {1, 1, 0}, {3, 1, 0}, {2, 2, 5}, {3, 2, 0}, {3, 3, -1}},
      Storage::symmetric_lower));
  Solver s(two_threads());
  const AnalysisResult zero = s.analyze(reference::from_triples(1, {{0, 0, 0}}, Storage::general));
  const bool refused =
      zero.status.code == StatusCode::singular ||
      s.factorize(reference::from_triples(1, {{0, 0, 0}}, Storage::general)).status.code == StatusCode::singular;
  EXPECT_TRUE(refused);
}

TEST(SolverInput, ImpossibleShapesAreRefused) {
  Solver s(two_threads());
  EXPECT_EQ(s.analyze(MatrixView{}).status.code, StatusCode::invalid_input);
  SparseMatrix empty;
  empty.col_ptr = {0};
  EXPECT_EQ(s.analyze(empty).status.code, StatusCode::invalid_input);
  SparseMatrix wide{2, 3, {0, 1, 2, 2}, {0, 1}, {1, 1}, Storage::general};
  const AnalysisResult r = s.analyze(wide);
  EXPECT_EQ(r.status.code, StatusCode::invalid_input);
  EXPECT_NE(r.status.message.find("2 x 3"), std::string::npos) << r.status.message;
  SparseMatrix outside{2, 2, {0, 1, 2}, {0, 2}, {1, 1}, Storage::general};
  EXPECT_EQ(s.analyze(outside).status.code, StatusCode::invalid_input);
  SparseMatrix upper_in_lower{2, 2, {0, 1, 3}, {0, 0, 1}, {1, 1, 1}, Storage::symmetric_lower};
  EXPECT_EQ(s.analyze(upper_in_lower).status.code, StatusCode::invalid_input);
  EXPECT_EQ(s.state(), Solver::State::empty);
}

TEST(SolverInput, UnsymmetricMatrixIsNotTakenForSymmetric) {
  const SparseMatrix a = reference::random_system(30, 5, Values::general, 9);
  for (const Kind kind : {Kind::llt, Kind::ldlt}) {
    Options o = two_threads();
    o.kind = kind;
    Solver s(o);
    EXPECT_EQ(s.analyze(a).status.code, StatusCode::invalid_input);
  }
}

TEST(SolverInput, StructurallySingularIsRefusedWithARow) {
  // Column and row 3 are empty.
  std::vector<Triple> t;
  for (Index k = 0; k < 6; ++k)
    if (k != 3) t.push_back({k, k, 2.0});
  for (const Storage storage : {Storage::general, Storage::symmetric_lower})
    for (const Kind kind : {Kind::automatic, Kind::llt, Kind::ldlt, Kind::lu})
      for (const bool matching : {true, false}) {
        SCOPED_TRACE(testing::Message() << static_cast<int>(storage) << ' ' << static_cast<int>(kind) << matching);
        Options o = two_threads();
        o.kind = kind;
        o.matching = matching;
        Solver s(o);
        const SparseMatrix a = reference::from_triples(6, t, storage);
        Status status = s.analyze(a).status;
        if (status.ok()) status = s.factorize(a).status;
        if (kind == Kind::llt) {
          EXPECT_EQ(status.code, StatusCode::not_positive_definite) << status.message;
        } else {
          EXPECT_EQ(status.code, StatusCode::singular) << status.message;
        }
        EXPECT_NE(status.message.find('3'), std::string::npos) << status.message;
        EXPECT_EQ(status.row, 3) << status.message;
      }
}

TEST(SolverInput, DisconnectedAndDenseRow) {
  std::vector<Triple> blocks;  // 2x2 blocks with negative determinant, and isolated unknowns
  for (Index k = 0; k + 1 < 60; k += 3) {
    blocks.push_back({k, k, 1});
    blocks.push_back({k + 1, k, 2});
    blocks.push_back({k + 1, k + 1, 1});
    blocks.push_back({k + 2, k + 2, 3});
  }
  expect_solved(reference::from_triples(60, blocks, Storage::symmetric_lower));
  const Index n = 3000;
  std::vector<Triple> arrow, tall;
  for (Index k = 0; k < n; ++k) {
    arrow.push_back({k, k, k == 7 ? 4.0 * n : 2.0});
    tall.push_back({k, k, 2.0});
    if (k == 7) continue;
    arrow.push_back({std::max<Index>(k, 7), std::min<Index>(k, 7), 1});
    tall.push_back({7, k, 1});  // a dense row without a dense column
  }
  expect_solved(reference::from_triples(n, arrow, Storage::symmetric_lower));
  expect_solved(reference::from_triples(n, tall, Storage::general));
}

// Work that grows with the square of n would take minutes here.
TEST(SolverInput, LargeDiagonalIsExact) {
  const Index n = 200000;
  std::vector<double> d(static_cast<std::size_t>(n));
  for (Index k = 0; k < n; ++k) d[static_cast<std::size_t>(k)] = (k % 3 == 0 ? -1.0 : 1.0) * (1 + k % 17);
  for (const Kind kind : {Kind::automatic, Kind::lu}) {
    Options o = two_threads();
    o.kind = kind;
    Solver s(o);
    const SparseMatrix a = diagonal(d);
    ASSERT_TRUE(s.analyze(a).status.ok());
    const FactorResult f = s.factorize(a);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    std::vector<double> b(d), x(d.size());
    ASSERT_TRUE(s.solve(b, x).status.ok());
    for (const double e : x) ASSERT_NEAR(e, 1.0, 4 * kEps);
    if (kind != Kind::lu) {
      EXPECT_EQ(f.inertia.negative, (n + 2) / 3);
      EXPECT_EQ(f.inertia.positive, n - (n + 2) / 3);
    }
  }
}

TEST(SolverInput, PatternOnlyAnalysis) {
  const SparseMatrix a = reference::random_system(80, 5, Values::positive, 10);
  MatrixView pattern = a;
  pattern.values = {};
  for (const Kind kind : {Kind::automatic, Kind::llt, Kind::ldlt, Kind::lu}) {
    Options o = two_threads();
    o.kind = kind;
    Solver s(o);
    ASSERT_TRUE(s.analyze(pattern).status.ok());
    EXPECT_EQ(s.factorize(pattern).status.code, StatusCode::invalid_input);
    ASSERT_TRUE(s.factorize(a).status.ok());
    const std::vector<double> b = reference::random_vector(80, 1);
    std::vector<double> x(80);
    EXPECT_TRUE(s.solve(b, x).status.ok());
    EXPECT_LE(reference::backward_error(a, b, x), 8 * kEps);
  }
}

}  // namespace solver_input_test
}  // namespace espalier
