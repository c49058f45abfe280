// Bodies that change step by step. Truth: nodes are coupled where they share an element, found by hand.
#include "matrix/generators/changing_body.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

namespace espalier::matrix {
namespace changing_body_test {

constexpr Index kBricks = 5, kNodes = kBricks + 1;

Index node_at(Index x, Index y, Index z) { return (x * kNodes + y) * kNodes + z; }

using Pairs = std::set<std::pair<Index, Index>>;  // of nodes, the larger first

/// Nodes that share an element of those that `alive` has.
template <class Alive>
Pairs coupled(const Alive& alive) {
  Pairs found;
  for (Index x = 0; x < kBricks; ++x)
    for (Index y = 0; y < kBricks; ++y)
      for (Index z = 0; z < kBricks; ++z)
        for (Index a = 0; a < 8 && alive(x, y, z); ++a)
          for (Index b = 0; b < 8; ++b) {
            const Index u = node_at(x + a / 4, y + a / 2 % 2, z + a % 2);
            const Index v = node_at(x + b / 4, y + b / 2 % 2, z + b % 2);
            if (u > v) found.emplace(u, v);
          }
  return found;
}

/// By its matrix, in which all three unknowns of two nodes are coupled, or none.
Pairs coupled_in(const SparseMatrix& a) {
  Pairs found;
  std::vector<Index> neighbours(static_cast<std::size_t>(a.cols), 0);
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const Index r = a.row_ind[static_cast<std::size_t>(q)];
      if (r / 3 != c / 3) found.emplace(r / 3, c / 3);
      if (r == c) continue;
      EXPECT_EQ(a.values[static_cast<std::size_t>(q)], -1);
      ++neighbours[static_cast<std::size_t>(r)];
      ++neighbours[static_cast<std::size_t>(c)];
    }
  for (Index c = 0; c < a.cols; ++c)
    EXPECT_GT(a.values[static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(c)])],
              neighbours[static_cast<std::size_t>(c)]);
  return found;
}

Pairs whole() {
  return coupled([](Index, Index, Index) { return true; });
}

TEST(ChangingBody, BeginsWhole) {
  for (const BodyChange sort : {BodyChange::elements, BodyChange::crack, BodyChange::remesh})
    EXPECT_EQ(coupled_in(ChangingBody(sort, kBricks, 0.05, 1).matrix()), whole());
}

TEST(ChangingBody, CracksGrowRowByRow) {
  ChangingBody body(BodyChange::crack, kBricks, 0.01, 1);  // 2 of 216 nodes a step
  Index failed = 0;
  for (int step = 0; step < 15; ++step) {
    body.change();
    failed = std::min<Index>(failed + 2, kBricks * kBricks - kBricks);
    EXPECT_EQ(coupled_in(body.matrix()),
              coupled([&](Index x, Index y, Index z) { return x != kBricks / 2 || y * kBricks + z >= failed; }))
        << step;
  }
  ChangingBody fast(BodyChange::crack, kBricks, 0.5, 1);  // no more than a row at a time
  fast.change();
  EXPECT_EQ(coupled_in(fast.matrix()), coupled([&](Index x, Index y, Index) { return x != kBricks / 2 || y > 0; }));
}

TEST(ChangingBody, ElementsGoInClustersAndComeBack) {
  ChangingBody body(BodyChange::elements, kBricks, 0.08, 1);  // 17 of 216 nodes: clusters of 2^3
  const Pairs all = whole();
  Pairs before = all;
  std::set<Pairs> seen;
  for (int step = 0; step < 20; ++step) {
    body.change();
    const Pairs now = coupled_in(body.matrix());
    EXPECT_TRUE(std::includes(all.begin(), all.end(), now.begin(), now.end())) << "nothing else is coupled";
    seen.insert(now);
    before = now;
  }
  EXPECT_GT(seen.size(), 10U);
  EXPECT_GT(before.size(), all.size() * 3 / 4) << "a twentieth of the body is out at a time";
}

TEST(ChangingBody, ContactsSlide) {
  ChangingBody body(BodyChange::contacts, kBricks, 0.1, 1);  // 21 springs at most
  const Pairs all = whole();
  std::set<std::pair<Index, Index>> ever;
  for (int step = 0; step < 12; ++step) {
    std::size_t springs = 0;
    for (const auto& [u, v] : coupled_in(body.matrix())) {
      if (all.count({u, v}) > 0) continue;
      ++springs;
      ever.emplace(u, v);
      EXPECT_EQ(u / (kNodes * kNodes), kBricks) << "a node of the last face";
      EXPECT_EQ(v / (kNodes * kNodes), kBricks - 2) << "two layers away";
      EXPECT_EQ(u % kNodes, v % kNodes);
      EXPECT_LE((v / kNodes) % kNodes, std::min(kBricks, (u / kNodes) % kNodes + 1));
    }
    if (step == 0) {
      EXPECT_GE(springs, 5U) << "it begins in contact";
    }
    EXPECT_LE(springs, 21U);
    body.change();
  }
  EXPECT_GT(ever.size(), 21U) << "some have gone";
}

TEST(ChangingBody, RemeshingKeepsTheSize) {
  ChangingBody body(BodyChange::remesh, kBricks, 0.1, 1);
  const Pairs all = whole();
  for (int step = 0; step < 5; ++step) {
    body.change();
    const Pairs now = coupled_in(body.matrix());
    EXPECT_EQ(now.size(), all.size()) << "the same mesh, other nodes";
    EXPECT_NE(now, all);
  }
}

}  // namespace changing_body_test
}  // namespace espalier::matrix
