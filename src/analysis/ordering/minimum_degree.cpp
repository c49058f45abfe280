#include "analysis/ordering/minimum_degree.hpp"

#include <bit>
#include <cstdint>

#include "base/at.hpp"

namespace espalier::analysis {

namespace {

/// Adjacency of the inner vertices as rows of bits; the weight of a row is counted by classes of equal weight.
class BitGraph {
 public:
  explicit BitGraph(const HaloGraph& g) : words_((g.weight.size() + 63) / 64), bits_(at(g.inner) * words_, 0) {
    for (Index v = 0; v < g.inner; ++v)
      for (Index k = g.ptr[at(v)]; k < g.ptr[at(v) + 1]; ++k) set(row(v), g.adj[at(k)]);
    for (std::size_t v = 0; v < g.weight.size(); ++v) set(class_of(g.weight[v]), static_cast<Index>(v));
  }

  /// Joins the neighbours of v to each other and takes v out. touched: its inner neighbours.
  void eliminate(Index v, Index inner, std::vector<Index>& touched) {
    touched.clear();
    const std::uint64_t* mine = row(v);
    for (std::size_t w = 0; w < (at(inner) + 63) / 64; ++w)
      for (std::uint64_t rest = mine[w]; rest != 0; rest &= rest - 1) {
        const auto u = static_cast<Index>(64 * w) + std::countr_zero(rest);
        if (u >= inner) break;
        touched.push_back(u);
      }
    for (const Index u : touched) {
      std::uint64_t* theirs = row(u);
      for (std::size_t w = 0; w < words_; ++w) theirs[w] |= mine[w];
      clear(theirs, u);
      clear(theirs, v);
    }
  }

  [[nodiscard]] Index degree(Index v) const {
    const std::uint64_t* mine = bits_.data() + at(v) * words_;
    Index sum = 0;
    for (const Class& c : classes_) {
      Index count = 0;
      for (std::size_t w = 0; w < words_; ++w) count += std::popcount(mine[w] & c.members[w]);
      sum += count * c.weight;
    }
    return sum;
  }

 private:
  struct Class {
    Index weight;
    std::vector<std::uint64_t> members;
  };
  static void set(std::uint64_t* bits, Index k) { bits[at(k) / 64] |= std::uint64_t{1} << (at(k) % 64); }
  static void clear(std::uint64_t* bits, Index k) { bits[at(k) / 64] &= ~(std::uint64_t{1} << (at(k) % 64)); }
  std::uint64_t* row(Index v) { return bits_.data() + at(v) * words_; }
  std::uint64_t* class_of(Index weight) {
    for (Class& c : classes_)
      if (c.weight == weight) return c.members.data();
    classes_.push_back({weight, std::vector<std::uint64_t>(words_, 0)});
    return classes_.back().members.data();
  }

  std::size_t words_;
  std::vector<std::uint64_t> bits_;
  std::vector<Class> classes_;
};

}  // namespace

std::vector<Index> minimum_degree(const HaloGraph& graph) {
  BitGraph bits(graph);
  std::vector<Index> degree(at(graph.inner)), order, left(at(graph.inner)), touched;
  for (Index v = 0; v < graph.inner; ++v) {
    degree[at(v)] = bits.degree(v);
    left[at(v)] = v;
  }
  while (!left.empty()) {
    std::size_t best = 0;
    for (std::size_t k = 1; k < left.size(); ++k) {
      const Index d = degree[at(left[k])], least = degree[at(left[best])];
      if (d < least || (d == least && left[k] < left[best])) best = k;
    }
    const Index v = left[best];
    left[best] = left.back();
    left.pop_back();
    order.push_back(v);
    bits.eliminate(v, graph.inner, touched);
    for (const Index u : touched) degree[at(u)] = bits.degree(u);
  }
  return order;
}

}  // namespace espalier::analysis
