// Rank, inertia, rows and null vectors of systems that are known without rounding (tests/verdict/exact.hpp), of
// structurally singular ones and of ones with very many zeros. Truth: elimination in integers, the construction.
#include <array>
#include <complex>
#include <sstream>

#include "base/at.hpp"
#include "espalier/complex_solver.hpp"
#include "matrix/generators/random.hpp"
#include "solver/solver_common.hpp"
#include "verdict/exact.hpp"

namespace espalier::test {
namespace exact_rank_test {

using reference::Triple;
using verdict::ExactCase;

// What tests/verdict/exact_campaign.cpp does with other seeds, and many more of them.
TEST(ExactRank, OfSystemsInIntegersInManyDisguises) {
  constexpr double kMostCondition = 1e10;
  int singular = 0, structurally = 0, judged = 0;
  for (std::uint64_t seed = 1; seed <= 600; ++seed) {
    const ExactCase c = verdict::make_exact_case(seed);
    ASSERT_GE(c.zeros, 0) << "seed " << seed << ": the two truths contradict each other";
    if (c.condition > kMostCondition) continue;
    const verdict::Trial trial = verdict::make_trial(c, seed);
    const std::string wrong = verdict::judge(c, trial.disguise, trial.options, seed);
    EXPECT_TRUE(wrong.empty() || wrong == "late")
        << "seed " << seed << ", n " << c.a.n << ", " << c.name << ": " << wrong << " (" << trial.name << ")";
    ++judged;
    singular += c.zeros > 0 ? 1 : 0;
    structurally += c.zeros > 0 && c.name.find("scattered") == 0 ? 1 : 0;
  }
  EXPECT_GT(judged, 500);
  EXPECT_GT(singular, 200);
  EXPECT_GT(structurally, 50);
}

// The two exact arithmetics against each other, and against eigenvalues in doubles.
TEST(ExactRank, TruthsAgree) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const ExactCase c = verdict::make_exact_case(seed);
    if (c.complex || c.negative < 0 || c.a.n > 20) continue;
    Index negative = 0, zeros = 0;
    if (!verdict::exact_inertia(c.a, negative, zeros)) continue;
    EXPECT_EQ(zeros, c.a.n - verdict::exact_rank(c.a)) << seed;
    EXPECT_EQ(negative, c.negative) << seed;
    std::vector<Triple> t;
    for (Index j = 0; j < c.a.n; ++j)
      for (Index i = j; i < c.a.n; ++i)
        if (c.a.at(i, j) != 0.0) t.push_back({i, j, c.a.at(i, j).real()});
    if (c.condition > 1e8) continue;
    const reference::Signs signs = reference::signs(reference::from_triples(c.a.n, t, Storage::symmetric_lower), 1e-12);
    EXPECT_EQ(signs.zero, zeros) << seed;
    EXPECT_EQ(signs.negative, negative) << seed;
  }
}

Options reporting(Kind kind = Kind::automatic) {
  Options o = two_threads();
  o.singular = SingularMatrix::report;
  o.kind = kind;
  return o;
}

// Two pivots that vanish one after the other leave numbers of 1e30 in a factor, beside which a search for null vectors
// sees no others: of these it found too few, and said nothing.
TEST(ExactRank, WhereVanishingPivotsHideOthers) {
  for (const std::uint64_t seed : {270079U, 209371U, 209807U, 210762U, 212696U, 223436U, 235919U, 236411U, 244947U,
                                   249815U, 260340U, 268535U, 291022U}) {
    const ExactCase c = verdict::make_exact_case(seed);
    verdict::Trial trial = verdict::make_trial(c, seed);
    trial.options.singular = SingularMatrix::report;
    const std::string wrong = verdict::judge(c, trial.disguise, trial.options, seed);
    EXPECT_TRUE(wrong.empty()) << "seed " << seed << ", n " << c.a.n << ": " << wrong << " (" << trial.name << ")";
  }
}

// Vanishing pivots that are no zeros. The first case: what two of them leave of a random vector vanishes with the
// second step, as if it had been part of the null space. The others are regular, and deserve a factor that solves.
TEST(ExactRank, WhereVanishingPivotsAreNoZeros) {
  for (const std::uint64_t seed : {410405U, 400438U, 405506U, 409084U, 430015U}) {
    const ExactCase c = verdict::make_exact_case(seed);
    const verdict::Trial trial = verdict::make_trial(c, seed);
    EXPECT_EQ(verdict::judge(c, trial.disguise, trial.options, seed), "") << seed;
  }
}

