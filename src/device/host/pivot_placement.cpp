#include "device/host/pivot_placement.hpp"

#include <algorithm>
#include <atomic>

#include "base/at.hpp"
#include "device/host/delaying_front.hpp"

namespace espalier::device::host {

namespace {

/// What a front leaves to its parent.
template <class Value>
struct Contribution {
  std::vector<Index> unknowns;  ///< positions: first the pivots that leave the front
  Index delayed = 0;            ///< that many
  base::Buffer<Value> values;   ///< column-major, square (lu) or its lower triangle
};

/// What one thread works with.
template <class Value>
struct Worker {
  DelayingFront<Value> front;
  std::vector<Index> unknowns;  // of the front: positions
  std::vector<Index> local;     // n + border; place of a position among the front's rows
};

// A search that takes more work than so many factorizations of the plan finds no places worth having: a matrix whose
// pivots nearly all fail ends as one dense front. Small ones may take what a second allows.
constexpr double kFactorizations = 10;
constexpr double kLeastEffort = 1e10;

template <class Value>
class Placement {
  using Worker = host::Worker<Value>;
  using Contribution = host::Contribution<Value>;

 public:
  explicit Placement(const PlacementJobOf<Value>& job)
      : job_(job),
        plan_(job.plan),
        lu_(job.kind == Kind::lu),
        effort_(std::max(kLeastEffort, kFactorizations * plan_.flops)),
        wanted_(at(plan_.fronts())),
        done_(at(plan_.fronts())),
        left_(at(plan_.fronts())),
        moves_(at(plan_.fronts())) {}

  std::optional<std::vector<analysis::PivotMove>> run();

 private:
  [[nodiscard]] std::vector<Index> cut_tree() const;
  void want_sub_tree(Index f);
  void want_failed();
  bool want_reached();
  void take_wanted();
  void take(Worker& w, Index f);
  void name_rows(Worker& w, Index f) const;
  void add_entries(Worker& w, Index f, Index arrived) const;
  void fetch(Index child);
  void add_child(Worker& w, Index child);
  void note_moves(const Worker& w, Index f);
  void leave(const Worker& w, Index f);
  [[nodiscard]] Worker make_worker(base::ThreadPool* helpers) {
    return {{MatrixKind{job_.kind, job_.hermitian}, job_.rule, plan_.options.tiles, job_.budget, helpers, &effort_},
            {},
            std::vector<Index>(at(plan_.tree.n + plan_.tree.border), -1)};
  }

