// Truth: dense elimination, the inertia of A by dense eigenvalues, backward errors in long double.
#include <cstdint>

#include "schur_common.hpp"

namespace espalier::test {

namespace {

struct Sample {
  const char* name;
  Kind kind;
  reference::Values values;
};

void PrintTo(const Sample& s, std::ostream* out) { *out << s.name; }

Options options_for(Kind kind, int threads = 2) {
  Options o;
  o.kind = kind;
  o.threads = threads;
  return o;
}

// Any part of it is structurally regular.
SparseMatrix system_of(Index n, reference::Values values, std::uint64_t seed) {
  const SparseMatrix a = reference::random_system(n, 4, values, seed);
  if (values != reference::Values::general) return a;
  std::vector<double> full = reference::dense(a);
  for (std::size_t k = 0; k < full.size(); k += static_cast<std::size_t>(n) + 1) full[k] += 0.5;
  return sparse(full, n);
}

// S of the class against the dense one; the tolerance is for systems of condition 1e4 or so.
void expect_complement(const SchurComplement& schur, const MatrixView& a, double tolerance = 1e-10) {
  const std::vector<double> expected = dense_complement(a, schur.unknowns());
  const std::span<const double> s = schur.complement();
  ASSERT_EQ(s.size(), expected.size());
  const double scale = std::max(largest(expected), largest(reference::dense(a)));
  for (std::size_t k = 0; k < s.size(); ++k)
    ASSERT_LE(std::abs(s[k] - expected[k]), tolerance * scale) << "at " << k << " of " << s.size();
}

SchurResult factorized(SchurComplement& schur, const SparseMatrix& a, const std::vector<Index>& list) {
  const AnalysisResult analysis = schur.analyze(a, list);
  EXPECT_TRUE(analysis.status.ok()) << analysis.status.message;
  if (!analysis.status.ok()) return {};
  SchurResult result = schur.factorize(a.values);
  EXPECT_TRUE(result.status.ok()) << result.status.message;
  return result;
}

// Condensing, solving densely and expanding solve the system; solve() does so by itself.
void expect_solves(SchurComplement& schur, const SparseMatrix& a, Index columns, Transpose transpose) {
  const bool flip = transpose != Transpose::no;
  const std::vector<double> b = reference::random_vector(static_cast<std::int64_t>(a.cols) * columns, 5);
  std::vector<double> g(static_cast<std::size_t>(schur.size()) * static_cast<std::size_t>(columns)), x(b.size());
  const SolveResult condensed = schur.condense(b, g, columns, transpose);
  ASSERT_TRUE(condensed.status.ok()) << condensed.status.message;
  const std::vector<double> s(schur.complement().begin(), schur.complement().end());
  const std::vector<double> xs = reference::solve(sparse(s, schur.size()), g, columns, flip);
  const SolveResult expanded = schur.expand(b, xs, x, columns, transpose);
  ASSERT_TRUE(expanded.status.ok()) << expanded.status.message;
  EXPECT_LE(reference::backward_error(a, b, x, columns, flip), 1e-10);
  std::vector<double> in_place = b;
  const SolveResult solved = schur.solve(in_place, in_place, columns, transpose);
  ASSERT_TRUE(solved.status.ok()) << solved.status.message;
  const double error = reference::backward_error(a, b, in_place, columns, flip);
  EXPECT_LE(error, 8 * kEps);
  EXPECT_LE(std::abs(error - solved.backward_error), 0.01 * error + kEps);
}

class EveryKind : public testing::TestWithParam<Sample> {};

TEST_P(EveryKind, IsCondensedOntoAnyList) {
  for (const Index n : {2, 7, 60, 300})
    for (const Index count : {1, 2, 5, 40, 299}) {
      if (count > n) continue;
      SCOPED_TRACE(testing::Message() << n << " unknowns, " << count << " listed");
      const SparseMatrix a = system_of(n, GetParam().values, static_cast<std::uint64_t>(n + count));
      SchurComplement schur(options_for(GetParam().kind));
      const SchurResult result = factorized(schur, a, random_list(n, count, static_cast<std::uint64_t>(count)));
      if (!result.status.ok()) continue;
      EXPECT_TRUE(result.by_elimination || result.rest.perturbed > 0);
      expect_complement(schur, a, 1e-9);
      for (const Index columns : {1, 3}) expect_solves(schur, a, columns, Transpose::no);
      for (const Transpose turned : {Transpose::yes, Transpose::conjugate}) expect_solves(schur, a, 2, turned);
    }
}

INSTANTIATE_TEST_SUITE_P(Schur, EveryKind,
                         testing::Values(Sample{"llt", Kind::llt, reference::Values::positive},
                                         Sample{"automatic", Kind::automatic, reference::Values::positive},
                                         Sample{"ldlt", Kind::ldlt, reference::Values::indefinite},
                                         Sample{"ldlt_of_definite", Kind::ldlt, reference::Values::positive},
                                         Sample{"lu_of_symmetric", Kind::lu, reference::Values::indefinite},
                                         Sample{"lu", Kind::lu, reference::Values::general}),
                         [](const auto& sample) { return std::string(sample.param.name); });

TEST(Schur, InertiaIsThatOfBothParts) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const SparseMatrix a = reference::random_system(120, 3, reference::Values::indefinite, seed);
    SchurComplement schur(options_for(Kind::ldlt));
    if (!factorized(schur, a, random_list(120, 30, seed)).status.ok()) continue;
    const SchurInertia inertia = schur.inertia();
    ASSERT_TRUE(inertia.status.ok()) << inertia.status.message;
    const reference::Signs signs = reference::signs(a, 1e-12);
    EXPECT_EQ(inertia.rest.positive + inertia.complement.positive, signs.positive) << "seed " << seed;
    EXPECT_EQ(inertia.rest.negative + inertia.complement.negative, signs.negative) << "seed " << seed;
    EXPECT_EQ(inertia.rest.zero + inertia.complement.zero, signs.zero) << "seed " << seed;
  }
}