// Row, column and value of each entry, 24 of them zeros that are stored. Rank 47 by elimination modulo 2^31 - 1.
constexpr const char* kOfRank47 =
    "0 4 12  0 16 7  0 36 -6  0 49 -12  0 53 -6  1 36 -4  1 42 -4  2 22 2  2 53 1  2 54 -4  3 37 0  3 43 0  "
    "3 60 1  4 21 -1  4 57 -1  4 63 -4  4 64 0  5 22 -3  5 34 4  5 67 0  6 3 6  6 18 -9  6 22 4  6 45 -4  "
    "6 46 6  6 59 9  8 67 4  9 21 2  9 28 1  9 57 2  9 61 -1  9 63 8  10 6 1  10 40 2  10 54 -1  11 2 1  "
    "11 15 4  11 65 1  12 9 -12  12 29 4  12 65 8  13 3 0  13 6 12  13 14 16  13 34 -16  13 36 -16  13 42 -16  "
    "13 52 -4  13 53 -8  13 62 16  13 65 -16  14 59 3  14 68 -4  15 2 1  15 4 3  16 9 1  16 13 4  16 27 1  "
    "16 40 1  16 68 4  17 37 -3  17 52 -3  17 61 -4  18 12 -2  18 31 3  18 52 3  19 16 -1  19 17 4  19 41 -4  "
    "19 43 3  20 0 0  20 21 -3  20 27 3  20 62 9  20 67 8  21 2 -1  21 15 -1  21 16 -1  21 27 -2  21 50 -2  "
    "21 62 -1  22 13 -4  22 57 0  23 18 4  23 35 0  23 52 1  23 65 0  24 2 -2  24 12 6  24 14 4  24 15 -8  "
    "24 42 -8  24 62 -12  25 9 0  25 13 4  25 33 3  25 49 2  26 18 3  26 45 2  26 49 0  26 59 -3  27 4 -4  "
    "27 16 -2  27 36 2  27 49 4  27 53 2  27 57 0  28 16 -1  29 2 2  29 15 -9  29 18 -8  29 27 3  29 45 -6  "
    "30 11 4  30 14 1  31 11 12  31 14 9  31 18 -3  31 36 3  31 54 2  32 6 4  32 42 -3  32 53 3  33 3 3  "
    "33 22 2  33 45 1  33 46 3  34 7 -1  34 11 -4  34 22 2  34 68 -1  35 13 2  35 65 3  36 9 3  36 29 -1  "
    "36 55 0  36 65 -2  37 3 3  37 33 3  37 50 -3  38 11 -4  38 14 -3  38 18 1  39 21 1  39 27 -1  39 62 -3  "
    "40 7 0  40 41 4  40 50 2  40 52 -3  41 15 2  41 42 2  41 62 3  41 68 0  43 2 4  43 6 -4  43 18 -16  "
    "43 42 3  43 45 -12  43 53 -3  44 2 1  44 18 -4  44 45 -3  45 13 4  45 25 -3  45 46 1  45 49 3  45 50 1  "
    "45 51 3  45 65 1  46 12 2  46 31 -3  46 52 -3  46 59 -3  46 68 4  47 2 2  47 12 -6  47 13 -3  47 14 -4  "
    "47 32 0  47 49 12  48 36 2  48 55 1  48 63 3  49 15 3  49 27 -1  50 2 -1  50 12 3  50 14 2  51 44 -2  "
    "51 67 -4  52 28 -1  52 61 1  53 7 2  53 22 -1  53 63 -4  54 9 2  54 15 -1  54 22 1  55 21 3  55 27 -3  "
    "55 36 9  55 54 6  55 62 -9  56 7 3  56 9 0  56 11 12  56 16 -4  56 17 16  56 22 -6  56 24 0  56 41 -16  "
    "56 43 12  56 68 3  57 36 3  57 54 2  58 6 3  58 14 4  58 34 -4  58 52 -1  58 53 -2  58 62 4  58 65 -4  "
    "59 3 -9  59 15 12  59 27 -4  59 33 -9  59 50 9  60 2 1  60 9 2  60 13 8  60 15 1  60 16 1  60 27 4  "
    "60 40 2  60 50 2  60 62 1  60 68 8  61 42 0  61 52 -2  61 54 1  61 61 -3  62 6 -4  62 17 2  62 42 -4  "
    "62 57 -1  62 65 2  63 4 3  63 15 2  63 50 -3  63 53 -3  63 63 -4  63 65 4  64 2 -1  64 33 -3  64 51 0  "
    "64 53 4  65 1 0  65 47 0  66 13 -1  66 49 4  66 63 0  67 16 -1  67 17 4  67 37 0  67 41 -4  67 43 3  "
    "68 63 1  69 2 -1  69 28 -2  69 40 -2  69 43 4  69 57 4  ";

