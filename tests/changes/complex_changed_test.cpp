// Changes around complex factors. Truth: dense matrices that are changed as said, solved by Eigen; eigenvalues for the
// inertia.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "changes/complex_changes.hpp"

namespace espalier::test {

namespace complex_changed_test {

using namespace complex_changes;

enum class Folds { never, by_itself, often };

/// Everything that can be done, in random order, and the dense matrix that it makes.
class RandomChanges {
 public:
  RandomChanges(const Given& given, Index n, unsigned seed, Folds folds, bool by_rows)
      : n_(n),
        dense_(random_dense(n, given.sort, seed)),
        solver_(factorized(sparse(by_rows ? Dense(dense_.transpose()) : dense_, given.storage), given.kind)),
        changed_(solver_, by_rows),
        random_(seed),
        folds_(folds),
        hermitian_(given.hermitian),
        inertia_(given.hermitian) {
    changed_.set_folding(folds == Folds::by_itself);
    EXPECT_EQ(changed_.hermitian(), given.hermitian);
  }

  void step() {
    switch (below(6)) {
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
    expect_solves();
    if (folds_ != Folds::often || below(3) != 0) return;
    const Status s = changed_.fold();
    if (s.ok()) {
      EXPECT_EQ(changed_.changes(), 0);
    } else {
      EXPECT_EQ(s.code, StatusCode::singular) << s.message;
      EXPECT_LT(smallest_over_largest(left()), 1e-13);
    }
    expect_solves();
  }
  [[nodiscard]] Index factorizations() const { return changed_.cost().factorizations; }
  [[nodiscard]] int solved() const { return solved_; }

 private:
  std::size_t below(std::size_t n) { return random_() % n; }
  [[nodiscard]] Index size() const { return static_cast<Index>(dense_.rows()); }
  [[nodiscard]] bool is_removed(Index v) const { return std::count(removed_.begin(), removed_.end(), v) > 0; }
  Dense mirrored(const Dense& m) const { return hermitian_ ? Dense(m.conjugate()) : m; }
  Dense columns(Index rows, Index count, bool sparse) {
    Dense m = random_columns(rows, count, static_cast<unsigned>(random_()));
    for (Index c = 0; c < count; ++c)
      for (Index i = 0; i < rows; ++i)
        if (sparse && below(4) != 0) m(i, c) = 0;
    return m;
  }
  [[nodiscard]] Dense left() const {
    std::vector<Index> kept;
    for (Index v = 0; v < size(); ++v)
      if (!is_removed(v)) kept.push_back(v);
    return dense_(kept, kept);
  }

  void add() {
    const bool both = below(3) != 0, sparse = below(2) == 0;
    const auto count = static_cast<Index>(1 + below(3));
    const Index rows = sparse ? size() : n_, first = size();
    const Dense u = columns(rows, count, sparse), w = both ? mirrored(u) : columns(rows, count, sparse);
    Dense corner = columns(count, count, false);
    if (both) corner = hermitian_ ? Dense(corner + corner.adjoint()) : Dense(corner + corner.transpose());
    const Status s =
        sparse ? changed_.add(Entries(u).view(), both ? ComplexSparseColumns{} : Entries(w).view(), numbers(corner))
               : changed_.add(numbers(u), count, both ? std::span<const Value>{} : numbers(w), numbers(corner));
    ASSERT_TRUE(s.ok()) << s.message;
    dense_.conservativeResizeLike(Dense::Zero(first + count, first + count));
    dense_.block(0, first, rows, count) = u;
    dense_.block(first, 0, count, rows) = w.transpose();
    dense_.bottomRightCorner(count, count) = corner;
    inertia_ = inertia_ && both;
  }
  void remove() {
    const auto v = static_cast<Index>(below(at(size())));
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
      if (const auto v = static_cast<Index>(below(at(size()))); std::count(list.begin(), list.end(), v) == 0)
        list.push_back(v);
    ASSERT_TRUE(changed_.flip(list).ok());
    for (const Index v : list)
      if (is_removed(v))
        removed_.erase(std::find(removed_.begin(), removed_.end(), v));
      else
        removed_.push_back(v);
  }
  void replace() {
    const bool both = below(3) != 0;
    std::vector<Index> list;
    for (int k = 0; k < 2; ++k)
      if (const auto v = static_cast<Index>(below(at(size()))); !is_removed(v) && (list.empty() || list[0] != v))
        list.push_back(v);
    if (list.empty()) return;
    Dense u = columns(size(), static_cast<Index>(list.size()), true);
    for (Index k = 0; k < u.cols(); ++k) u(list[at(k)], k) = hermitian_ ? Value(3) : Value(3, 1);
    Dense w = both ? mirrored(u) : columns(size(), static_cast<Index>(list.size()), true);
    for (Index k = 0; k < u.cols(); ++k) {
      const Value diagonal = u(list[at(k)], k);
      dense_.row(list[at(k)]) = w.col(k).transpose();
      dense_.col(list[at(k)]) = u.col(k);
      dense_(list[at(k)], list[at(k)]) = diagonal;
    }
    const Status s = changed_.replace(list, Entries(u).view(), both ? ComplexSparseColumns{} : Entries(w).view());
    ASSERT_TRUE(s.ok()) << s.message;
    inertia_ = inertia_ && both;
  }
  void add_low_rank() {
    const bool both = below(3) != 0, sparse = below(2) == 0;
    const auto rank = static_cast<Index>(1 + below(3));
    const Dense u = columns(n_, rank, sparse), v = both ? mirrored(u) : columns(n_, rank, sparse);
    Dense c = columns(rank, rank, false);
    if (both && below(4) != 0) c = hermitian_ ? Dense(c + c.adjoint()) : Dense(c + c.transpose());
    if (below(4) == 0) c.row(0).setZero(), c.col(0).setZero();  // of less than full rank
    const bool same = both && c == (hermitian_ ? Dense(c.adjoint()) : Dense(c.transpose()));
    const Status s =
        sparse ? changed_.add_low_rank(Entries(u).view(), numbers(c), both ? ComplexSparseColumns{} : Entries(v).view())
               : changed_.add_low_rank(numbers(u), rank, numbers(c), both ? std::span<const Value>{} : numbers(v));
    ASSERT_TRUE(s.ok()) << s.message;
    // It changes what A has now, replaced unknowns among it.
    dense_.topLeftCorner(n_, n_) += u * c * v.transpose();
    inertia_ = inertia_ && same;
  }

  void expect_solves() {
    ASSERT_EQ(changed_.size(), size());
    for (const Transpose how : {Transpose::no, Transpose::yes, Transpose::conjugate})
      if (!solves(how)) return;
    ++solved_;
    const Inertia inertia = changed_.inertia();
    if (!hermitian_) {
      EXPECT_EQ(inertia.positive, -1);
    } else if (inertia_) {
      ASSERT_GE(inertia.positive, 0);
      const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Dense>(left()).eigenvalues();
      EXPECT_EQ(inertia.positive, (values.array() > 0).count());
      EXPECT_EQ(inertia.negative, (values.array() < 0).count());
    }
  }
  bool solves(Transpose how) {
    const Dense m = op(left(), how), b = random_columns(size(), 2, 3);
    Dense x = b;
    const std::span<Value> both(x.data(), at(static_cast<Index>(x.size())));
    const ChangedSolveResult r = changed_.solve(both, both, 2, how);
    if (r.status.code == StatusCode::singular) {
      EXPECT_LT(smallest_over_largest(m), 1e-12);
      return false;
    }
    EXPECT_TRUE(r.status.ok()) << r.status.message;
    if (!r.status.ok()) return false;
    std::vector<Index> kept;
    for (Index v = 0; v < size(); ++v)
      if (!is_removed(v)) kept.push_back(v);
    for (const Index v : removed_) EXPECT_EQ(x.row(v).cwiseAbs().maxCoeff(), 0);
    const Dense found = x(kept, Eigen::all), given = b(kept, Eigen::all);
    double error = 0;
    for (Index c = 0; c < 2 && !kept.empty(); ++c) {
      const double scale = m.cwiseAbs().rowwise().sum().maxCoeff() * found.col(c).cwiseAbs().maxCoeff() +
                           given.col(c).cwiseAbs().maxCoeff();
      error = std::max(error, (given.col(c) - m * found.col(c)).cwiseAbs().maxCoeff() / scale);
    }
    EXPECT_LE(error, 100 * kEps);
    EXPECT_GE(r.backward_error, error / 4 - 2 * kEps) << "the reported error is too small";
    EXPECT_LE(r.backward_error, 10 * error + 4 * kEps);
    return !testing::Test::HasFailure();
  }

  Index n_;
  Dense dense_;
  ComplexSolver solver_;
  ComplexChangedSystem changed_;
  std::mt19937 random_;
  Folds folds_;
  bool hermitian_;  // what is left out is the conjugate
  bool inertia_;    // all that was said is Hermitian
  std::vector<Index> removed_;
  int solved_ = 0;
};

struct Count {
  Index factorizations = 0;
  int solved = 0;
};

Count change_at_random(unsigned seeds, Index n, Folds folds, int steps) {
  Count all;
  for (unsigned seed = 1; seed <= seeds; ++seed)
    for (const Given& given : kGiven)
      for (const bool by_rows : {false, true}) {
        if (testing::Test::HasFailure()) return all;
        const Index size = n > 0 ? n : static_cast<Index>(1 + (seed * 7) % 60);
        SCOPED_TRACE(testing::Message() << "seed " << seed << ", case " << &given - kGiven << ", n " << size
                                        << (by_rows ? ", by rows" : "") << ", folds " << static_cast<int>(folds));
        if (smallest_over_largest(random_dense(size, given.sort, seed)) < 1e-10) continue;
        RandomChanges changes(given, size, seed, folds, by_rows);
        for (int step = 0; step < steps && !testing::Test::HasFailure(); ++step) changes.step();
        all.factorizations += changes.factorizations();
        all.solved += changes.solved();
      }
  return all;
}

TEST(ComplexChanged, IsTheSystemThatWasChanged) { EXPECT_GT(change_at_random(12, 0, Folds::never, 8).solved, 1000); }

TEST(ComplexChanged, IsThatSystemWithFactorizationsInBetween) {
  EXPECT_GT(change_at_random(6, 0, Folds::often, 12).factorizations, 100);
  EXPECT_GT(change_at_random(2, 23, Folds::by_itself, 40).factorizations, 0);
}

// Real systems of twice the size, as GPUs get them.
TEST(ComplexChanged, IsThatSystemInRealForm) {
  const AsRealForm form;
  EXPECT_GT(change_at_random(3, 0, Folds::never, 8).solved, 200);
  EXPECT_GT(change_at_random(2, 0, Folds::often, 8).factorizations, 20);
}

}  // namespace complex_changed_test

}  // namespace espalier::test