TEST(Schur, MultipliersInTheListLeaveADefiniteRest) {
  const SparseMatrix a = reference::saddle_point(90, 20, 3);
  const std::vector<double> full = reference::dense(a);
  std::vector<Index> multipliers;
  for (Index v = 0; v < a.cols; ++v)
    if (full[static_cast<std::size_t>(v) * static_cast<std::size_t>(a.cols + 1)] == 0) multipliers.push_back(v);
  ASSERT_EQ(multipliers.size(), 20u);
  SchurComplement schur(options_for(Kind::automatic));
  const SchurResult result = factorized(schur, a, multipliers);
  EXPECT_EQ(schur.analysis().kind, Kind::llt);
  EXPECT_EQ(result.rest.inertia.positive, 90);
  EXPECT_EQ(schur.inertia().complement.negative, 20);
  expect_complement(schur, a);
  expect_solves(schur, a, 2, Transpose::no);
}

TEST(Schur, MultipliersInTheRestAreSolvedOrNamed) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const SparseMatrix a = reference::saddle_point(200, 60, seed);
    SchurComplement schur(options_for(Kind::ldlt));
    const AnalysisResult analysis = schur.analyze(a, random_list(a.cols, 25, seed));
    if (!analysis.status.ok()) continue;  // a multiplier without a partner
    const SchurResult result = schur.factorize(a.values);
    if (!result.status.ok()) {
      EXPECT_EQ(result.status.code, StatusCode::singular) << result.status.message;
      continue;
    }
    expect_complement(schur, a, 1e-8);
    expect_solves(schur, a, 1, Transpose::no);
  }
}

