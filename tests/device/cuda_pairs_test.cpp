// Plans whose unknowns stand in pairs, as those of the real form of a complex system do. Truth: trees made by hand, and
// the plan of a matrix of which every entry has become a block of 2 x 2.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "analysis/ordering.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "device/cuda/tables/pairs.hpp"
#include "matrix/generators/generate.hpp"

namespace espalier {
namespace cuda_pairs_test {

using device::cuda::stands_in_pairs;

// Two fronts of a pair each; the first has the second's pair in its rows.
plan::Plan two_pairs() {
  plan::Plan p;
  p.tree.n = 4;
  p.tree.order = {2, 3, 0, 1};
  p.tree.first = {0, 2, 4};
  p.tree.parent = {1, -1};
  p.tree.row_ptr = {0, 2, 2};
  p.tree.rows = {2, 3};
  return p;
}

TEST(CudaPairs, AnythingOutOfPlaceIsSeen) {
  EXPECT_TRUE(stands_in_pairs(plan::Plan()));
  EXPECT_TRUE(stands_in_pairs(two_pairs()));
  plan::Plan p = two_pairs();
  p.tree.order = {3, 2, 0, 1};
  EXPECT_FALSE(stands_in_pairs(p)) << "the imaginary part comes first";
  p.tree.order = {1, 2, 3, 0};
  EXPECT_FALSE(stands_in_pairs(p)) << "parts of different numbers";
  p = two_pairs();
  p.tree.first = {0, 1, 4};
  EXPECT_FALSE(stands_in_pairs(p)) << "a pivot has moved alone";
  p = two_pairs();
  p.tree.row_ptr = {0, 1, 2};
  EXPECT_FALSE(stands_in_pairs(p));
  p = two_pairs();
  p.tree.rows = {3};
  EXPECT_FALSE(stands_in_pairs(p));
  p = two_pairs();
  p.tree.border = 2;
  EXPECT_FALSE(stands_in_pairs(p)) << "a border has no pairs";
}

// The lower triangle of `a` in blocks.
SparseMatrix in_blocks(const SparseMatrix& a) {
  SparseMatrix two;
  two.rows = two.cols = 2 * a.cols;
  two.storage = a.storage;
  two.col_ptr = {0};
  for (Index c = 0; c < 2 * a.cols; ++c) {
    for (auto q = static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(c / 2)]);
         q < static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(c / 2) + 1]); ++q)
      for (const Index part : {0, 1})
        if (const Index r = 2 * a.row_ind[q] + part; r >= c) two.row_ind.push_back(r);
    two.col_ptr.push_back(static_cast<Offset>(two.row_ind.size()));
  }
  two.values.assign(two.row_ind.size(), 1.0);
  return two;
}

TEST(CudaPairs, APlanKeepsThoseOfItsTree) {
  base::ThreadPool pool(2);
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    const SparseMatrix a =
        matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "7"}), &pool);
    ASSERT_EQ(a.storage, Storage::symmetric_lower);
    const analysis::AssemblyTree one = analysis::build_tree(analysis::graph_of(a, pool), {}, pool);
    analysis::AssemblyTree two;
    two.n = 2 * one.n;
    two.parent = one.parent;
    for (const Index c : one.order) two.order.insert(two.order.end(), {2 * c, 2 * c + 1});
    for (const Index r : one.rows) two.rows.append({2 * r, 2 * r + 1});
    for (const Index f : one.first) two.first.push_back(2 * f);
    for (const Offset r : one.row_ptr) two.row_ptr.push_back(2 * r);
    device::cuda::DeviceTuning tuning;
    tuning.narrow_rows = 300;
    const plan::Plan p =
        plan::make_plan(std::move(two), in_blocks(a), {}, device::cuda::cuda_plan_options(kind, tuning), pool);
    EXPECT_TRUE(stands_in_pairs(p));
  }
}

}  // namespace cuda_pairs_test
}  // namespace espalier
