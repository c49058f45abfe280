// Truth: dense systems that are changed as said, solved by Eigen; eigenvalues for the inertia.
#include "espalier/changed_system.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "changes/dense_changes.hpp"
#include "solver/gpu_fixture.hpp"

namespace espalier::test {

namespace {

using namespace changed;

/// Columns of entries, with the rows of each in a random order and one of them in two parts.
struct Entries {
  std::vector<Offset> ptr{0};
  std::vector<Index> rows;
  std::vector<double> values;

  void put(const std::vector<double>& column, std::uint64_t seed) {
    std::vector<Index> order;
    for (std::size_t i = 0; i < column.size(); ++i)
      if (column[i] != 0) order.push_back(static_cast<Index>(i));
    std::shuffle(order.begin(), order.end(), std::mt19937_64(seed));
    for (std::size_t k = 0; k < order.size(); ++k) {
      const double v = column[at(order[k])];
      rows.push_back(order[k]);
      values.push_back(k == 0 ? v / 2 : v);
    }
    if (!order.empty()) {
      rows.push_back(order.front());
      values.push_back(column[at(order.front())] / 2);
    }
    ptr.push_back(static_cast<Offset>(rows.size()));
  }
  [[nodiscard]] SparseColumns columns() const { return {ptr, rows, values}; }
};

enum class Folds { never, by_itself, often };

/// Everything that can be done, in random order, and the dense matrix that it makes.
class RandomChanges {
 public:
  RandomChanges(const SparseMatrix& a, Kind kind, std::uint64_t seed, Folds folds, const std::string& device)
      : n_(a.cols), solver_(factorized(a, kind, device)), changed_(solver_), dense_(a), random_(seed), folds_(folds) {
    symmetric_ = kind != Kind::lu;
    changed_.set_folding(folds == Folds::by_itself);
  }

  void step() {
    switch (random_() % 6) {
      case 0:
        add();
        break;
      case 1:
        remove();
        break;
      case 2:
        restore();
        break;
      case 3:
        replace();
        break;
      case 4:
        flip();
        break;
      default:
        add_low_rank();
    }
    expect_solves(changed_, dense_, removed_, symmetric_);
    if (folds_ == Folds::often && random_() % 3 == 0) {
      const Status s = changed_.fold();
      const SparseMatrix left = dense_.without(removed_);
      if (!s.ok()) {
        EXPECT_EQ(s.code, StatusCode::singular) << s.message;
        EXPECT_FALSE(reference::condition(left) < 1e13);
      } else {
        EXPECT_EQ(changed_.changes(), 0);
      }
      expect_solves(changed_, dense_, removed_, symmetric_);
    }
  }
  [[nodiscard]] Index factorizations() const { return changed_.cost().factorizations; }

 private:
  [[nodiscard]] bool is_removed(Index v) const {
    return std::find(removed_.begin(), removed_.end(), v) != removed_.end();
  }
  void put_back(Index v) { removed_.erase(std::find(removed_.begin(), removed_.end(), v)); }
  [[nodiscard]] Index any() { return static_cast<Index>(random_() % at(dense_.n)); }
  std::vector<double> vector(Index size, bool sparse) {
    std::vector<double> v = reference::random_vector(size, random_());
    for (double& x : v)
      if (sparse && random_() % 4 != 0) x = 0;
    return v;
  }

