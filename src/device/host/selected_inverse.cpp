#include "device/host/selected_inverse.hpp"

#include <algorithm>
#include <numeric>

#include "device/host/inverse_front.hpp"
#include "device/inverse_places.hpp"
#include "plan/front_cost.hpp"

namespace espalier::device::host {

namespace {

using plan::FrontLayout;

// What fronts need at most.
struct Sizes {
  Index widest = 1;
  Offset column = 0;  // InverseColumn
  Offset stack = 0;   // elements below the root of a sub-tree
  template <class T>
  void cover(const FrontLayout& l) {
    for (Index i = 0; i < l.tiles; ++i) widest = std::max(widest, l.width(i));
    column = std::max(column, InverseColumn<T>::size(l));
  }
};

template <class T>
class TreeInverse {
 public:
  TreeInverse(NumericState<T>& state, base::ThreadPool& pool, base::MemoryBudget* budget,
              const InverseEntries<T>& entries)
      : s_(state),
        plan_(state.plan),
        pool_(pool),
        budget_(budget),
        entries_(entries),
        lu_(state.kind == Kind::lu),
        wanted_(find_inverse_places(plan_, entries, pool, budget)) {}

  void run() {
    part_tree();
    if (parts_.empty()) return;
    for (int t = 0; t < pool_.size(); ++t) {
      scratch_.emplace_back(std::max(top_.widest, below_.widest), budget_);
      if (below_.column == 0) continue;
      columns_.emplace_back(below_.widest, below_.column, lu_, budget_);
      stacks_.emplace_back(below_.stack, budget_);
    }
    if (top_.column > 0) top_column_.emplace_back(top_.widest, top_.column, lu_, budget_);
    for (const InverseTask& part : parts_) {
      open(part.front);
      if (part.by_all)
        make_by_all(open_.back());
      else
        put_off(part);
    }
    make_waiting();
  }

 private:
  // A front that all threads make, or the sub-tree begin .. front, which one thread makes.
  struct InverseTask {
    Index front, begin;
    double flops;
    bool by_all;
  };
  struct OpenFront {
    Index front;
    FrontInverse<T> inverse;
    base::Buffer<T> memory;
  };
  struct Waiting {
    InverseTask part;
    OpenFront root;
  };

  [[nodiscard]] Offset size(Index f) const { return (lu_ ? 2 : 1) * FrontInverse<T>::size(plan_.layout[f]); }
  [[nodiscard]] FrontInverse<T> in_place(Index f, T* at) const {
    return {&plan_.layout[f], at, lu_ ? at + FrontInverse<T>::size(plan_.layout[f]) : at};
  }

  // Fronts that are needed, from the last on: a front, then all that is below it.
  void part_tree() {
    const Index fronts = plan_.fronts();
    const auto n = static_cast<std::size_t>(fronts);
    needed_.assign(n, 0);
    std::vector<double> flops(n, 0);
    std::vector<Index> begin(n);
    std::iota(begin.begin(), begin.end(), 0);
    double all = 0;
    for (Index f = 0; f < fronts; ++f) {
      const FrontLayout& l = plan_.layout[f];
      if (wanted_.ptr[f + 1] > wanted_.ptr[f]) needed_[f] = 1;
      const double own = needed_[f] != 0 ? plan::front_flops(l.pivots, l.rows, lu_) : 0;
      flops[f] += own;
      all += own;
      if (const Index parent = plan_.tree.parent[f]; parent >= 0) {
        needed_[parent] |= needed_[f];
        flops[parent] += flops[f];
        begin[parent] = std::min(begin[parent], begin[f]);
      }
    }
    constexpr double kLeast = 1e6;  // some ten microseconds: less is not worth a part
    const double most = std::max(kLeast, all / (16.0 * pool_.size()));
    std::vector<Offset> path(n, 0);
    for (Index f = fronts - 1; f >= 0; --f) {
      if (needed_[f] == 0) continue;
      if (flops[f] > most) {
        parts_.push_back({f, f, flops[f], true});
        top_.template cover<T>(plan_.layout[f]);
        continue;
      }
      parts_.push_back({f, begin[f], flops[f], false});
      below_.template cover<T>(plan_.layout[f]);
      const Index root = f;
      for (--f; f >= begin[root]; --f) {
        if (needed_[f] == 0) continue;
        path[f] = path[plan_.tree.parent[f]] + size(f);
        below_.template cover<T>(plan_.layout[f]);
        below_.stack = std::max(below_.stack, path[f]);
      }
      ++f;
    }
  }