// The caller eliminates the multipliers first, whose diagonal is zero: their pivots move up, and with them the rows of
// the list below.
TEST(Schur, PivotsMoveBesideTheList) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const SparseMatrix a = reference::saddle_point(160, 40, seed);
    const std::vector<double> full = reference::dense(a);
    std::vector<Index> free, multipliers;
    for (Index k = 0; k < a.cols; ++k)
      (full[static_cast<std::size_t>(k) * (static_cast<std::size_t>(a.cols) + 1)] == 0 ? multipliers : free)
          .push_back(k);
    Options o = options_for(Kind::ldlt);
    o.matching = false;
    o.permutation = multipliers;
    o.permutation.insert(o.permutation.end(), free.begin(), free.end());
    const std::vector<Index> list{free[3], free[40], free[7], free[90]};
    SchurComplement schur(o);
    const SchurResult result = factorized(schur, a, list);
    EXPECT_GT(result.rest.delayed, 0) << "the test wants pivots that fail";
    EXPECT_TRUE(result.by_elimination);
    expect_complement(schur, a, 1e-8);
    expect_solves(schur, a, 1, Transpose::no);
  }
}

// Small tiles and no whole fronts take the other way through the executor.
TEST(Schur, TilesOfAnyWidthAndThreadsLeaveTheSame) {
  const SparseMatrix a = generated({"elasticity", "4"});
  const std::vector<Index> list = random_list(a.cols, 100, 9);
  std::vector<double> first;
  for (const int threads : {1, 2, 3}) {
    SchurComplement schur(options_for(Kind::automatic, threads));
    EXPECT_TRUE(factorized(schur, a, list).by_elimination);
    const std::vector<double> s(schur.complement().begin(), schur.complement().end());
    if (first.empty()) first = s;
    EXPECT_EQ(first, s) << threads << " threads";
  }
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu})
    for (const Index width : {8, 40}) {
      Options o = options_for(kind);
      o.max_block_size = width;
      SchurComplement schur(o);
      (void)factorized(schur, a, list);
      expect_complement(schur, a, 1e-11);
    }
}

TEST(Schur, ManyPiecesOfTheRestMeetInOneRoot) {
  std::vector<reference::Triple> t;  // 50 chains of 4 that meet in the list alone; one knows nobody of it
  constexpr Index kChains = 50, kLength = 4, kListed = 6;
  const Index n = kChains * kLength + kListed;
  for (Index k = 0; k < kChains; ++k)
    for (Index j = 0; j < kLength; ++j) {
      const Index v = k * kLength + j;
      t.push_back({v, v, 4.0 + k});
      if (j + 1 < kLength) t.push_back({v + 1, v, -1.0});
      if (j == 0 && k != 7) t.push_back({kChains * kLength + k % kListed, v, 0.5});
    }
  for (Index v = kChains * kLength; v < n; ++v) t.push_back({v, v, 3.0});
  const SparseMatrix a = reference::from_triples(n, t, Storage::symmetric_lower);
  std::vector<Index> list;
  for (Index v = kChains * kLength; v < n; ++v) list.push_back(v);
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    SchurComplement schur(options_for(kind));
    EXPECT_TRUE(factorized(schur, a, list).by_elimination);
    expect_complement(schur, a);
  }
}

TEST(Schur, AllUnknownsListedLeaveTheMatrix) {
  const SparseMatrix a = reference::random_system(30, 4, reference::Values::general, 4);
  SchurComplement schur;
  const SchurResult result = factorized(schur, a, random_list(30, 30, 1));
  EXPECT_EQ(result.rest.rank, 0);
  expect_complement(schur, a, 0);
  expect_solves(schur, a, 2, Transpose::yes);
}

TEST(Schur, OneByOne) {
  const SparseMatrix a = reference::from_triples(1, {{0, 0, -3.0}}, Storage::symmetric_lower);
  SchurComplement schur;
  (void)factorized(schur, a, {0});
  EXPECT_EQ(schur.complement()[0], -3.0);
  EXPECT_EQ(schur.inertia().complement.negative, 1);
}