  void add() {
    const bool both = random_() % 3 != 0, sparse = random_() % 2 == 0;
    const auto count = static_cast<Index>(1 + random_() % 3);
    const Index size = sparse ? dense_.n : n_;
    std::vector<double> u, other, corner = vector(count * count, false);
    Entries columns, rows;
    for (Index k = 0; k < count; ++k) {
      const std::vector<double> column = vector(size, sparse), row = both ? column : vector(size, sparse);
      columns.put(column, random_());
      rows.put(row, random_());
      u.insert(u.end(), column.begin(), column.end());
      other.insert(other.end(), row.begin(), row.end());
      for (Index j = 0; j < k && both; ++j) corner[at(j * count + k)] = corner[at(k * count + j)];
    }
    const Status s = sparse ? changed_.add(columns.columns(), both ? SparseColumns{} : rows.columns(), corner)
                            : changed_.add(u, count, both ? std::span<const double>{} : other, corner);
    ASSERT_TRUE(s.ok()) << s.message;
    dense_.grow(count);
    const Index first = dense_.n - count;
    for (Index k = 0; k < count; ++k) {
      for (Index v = 0; v < size; ++v) {
        dense_.entry(v, first + k) = u[at(k) * at(size) + at(v)];
        dense_.entry(first + k, v) = other[at(k) * at(size) + at(v)];
      }
      for (Index j = 0; j < count; ++j) dense_.entry(first + j, first + k) = corner[at(k * count + j)];
    }
    symmetric_ = symmetric_ && both;
  }
  void remove() {
    const Index v = any();
    const bool gone = is_removed(v);
    EXPECT_EQ(changed_.remove(std::vector<Index>{v}).ok(), !gone);
    if (!gone) removed_.push_back(v);
  }
  void restore() {
    if (removed_.empty()) return;
    ASSERT_TRUE(changed_.restore(std::vector<Index>{removed_.front()}).ok());
    removed_.erase(removed_.begin());
  }
  void flip() {
    std::vector<Index> list;
    for (int k = 0; k < 5; ++k)
      if (const Index v = any(); std::find(list.begin(), list.end(), v) == list.end()) list.push_back(v);
    ASSERT_TRUE(changed_.flip(list).ok());
    for (const Index v : list)
      if (is_removed(v))
        put_back(v);
      else
        removed_.push_back(v);
    for (const Index v : list) EXPECT_EQ(changed_.removed(v), is_removed(v));
  }
  void replace() {
    const bool both = random_() % 3 != 0;
    std::vector<Index> list;
    for (int k = 0; k < 2; ++k)
      if (const Index v = any(); !is_removed(v) && (list.empty() || list.front() != v)) list.push_back(v);
    Entries columns, rows;
    for (const Index v : list) {
      std::vector<double> column = vector(dense_.n, true), row = both ? column : vector(dense_.n, true);
      column[at(v)] = 3;
      columns.put(column, random_());
      rows.put(row, random_());
      for (Index i = 0; i < dense_.n; ++i) {
        dense_.entry(v, i) = row[at(i)];
        dense_.entry(i, v) = column[at(i)];
      }
    }
    const Status s = changed_.replace(list, columns.columns(), both ? SparseColumns{} : rows.columns());
    ASSERT_TRUE(s.ok()) << s.message;
    symmetric_ = symmetric_ && (both || list.empty());
  }
  void add_low_rank() {
    const bool both = random_() % 3 != 0, sparse = random_() % 2 == 0;
    const auto rank = static_cast<Index>(1 + random_() % 3);
    const std::vector<double> u = vector(n_ * rank, sparse), v = both ? u : vector(n_ * rank, sparse);
    std::vector<double> c = vector(rank * rank, false);
    for (Index i = 0; i < rank && both; ++i)
      for (Index j = 0; j < i; ++j) c[at(j * rank + i)] = c[at(i * rank + j)];
    Entries of_u, of_v;
    for (Index k = 0; k < rank; ++k) {
      of_u.put({u.begin() + k * n_, u.begin() + (k + 1) * n_}, random_());
      of_v.put({v.begin() + k * n_, v.begin() + (k + 1) * n_}, random_());
    }
    const Status s = sparse ? changed_.add_low_rank(of_u.columns(), c, both ? SparseColumns{} : of_v.columns())
                            : changed_.add_low_rank(u, rank, c, both ? std::span<const double>{} : v);
    ASSERT_TRUE(s.ok()) << s.message;
    for (Index i = 0; i < rank; ++i)
      for (Index j = 0; j < rank; ++j)
        for (Index r = 0; r < n_; ++r)
          for (Index k = 0; k < n_; ++k)
            dense_.entry(r, k) += u[at(i * n_ + r)] * c[at(j * rank + i)] * v[at(j * n_ + k)];
    symmetric_ = symmetric_ && both;
  }