  // The system clears pages that it hands out, which takes as long as making a front: memory is used again, where it is
  // not far too large. What is waiting may hold what is lacking.
  base::Buffer<T> take_memory(Offset elements) {
    auto best = spare_.end();
    for (auto b = spare_.begin(); b != spare_.end(); ++b)
      if (b->size() >= elements && b->size() <= 3 * elements && (best == spare_.end() || b->size() < best->size()))
        best = b;
    if (best != spare_.end()) {
      base::Buffer<T> found = std::move(*best);
      spare_.erase(best);
      return found;
    }
    try {
      return base::Buffer<T>(elements, budget_);
    } catch (const Error&) {
      if (waiting_.empty() && spare_.empty()) throw;
    }
    make_waiting();
    spare_.clear();
    return base::Buffer<T>(elements, budget_);
  }
  void give_back(base::Buffer<T> memory) {
    constexpr Offset kWorthIt = 1 << 20;  // bytes
    if (memory.bytes() >= kWorthIt) spare_.push_back(std::move(memory));
  }

  // Takes memory for front f, and what its parent knows.
  void open(Index f) {
    const Index parent = plan_.tree.parent[f];
    while (!open_.empty() && open_.back().front != parent) {
      give_back(std::move(open_.back().memory));
      open_.pop_back();
    }
    base::Buffer<T> memory = take_memory(size(f));
    T* at = memory.data();
    open_.push_back({f, in_place(f, at), std::move(memory)});
    if (parent < 0) return;
    const FrontLayout& l = plan_.layout[f];
    InverseFront<T> front(s_, f, open_.back().inverse);
    const FrontInverse<T>& from = open_[open_.size() - 2].inverse;
    for_each(l.tiles_below(),
             [&](InverseScratch<T>& w, Index i) { front.take_from_parent(from, l.pivot_tiles + i, w); });
  }

  // body(scratch, i) for all i < count, by whoever is free.
  template <class Body>
  void for_each(Index count, Body&& body) {
    std::atomic<Index> next{0};
    const auto take = [&](int worker) {
      for (Index i = next++; i < count; i = next++) {
        pool_.check();
        body(scratch_[static_cast<std::size_t>(worker)], i);
      }
    };
    if (count <= 1)
      take(0);
    else
      pool_.share(take);
  }

  void make_by_all(const OpenFront& open) {
    const Index f = open.front;
    const FrontLayout& l = plan_.layout[f];
    InverseFront<T> front(s_, f, open.inverse);
    InverseColumn<T>& column = top_column_.front();
    for (Index j = l.pivot_tiles - 1; j >= 0; --j) {
      const Index first = j + 1, below = l.tiles - first;
      front.begin_column(j, column, scratch_.front());
      for_each(below, [&](InverseScratch<T>& w, Index i) { front.solve_tile(first + i, j, column, w); });
      for_each(below, [&](InverseScratch<T>& w, Index i) { front.make_tile(first + i, j, column, w); });
      front.make_diagonal(j, column, scratch_.front());
    }
    constexpr std::int64_t kGrain = 1 << 12;
    pool_.for_each_range(wanted_.ptr[f + 1] - wanted_.ptr[f], kGrain, [&](std::int64_t begin, std::int64_t end) {
      hand_out(open.inverse, wanted_.ptr[f] + begin, wanted_.ptr[f] + end);
    });
  }

  void hand_out(const FrontInverse<T>& inverse, Offset begin, Offset end) {
    for (Offset at = begin; at < end; ++at) {
      const InversePlaces::Place& p = wanted_.places[at];
      entries_.value[static_cast<std::size_t>(p.number)] = inverse.at(p.row, p.col);
    }
  }

