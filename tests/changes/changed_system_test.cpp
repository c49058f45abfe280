// Truth: dense systems that are changed as said, solved by Eigen; eigenvalues for the inertia.
#include "espalier/changed_system.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "changes/dense_changes.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier::test {

namespace changed_system_test {

using namespace changed;

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
      columns.add_column(column, random_());
      rows.add_column(row, random_());
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
      columns.add_column(column, random_());
      rows.add_column(row, random_());
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
      of_u.add_column({u.begin() + k * n_, u.begin() + (k + 1) * n_}, random_());
      of_v.add_column({v.begin() + k * n_, v.begin() + (k + 1) * n_}, random_());
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

}  // namespace changed_system_test

}  // namespace espalier::test
