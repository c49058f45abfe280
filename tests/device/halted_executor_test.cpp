// Factorizations that halt where pivots fail and go on in a changed plan. The truth is an executor that makes all of
// the final plan: same bits, same outcome.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <deque>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "analysis/ordering.hpp"
#include "analysis/relocation.hpp"
#include "device/host/host_executor.hpp"
#include "device/host/pivot_placement.hpp"
#include "matrix/row_index.hpp"
#include "plan/changed_plan.hpp"

namespace espalier::device::host {
namespace halted_executor_test {

constexpr PivotRule kRule{0.01, 1e-14, 0};

// A grid whose diagonal has small and large entries, some of them so small that pivots fail.
SparseMatrix weak_grid(Index width, Index height, Kind kind, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const Index n = width * height;
  const double weak = 1.0 / (2 + seed % 40);
  SparseMatrix a{n, n, {0}, {}, {}, kind == Kind::lu ? Storage::general : Storage::symmetric_lower};
  for (Index c = 0; c < n; ++c) {
    for (const Index r : {c - width, c - 1, c, c + 1, c + width}) {
      if (r < 0 || r >= n || (kind != Kind::lu && r < c)) continue;
      if ((r == c + 1 && r % width == 0) || (r == c - 1 && c % width == 0)) continue;
      a.row_ind.push_back(r);
      const bool is_weak = std::abs(uniform(random)) < weak;
      a.values.push_back(r == c ? (is_weak ? 1e-9 : 4) * uniform(random) : uniform(random));
    }
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

plan::PlanOptions random_options(Kind kind, std::mt19937& random) {
  const auto pick = [&](std::initializer_list<Index> list) { return *(list.begin() + random() % list.size()); };
  plan::PlanOptions o;
  o.tiles.whole_rows = pick({8, 32, 128});
  o.tiles.whole_pivots = std::min(pick({8, 32, 96}), o.tiles.whole_rows);
  o.tiles.max_block_size = pick({0, 16, 32});
  o.unsymmetric = kind == Kind::lu;
  o.ldlt = kind == Kind::ldlt;
  o.range_flops = static_cast<double>(pick({0, 10000, 100000}));
  o.group_entries = pick({0, 1000, 1 << 20});
  o.interleave = pick({1, 4});
  o.reuse_distance = pick({0, 1, 8});
  return o;
}

std::vector<double> solution(Executor<double>& executor, Index n) {
  std::vector<double> x(static_cast<std::size_t>(n));
  for (Index k = 0; k < n; ++k) x[static_cast<std::size_t>(k)] = 1.0 / (1 + k % 7);
  executor.solve(x.data(), 1, false);
  return x;
}

struct Counted {
  int changes = 0;        // plans that followed moved pivots
  int finished = 0;       // factorizations that were complete after that
  Index tasks = 0;        // of changed plans
  Index made = 0;         // of them, those that were carried out
  std::vector<double> x;  // of the last solution
};

// Moves pivots until none fails, or the plan would have to be made anew.
class Going {
 public:
  Going(const SparseMatrix& a, Kind kind, unsigned seed, int threads)
      : a_(a), kind_(kind), pool_(threads), rows_(matrix::index_rows(a, pool_)) {
    std::mt19937 random(seed);
    plans_.push_back(plan::make_plan(analysis::build_tree(analysis::graph_of(a, pool_), {}, pool_), a, {},
                                     random_options(kind, random), pool_, &rows_));
    HostOptions options;
    options.before_task = [this](Index, const plan::Task&) { ++made_; };
    executor_ = make_host_executor<double>({plans_.back(), kind, false, kRule, pool_, &budget_}, options);
    executor_->halt_at_failures(true);
  }

  void run(Counted& counted) {
    FactorOutcome outcome = executor_->factorize(a_.values);
    bool changed = false;
    while (outcome.halted && change_plan(outcome)) {
      made_ = 0;
      outcome = executor_->factorize(a_.values);
      changed = true;
      ++counted.changes;
      counted.made += made_;
      counted.tasks += static_cast<Index>(plans_.back().tasks.size());
    }
    if (!changed || outcome.halted) return;
    ++counted.finished;
    counted.x = solution(*executor_, a_.cols);
    expect_as_if_made_at_once(outcome, counted.x);
    // What was kept is forgotten: the next factorization makes everything.
    made_ = 0;
    EXPECT_EQ(executor_->factorize(a_.values).determinant_log, outcome.determinant_log);
    EXPECT_EQ(made_, static_cast<Index>(plans_.back().tasks.size()));
  }

 private:
  bool change_plan(const FactorOutcome& outcome) {
    std::vector<Index> failed = outcome.failed;
    failed.insert(failed.end(), outcome.replaced.begin(), outcome.replaced.end());
    std::sort(failed.begin(), failed.end());
    failed.erase(std::unique(failed.begin(), failed.end()), failed.end());
    const LeftContributions<double>* left = executor_->left_contributions();
    EXPECT_NE(left, nullptr);
    const auto moves =
        place_pivots(PlacementJob{plans_.back(), kind_, false, kRule, a_.values, pool_, &budget_, failed, left});
    if (!moves || moves->empty() || plans_.size() > 8) return false;
    analysis::AssemblyTree tree = plans_.back().tree;
    std::vector<Index> before = relocate_pivots(tree, *moves);
    auto next = plan::change_plan(plans_.back(), std::move(tree), std::move(before), a_, {}, rows_, pool_);
    if (!next) return false;
    plans_.push_back(std::move(next->plan));
    auto executor = executor_->with_changed_plan(plans_.back(), next->before);
    EXPECT_NE(executor, nullptr);
    executor_ = std::move(executor);
    return true;
  }

  void expect_as_if_made_at_once(const FactorOutcome& outcome, const std::vector<double>& x) {
    const auto all = make_host_executor<double>({plans_.back(), kind_, false, kRule, pool_, &budget_});
    const FactorOutcome expected = all->factorize(a_.values);
    EXPECT_EQ(outcome.negative, expected.negative);
    EXPECT_EQ(outcome.two_by_two, expected.two_by_two);
    EXPECT_EQ(outcome.replaced, expected.replaced);
    EXPECT_EQ(outcome.failed, expected.failed);
    EXPECT_EQ(outcome.determinant_sign, expected.determinant_sign);
    EXPECT_EQ(outcome.determinant_log, expected.determinant_log);
    const std::vector<double> y = solution(*all, a_.cols);
    EXPECT_EQ(std::memcmp(x.data(), y.data(), x.size() * sizeof(double)), 0);
  }

  const SparseMatrix& a_;
  Kind kind_;
  base::ThreadPool pool_;
  base::MemoryBudget budget_{"test"};
  matrix::RowIndex rows_;
  std::deque<plan::Plan> plans_;  // the executor refers to the last one
  std::atomic<Index> made_{0};
  std::unique_ptr<Executor<double>> executor_;
};

TEST(HaltedExecutor, MakesTheRestInAChangedPlanWithTheSameBits) {
  for (const Kind kind : {Kind::ldlt, Kind::lu}) {
    Counted all;
    for (unsigned seed = 0; seed < 150; ++seed) {
      SCOPED_TRACE(::testing::Message() << (kind == Kind::lu ? "lu" : "ldlt") << " seed " << seed);
      const SparseMatrix a = weak_grid(10 + static_cast<Index>(seed % 23), 15, kind, seed);
      std::vector<double> first;
      for (const int threads : {1, 3}) {
        Counted one;
        Going(a, kind, seed, threads).run(one);
        if (threads == 1)
          first = one.x;
        else
          EXPECT_EQ(one.x, first) << "threads change bits";
        all.changes += one.changes;
        all.finished += one.finished;
        all.tasks += one.tasks;
        all.made += one.made;
      }
      if (HasFailure()) return;
    }
    EXPECT_GT(all.finished, 60);
    EXPECT_GT(all.changes, 100);
    EXPECT_LT(all.made, all.tasks * 3 / 4);
  }
}

}  // namespace halted_executor_test
}  // namespace espalier::device::host