  const PlacementJobOf<Value>& job_;
  const plan::Plan& plan_;
  bool lu_;
  Effort effort_;
  std::vector<Index> task_;                              // fronts; see cut_tree()
  std::vector<Index> first_below_;                       // fronts; the first front of the sub-tree
  std::vector<char> wanted_, done_;                      // fronts
  std::vector<Worker> workers_;                          // by thread; the last one has all of them as helpers
  std::vector<Contribution> left_;                       // fronts
  std::vector<std::vector<analysis::PivotMove>> moves_;  // by the front that they go to
};

/// For each front the root of the sub-tree that it belongs to, -1 above: sub-trees of a small part of all flops.
template <class Value>
std::vector<Index> Placement<Value>::cut_tree() const {
  constexpr double kTasksPerThread = 8;
  const auto& parent = plan_.tree.parent;
  std::vector<double> flops(at(plan_.fronts()), 0);
  for (Index f = 0; f < plan_.fronts(); ++f) {
    flops[at(f)] += plan::front_flops(plan_.layout[f].pivots, plan_.layout[f].rows, lu_);
    if (parent[f] >= 0) flops[at(parent[f])] += flops[at(f)];
  }
  const double most = plan_.flops / (kTasksPerThread * job_.pool.size());
  std::vector<Index> task(at(plan_.fronts()), -1);
  for (Index f = plan_.fronts() - 1; f >= 0; --f) {
    if (parent[f] >= 0 && task[at(parent[f])] >= 0)
      task[at(f)] = task[at(parent[f])];
    else if (flops[at(f)] <= most)
      task[at(f)] = f;
  }
  return task;
}

template <class Value>
std::optional<std::vector<analysis::PivotMove>> Placement<Value>::run() {
  task_ = cut_tree();
  first_below_.resize(at(plan_.fronts()));
  for (Index f = plan_.fronts() - 1; f >= 0; --f) first_below_[at(f)] = f;
  for (Index f = 0; f < plan_.fronts(); ++f)
    if (const Index up = plan_.tree.parent[f]; up >= 0)
      first_below_[at(up)] = std::min(first_below_[at(up)], first_below_[at(f)]);
  for (int t = 0; t < job_.pool.size(); ++t) workers_.push_back(make_worker(nullptr));
  workers_.push_back(make_worker(&job_.pool));
  want_failed();
  do take_wanted();
  while (!effort_.spent() && want_reached());
  if (effort_.spent()) return std::nullopt;
  std::vector<analysis::PivotMove> all;
  for (const auto& moves : moves_) all.insert(all.end(), moves.begin(), moves.end());
  return all;
}

// As far as contributions are not there.
template <class Value>
void Placement<Value>::want_sub_tree(Index f) {
  if (job_.left == nullptr) return std::fill(wanted_.begin() + first_below_[at(f)], wanted_.begin() + f + 1, 1);
  std::vector<Index> open{f};
  while (!open.empty()) {
    const Index g = open.back();
    open.pop_back();
    if (wanted_[at(g)] != 0) continue;
    wanted_[at(g)] = 1;
    for (Offset c = plan_.child_ptr[g]; c < plan_.child_ptr[g + 1]; ++c)
      if (!job_.left->has(plan_.children[c])) open.push_back(plan_.children[c]);
  }
}

// From where a factorization has left it.
template <class Value>
void Placement<Value>::fetch(Index child) {
  Contribution& to = left_[at(child)];
  const auto& t = plan_.tree;
  to.unknowns.assign(t.rows.begin() + t.row_ptr[child], t.rows.begin() + t.row_ptr[child + 1]);
  to.values = base::Buffer<Value>(Offset{t.rows_below(child)} * t.rows_below(child), job_.budget);
  job_.left->copy(child, to.values.data());
}

template <class Value>
void Placement<Value>::want_failed() {
  if (job_.failed.empty()) return std::fill(wanted_.begin(), wanted_.end(), 1);
  Index f = 0;
  for (const Index p : job_.failed) {
    while (plan_.tree.first[f + 1] <= p) ++f;
    want_sub_tree(f);
  }
}

// Fronts that pivots have reached.
template <class Value>
bool Placement<Value>::want_reached() {
  bool any = false;
  for (Index f = 0; f < plan_.fronts(); ++f) {
    const Index up = plan_.tree.parent[f];
    if (done_[at(f)] == 0 || up < 0 || wanted_[at(up)] != 0 || left_[at(f)].delayed == 0) continue;
    want_sub_tree(up);
    any = true;
  }
  return any;
}

// Sub-trees side by side, what is above them front by front.
template <class Value>
void Placement<Value>::take_wanted() {
  std::vector<std::vector<Index>> members(at(plan_.fronts()));
  std::vector<Index> roots, above;
  for (Index f = 0; f < plan_.fronts(); ++f) {
    if (wanted_[at(f)] == 0 || done_[at(f)] != 0) continue;
    const Index root = task_[at(f)];
    if (root < 0) {
      above.push_back(f);
      continue;
    }
    if (members[at(root)].empty()) roots.push_back(root);
    members[at(root)].push_back(f);
  }
  std::atomic<std::size_t> taken{0};
  job_.pool.share([&](int t) {
    for (std::size_t k = taken++; k < roots.size(); k = taken++)
      for (const Index f : members[at(roots[k])])
        if (!effort_.spent()) {
          job_.pool.check();
          take(workers_[at(t)], f);
        }
  });
  for (const Index f : above)
    if (!effort_.spent()) {
      job_.pool.check();
      take(workers_.back(), f);
    }
}

template <class Value>
void Placement<Value>::take(Worker& w, Index f) {
  for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c)
    if (done_[at(plan_.children[c])] == 0) fetch(plan_.children[c]);
  name_rows(w, f);
  const Index arrived = static_cast<Index>(w.unknowns.size()) - plan_.layout[f].rows;
  w.front.start(plan_.layout[f].pivots + arrived, static_cast<Index>(w.unknowns.size()), plan_.tree.border_rows(f));
  add_entries(w, f, arrived);
  for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) add_child(w, plan_.children[c]);
  if (!w.front.eliminate()) return;
  note_moves(w, f);
  if (plan_.tree.parent[f] >= 0) leave(w, f);
  done_[at(f)] = 1;
}