TEST(Schur, EveryStorageAndDuplicatesAreTheSameMatrix) {
  const SparseMatrix lower = reference::random_system(80, 4, reference::Values::indefinite, 8);
  const std::vector<Index> list = random_list(80, 12, 2);
  for (const Storage storage :
       {Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both, Storage::general})
    for (const bool split : {false, true}) {
      const SparseMatrix a = reference::stored_as(lower, storage, split);
      for (const Kind kind : {Kind::ldlt, Kind::lu}) {
        SchurComplement schur(options_for(kind));
        (void)factorized(schur, a, list);
        expect_complement(schur, lower, 1e-9);
      }
    }
}

TEST(Schur, NewValuesMakeANewComplement) {
  SparseMatrix a = system_of(150, reference::Values::general, 6);
  SchurComplement schur;
  (void)factorized(schur, a, random_list(150, 20, 3));
  std::mt19937_64 random(1);
  for (double& v : a.values) v *= 1 + 0.2 * static_cast<double>(random() % 1000) / 1000;
  ASSERT_TRUE(schur.factorize(a.values).status.ok());
  expect_complement(schur, a, 1e-9);
  expect_solves(schur, a, 1, Transpose::no);
}

TEST(Schur, ASingularComplementIsNoHindranceUntilItIsSolved) {
  const SparseMatrix a = reference::from_triples(
      4, {{0, 0, 1.0}, {1, 0, -1.0}, {1, 1, 2.0}, {2, 1, -1.0}, {2, 2, 2.0}, {3, 2, -1.0}, {3, 3, 1.0}},
      Storage::symmetric_lower);  // a free chain
  SchurComplement schur(options_for(Kind::ldlt));
  (void)factorized(schur, a, {0, 3});
  expect_complement(schur, a);
  const SchurInertia inertia = schur.inertia();
  EXPECT_TRUE(inertia.status.ok()) << inertia.status.message;
  EXPECT_EQ(inertia.complement.zero, 1);
  EXPECT_EQ(inertia.complement.positive, 1);
  std::vector<double> b(4, 1.0), x(4);
  const SolveResult solved = schur.solve(b, x);
  EXPECT_EQ(solved.status.code, StatusCode::singular);
  EXPECT_TRUE(solved.status.row == 0 || solved.status.row == 3) << solved.status.row;
}

TEST(Schur, ASingularRestIsNamedInRowsOfA) {
  // A free chain 1 - 2 - 4 between listed unknowns that it does not know, and a clamped one.
  const std::vector<reference::Triple> t{{0, 0, 1.0},  {1, 1, 1.0}, {2, 1, -1.0}, {2, 2, 2.0},
                                         {4, 2, -1.0}, {4, 4, 1.0}, {3, 3, 2.0},  {3, 0, 0.5}};
  const SparseMatrix a = reference::from_triples(5, t, Storage::symmetric_lower);
  for (const Kind kind : {Kind::automatic, Kind::ldlt, Kind::lu}) {
    SchurComplement schur(options_for(kind));
    ASSERT_TRUE(schur.analyze(a, std::vector<Index>{0}).status.ok());
    const SchurResult result = schur.factorize(a.values);
    EXPECT_EQ(result.status.code, StatusCode::singular) << result.status.message;
    EXPECT_EQ(result.rest.rank, 3);
    ASSERT_EQ(result.rest.dependent_rows.size(), 1u);
    const Index row = result.rest.dependent_rows[0];
    EXPECT_TRUE(row == 1 || row == 2 || row == 4) << row;
    ASSERT_EQ(result.rest.null_vectors.size(), 5u);
    EXPECT_EQ(result.rest.null_vectors[0], 0);
    EXPECT_NEAR(std::abs(result.rest.null_vectors[4]), 1, 1e-10);
    EXPECT_FALSE(schur.factorized());
  }
}

