// Patterns that are declared entry by entry and in blocks of vertices. Truth: a set of pairs.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <stdexcept>
#include <utility>

#include "dynamics/dae/pattern.hpp"

namespace espalier::dynamics {
namespace pattern_builder_test {

using Entries = std::set<std::pair<Index, Index>>;  // column, row

Entries entries_of(const SparsePattern& p) {
  Entries entries;
  for (std::size_t j = 0; j + 1 < p.ptr.size(); ++j)
    for (Offset e = p.ptr[j]; e < p.ptr[j + 1]; ++e) {
      const Index row = p.ind[static_cast<std::size_t>(e)];
      EXPECT_TRUE(e == p.ptr[j] || p.ind[static_cast<std::size_t>(e) - 1] < row) << j;  // sorted and unique
      entries.emplace(static_cast<Index>(j), row);
    }
  return entries;
}

// Vertices in a chain; those that `linked` of them follow share an element.
struct Pairs {
  std::vector<Offset> ptr{0};
  std::vector<Index> ind;
  Pairs(Index vertices, Index linked) {
    for (Index b = 0; b < vertices; ++b) {
      for (Index a = std::max(0, b - linked); a <= std::min(vertices - 1, b + linked); ++a) ind.push_back(a);
      ptr.push_back(static_cast<Offset>(ind.size()));
    }
  }
};

TEST(PatternBuilder, VerticesEntriesAndDiagonalTogether) {
  constexpr Index kSize = 3 * 1500 + 10 + 3 * 40 + 5;
  const Pairs large(1500, 2), small(40, 5);
  const Index first_large = 7, first_small = first_large + 3 * 1500 + 2;
  for (const bool diagonal : {false, true}) {
    Entries truth;
    PatternBuilder builder(kSize, kSize, true);
    if (diagonal) builder.add_diagonal();
    for (Index i = 0; diagonal && i < kSize; ++i) truth.emplace(i, i);
    const auto add_pairs = [&](Index first, const Pairs& pairs) {
      builder.add_vertex_pairs(first, pairs.ptr, pairs.ind);
      for (std::size_t b = 0; b + 1 < pairs.ptr.size(); ++b)
        for (Offset e = pairs.ptr[b]; e < pairs.ptr[b + 1]; ++e)
          for (Index i = 0; i < 9; ++i)
            truth.emplace(first + 3 * static_cast<Index>(b) + i / 3,
                          first + 3 * pairs.ind[static_cast<std::size_t>(e)] + i % 3);
    };
    add_pairs(first_large, large);
    add_pairs(first_small, small);
    EXPECT_EQ(builder.declared(), 9 * static_cast<Offset>(large.ind.size() + small.ind.size()));
    std::mt19937 generator(3);
    std::uniform_int_distribution<Index> any(-1, kSize - 1);  // -1: the ground
    for (int k = 0; k < 5000; ++k) {
      const Index row = any(generator), column = any(generator) / 20 * 20;
      builder.add(row, column);
      if (row >= 0 && column >= 0) truth.emplace(column, row);
    }
    // Long lists, one with rows of the ground and with some twice; short ones.
    for (const Index length : {100, 7, 40}) {
      std::vector<Index> rows, columns;
      for (Index k = 0; k < length; ++k) rows.push_back(any(generator)), columns.push_back(any(generator) / 9);
      rows.push_back(rows.front());
      const Offset before = builder.declared();
      builder.add_block(rows, columns);
      Offset pairs = 0;
      for (const Index row : rows)
        for (const Index column : columns)
          if (row >= 0 && column >= 0) truth.emplace(column, row), ++pairs;
      EXPECT_EQ(builder.declared() - before, pairs);
    }
    EXPECT_EQ(entries_of(builder.build()), truth);
    for (const int threads : {1, 3}) {
      base::ThreadPool pool(threads);
      const SparsePattern p = builder.build(&pool);
      EXPECT_EQ(p.ind, builder.build().ind);
      EXPECT_EQ(p.ptr, builder.build().ptr);
    }
  }
}

TEST(PatternBuilder, EmptyOnesAndMistakes) {
  PatternBuilder none(0, 0, true);
  none.add_diagonal();
  EXPECT_EQ(none.build().nonzeros(), 0);
  const Pairs pairs(4, 1);
  PatternBuilder builder(13, 13, true);
  builder.add_vertex_pairs(0, {}, {});
  EXPECT_THROW(builder.add_vertex_pairs(2, pairs.ptr, pairs.ind), std::logic_error);  // beyond the last column
  builder.add_vertex_pairs(1, pairs.ptr, pairs.ind);
  EXPECT_THROW(builder.add_vertex_pairs(1, pairs.ptr, pairs.ind), std::logic_error);
  std::vector<Index> many(50, 3);
  many.back() = 13;  // beyond the last row
  EXPECT_THROW(builder.add_block(many, std::vector<Index>{2}), std::logic_error);
  many.back() = 4;
  EXPECT_THROW(builder.add_block(many, std::vector<Index>{13}), std::logic_error);
  PatternBuilder by_rows(13, 13, false);
  EXPECT_THROW(by_rows.add_vertex_pairs(0, pairs.ptr, pairs.ind), std::logic_error);
}

}  // namespace pattern_builder_test
}  // namespace espalier::dynamics