// Its own pivots, those of its children that could not be eliminated there, the rows below.
template <class Value>
void Placement<Value>::name_rows(Worker& w, Index f) const {
  const auto& t = plan_.tree;
  w.unknowns.clear();
  for (Index p = t.first[f]; p < t.first[f + 1]; ++p) w.unknowns.push_back(p);
  for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) {
    const Contribution& child = left_[at(plan_.children[c])];
    w.unknowns.insert(w.unknowns.end(), child.unknowns.begin(), child.unknowns.begin() + child.delayed);
  }
  std::sort(w.unknowns.begin() + t.pivots(f), w.unknowns.end());
  w.unknowns.insert(w.unknowns.end(), t.rows.begin() + t.row_ptr[f], t.rows.begin() + t.row_ptr[f + 1]);
  for (std::size_t k = 0; k < w.unknowns.size(); ++k) w.local[at(w.unknowns[k])] = static_cast<Index>(k);
}

template <class Value>
void Placement<Value>::add_entries(Worker& w, Index f, Index arrived) const {
  const plan::FrontLayout& l = plan_.layout[f];
  const auto place = [&](Index row) { return row < l.pivots ? row : row + arrived; };
  const auto add_tile = [&](Offset tile, Index row_begin, Index col_begin) {
    for (Offset k = plan_.entry_ptr[plan_.first_tile[f] + tile]; k < plan_.entry_ptr[plan_.first_tile[f] + tile + 1];
         ++k) {
      const plan::EntryPlace& e = plan_.entries[k];
      const Index row = place(row_begin + e.row()), col = place(col_begin + e.col());
      const Value value = job_.values[at(e.source())];
      w.front.add(e.transposed() ? col : row, e.transposed() ? row : col, value);
    }
  };
  if (plan_.whole[f] != 0) return add_tile(0, 0, 0);
  for (Index j = 0; j < l.pivot_tiles; ++j)
    for (Index i = j; i < l.tiles; ++i) add_tile(l.tile_index(i, j), l.begin(i), l.begin(j));
}

template <class Value>
void Placement<Value>::add_child(Worker& w, Index child) {
  Contribution& from = left_[at(child)];
  const auto rows = static_cast<Index>(from.unknowns.size());
  for (Index c = 0; c < rows; ++c) {
    const Index col = w.local[at(from.unknowns[at(c)])];
    for (Index r = lu_ ? 0 : c; r < rows; ++r) {
      const Index row = w.local[at(from.unknowns[at(r)])];
      const Value value = from.values[Offset{c} * rows + r];
      if (lu_)
        w.front.add(row, col, value);
      else
        w.front.add(std::max(row, col), std::min(row, col),
                    job_.hermitian && row < col ? base::conjugate(value) : value);
    }
  }
  from.values = base::Buffer<Value>();
}

// What arrived and found its place here, or will find none; own pivots that went behind the others.
template <class Value>
void Placement<Value>::note_moves(const Worker& w, Index f) {
  const Index own = plan_.tree.pivots(f);
  Index here = w.front.eliminated();
  if (plan_.tree.parent[f] < 0) here += w.front.leaving();
  const bool several = plan_.layout[f].pivot_tiles > 1;
  for (Index k = 0; k < here; ++k) {
    const Index row = w.front.order()[at(k)];
    if (row >= own || (several && w.front.late(row))) moves_[at(f)].push_back({w.unknowns[at(row)], f});
  }
}

template <class Value>
void Placement<Value>::leave(const Worker& w, Index f) {
  Contribution& to = left_[at(f)];
  const Index done = w.front.eliminated(), rows = static_cast<Index>(w.unknowns.size()) - done;
  to.delayed = w.front.leaving();
  for (Index k = 0; k < rows; ++k) to.unknowns.push_back(w.unknowns[at(w.front.order()[at(done + k)])]);
  to.values = base::Buffer<Value>(Offset{rows} * rows, job_.budget);
  for (Index c = 0; c < rows; ++c)
    for (Index r = lu_ ? 0 : c; r < rows; ++r) to.values[Offset{c} * rows + r] = w.front.rest(r, c);
}

}  // namespace

template <class Value>
std::optional<std::vector<analysis::PivotMove>> place_pivots(const PlacementJobOf<Value>& job) {
  return Placement<Value>(job).run();
}

template std::optional<std::vector<analysis::PivotMove>> place_pivots(const PlacementJob&);
template std::optional<std::vector<analysis::PivotMove>> place_pivots(const ComplexPlacementJob&);

}  // namespace espalier::device::host