TEST(Schur, AStructurallySingularRestIsNamedAtTheAnalysis) {
  // Unknown 3 is coupled with the listed one alone.
  const SparseMatrix a =
      reference::from_triples(4, {{0, 0, 1.0}, {1, 1, 1.0}, {2, 2, 1.0}, {3, 1, 2.0}}, Storage::symmetric_lower);
  SchurComplement schur(options_for(Kind::ldlt));
  const AnalysisResult analysis = schur.analyze(a, std::vector<Index>{1});
  EXPECT_EQ(analysis.status.code, StatusCode::singular) << analysis.status.message;
  EXPECT_EQ(analysis.status.row, 3) << analysis.status.message;
}

TEST(Schur, LltOfAnIndefiniteRestIsSaidWithItsRow) {
  const SparseMatrix a = reference::from_triples(3, {{0, 0, 1.0}, {1, 1, 2.0}, {2, 2, -1.0}}, Storage::symmetric_lower);
  SchurComplement schur(options_for(Kind::llt));
  ASSERT_TRUE(schur.analyze(a, std::vector<Index>{0}).status.ok());
  const SchurResult result = schur.factorize(a.values);
  EXPECT_EQ(result.status.code, StatusCode::not_positive_definite);
  EXPECT_EQ(result.status.row, 2);
  SchurComplement other(options_for(Kind::llt));  // where it is listed, the rest is definite
  (void)factorized(other, a, {2});
  EXPECT_EQ(other.complement()[0], -1.0);
}

TEST(Schur, BadListsAreNamed) {
  const SparseMatrix a = reference::random_system(10, 3, reference::Values::positive, 1);
  SchurComplement schur;
  const auto refused = [&](const std::vector<Index>& list, const std::string& text) {
    const AnalysisResult r = schur.analyze(a, list);
    EXPECT_EQ(r.status.code, StatusCode::invalid_input);
    EXPECT_NE(r.status.message.find(text), std::string::npos) << r.status.message;
    EXPECT_THROW((void)schur.factorize(a.values), std::logic_error);
  };
  refused({}, "empty");
  refused({3, 10}, "is 10");
  refused({-1}, "is -1");
  refused({4, 5, 4}, "unknown 4 stands twice");
  (void)factorized(schur, a, {4, 5});
  expect_complement(schur, a);
}