TEST(ExactRank, IsThatOfTheTransposed) {
  std::vector<Triple> t;
  std::istringstream in(kOfRank47);
  Index i = 0, j = 0;
  for (double v = 0; in >> i >> j >> v;) t.push_back({i, j, v});
  for (const bool transpose : {false, true}) {
    if (transpose)
      for (Triple& e : t) std::swap(e.row, e.col);
    Solver s(reporting(Kind::lu));
    const SparseMatrix a = reference::from_triples(70, t, Storage::general);
    ASSERT_TRUE(s.analyze(a).status.ok());
    const FactorResult f = s.factorize(a);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(f.rank, 47);
  }
}

struct Known {
  const char* name;
  SparseMatrix a;  ///< symmetric_lower
  Index negative, zeros;
};

// 2 x 2 blocks in a row: rank `blocks` of twice as many.
SparseMatrix doubled_chain(Index blocks) {
  std::vector<Triple> t;
  for (Index i = 0; i < blocks; ++i) {
    for (Index p = 0; p < 2; ++p)
      for (Index q = p; q < 2; ++q) t.push_back({2 * i + q, 2 * i + p, 3});
    for (Index p = 0; p < 2 && i + 1 < blocks; ++p)
      for (Index q = 0; q < 2; ++q) t.push_back({2 * i + 2 + q, 2 * i + p, 1});
  }
  return reference::from_triples(2 * blocks, t, Storage::symmetric_lower);
}

// So many chains of springs side by side.
SparseMatrix loose_chains(Index chains, Index length) {
  std::vector<Triple> t;
  for (Index c = 0; c < chains; ++c)
    for (Index i = 0; i < length; ++i) {
      const auto weight = [&](Index k) { return k < 0 || k + 1 >= length ? 0.0 : 1 + 0.1 * ((7 * k + 3 * c) % 13); };
      const Index at = c * length + i;
      t.push_back({at, at, weight(i - 1) + weight(i)});
      if (i + 1 < length) t.push_back({at + 1, at, -weight(i)});
    }
  return reference::from_triples(chains * length, t, Storage::symmetric_lower);
}

// A chain of which each third unknown stands alone, with zeros stored at it and beside it: a plane model in a code for
// three dimensions.
SparseMatrix with_stored_zeros(Index nodes, double in_place_of_zero) {
  std::vector<Triple> t;
  for (Index i = 0; i < nodes; ++i)
    for (Index p = 0; p < 3; ++p) {
      for (Index q = p; q < 3; ++q)
        t.push_back({3 * i + q, 3 * i + p, q == 2 ? (p == 2 ? in_place_of_zero : 0) : q == p ? 4.0 : 1.0});
      for (Index q = 0; q < 3 && i + 1 < nodes; ++q)
        t.push_back({3 * i + 3 + q, 3 * i + p, p == 2 || q == 2 ? 0 : p == q ? -1.0 : 0.25});
    }
  return reference::from_triples(3 * nodes, t, Storage::symmetric_lower);
}

// [I A^T; A 0] with more rows than columns: rank at most twice the columns.
SparseMatrix least_squares(Index columns, Index rows) {
  std::vector<Triple> t;
  for (Index j = 0; j < columns; ++j) t.push_back({j, j, 1});
  for (Index i = 0; i < rows; ++i) {
    t.push_back({columns + i, i % columns, 1.0 + i / columns});
    if (i >= columns) t.push_back({columns + i, (i + 1) % columns, 2});
  }
  return reference::from_triples(columns + rows, t, Storage::symmetric_lower);
}

