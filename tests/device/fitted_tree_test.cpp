// Pivots that move up so that padded arrays are filled. Truth: the tree is valid for the same matrix (analysis/verify),
// and the sizes of all arrays, counted before and after.
#include "plan/fitted_tree.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "analysis/ordering.hpp"
#include "analysis/verify.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "matrix/generators/generate.hpp"
#include "parameters.hpp"
#include "plan/regions.hpp"

namespace espalier {
namespace fitted_tree_test {

struct Parameter {
  std::vector<std::string> words;
  Kind kind;
  friend void PrintTo(const Parameter& p, std::ostream* out) { test::print(*out, p.words, p.kind); }
};

class FittedTree : public ::testing::TestWithParam<Parameter> {
 protected:
  void SetUp() override {
    a_ = matrix::generate(matrix::parse_generator(GetParam().words), &pool_);
    graph_ = analysis::graph_of(a_, pool_);
    tree_ = analysis::build_tree(graph_, {}, pool_);
    options_ = device::cuda::cuda_plan_options(GetParam().kind);
  }
  // The elements of all factors of the plan's tree.
  [[nodiscard]] static Offset factor_elements(const plan::Plan& plan) {
    Offset sum = 0;
    for (const Offset size : plan::array_sizes(plan).factor) sum += size;
    return sum;
  }

  base::ThreadPool pool_{2};
  SparseMatrix a_;
  analysis::Graph graph_;
  analysis::AssemblyTree tree_;
  plan::PlanOptions options_;
};

TEST_P(FittedTree, TakesLessAndIsValid) {
  const std::vector<analysis::PivotMove> moves = plan::moves_that_fit(tree_, options_);
  ASSERT_FALSE(moves.empty());
  std::vector<Index> leaving(static_cast<std::size_t>(tree_.fronts()), 0);
  for (const analysis::PivotMove& m : moves) {
    Index f = 0;
    while (tree_.first[f + 1] <= m.position) ++f;
    EXPECT_EQ(m.front, tree_.parent[f]);
    ++leaving[static_cast<std::size_t>(f)];
  }
  for (Index f = 0; f < tree_.fronts(); ++f) {
    EXPECT_LE(leaving[static_cast<std::size_t>(f)], options_.tiles.panel / 2);
    EXPECT_LT(leaving[static_cast<std::size_t>(f)], tree_.pivots(f)) << "no front disappears";
  }

  plan::PlanOptions as_it_is = options_;
  as_it_is.ldlt = true;  // that is not fitted
  const plan::Plan before = plan::make_plan(tree_, a_, {}, as_it_is, pool_);
  const plan::Plan after = plan::make_plan(tree_, a_, {}, options_, pool_);
  EXPECT_EQ(before.tree.first, tree_.first);
  EXPECT_EQ(after.tree.parent, tree_.parent);
  EXPECT_NE(after.tree.first, tree_.first);
  EXPECT_EQ(analysis::verify_tree(graph_, after.tree), "");
  EXPECT_LT(factor_elements(after), factor_elements(before));
  EXPECT_TRUE(plan::moves_that_fit(after.tree, options_).empty()) << "a tree that is read again would change";
  EXPECT_LT(after.flops, 1.1 * before.flops * (options_.unsymmetric ? 2 : 1));
}

INSTANTIATE_TEST_SUITE_P(Systems, FittedTree,
                         ::testing::Values(Parameter{{"plate", "20", "20"}, Kind::llt},
                                           Parameter{{"poisson", "40", "40", "1"}, Kind::llt},
                                           Parameter{{"elasticity", "7"}, Kind::llt},
                                           Parameter{{"gyroscopic", "7"}, Kind::lu}));

}  // namespace fitted_tree_test
}  // namespace espalier