  Index n_;
  Solver solver_;
  ChangedSystem changed_;
  Dense dense_;
  std::mt19937_64 random_;
  Folds folds_;
  std::vector<Index> removed_;
  bool symmetric_ = false;
};

// @returns factorizations of changed matrices
Index change_at_random(const SparseMatrix& a, Kind kind, std::uint64_t seed, Folds folds = Folds::never, int steps = 8,
                       const std::string& device = "cpu") {
  SCOPED_TRACE(testing::Message() << "seed " << seed << ", folds " << static_cast<int>(folds));
  RandomChanges changes(a, kind, seed, folds, device);
  for (int step = 0; step < steps && !testing::Test::HasFailure(); ++step) changes.step();
  return changes.factorizations();
}

Index all_kinds_at_random(std::uint64_t seeds, Folds folds, int steps, const std::string& device = "cpu") {
  Index folded = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const auto n = static_cast<Index>(12 + 9 * seed);
    const auto one = [&](const SparseMatrix& a, Kind kind) {
      folded += change_at_random(a, kind, seed, folds, steps, device);
    };
    one(reference::random_system(n, 3, reference::Values::positive, seed), Kind::llt);
    one(reference::stored_as(reference::random_system(n, 3, reference::Values::positive, seed),
                             Storage::symmetric_upper),
        Kind::automatic);
    one(reference::random_system(n, 3, reference::Values::indefinite, seed), Kind::ldlt);
    one(reference::stored_as(reference::random_system(n, 3, reference::Values::indefinite, seed), Storage::general),
        Kind::ldlt);
    one(reference::random_system(n, 3, reference::Values::general, seed), Kind::lu);
    one(reference::saddle_point(n, n / 4, seed), Kind::ldlt);
  }
  return folded;
}

TEST(ChangedSystem, IsTheSystemThatWasChanged) { (void)all_kinds_at_random(8, Folds::never, 8); }

// Factors of the changed matrix in between, in which what is removed is an identity and comes back as a new column.
TEST(ChangedSystem, IsThatSystemWithFactorizationsInBetween) {
  EXPECT_GT(all_kinds_at_random(6, Folds::often, 12), 50);
  EXPECT_GT(all_kinds_at_random(2, Folds::by_itself, 60), 0);
}

class ChangedSystemOnGpu : public OnGpu {};

// Columns stay on the device.
TEST_F(ChangedSystemOnGpu, IsTheSystemThatWasChanged) {
  (void)all_kinds_at_random(3, Folds::never, 8, "gpu:0");
  EXPECT_GT(all_kinds_at_random(2, Folds::often, 10, "gpu:0"), 5);
}

// The solver's factor goes first.
TEST_F(ChangedSystemOnGpu, OutlivesTheColumnsOfAnotherFactor) {
  const SparseMatrix a = reference::random_system(2000, 6, reference::Values::positive, 1);
  Solver solver = factorized(a, Kind::llt, "gpu:0");
  ChangedSystem changed(solver);
  std::vector<double> b = reference::random_vector(a.cols, 1), x(b.size());
  std::vector<Index> list;
  for (Index v = 0; v < 70; ++v) list.push_back(17 * v);
  ASSERT_TRUE(changed.flip(list).ok());
  ASSERT_TRUE(changed.solve(b, x).status.ok());
  ASSERT_TRUE(solver.analyze(reference::random_system(50, 3, reference::Values::positive, 1)).status.ok());
  EXPECT_THROW((void)changed.solve(b, x), std::logic_error);
  ASSERT_TRUE(solver.analyze(a).status.ok());
  ASSERT_TRUE(solver.factorize(a).status.ok());
  changed.reset();
  ASSERT_TRUE(changed.solve(b, x).status.ok());
}

TEST(ChangedSystem, ConstraintsOfKktSystemsComeAndGo) {
  const SparseMatrix a = reference::saddle_point(60, 10, 4);
  Solver solver = factorized(a, Kind::ldlt);
  ChangedSystem changed(solver);
  Dense dense(a);
  std::vector<double> g(at(a.cols), 0.0);
  for (Index v = 0; v < a.cols; ++v)
    if (dense.entry(v, v) > 0) g[at(v)] = v % 7 == 0 ? 1 : 0;
  ASSERT_TRUE(changed.add(g, 1).ok());
  EXPECT_EQ(changed.inertia().positive, 60);
  EXPECT_EQ(changed.inertia().negative, 11);
  for (Index v = 0; v < a.cols; ++v)
    if (dense.entry(v, v) == 0) {
      ASSERT_TRUE(changed.remove(std::vector<Index>{v}).ok());  // a multiplier
      break;
    }
  EXPECT_EQ(changed.inertia().positive, 60);
  EXPECT_EQ(changed.inertia().negative, 10);
  // The same constraint twice is one too many.
  ASSERT_TRUE(changed.add(g, 1).ok());
  EXPECT_EQ(changed.inertia().zero, 1);
  std::vector<double> b(at(changed.size()), 1.0), x(b.size());
  EXPECT_EQ(changed.solve(b, x).status.code, StatusCode::singular);
  ASSERT_TRUE(changed.remove(std::vector<Index>{changed.size() - 1}).ok());
  EXPECT_TRUE(changed.solve(b, x).status.ok());
}

TEST(ChangedSystem, ASingularChangeIsSaid) {
  const SparseMatrix a = reference::from_triples(2, {{0, 0, 2.0}, {1, 1, 3.0}}, Storage::symmetric_lower);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  ASSERT_TRUE(changed.add_low_rank(std::vector<double>{1, 0}, 1, std::vector<double>{-2.0}).ok());  // row 0 is gone
  std::vector<double> b{1, 1}, x(2);
  EXPECT_EQ(changed.solve(b, x).status.code, StatusCode::singular);
  EXPECT_EQ(changed.inertia().zero, 1);
  EXPECT_EQ(changed.inertia().positive, 1);
}

// An equation that says nothing beside one that says something: the condensed rows are [x 0; 0 0].
TEST(ChangedSystem, AnEmptyRowBesideOthersIsSingular) {
  const SparseMatrix a = reference::random_system(20, 3, reference::Values::positive, 1);
  Solver solver = factorized(a, Kind::llt);
  for (const bool first : {true, false}) {
    ChangedSystem changed(solver);
    const std::vector<double> nothing(20, 0.0), something = reference::random_vector(20, 4);
    ASSERT_TRUE(changed.add(first ? nothing : something, 1).ok());
    ASSERT_TRUE(changed.add(first ? something : nothing, 1).ok());
    std::vector<double> b(22, 1.0), x(22);
    EXPECT_EQ(changed.solve(b, x).status.code, StatusCode::singular) << first;
  }
}

TEST(ChangedSystem, ChangesOfNothingAndSingularCores) {
  const SparseMatrix a = reference::random_system(20, 3, reference::Values::positive, 1);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  Dense dense(a);
  expect_solves(changed, dense, {}, true);
  ASSERT_TRUE(changed.add_low_rank(std::vector<double>(40, 0.0), 2).ok());
  expect_solves(changed, dense, {}, true);
  ASSERT_TRUE(changed.add_low_rank(reference::random_vector(40, 1), 2, std::vector<double>(4, 0.0)).ok());
  expect_solves(changed, dense, {}, true);
  changed.reset();
  EXPECT_EQ(changed.changes(), 0);
}

/// |M x - b| of the changed matrix without its removed rows, as expect_solves() forms it.
double error_beside(Dense& dense, const std::vector<Index>& removed, const std::vector<double>& b,
                    const std::vector<double>& x) {
  std::vector<double> b_left, x_left;
  for (Index v = 0; v < dense.n; ++v)
    if (std::find(removed.begin(), removed.end(), v) == removed.end()) {
      b_left.push_back(b[at(v)]);
      x_left.push_back(x[at(v)]);
    }
  return reference::backward_error(dense.without(removed), b_left, x_left);
}

/// With a large diagonal, so that it stays regular without some rows and columns.
SparseMatrix unsymmetric(Index n, std::uint64_t seed) {
  SparseMatrix a =
      reference::stored_as(reference::random_system(n, 4, reference::Values::positive, seed), Storage::general);
  const std::vector<double> other = reference::random_vector(static_cast<Index>(a.nonzeros()), seed);
  for (Index c = 0; c < n; ++c)
    for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q)
      if (a.row_ind[at(q)] != c) a.values[at(q)] *= other[at(q)];
  return a;
}

