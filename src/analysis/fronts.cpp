#include "analysis/fronts.hpp"

#include <algorithm>
#include <atomic>
#include <numeric>

#include "analysis/elimination_tree.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

namespace {

double seconds_of(double width, double below, const AmalgamationCost& cost) {
  const bool whole = width + below <= cost.whole_rows && width <= cost.whole_pivots;
  return cost.front + (whole ? 0 : cost.tiled) + cost.entry * front_entries(width, below) +
         cost.contribution * 0.5 * below * (below + 1) +
         cost.flop * front_flops(width, below) * (1 + cost.narrow / width);
}

/// Children of each front as linked lists in rising order; the list of the roots stands last.
struct Children {
  std::vector<Index> head, next;
  explicit Children(std::span<const Index> parent) : head(parent.size() + 1, -1), next(parent.size(), -1) {
    for (auto f = static_cast<Index>(parent.size()) - 1; f >= 0; --f) {
      const std::size_t p = parent[at(f)] < 0 ? parent.size() : at(parent[at(f)]);
      next[at(f)] = head[p];
      head[p] = f;
    }
  }
};

/// The working state of amalgamate(): fronts merge into their parents; `into[f]` says where f went (itself: it stays).
class Merger {
 public:
  Merger(const FrontTree& tree, const AmalgamationCost& cost)
      : tree_(tree),
        cost_(cost),
        children_(tree.parent),
        width_(tree.width),
        seconds_(tree.width.size()),
        into_(tree.width.size()),
        kept_(tree.width.size()) {
    std::iota(into_.begin(), into_.end(), 0);
  }

  void run() {
    for (Index f = 0; f < tree_.fronts(); ++f) absorb_children(f);
    join_roots();
  }

  [[nodiscard]] FrontTree result();

 private:
  void absorb_children(Index f);
  void join_roots();
  [[nodiscard]] std::vector<Index> stack_order();

  const FrontTree& tree_;
  const AmalgamationCost& cost_;
  Children children_;
  std::vector<Index> width_;
  std::vector<double> seconds_;
  std::vector<Index> into_;
  std::vector<std::vector<Index>> kept_;  // children that stay fronts, and those of the absorbed ones
};

void Merger::absorb_children(Index f) {
  seconds_[at(f)] = seconds_of(width_[at(f)], tree_.below[at(f)], cost_);
  std::vector<Index>& kept = kept_[at(f)];
  for (Index c = children_.head[at(f)]; c >= 0; c = children_.next[at(c)]) kept.push_back(c);
  // Children with the most rows go first: they add the fewest zeros. An absorbed child hands on its own children.
  std::stable_sort(kept.begin(), kept.end(), [&](Index a, Index b) {
    return tree_.below[at(a)] + width_[at(a)] > tree_.below[at(b)] + width_[at(b)];
  });
  std::vector<Index> stay;
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const Index c = kept[k];
    const Index width = width_[at(f)] + width_[at(c)];
    const double merged = seconds_of(width, tree_.below[at(f)], cost_);
    if (merged > seconds_[at(f)] + seconds_[at(c)]) {
      stay.push_back(c);
      continue;
    }
    into_[at(c)] = f;
    width_[at(f)] = width;
    seconds_[at(f)] = merged;
    auto& handed = kept_[at(c)];
    if (handed.size() > stay.size()) std::swap(handed, stay);
    stay.insert(stay.end(), handed.begin(), handed.end());
    handed = {};
  }
  kept = std::move(stay);
}

/// A root joins the next one while both together are tiny.
void Merger::join_roots() {
  constexpr Index kWidth = 8;  // a dense block of 8 holds 4.5 entries per column: memory for a diagonal matrix
  Index open = -1;
  for (Index root = children_.head.back(); root >= 0; root = children_.next[at(root)]) {
    if (open >= 0 && width_[at(open)] + width_[at(root)] <= kWidth) {
      into_[at(open)] = root;
      width_[at(root)] += width_[at(open)];
      kept_[at(root)].insert(kept_[at(root)].end(), kept_[at(open)].begin(), kept_[at(open)].end());
      kept_[at(open)] = {};
    }
    open = root;
  }
}