std::vector<Known> systems_with_many_zeros() {
  std::vector<Known> all;
  all.push_back({"kron(tridiag(1,3,1), ones)", doubled_chain(200), 0, 200});
  all.push_back({"loose springs", loose_chains(300, 2), 0, 300});
  all.push_back({"loose chains", loose_chains(200, 30), 0, 200});
  all.push_back({"stored zeros", with_stored_zeros(400, 0), 0, 400});
  all.push_back({"least squares", least_squares(100, 400), 100, 300});
  all.push_back({"nothing stored", reference::from_triples(500, {}, Storage::symmetric_lower), 0, 500});
  all.push_back(
      {"zeros alone", reference::from_triples(3, {{0, 0, 0}, {1, 1, 0}, {2, 1, 0}}, Storage::symmetric_lower), 0, 3});
  return all;
}

TEST(ManyZeros, RankInertiaAndSolutionOfAnyNumber) {
  for (const Known& known : systems_with_many_zeros())
    for (const Kind kind : {Kind::automatic, Kind::ldlt, Kind::lu})
      for (const Storage storage : {Storage::symmetric_lower, Storage::symmetric_upper, Storage::general}) {
        SCOPED_TRACE(testing::Message() << known.name << " kind " << static_cast<int>(kind));
        const SparseMatrix a = reference::stored_as(known.a, storage);
        const auto n = static_cast<std::size_t>(a.rows);
        Solver s(reporting(kind));
        const AnalysisResult analysis = s.analyze(a);
        ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
        const FactorResult f = s.factorize(a);
        ASSERT_TRUE(f.status.ok()) << f.status.message;
        EXPECT_EQ(a.rows - f.rank, known.zeros);
        EXPECT_EQ(static_cast<Index>(f.dependent_rows.size()), known.zeros);
        if (analysis.kind != Kind::lu) {
          EXPECT_EQ(f.inertia.negative, known.negative);
          EXPECT_EQ(f.inertia.zero, known.zeros);
        }
        const std::vector<double> zero(n, 0.0), given = reference::random_vector(a.rows, 3);
        std::vector<double> b = reference::residual(a, zero.data(), given.data(), false), x(n);
        EXPECT_TRUE(s.solve(b, x).status.ok());
        EXPECT_LE(reference::backward_error(a, b, x), 1e-13);
      }
}

// The image of A v beside |A| |v|, the largest, in the infinity norm.
double largest_image(const SparseMatrix& a, const std::vector<double>& vectors) {
  const auto n = static_cast<std::size_t>(a.rows);
  const std::vector<double> zero(n, 0.0);
  double most = 0;
  for (std::size_t at = 0; at < vectors.size(); at += n)
    for (const double r : reference::residual(a, zero.data(), vectors.data() + at, false))
      most = std::max(most, std::abs(r));
  return most;
}

TEST(ManyZeros, NullVectorsWhereTheyAreAskedFor) {
  for (const Known& known : systems_with_many_zeros())
    for (const Kind kind : {Kind::ldlt, Kind::lu}) {
      if (known.a.rows > 1000) continue;
      SCOPED_TRACE(testing::Message() << known.name << " kind " << static_cast<int>(kind));
      Options o = reporting(kind);
      o.singular = SingularMatrix::null_vectors;
      Solver s(o);
      ASSERT_TRUE(s.analyze(known.a).status.ok());
      const FactorResult f = s.factorize(known.a);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      const auto numbers = static_cast<std::size_t>(known.a.rows) * static_cast<std::size_t>(known.zeros);
      ASSERT_EQ(f.null_vectors.size(), numbers);
      ASSERT_EQ(f.left_null_vectors.size(), kind == Kind::lu ? numbers : 0);
      EXPECT_LE(largest_image(known.a, f.null_vectors), 1e-12);
      EXPECT_LE(largest_image(known.a, f.left_null_vectors), 1e-12);  // they are symmetric
    }
}

// Blocks u v^T, neither symmetric nor Hermitian: A v = 0 and A^T w = 0, however many there are.
TEST(ManyZeros, ComplexNullVectorsOfBothSides) {
  using Number = std::complex<double>;
  const std::array<Number, 2> u = {Number(1, 0.5), Number(-2, 1)}, v = {Number(0, 3), Number(1, -1)};
  for (const Index blocks : {20, 600}) {
    ComplexSparseMatrix a{2 * blocks, 2 * blocks, {0}, {}, {}, Storage::general};
    for (Index c = 0; c < a.cols; ++c) {
      for (Index r = c / 2 * 2; r < c / 2 * 2 + 2; ++r) {
        a.row_ind.push_back(r);
        a.values.push_back(u[at(r % 2)] * v[at(c % 2)] * (1.0 + c / 2 % 7));
      }
      a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
    }
    Options o = reporting(Kind::lu);
    o.singular = SingularMatrix::null_vectors;
    ComplexSolver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    const ComplexFactorResult f = s.factorize(a);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(f.rank, blocks);
    const auto numbers = static_cast<std::size_t>(a.rows) * at(blocks);
    ASSERT_EQ(f.null_vectors.size(), numbers);
    ASSERT_EQ(f.left_null_vectors.size(), numbers);
    double most = 0;
    for (std::size_t k = 0; k < numbers; k += 2) {
      most = std::max(most, std::abs(v[0] * f.null_vectors[k] + v[1] * f.null_vectors[k + 1]));
      most = std::max(most, std::abs(u[0] * f.left_null_vectors[k] + u[1] * f.left_null_vectors[k + 1]));
    }
    EXPECT_LE(most, 1e-12);
  }
}