// One by one, each with a solve, around one factor; beside a factor of the changed matrix.
TEST(ChangedSystem, AHundredFlipsLoseNothing) {
  const std::vector<std::pair<SparseMatrix, Kind>> cases{
      {reference::random_system(400, 4, reference::Values::positive, 3), Kind::llt},
      {reference::random_system(400, 4, reference::Values::indefinite, 4), Kind::ldlt},
      {reference::saddle_point(300, 60, 5), Kind::ldlt},
      {unsymmetric(400, 6), Kind::lu}};
  for (const auto& [a, kind] : cases) {
    SCOPED_TRACE(testing::Message() << "kind " << static_cast<int>(kind));
    Solver solver = factorized(a, kind);
    ChangedSystem changed(solver);
    changed.set_folding(false);
    Dense dense(a);
    std::vector<Index> removed;
    std::mt19937_64 random(9);
    std::vector<double> b = reference::random_vector(a.cols, 1), x(b.size()), y(b.size());
    int solved = 0;
    for (int k = 0; k < 100; ++k) {
      const auto v = static_cast<Index>(random() % at(a.cols));
      ASSERT_TRUE(changed.flip(std::vector<Index>{v}).ok());
      if (changed.removed(v))
        removed.push_back(v);
      else
        removed.erase(std::find(removed.begin(), removed.end(), v));
      const ChangedSolveResult r = changed.solve(b, x);
      if (r.status.code == StatusCode::singular) continue;  // constraints of which too few unknowns are left
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_EQ(r.cost.factorizations, 0);
      ++solved;
    }
    EXPECT_GT(solved, 80);
    const double error = error_beside(dense, removed, b, x);
    const Status s = changed.fold();
    if (s.code == StatusCode::singular) continue;
    ASSERT_TRUE(s.ok()) << s.message;
    ASSERT_TRUE(changed.solve(b, y).status.ok());
    EXPECT_EQ(changed.cost().factorizations, 1);
    EXPECT_LE(error, 10 * error_beside(dense, removed, b, y) + kEps);
  }
}

