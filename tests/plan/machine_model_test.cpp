// The machine model: its text, its tables, and what follows from them. Truth: the formulas written out with the numbers
// that plans were made with before the model existed (98f6ff2), bit for bit; operations counted one by one; chains
// found by walking up from every leaf.
#include "plan/machine_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "plan/front_cost.hpp"

namespace espalier::plan {
namespace {

TEST(MachineModel, TablesGiveTheTimesThatPlansWereMadeWith) {
  for (const Index rows : {1, 7, 64, 1000, 30000})
    for (const Index pivots : {1, rows / 3 + 1, rows})
      for (const bool lu : {false, true}) {
        const double flops = front_flops(pivots, rows, lu), r = rows;
        EXPECT_EQ(front_seconds(pivots, rows, lu, host_thread()), 1.5e-6 + flops / 6e10 * (1 + 300.0 / r));
        EXPECT_EQ(front_seconds(pivots, rows, lu, h200()), 5e-7 + flops / 4e13 * (1 + 1800.0 / r));
      }
  EXPECT_EQ(h200().tasks_at_once(), 264);
}

// Trees with random parents and sizes.
analysis::AssemblyTree random_tree(Index fronts, unsigned seed) {
  std::mt19937 random(seed);
  analysis::AssemblyTree tree;
  tree.first = {0};
  tree.row_ptr = {0};
  for (Index f = 0; f < fronts; ++f) {
    const auto pick = [&](Index least, Index most) {
      return std::uniform_int_distribution<Index>(least, most)(random);
    };
    tree.parent.push_back(f + 1 == fronts ? -1 : pick(f + 1, fronts - 1));
    tree.first.push_back(tree.first.back() + pick(1, 200));
    tree.row_ptr.push_back(tree.row_ptr.back() + (f + 1 == fronts ? 0 : pick(1, 300)));
  }
  tree.n = tree.first.back();
  return tree;
}

TEST(MachineModel, WholeFactorizationsAreSumsOverTheTreeAndChainsAreTheLongestPath) {
  for (const unsigned seed : {1U, 2U, 3U})
    for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
      const analysis::AssemblyTree tree = random_tree(60, seed);
      double work = 0;
      Index longest = 0;
      for (Index f = 0; f < tree.fronts(); ++f) {
        const Index rows = tree.pivots(f) + tree.rows_below(f);
        const double here = front_flops(tree.pivots(f), rows, kind == Kind::lu);
        work += 1e-7 + here / 4e13 * (1 + 1800.0 / rows);
        Index path = 0;
        for (Index g = f; g >= 0; g = tree.parent[g]) path += tree.pivots(g);
        longest = std::max(longest, path);
      }
      const double pivot = kind == Kind::lu ? 9e-7 : kind == Kind::ldlt ? 4.3e-7 : 5.5e-7;
      const GpuTime t = gpu_time(tree, kind, false, h200());
      EXPECT_EQ(t.work_seconds, work) << "seed " << seed;
      EXPECT_NEAR(t.chain_seconds, pivot * longest, 1e-12 * t.chain_seconds) << "seed " << seed;
      for (const int n : {1, 2, 8})
        EXPECT_EQ(t.on(n), t.chain_seconds + work / n * (1 + 0.04 * (n - 1)) + 2e-5 * n + 4e-5 * std::log2(n));
    }
}

TEST(MachineModel, AHostIsBoundByItsThreadsOrByTheLongestPath) {
  bool by_path = false, by_work = false;
  for (const unsigned seed : {1U, 2U, 3U})
    for (const Kind kind : {Kind::llt, Kind::lu})
      for (const bool single : {false, true})
        for (const int threads : {1, 2, 64}) {
          const analysis::AssemblyTree tree = random_tree(60, seed);
          const auto time = [&](Index f) {
            const Index rows = tree.pivots(f) + tree.rows_below(f);
            return 1.5e-6 +
                   front_flops(tree.pivots(f), rows, kind == Kind::lu) / (single ? 12e10 : 6e10) * (1 + 300.0 / rows);
          };
          double work = 0, longest = 0;
          for (Index f = 0; f < tree.fronts(); ++f) {
            work += time(f);
            double path = 0;
            for (Index g = f; g >= 0; g = tree.parent[g]) {
              const double share = (tree.pivots(g) + tree.rows_below(g)) / 160.0;
              path += time(g) / std::clamp(share, 1.0, static_cast<double>(threads));
            }
            longest = std::max(longest, path);
          }
          const double expected = std::max(work / threads, longest);
          (longest > work / threads ? by_path : by_work) = true;
          EXPECT_NEAR(host_seconds(tree, kind, single, threads, host_thread()), expected, 1e-12 * expected);
        }
  EXPECT_TRUE(by_path && by_work);
}

// A front of L L^T, eliminated on paper: a root, the quotients below it, and a product and a difference for every entry
// of the lower triangle that is left.
TEST(MachineModel, FlopsOfAFrontAreThoseCountedInItsElimination) {
  for (const Index rows : {1, 5, 40})
    for (const Index pivots : {Index{1}, (rows + 1) / 2, rows}) {
      long long operations = 0;
      for (Index k = 0; k < pivots; ++k) {
        ++operations;
        for (Index j = k + 1; j < rows; ++j) {
          ++operations;
          for (Index i = j; i < rows; ++i) operations += 2;
        }
      }
      EXPECT_EQ(front_flops(pivots, rows, false), static_cast<double>(operations)) << pivots << " of " << rows;
      EXPECT_EQ(front_flops(pivots, rows, true), static_cast<double>(2 * operations)) << pivots << " of " << rows;
    }
}

std::vector<double> numbers_of(MachineModel model) {
  std::vector<double> numbers;
  for (const NamedRate& r : rates_of(model)) numbers.push_back(*r.rate);
  return numbers;
}

TEST(MachineModel, EveryRateCanBeGivenAndChangesNothingElse) {
  for (const bool on_gpu : {false, true}) {
    MachineModel table = on_gpu ? h200() : host_thread();
    const std::vector<double> before = numbers_of(table);
    const std::vector<NamedRate> names = rates_of(table);
    for (std::size_t k = 0; k < names.size(); ++k) {
      Machine given = machine_with((on_gpu ? "gpu." : "host.") + names[k].key + "=12345");
      EXPECT_EQ(numbers_of(on_gpu ? given.host : given.gpu), numbers_of(on_gpu ? host_thread() : h200()));
      MachineModel& model = on_gpu ? given.gpu : given.host;
      std::vector<double> expected = before;
      expected[k] = 12345;
      EXPECT_EQ(numbers_of(model), expected) << names[k].key;
      const std::vector<NamedRate> now = rates_of(model);
      for (std::size_t j = 0; j < now.size(); ++j)
        EXPECT_EQ(now[j].rate->source, j == k ? Rate::Source::caller : Rate::Source::table) << now[j].key;
    }
  }
}

TEST(MachineModel, SeveralRatesInOneTextAndTheLastOneCounts) {
  const Machine m = machine_with("gpu.flops=2e13,host.pivot.lu=1e-6,gpu.flops=1e13");
  EXPECT_EQ(m.gpu.flops, 1e13);
  EXPECT_EQ(m.host.pivot.of(Kind::lu), 1e-6);
  const double work = front_seconds(100, 100, false, h200()) - h200().dealt_front;
  EXPECT_NEAR(front_seconds(100, 100, false, m.gpu), m.gpu.dealt_front + 4 * work, 1e-12 * work);
}

TEST(MachineModel, TextsThatSayNothingAreRefusedByName) {
  const auto message = [](const std::string& text) -> std::string {
    try {
      (void)machine_with(text);
    } catch (const Error& e) {
      EXPECT_EQ(e.status().code, StatusCode::invalid_input);
      return e.what();
    }
    return "accepted";
  };
  EXPECT_NE(message("gpu.speed=1").find("no rate 'gpu.speed'; the rates are host.flops"), std::string::npos);
  EXPECT_NE(message("flops=1e13").find("no rate 'flops'"), std::string::npos);
  for (const char* text :
       {"gpu.flops", "gpu.flops=", "gpu.flops=x", "gpu.flops=0", "gpu.flops=-1", "gpu.flops=nan", "gpu.flops=inf",
        "gpu.flops=1e13x", "gpu.flops=1e13,", ",", "gpu.start=-1e-9", "gpu.multiprocessors=0", "gpu.blocks=1e300"})
    EXPECT_NE(message(text).find("is not understood; give"), std::string::npos) << text << ": " << message(text);
  EXPECT_EQ(message("gpu.start=0"), "accepted");
}

}  // namespace
}  // namespace espalier::plan
