// Clones: factors of their own on one analysis. Truth: the bits of a solver that did everything itself, and independent
// residuals; under the thread sanitizer, the absence of races.
#include <gtest/gtest.h>

#include <cstring>
#include <numeric>
#include <thread>

#include "espalier/espalier.h"
#include "solver/fake_backend.hpp"
#include "solver/session/session.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace clone_test {

using reference::Values;

// The k-th of a family of matrices of one pattern.
std::vector<double> values_of(const SparseMatrix& a, int k) {
  std::vector<double> values = a.values;
  for (std::size_t q = 0; q < values.size(); ++q) values[q] *= 1.0 + 0.25 * k;
  return values;
}

std::vector<double> solved_by(Solver& s, const std::vector<double>& values, const std::vector<double>& b) {
  const FactorResult f = s.refactorize(values);
  EXPECT_TRUE(f.status.ok()) << f.status.message;
  std::vector<double> x(b.size());
  const SolveResult r = s.solve(b, x);
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  return x;
}

struct System {
  const char* name;
  SparseMatrix a;
};
std::vector<System> systems() {
  return {{"llt", reference::random_system(300, 5, Values::positive, 1)},
          {"ldlt", reference::saddle_point(200, 40, 2)},
          {"lu", reference::random_system(250, 5, Values::general, 3)}};
}

TEST(Clone, ManyInManyThreadsGiveTheBitsOfOne) {
  constexpr int kClones = 6;
  for (const System& system : systems()) {
    SCOPED_TRACE(system.name);
    const SparseMatrix& a = system.a;  // a name of a structured binding could not be used in the threads (C++20)
    const std::vector<double> b = reference::random_vector(a.rows, 4);
    Solver original(test::two_threads());
    ASSERT_TRUE(original.analyze(a).status.ok());
    std::vector<std::vector<double>> truth, found(kClones);
    for (int k = 0; k < kClones; ++k) {
      Solver alone(test::two_threads());
      ASSERT_TRUE(alone.analyze(a).status.ok());
      truth.push_back(solved_by(alone, values_of(a, k), b));
    }
    std::vector<std::thread> threads;
    for (int k = 0; k < kClones; ++k)
      threads.emplace_back([&, k] {
        Solver clone = original.clone(1);  // at the same time as the others
        EXPECT_EQ(clone.state(), Solver::State::analyzed);
        for (int round = 0; round < 3; ++round)
          found[static_cast<std::size_t>(k)] = solved_by(clone, values_of(a, k), b);
      });
    for (std::thread& t : threads) t.join();
    for (std::size_t k = 0; k < kClones; ++k)
      EXPECT_EQ(std::memcmp(found[k].data(), truth[k].data(), b.size() * sizeof(double)), 0) << "clone " << k;
    EXPECT_EQ(original.state(), Solver::State::analyzed);
  }
}

TEST(Clone, OutlivesItsOriginalAndGoesItsOwnWay) {
  const SparseMatrix a = reference::random_system(200, 5, Values::positive, 5);
  const std::vector<double> b = reference::random_vector(a.rows, 6);
  auto original = std::make_unique<Solver>(test::two_threads());
  ASSERT_TRUE(original->analyze(a).status.ok());
  Solver clone = original->clone();
  EXPECT_EQ(clone.analysis().fronts, original->analysis().fronts);
  // The clone turns to ldlt; its original does not, even though it factorizes afterwards.
  std::vector<double> indefinite = a.values;
  for (double& v : indefinite) v = -v;
  const FactorResult turned = clone.refactorize(indefinite);
  ASSERT_TRUE(turned.status.ok()) << turned.status.message;
  EXPECT_EQ(turned.inertia.negative, a.rows);
  EXPECT_EQ(clone.analysis().kind, Kind::ldlt);
  EXPECT_EQ(original->analysis().kind, Kind::llt);
  (void)solved_by(*original, a.values, b);
  Solver second = original->clone();
  original.reset();
  const std::vector<double> x = solved_by(second, a.values, b);
  EXPECT_LE(reference::backward_error(a, b, x), 8 * test::kEps);
  EXPECT_EQ(second.analysis().kind, Kind::llt);
}

TEST(Clone, OfAnEmptySolverIsEmpty) {
  const Solver empty(test::two_threads());
  Solver clone = empty.clone();
  EXPECT_EQ(clone.state(), Solver::State::empty);
  EXPECT_EQ(clone.options().threads, 2);
  test::expect_solved(clone, reference::random_system(50, 4, Values::general, 7));
  EXPECT_THROW((void)empty.clone(-1), std::invalid_argument);
}