/// The fronts that stay, in postorder; the child whose sub-tree needs most beyond what it leaves goes first.
std::vector<Index> Merger::stack_order() {
  const auto block = [](double rows) { return 0.5 * rows * (rows + 1); };
  std::vector<double> peak(tree_.width.size(), 0);
  const auto leaves = [&](Index f) { return block(tree_.below[at(f)]); };
  for (Index f = 0; f < tree_.fronts(); ++f) {
    if (into_[at(f)] != f) continue;
    auto& kept = kept_[at(f)];
    std::stable_sort(kept.begin(), kept.end(),
                     [&](Index a, Index b) { return peak[at(a)] - leaves(a) > peak[at(b)] - leaves(b); });
    double stacked = 0, most = 0;
    for (const Index c : kept) {
      most = std::max(most, stacked + peak[at(c)]);
      stacked += leaves(c);
    }
    peak[at(f)] = std::max(most, stacked + block(width_[at(f)] + tree_.below[at(f)]));
  }
  std::vector<Index> order, stack;
  std::vector<std::size_t> taken(tree_.width.size(), 0);
  for (Index root = children_.head.back(); root >= 0; root = children_.next[at(root)]) {
    if (into_[at(root)] != root) continue;
    stack.push_back(root);
    while (!stack.empty()) {
      const Index f = stack.back();
      const std::size_t k = taken[at(f)]++;
      if (k < kept_[at(f)].size()) {
        stack.push_back(kept_[at(f)][k]);
      } else {
        order.push_back(f);
        stack.pop_back();
      }
    }
  }
  return order;
}

FrontTree Merger::result() {
  const std::vector<Index> order = stack_order();
  std::vector<Index> place(tree_.width.size(), -1);  // of each old front
  for (std::size_t k = 0; k < order.size(); ++k) place[at(order[k])] = static_cast<Index>(k);
  for (Index f = tree_.fronts() - 1; f >= 0; --f)
    if (into_[at(f)] != f) place[at(f)] = place[at(into_[at(f)])];
  FrontTree out;
  const std::size_t fronts = order.size();
  out.parent.resize(fronts);
  out.width.resize(fronts);
  out.below.resize(fronts);
  out.first.assign(fronts + 1, 0);
  for (std::size_t k = 0; k < fronts; ++k) {
    const std::size_t f = at(order[k]);
    out.parent[k] = tree_.parent[f] < 0 ? -1 : place[at(tree_.parent[f])];
    out.width[k] = width_[f];
    out.below[k] = tree_.below[f];
  }
  for (Index f = 0; f < tree_.fronts(); ++f)
    out.first[at(place[at(f)]) + 1] += tree_.first[at(f) + 1] - tree_.first[at(f)];
  std::partial_sum(out.first.begin(), out.first.end(), out.first.begin());
  out.order.resize(tree_.order.size());
  std::vector<Index> next(out.first.begin(), out.first.end() - 1);
  for (Index f = 0; f < tree_.fronts(); ++f)  // old fronts in rising order: descendants before ancestors
    for (Index v = tree_.first[at(f)]; v < tree_.first[at(f) + 1]; ++v)
      out.order[at(next[at(place[at(f)])]++)] = tree_.order[at(v)];
  return out;
}

}  // namespace

double front_entries(double width, double below) { return width * below + 0.5 * width * (width + 1); }

double front_flops(double width, double below) {
  // sum over k = 1 .. width of (below + k)^2
  return width * below * below + below * width * (width + 1) + width * (width + 1) * (2 * width + 1) / 6;
}