// What a batch costs, and when it is cheaper to factorize: counted, so that it does not depend on the clock.
TEST(ChangedSystem, FactorizesWhereThatIsCheaper) {
  const SparseMatrix a = reference::random_system(1200, 12, reference::Values::positive, 3);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  std::vector<double> b = reference::random_vector(a.cols, 1), x(b.size());
  std::vector<Index> few{1, 2, 3}, many;
  for (Index v = 10; v < 400; ++v) many.push_back(v);
  ASSERT_TRUE(changed.remove(few).ok());
  const ChangedSolveResult first = changed.solve(b, x);
  ASSERT_TRUE(first.status.ok()) << first.status.message;
  EXPECT_EQ(first.cost.factorizations, 0);
  EXPECT_EQ(first.cost.columns, 3);
  EXPECT_GT(first.cost.factorization, first.cost.changes);
  ASSERT_TRUE(changed.restore(few).ok());
  ASSERT_TRUE(changed.remove(few).ok());
  EXPECT_EQ(changed.solve(b, x).cost.columns, 3) << "columns of what came back are there";
  changed.set_folding(false);
  ASSERT_TRUE(changed.remove(many).ok());
  EXPECT_EQ(changed.changes(), 393);
  const ChangedSolveResult by_columns = changed.solve(b, x);
  ASSERT_TRUE(by_columns.status.ok()) << by_columns.status.message;
  EXPECT_EQ(by_columns.cost.columns, 393);
  EXPECT_GT(by_columns.cost.changes, by_columns.cost.factorization);
  std::vector<double> y(x.size());
  changed.set_folding(true);
  ASSERT_TRUE(changed.flip(std::vector<Index>{500}).ok());
  ASSERT_TRUE(changed.flip(std::vector<Index>{500}).ok());
  const ChangedSolveResult folded = changed.solve(b, y);
  ASSERT_TRUE(folded.status.ok()) << folded.status.message;
  EXPECT_EQ(folded.cost.factorizations, 1);
  EXPECT_EQ(folded.cost.columns, 0);
  EXPECT_EQ(changed.changes(), 0);
  for (std::size_t k = 0; k < x.size(); ++k) EXPECT_NEAR(x[k], y[k], 1e-10 * (1 + std::abs(x[k])));
  EXPECT_EQ(solver.values(), a.values) << "the solver's own factor stays";
}

