// verify_tree() names every damage of a tree. Truth: a tree that is written down, with one promise of assembly_tree.hpp
// broken at a time.
#include "analysis/verify.hpp"

#include <gtest/gtest.h>

#include <initializer_list>
#include <string>

#include "analysis/graphs.hpp"

namespace espalier::analysis {
namespace {

namespace verify_test {

using namespace testing;

//        4: 5 6
//      2: 2 3   3: 4
//   0: 0  1: 1           front: its pivots, by position; unknown k stands at position 6 - k
Graph graph() { return graph_of_edges(7, {{6, 4}, {6, 1}, {5, 3}, {4, 3}, {4, 1}, {3, 0}, {2, 0}, {1, 0}}); }

AssemblyTree tree() {
  AssemblyTree t{7, 0, {6, 5, 4, 3, 2, 1, 0}, {0, 1, 2, 4, 5, 7}, {2, 2, 4, 4, -1}, {0, 2, 3, 5, 6, 6}, {}};
  for (const Index row : {2, 5, 3, 5, 6, 6}) t.rows.push_back(row);
  return t;
}

void set_rows(AssemblyTree& t, std::initializer_list<Index> rows) {
  t.rows.resize(0);
  for (const Index row : rows) t.rows.push_back(row);
}

template <class Damage>
std::string named(Damage&& damage) {
  AssemblyTree t = tree();
  damage(t);
  return verify_tree(graph(), t);
}

TEST(VerifyTree, TakesWhatIsRight) { EXPECT_EQ(verify_tree(graph(), tree()), ""); }

TEST(VerifyTree, NamesSizesAndNumbersThatDoNotFit) {
  EXPECT_EQ(named([](auto& t) { t.n = 6; }), "n is 6, the graph has 7");
  EXPECT_EQ(named([](auto& t) { t.order.push_back(0); }), "n is 7, the graph has 7");
  EXPECT_EQ(named([](auto& t) { t.order[3] = 4; }), "order is no permutation: 4");
  EXPECT_EQ(named([](auto& t) { t.order[3] = 7; }), "order is no permutation: 7");
  EXPECT_EQ(named([](auto& t) { t.order[3] = -1; }), "order is no permutation: -1");
  EXPECT_EQ(named([](auto& t) { t.parent.assign(8, -1); }), "8 fronts for 7 unknowns");
  EXPECT_EQ(named([](auto& t) { t.first.pop_back(); }), "array sizes do not fit");
  EXPECT_EQ(named([](auto& t) { t.row_ptr.push_back(6); }), "array sizes do not fit");
  EXPECT_EQ(named([](auto& t) { t.first[0] = 1; }), "the fronts do not cover all positions");
  EXPECT_EQ(named([](auto& t) { t.first[5] = 6; }), "the fronts do not cover all positions");
  EXPECT_EQ(named([](auto& t) { t.row_ptr[0] = 1; }), "row_ptr does not fit");
  EXPECT_EQ(named([](auto& t) { t.rows.push_back(6); }), "row_ptr does not fit");
  EXPECT_EQ(named([](auto& t) { t.first[2] = 1; }), "front 1 has no pivots");
  EXPECT_EQ(named([](auto& t) { t.row_ptr[2] = 1; }), "front 1: row_ptr falls");
}

TEST(VerifyTree, NamesParentsOutOfPlace) {
  EXPECT_EQ(named([](auto& t) { t.parent[1] = 1; }), "front 1 has the parent 1");
  EXPECT_EQ(named([](auto& t) { t.parent[1] = 5; }), "front 1 has the parent 5");
  EXPECT_EQ(named([](auto& t) { t.parent[1] = -2; }), "front 1 has the parent -2");
  EXPECT_EQ(named([](auto& t) { t.parent[2] = -1; }), "the root 2 has rows below");
  EXPECT_EQ(named([](auto& t) { t.parent[1] = 4; }), "front 1 below 4 is out of postorder");
  EXPECT_EQ(named([](auto& t) { t.parent[0] = 3; }), "front 2 below 4 is out of postorder");
}

TEST(VerifyTree, NamesRowsOutOfPlace) {
  EXPECT_EQ(named([](auto& t) {
              set_rows(t, {5, 2, 3, 5, 6, 6});
            }),
            "the rows of front 0 do not rise above its pivots");
  EXPECT_EQ(named([](auto& t) {
              set_rows(t, {2, 2, 3, 5, 6, 6});
            }),
            "the rows of front 0 do not rise above its pivots");
  EXPECT_EQ(named([](auto& t) {
              set_rows(t, {2, 5, 3, 5, 5, 6});
            }),
            "the rows of front 2 do not rise above its pivots");
  EXPECT_EQ(named([](auto& t) {
              set_rows(t, {2, 5, 3, 5, 7, 6});
            }),
            "the rows of front 2 do not rise above its pivots");
  EXPECT_EQ(named([](auto& t) {
              set_rows(t, {2, 5, 1, 5, 6, 6});
            }),
            "the rows of front 1 do not rise above its pivots");
  EXPECT_EQ(named([](auto& t) { set_rows(t, {1, 5, 3, 5, 6, 6}); }), "row 1 of front 0 belongs to no ancestor");
  EXPECT_EQ(named([](auto& t) { set_rows(t, {2, 4, 3, 5, 6, 6}); }), "row 4 of front 0 is missing in its parent 2");
}

TEST(VerifyTree, NamesEntriesWithoutAPlace) {
  EXPECT_EQ(named([](auto& t) {
              set_rows(t, {2, 5, 3, 5, 6});
              t.row_ptr = {0, 2, 3, 5, 5, 5};
            }),
            "the entry (0, 2) has no row in front 3");
  EXPECT_EQ(named([](auto& t) { set_rows(t, {2, 6, 3, 5, 6, 6}); }), "the entry (1, 6) has no row in front 0");
}

}  // namespace verify_test

}  // namespace
}  // namespace espalier::analysis