// Rows and columns of a regular matrix with units of 2^-20 to 2^20, some of them several times: the factor of B + E is
// nearly singular itself, so that pivots prove nothing. The rank is that of the regular one, and no solution is called
// one that leaves its right-hand side.
TEST(ManyZeros, RepeatedRowsAndColumnsInOtherUnits) {
  using Number = std::complex<double>;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    std::uint64_t counter = 0;
    const auto below = [&](Index m) {
      return static_cast<Index>(matrix::random_below(seed, counter++, static_cast<std::uint64_t>(m)));
    };
    const Index n = 200, m = 110;
    const auto unit = [&] { return std::ldexp(1.0, below(41) - 20); };
    std::vector<Number> regular(at(m * m));
    for (Index k = 0; k < m; ++k) {
      regular[at(k * m + k)] = 12;
      for (int more = 0; more < 4; ++more) regular[at(below(m) * m + k)] += Number(below(5) - 2, below(5) - 2);
    }
    std::vector<Index> row_of(at(n)), column_of(at(n));
    std::vector<double> row_unit(at(n)), column_unit(at(n));
    for (Index k = 0; k < n; ++k) {
      row_of[at(k)] = k < m ? k : below(m);
      column_of[at(k)] = k < m ? k : below(m);
      row_unit[at(k)] = unit();
      column_unit[at(k)] = unit();
    }
    ComplexSparseMatrix a{n, n, {0}, {}, {}, Storage::general};
    std::vector<Number> inside(at(n));  // A 1
    for (Index c = 0; c < n; ++c) {
      for (Index r = 0; r < n; ++r) {
        const Number v = regular[at(row_of[at(r)] * m + column_of[at(c)])] * row_unit[at(r)] * column_unit[at(c)];
        if (v == 0.0) continue;
        a.row_ind.push_back(r);
        a.values.push_back(v);
        inside[at(r)] += v;
      }
      a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
    }
    ComplexSolver s(reporting(Kind::lu));
    ASSERT_TRUE(s.analyze(a).status.ok());
    const ComplexFactorResult f = s.factorize(a);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(f.rank, m) << "seed " << seed;
    for (const bool consistent : {true, false}) {
      const std::vector<Number> b = consistent ? inside : std::vector<Number>(at(n), 1.0);
      std::vector<Number> x(at(n)), rest = b;
      if (!s.solve(b, x).status.ok()) continue;
      EXPECT_TRUE(consistent) << "seed " << seed << ": no x solves this";
      double left = 0, given = 0;
      for (Index c = 0; c < n; ++c)
        for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q)
          rest[at(a.row_ind[at(q)])] -= a.values[at(q)] * x[at(c)];
      for (std::size_t k = 0; k < rest.size(); ++k) {
        left = std::max(left, std::abs(rest[k]));
        given = std::max(given, std::abs(b[k]));
      }
      EXPECT_LE(left, 0.02 * given) << "seed " << seed;
    }
  }
}