TEST(ChangedSystem, SingularChangesLeaveEverythingUsable) {
  const SparseMatrix a = reference::random_system(30, 3, reference::Values::positive, 1);
  Solver solver = factorized(a, Kind::llt);
  for (const bool folds : {false, true}) {
    ChangedSystem changed(solver);
    Dense dense(a);
    const std::vector<double> nothing(30, 0.0);
    ASSERT_TRUE(changed.remove(std::vector<Index>{4}).ok());
    ASSERT_TRUE(changed.add(nothing, 1).ok());  // an equation that says nothing
    dense.grow(1);
    std::vector<double> b(31, 1.0), x(31);
    const Status s = folds ? changed.fold() : changed.prepare();
    EXPECT_EQ(s.code, StatusCode::singular) << s.message;
    EXPECT_EQ(changed.solve(b, x).status.code, StatusCode::singular);
    ASSERT_TRUE(changed.remove(std::vector<Index>{30}).ok());
    expect_solves(changed, dense, {4, 30}, true);
  }
}

// Threads add in the same order.
TEST(ChangedSystem, BitsDoNotDependOnThreads) {
  const SparseMatrix a = reference::random_system(900, 5, reference::Values::indefinite, 7);
  std::vector<double> first;
  for (const int threads : {1, 2, 3}) {
    Options o;
    o.threads = threads;
    o.device = "cpu";
    Solver solver(o);
    ASSERT_TRUE(solver.analyze(a).status.ok());
    ASSERT_TRUE(solver.factorize(a).status.ok());
    ChangedSystem changed(solver);
    std::vector<Index> list;
    for (Index v = 0; v < 40; ++v) list.push_back(13 * v);
    ASSERT_TRUE(changed.flip(list).ok());
    const std::vector<double> b = reference::random_vector(3 * a.cols, 1);
    std::vector<double> x(b.size());
    ASSERT_TRUE(changed.solve(b, x, 3).status.ok());
    if (first.empty()) first = x;
    EXPECT_EQ(first, x) << threads;
  }
}

TEST(ChangedSystem, MisuseAndBadNumbersAreErrors) {
  const SparseMatrix a = reference::random_system(10, 3, reference::Values::positive, 1);
  Solver empty;
  EXPECT_THROW(ChangedSystem{empty}, std::logic_error);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  std::vector<double> u(10, 1.0), x(10);
  EXPECT_THROW((void)changed.add(u, 2), std::invalid_argument);
  EXPECT_THROW((void)changed.add(u, 0), std::invalid_argument);
  EXPECT_THROW((void)changed.add_low_rank(u, 1, u), std::invalid_argument);
  EXPECT_THROW((void)changed.solve(u, std::span(x).first(9)), std::invalid_argument);
  EXPECT_EQ(changed.remove(std::vector<Index>{3, 3}).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.remove(std::vector<Index>{10}).row, 10);
  EXPECT_EQ(changed.restore(std::vector<Index>{2}).code, StatusCode::invalid_input);
  u[4] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(changed.add(u, 1).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.add_low_rank(u, 1).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.size(), 10);
  EXPECT_EQ(changed.solve(u, x).status.row, 4);
  EXPECT_EQ(changed.flip(std::vector<Index>{-1}).row, -1);
  EXPECT_EQ(changed.flip(std::vector<Index>{2, 2}).row, 2);
  EXPECT_THROW((void)changed.removed(10), std::out_of_range);
  Entries one, other;
  one.put(std::vector<double>(10, 1.0), 1);
  other.put(u, 1);
  EXPECT_EQ(changed.add(other.columns()).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.add_low_rank(other.columns()).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.replace(std::vector<Index>{3}, other.columns()).row, 4);
  EXPECT_EQ(changed.replace(std::vector<Index>{10}, one.columns()).row, 10);
  EXPECT_THROW((void)changed.replace(std::vector<Index>{3, 4}, one.columns()), std::invalid_argument);
  EXPECT_THROW((void)changed.add(SparseColumns{}), std::invalid_argument);
  one.rows.back() = 10;
  EXPECT_EQ(changed.add(one.columns()).row, 10);
  one.rows.back() = 0;
  one.ptr.back() -= 1;
  EXPECT_EQ(changed.add(one.columns()).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.changes(), 0);
  ASSERT_TRUE(solver.factorize(a).status.ok());
  EXPECT_THROW((void)changed.solve(x, x), std::logic_error);
  changed.reset();
  EXPECT_TRUE(changed.solve(x, x).status.ok());
}

}  // namespace

}  // namespace espalier::test