  // By one thread.
  void make(Index f, const FrontInverse<T>& inverse, std::size_t worker) {
    const FrontLayout& l = plan_.layout[f];
    InverseFront<T> front(s_, f, inverse);
    InverseScratch<T>& w = scratch_[worker];
    InverseColumn<T>& column = columns_[worker];
    for (Index j = l.pivot_tiles - 1; j >= 0; --j) {
      front.begin_column(j, column, w);
      for (Index i = j + 1; i < l.tiles; ++i) front.solve_tile(i, j, column, w);
      for (Index i = j + 1; i < l.tiles; ++i) front.make_tile(i, j, column, w);
      front.make_diagonal(j, column, w);
    }
    hand_out(inverse, wanted_.ptr[f], wanted_.ptr[f + 1]);
  }

  void make_subtree(const Waiting& waiting, std::size_t worker) {
    struct Level {
      Index front;
      FrontInverse<T> inverse;
      Offset end;  // of the stack
    };
    make(waiting.part.front, waiting.root.inverse, worker);
    std::vector<Level> levels{{waiting.part.front, waiting.root.inverse, 0}};
    for (Index f = waiting.part.front - 1; f >= waiting.part.begin; --f) {
      if (needed_[f] == 0) continue;
      pool_.check();
      while (levels.back().front != plan_.tree.parent[f]) levels.pop_back();
      const Level above = levels.back();
      levels.push_back({f, in_place(f, stacks_[worker].data() + above.end), above.end + size(f)});
      InverseFront<T> front(s_, f, levels.back().inverse);
      const FrontLayout& l = plan_.layout[f];
      for (Index i = l.pivot_tiles; i < l.tiles; ++i) front.take_from_parent(above.inverse, i, scratch_[worker]);
      make(f, levels.back().inverse, worker);
    }
  }

  // The sub-tree of the front that was opened last waits until there are enough of them for all threads.
  void put_off(const InverseTask& part) {
    constexpr Offset kMostBytes = 256 << 20;
    waiting_.push_back({part, std::move(open_.back())});
    open_.pop_back();
    waiting_bytes_ += waiting_.back().root.memory.bytes();
    if (waiting_bytes_ > kMostBytes && waiting_.size() >= 2 * static_cast<std::size_t>(pool_.size())) make_waiting();
  }

  void make_waiting() {
    std::stable_sort(waiting_.begin(), waiting_.end(),
                     [](const Waiting& a, const Waiting& b) { return a.part.flops > b.part.flops; });
    std::atomic<std::size_t> next{0};
    const auto take = [&](int worker) {
      for (std::size_t k = next++; k < waiting_.size(); k = next++)
        make_subtree(waiting_[k], static_cast<std::size_t>(worker));
    };
    pool_.share(take);
    for (Waiting& w : waiting_) give_back(std::move(w.root.memory));
    waiting_.clear();
    waiting_bytes_ = 0;
  }

  NumericState<T>& s_;
  const plan::Plan& plan_;
  base::ThreadPool& pool_;
  base::MemoryBudget* budget_;
  const InverseEntries<T>& entries_;
  bool lu_;
  InversePlaces wanted_;
  std::vector<char> needed_;  // fronts
  std::vector<InverseTask> parts_;
  Sizes top_, below_;  // of fronts that all threads make; of those in sub-trees
  std::vector<InverseScratch<T>> scratch_;
  std::vector<InverseColumn<T>> columns_;  // by worker, as the scratch
  std::vector<base::Buffer<T>> stacks_;
  std::vector<InverseColumn<T>> top_column_;  // one, where there are such fronts
  std::vector<OpenFront> open_;               // the way from a root to the last one
  std::vector<Waiting> waiting_;
  Offset waiting_bytes_ = 0;
  std::vector<base::Buffer<T>> spare_;  // memory of fronts that are done
};

}  // namespace

template <class T>
void invert_at(NumericState<T>& state, base::ThreadPool& pool, base::MemoryBudget* budget,
               const InverseEntries<T>& entries) {
  TreeInverse<T>(state, pool, budget, entries).run();
}

#define ESPALIER_INSTANTIATE(T) \
  template void invert_at(NumericState<T>&, base::ThreadPool&, base::MemoryBudget*, const InverseEntries<T>&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