// Pivots that one factor has moved stay where they are in the analysis that others share.
TEST(Clone, MovedPivotsAreAFactorsOwnAffair) {
  // Tiny diagonals in a natural order: growth, or a vanishing pivot, in nearly every small front.
  SparseMatrix a = reference::random_system(200, 4, Values::indefinite, 1);
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      if (a.row_ind[static_cast<std::size_t>(q)] == c && c % 3 != 0) a.values[static_cast<std::size_t>(q)] *= 1e-9;
  Options options = test::two_threads();
  options.kind = Kind::ldlt;
  options.matching = false;
  options.permutation.resize(200);
  std::iota(options.permutation.begin(), options.permutation.end(), 0);
  Solver original(options);
  ASSERT_TRUE(original.analyze(a).status.ok());
  Solver first = original.clone(), second = original.clone();
  const FactorResult moved = first.refactorize(a.values);
  ASSERT_TRUE(moved.status.ok()) << moved.status.message;
  ASSERT_GT(moved.delayed, 0) << "no pivot was moved: the system tests nothing";
  const FactorResult again = second.refactorize(a.values);
  EXPECT_EQ(again.delayed, moved.delayed) << "it began with the tree of the analysis";
  EXPECT_EQ(again.inertia.negative, moved.inertia.negative);
}

TEST(Clone, ThroughC) {
  const SparseMatrix a = reference::random_system(100, 4, Values::positive, 9);
  espalier_matrix_i64 m{};
  m.size = sizeof m;
  m.rows = m.cols = a.rows;
  m.nonzeros = a.nonzeros();
  std::vector<std::int64_t> pointers(a.col_ptr.begin(), a.col_ptr.end()), indices(a.row_ind.begin(), a.row_ind.end());
  m.pointers = pointers.data();
  m.indices = indices.data();
  m.values = a.values.data();
  m.layout = ESPALIER_CSC;
  m.storage = ESPALIER_SYMMETRIC_LOWER;
  espalier_solver *s = nullptr, *c = nullptr;
  ASSERT_EQ(espalier_create(&s), ESPALIER_OK);
  ASSERT_EQ(espalier_clone(s, 0, &c), ESPALIER_OK) << "of a solver without analysis";
  espalier_destroy(c);
  ASSERT_EQ(espalier_analyze_i64(s, &m, nullptr), ESPALIER_OK);
  EXPECT_EQ(espalier_clone(nullptr, 0, &c), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_clone(s, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_clone(s, -1, &c), ESPALIER_MISUSE);
  EXPECT_EQ(c, nullptr);
  ASSERT_EQ(espalier_clone(s, 1, &c), ESPALIER_OK);
  espalier_destroy(s);
  EXPECT_EQ(espalier_refactorize(c, a.values.data(), a.nonzeros(), nullptr), ESPALIER_OK);
  const std::vector<double> b = reference::random_vector(a.rows, 3);
  std::vector<double> x(b.size());
  EXPECT_EQ(espalier_solve(c, b.data(), x.data(), 1, ESPALIER_NO_TRANSPOSE, nullptr), ESPALIER_OK);
  EXPECT_LE(reference::backward_error(a, b, x), 8 * test::kEps);
  espalier_destroy(c);
}

// What the caller has asked for is what he finds in the options, whatever became of it; and the next analysis looks
// for the devices again.
TEST(EffectiveDevice, StandsInTheResultNotInTheOptions) {
  test::FakeBackend fake;
  const device::Registry registry{{&device::registry().host(), &fake}, {}};
  solver::Session session(test::two_threads(), registry);
  const SparseMatrix a = reference::random_system(120, 4, Values::positive, 1);
  for (int round = 1; round <= 3; ++round) {
    SCOPED_TRACE(round);
    const int finds = fake.finds, asked = fake.asked;
    session.analyze(a.view());
    EXPECT_GT(fake.finds, finds) << "the devices were not looked for again";
    EXPECT_NE(session.analysis.device.find("fake"), std::string::npos) << session.analysis.device;
    session.factor->factorize(a.values);
    EXPECT_EQ(fake.asked, asked + 2) << "two devices, then one";
    const FactorResult& f = session.factor->result();
    EXPECT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(f.device, "the host: others have its memory");
    EXPECT_EQ(session.options.device, "auto");
    session.factor->factorize(a.values);
    EXPECT_EQ(fake.asked, asked + 2) << "the same analysis does not try again";
  }
  fake.works = true;  // the others are gone
  session.analyze(a.view());
  session.factor->factorize(a.values);
  EXPECT_NE(session.factor->result().device.find("fake"), std::string::npos) << session.factor->result().device;
}

}  // namespace clone_test
}  // namespace espalier