TEST(Schur, BadArraysAndValuesAreErrors) {
  SparseMatrix a = reference::random_system(10, 3, reference::Values::positive, 1);
  SchurComplement schur;
  EXPECT_THROW((void)schur.factorize(a.values), std::logic_error);
  EXPECT_THROW((void)schur.complement(), std::logic_error);
  ASSERT_TRUE(schur.analyze(a, std::vector<Index>{1, 2}).status.ok());
  EXPECT_THROW((void)schur.factorize(std::vector<double>(3)), std::invalid_argument);
  std::vector<double> b(10, 1.0), g(2), x(10);
  EXPECT_THROW((void)schur.condense(b, g), std::logic_error);
  ASSERT_TRUE(schur.factorize(a.values).status.ok());
  EXPECT_THROW((void)schur.condense(b, x), std::invalid_argument);
  EXPECT_THROW((void)schur.expand(b, b, x), std::invalid_argument);
  EXPECT_THROW((void)schur.solve(b, x, 0), std::invalid_argument);
  b[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(schur.condense(b, g).status.row, 3);
  EXPECT_EQ(schur.solve(b, x).status.code, StatusCode::invalid_input);
  a.values[5] = std::numeric_limits<double>::infinity();
  const SchurResult bad = schur.factorize(a.values);
  EXPECT_EQ(bad.status.code, StatusCode::invalid_input);
  EXPECT_FALSE(schur.factorized());
  SparseMatrix wide = a;
  wide.cols = 3;
  EXPECT_EQ(schur.analyze(wide, std::vector<Index>{1}).status.code, StatusCode::invalid_input);
}

TEST(Schur, UnitsDoNotMatter) {
  SparseMatrix a = reference::random_system(100, 4, reference::Values::indefinite, 12);
  const std::vector<Index> list = random_list(100, 10, 4);
  SchurComplement plain(options_for(Kind::ldlt)), scaled(options_for(Kind::ldlt));
  (void)factorized(plain, a, list);
  for (double& v : a.values) v *= 0x1p200;
  (void)factorized(scaled, a, list);
  for (std::size_t k = 0; k < plain.complement().size(); ++k)
    EXPECT_NEAR(scaled.complement()[k] * 0x1p-200, plain.complement()[k], 1e-11 * largest(a.values) * 0x1p-200);
}

// Out of core, and on backends that keep nothing for a border, solves make S.
TEST(Schur, SolvesMakeTheSameComplement) {
  const SparseMatrix a = generated({"elasticity", "4"});
  const std::vector<Index> list = random_list(a.cols, 50, 5);
  for (const Kind kind : {Kind::llt, Kind::lu}) {
    Options small = options_for(kind);
    small.device = "host:2";
    SchurComplement whole(small);
    const SchurResult in_core = factorized(whole, a, list);
    EXPECT_TRUE(in_core.by_elimination);
    small.device_memory_bytes = whole.analysis().predicted_bytes / 3;
    SchurComplement budgeted(small);
    EXPECT_FALSE(factorized(budgeted, a, list).by_elimination);
    expect_complement(budgeted, a, 1e-11);
    small.device_memory_bytes = 0;
    small.device = "reference";
    SchurComplement by_reference(small);
    EXPECT_FALSE(factorized(by_reference, a, list).by_elimination);
    expect_complement(by_reference, a, 1e-11);
    small.device = "host:1,1";
    SchurComplement shared(small);
    EXPECT_TRUE(factorized(shared, a, list).by_elimination);
    expect_complement(shared, a, 1e-11);
  }
}

// Where the devices are too small for a border, the rest is analyzed once more, within factorize(). Stopped there.
TEST(Schur, GoesOnAfterItsSecondAnalysisWasStopped) {
  const SparseMatrix a = generated({"elasticity", "4"});
  const std::vector<Index> list = random_list(a.cols, 50, 5);
  Options small = options_for(Kind::llt);
  small.device = "host:2";
  SchurComplement whole(small);
  (void)factorized(whole, a, list);
  small.device_memory_bytes = whole.analysis().predicted_bytes / 3;
  bool stop = false, stops = true;
  small.log = [&](const std::string& line) { stop = stops && line.find("formed by solves") != std::string::npos; };
  small.interrupted = [&] { return stop; };
  small.interrupted_every = 0;
  SchurComplement schur(small);
  ASSERT_TRUE(schur.analyze(a, list).status.ok());
  for (int turn = 0; turn < 2; ++turn) {
    const SchurResult stopped = schur.factorize(a.values);
    EXPECT_EQ(stopped.status.code, StatusCode::cancelled) << stopped.status.message;
    EXPECT_FALSE(schur.factorized());
    stop = false;
  }
  stops = false;
  const SchurResult found = schur.factorize(a.values);
  ASSERT_TRUE(found.status.ok()) << found.status.message;
  expect_complement(schur, a, 1e-11);
}

TEST(Schur, OrdersOfTheCallerArePassedOn) {
  const SparseMatrix a = reference::random_system(60, 4, reference::Values::positive, 2);
  Options o = options_for(Kind::automatic);
  o.permutation = random_list(60, 60, 3);
  SchurComplement schur(o);
  (void)factorized(schur, a, random_list(60, 9, 1));
  expect_complement(schur, a);
  o.permutation.pop_back();
  SchurComplement wrong(o);
  EXPECT_EQ(wrong.analyze(a, std::vector<Index>{1}).status.code, StatusCode::invalid_input);
}

}  // namespace

}  // namespace espalier::test