FrontTree fundamental_supernodes(std::span<const Index> parent, std::span<const Index> weight,
                                 std::span<const Index> count) {
  const auto n = static_cast<Index>(parent.size());
  std::vector<Index> children(parent.size(), 0), front(parent.size());
  for (const Index p : parent)
    if (p >= 0) ++children[at(p)];
  FrontTree tree;
  tree.order.resize(parent.size());
  std::iota(tree.order.begin(), tree.order.end(), 0);
  for (Index j = 0; j < n; ++j) {
    const bool joins =
        j > 0 && parent[at(j - 1)] == j && children[at(j)] == 1 && count[at(j)] == count[at(j - 1)] - weight[at(j - 1)];
    if (!joins) {
      tree.first.push_back(j);
      tree.width.push_back(0);
      tree.below.push_back(0);
      tree.parent.push_back(-1);
    }
    front[at(j)] = static_cast<Index>(tree.width.size()) - 1;
    tree.width.back() += weight[at(j)];
    tree.below.back() = count[at(j)] - weight[at(j)];
  }
  tree.first.push_back(n);
  for (Index f = 0; f < tree.fronts(); ++f) {
    const Index p = parent[at(tree.first[at(f) + 1] - 1)];
    tree.parent[at(f)] = p < 0 ? -1 : front[at(p)];
  }
  return tree;
}

FrontTree amalgamate(const FrontTree& tree, const AmalgamationCost& cost) {
  Merger merger(tree, cost);
  merger.run();
  return merger.result();
}

namespace {

/// Fronts by height above the leaves, lowest first: those of one height do not depend on each other.
std::vector<std::vector<Index>> heights(const FrontTree& tree) {
  std::vector<Index> height(tree.parent.size(), 0);
  std::vector<std::vector<Index>> out;
  for (Index f = 0; f < tree.fronts(); ++f) {
    const auto h = at(height[at(f)]);
    if (h >= out.size()) out.resize(h + 1);
    out[h].push_back(f);
    if (tree.parent[at(f)] >= 0)
      height[at(tree.parent[at(f)])] = std::max(height[at(tree.parent[at(f)])], height[at(f)] + 1);
  }
  return out;
}

}  // namespace

std::vector<Index> front_rows(const Graph& graph, const FrontTree& tree, std::span<const Offset> row_ptr,
                              std::span<Index> rows, base::ThreadPool& pool) {
  const std::vector<Index> position = inverse(tree.order, pool);
  const Children children(tree.parent);
  std::vector<Index> count(tree.parent.size(), 0);
  std::vector<std::vector<Index>> marks(static_cast<std::size_t>(pool.size()));
  const auto make = [&](Index f, std::vector<Index>& mark) {
    Index* const begin = rows.data() + row_ptr[at(f)];
    Index* end = begin;
    const Index last = tree.first[at(f) + 1] - 1;
    const auto add = [&](Index p) {
      if (p <= last || mark[at(p)] == f) return;
      mark[at(p)] = f;
      *end++ = p;
    };
    for (Index c = children.head[at(f)]; c >= 0; c = children.next[at(c)])
      for (const Index p : rows.subspan(at(row_ptr[at(c)]), at(count[at(c)]))) add(p);
    for (Index k = tree.first[at(f)]; k <= last; ++k)
      for (const Index u : graph.neighbours(tree.order[at(k)])) add(position[at(u)]);
    std::sort(begin, end);
    count[at(f)] = static_cast<Index>(end - begin);
  };
  constexpr std::int64_t kFronts = 16;  // fronts per draw
  for (const auto& tier : heights(tree)) {
    std::atomic<std::int64_t> next{0};
    const auto size = static_cast<std::int64_t>(tier.size());
    const auto work = [&](int worker) {
      auto& mark = marks[at(worker)];
      if (mark.empty()) mark.assign(tree.order.size(), -1);
      for (;;) {
        const std::int64_t begin = next.fetch_add(kFronts);
        if (begin >= size) return;
        for (std::int64_t k = begin; k < std::min(size, begin + kFronts); ++k) make(tier[at(k)], mark);
      }
    };
    if (size <= kFronts)
      work(0);
    else
      pool.share(work);
  }
  return count;
}

}  // namespace espalier::analysis