// L U meets more vanishing pivots than zeros here, for want of rows that others have taken.
TEST(ManyZeros, OfLuBesideOtherVanishingPivots) {
  for (const Index blocks : {40, 200, 3000}) {
    const SparseMatrix a = reference::stored_as(doubled_chain(blocks), Storage::general);
    const auto n = static_cast<std::size_t>(a.rows);
    Solver s(reporting(Kind::lu));
    ASSERT_TRUE(s.analyze(a).status.ok());
    for (int again = 0; again < 2; ++again) {
      const FactorResult f = s.factorize(a);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      EXPECT_EQ(f.rank, blocks);
      ASSERT_EQ(f.dependent_rows.size(), n / 2);
      ASSERT_EQ(f.dependent_columns.size(), n / 2);
      for (Index k = 0; k < blocks; ++k) {  // one of each block
        EXPECT_EQ(f.dependent_rows[at(k)] / 2, k);
        EXPECT_EQ(f.dependent_columns[at(k)] / 2, k);
      }
      const std::vector<double> zero(n, 0.0), given = reference::random_vector(a.rows, 3);
      for (const bool transpose : {false, true}) {
        const std::vector<double> b = reference::residual(a, zero.data(), given.data(), transpose);
        std::vector<double> x(n);
        const SolveResult r = s.solve(b, x, 1, transpose ? Transpose::yes : Transpose::no);
        ASSERT_TRUE(r.status.ok()) << r.status.message;
        EXPECT_LE(r.backward_error, 1e-15);
        EXPECT_LE(std::abs(*std::max_element(x.begin(), x.end())), 100) << "a part of the null space";
      }
    }
  }
}

TEST(StructurallySingular, AnErrorNamesRowsAndAReportGoesOn) {
  // Row 1 is empty; rows 2 and 3 share a column.
  const std::vector<Triple> t = {{0, 0, 2}, {4, 0, 1}, {2, 2, 1}, {3, 2, 5}, {4, 4, 3}, {0, 3, 1}};
  const SparseMatrix a = reference::from_triples(5, t, Storage::general);
  Solver strict(two_threads());
  EXPECT_EQ(strict.analyze(a).status.code, StatusCode::singular);
  Solver s(reporting());
  ASSERT_TRUE(s.analyze(a).status.ok());
  const FactorResult f = s.factorize(a);
  ASSERT_TRUE(f.status.ok()) << f.status.message;
  EXPECT_EQ(f.rank, 3);
  ASSERT_EQ(f.null_vectors.size(), 10U);
  ASSERT_EQ(f.left_null_vectors.size(), 10U);
  EXPECT_EQ(f.dependent_rows.front(), 1);
}

// All entries of an inverse are its neighbours' sums: 2^58 is the largest.
TEST(Triangular, IsRegularHoweverIllConditioned) {
  constexpr Index n = 60;
  std::vector<Triple> t;
  for (Index j = 0; j < n; ++j)
    for (Index i = 0; i <= j; ++i) t.push_back({i, j, i == j ? 1.0 : -1.0});
  for (const bool renumbered : {false, true}) {
    std::vector<Triple> given = t;
    if (renumbered)
      for (Triple& e : given) e = {(e.row * 17 + 5) % n, (e.col * 23 + 11) % n, e.value};
    const SparseMatrix a = reference::from_triples(n, given, Storage::general);
    for (const bool transpose : {false, true}) {
      Solver s(two_threads());
      ASSERT_TRUE(s.analyze(a).status.ok());
      const FactorResult f = s.factorize(a);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      EXPECT_EQ(f.rank, n);
      const std::vector<double> zero(n, 0.0);
      for (const bool ones : {true, false}) {
        std::vector<double> b(n, 1.0), x(n);
        if (ones) b = reference::residual(a, zero.data(), std::vector<double>(n, -1.0).data(), transpose);
        const SolveResult r = s.solve(b, x, 1, transpose ? Transpose::yes : Transpose::no);
        EXPECT_TRUE(r.status.ok()) << r.status.message;
        EXPECT_LE(r.componentwise_error, 4 * kEps);
        if (ones) {
          for (const double v : x) EXPECT_EQ(v, 1);
        }
      }
    }
  }
}

TEST(Condition, OfSmallMatricesIsExactAndOfOthersNear) {
  for (std::uint64_t seed = 0; seed < 20; ++seed)
    for (const Index n : {37, 64, 150}) {
      const SparseMatrix a = reference::random_system(n, 4, reference::Values::general, seed);
      Solver s(two_threads());
      ASSERT_TRUE(s.analyze(a).status.ok());
      ASSERT_TRUE(s.factorize(a).status.ok());
      const double truth = reference::condition(a), estimate = s.condition_estimate().estimate;
      EXPECT_LE(estimate, truth * (1 + 1e-6));
      EXPECT_GE(estimate, n <= 64 ? truth * (1 - 1e-6) : truth / 2) << "n " << n << " seed " << seed;
    }
}

}  // namespace exact_rank_test
}  // namespace espalier::test
