#include "device/host/triangular_solve.hpp"

#include <algorithm>
#include <cstring>

#include "device/block_diagonal.hpp"

namespace espalier::device::host {

namespace {

using plan::FrontLayout;

// A row of `nr` numbers, of which there is one as a rule.
template <class T>
void copy_row(const T* from, Index nr, T* to) {
  if (nr == 1)
    *to = *from;
  else
    std::copy_n(from, nr, to);
}

}  // namespace

template <class T>
TriangularSolve<T>::TriangularSolve(NumericState<T>& state, base::ThreadPool& pool, base::MemoryBudget* budget,
                                    SolveSharing<T>* sharing)
    : s_(state),
      plan_(state.plan),
      pool_(pool),
      budget_(budget),
      sharing_(sharing),
      schedule_(plan_, sharing),
      tile_done_(plan_.tiles()),
      front_done_(plan_.fronts()),
      open_(std::make_unique<std::atomic<Index>[]>(static_cast<std::size_t>(plan_.fronts()))) {
  prepare(1);
}

template <class T>
void TriangularSolve<T>::set_reader(out_of_core::FrontReader* reader) {
  reader_ = reader;
  schedule_.follow(reader->order());
}

// Tells a reader what the sweep to come reads.
template <class T>
void TriangularSolve<T>::begin_way(bool up) {
  if (reader_ == nullptr) return;
  std::vector<Index> fronts;
  const auto add = [&](Index f) {
    if (up ? passes_up(f) : passes_down(f)) fronts.push_back(f);
  };
  for (const SolveTask& task : up ? schedule_.forward() : schedule_.backward()) {
    if (task.tile >= 0 && !fronts.empty() && fronts.back() == task.front) continue;
    for (Index k = 0; k <= task.front - task.begin; ++k) add(up ? task.begin + k : task.front - k);
  }
  reader_->begin_way(fronts, s_.kind == Kind::lu && up == transpose_);
}

template <class T>
void TriangularSolve<T>::take(Index front, const std::byte* rows) {
  const auto bytes = static_cast<std::size_t>(Offset{plan_.layout[front].below()} * nr_) * sizeof(T);
  std::memcpy(contributions_.data() + schedule_.place(front) * nr_, rows, bytes);
  front_done_.set(front);
}

template <class T>
void TriangularSolve<T>::prepare(Index nr) {
  if (nr <= allocated_nr_) return;
  allocated_nr_ = 0;  // until everything below has been taken
  contributions_ = base::Buffer<T>();
  contributions_ = base::Buffer<T>(schedule_.contribution_rows() * nr, budget_);
  workers_.clear();
  workers_.reserve(static_cast<std::size_t>(pool_.size()));
  for (int t = 0; t < pool_.size(); ++t) {
    Worker w;
    w.front = base::Buffer<T>((static_cast<Offset>(schedule_.largest_front_rows()) + kPanel<T>)*nr, budget_);
    w.tile = base::Buffer<T>(2 * static_cast<Offset>(schedule_.largest_tile()) * nr, budget_);
    w.stack = base::Buffer<T>(schedule_.stack_rows() * nr, budget_);
    workers_.push_back(std::move(w));
  }
  allocated_nr_ = nr;
}

template <class T>
void TriangularSolve<T>::run(T* x, Index nr, bool transpose, const FrontPaths* paths) {
  prepare(nr);
  x_ = x;
  nr_ = nr;
  paths_ = paths;
  transpose_ = transpose && s_.kind == Kind::lu;
  const auto reset = [&](bool back) {
    tile_done_.reset();
    front_done_.reset();
    for (Index f = 0; f < plan_.fronts(); ++f)
      open_[f].store(back && schedule_.tiles(f) > 1 ? plan_.layout[f].pivot_tiles : schedule_.tiles(f),
                     std::memory_order_relaxed);
  };
  reset(false);
  begin_way(true);
  sweep(schedule_.forward(), &TriangularSolve::forward);
  reset(true);
  begin_way(false);
  sweep(schedule_.backward(), &TriangularSolve::backward);
}

template <class T>
void TriangularSolve<T>::run(const PathSolve<T>& solve) {
  const Offset columns = solve.columns;
  if (on_paths_.size() < plan_.tree.n * columns) {
    on_paths_ = base::Buffer<T>();
    on_paths_ = base::Buffer<T>(plan_.tree.n * columns, budget_);
  }
  T* x = on_paths_.data();
  const auto passed = [&](Index f) {
    return solve.paths.up[static_cast<std::size_t>(f)] != 0 || solve.paths.down[static_cast<std::size_t>(f)] != 0;
  };
  for (Index f = 0; f < plan_.fronts(); ++f)
    if (passed(f)) std::fill_n(x + plan_.tree.first[f] * columns, plan_.layout[f].pivots * columns, T(0));
  for (std::size_t k = 0; k < solve.given.size(); ++k)
    std::copy_n(solve.b + static_cast<Offset>(k) * columns, columns, x + solve.given[k] * columns);
  run(x, solve.columns, solve.transpose, &solve.paths);
  for (std::size_t k = 0; k < solve.wanted.size(); ++k)
    std::copy_n(x + solve.wanted[k] * columns, columns, solve.x + static_cast<Offset>(k) * columns);
}

template <class T>
void TriangularSolve<T>::sweep(const std::vector<SolveTask>& tasks,
                               void (TriangularSolve::*one)(const SolveTask&, Worker&)) {
  std::atomic<std::size_t> next{0};
  s_.abort = false;
  finished_ = 0;
  const auto take_tasks = [&](int t) {
    Worker& w = workers_[static_cast<std::size_t>(t)];
    try {
      for (std::size_t at = next++; at < tasks.size(); at = next++) {
        pool_.check();
        (this->*one)(tasks[at], w);
        ++finished_;
      }
      // Others may still wait for messages.
      if (t == 0 && sharing_ != nullptr) sharing_->wait([&] { return finished_ == tasks.size() || s_.abort; });
    } catch (const Aborted&) {
    } catch (const out_of_core::GivenUp&) {
    } catch (...) {  // others may wait for what this worker does not finish any more
      s_.abort = true;
      if (reader_ != nullptr) reader_->give_up();
      throw;
    }
  };
  const out_of_core::FrontReader::EndOfWay end(reader_);
  if (sharing_ != nullptr)
    pool_.run(take_tasks);
  else
    pool_.share(take_tasks);
}

template <class T>
void TriangularSolve<T>::forward(const SolveTask& task, Worker& w) {
  if (!passes_up(task.front)) return;  // with a front those above it
  if (task.tile >= 0) {
    need(task.front);
    return forward_tile(task.front, task.tile, w);
  }
  for (Index f = task.begin; f <= task.front; ++f) {
    if (!passes_up(f)) continue;
    need(f);
    forward_front(f, w);
    done(f);
    if (f == task.front) finish_forward(f);
    front_done_.set(f);
  }
}

template <class T>
void TriangularSolve<T>::finish_forward(Index f) {
  if (sharing_ != nullptr) sharing_->made(f, contributions_.data() + schedule_.place(f) * nr_, nr_);
}

template <class T>
void TriangularSolve<T>::backward(const SolveTask& task, Worker& w) {
  if (!passes_down(task.front)) return;
  if (task.tile >= 0) {
    need(task.front);
    return backward_tile(task.front, task.tile, w);
  }
  for (Index f = task.front; f >= task.begin; --f) {
    if (!passes_down(f)) continue;
    need(f);
    backward_front(f, w);
    done(f);
    front_done_.set(f);
  }
}

template <class T>
const T* TriangularSolve<T>::lower(Index f, Index i, Index j) const {
  return (transpose_ ? s_.factor2(f) : s_.factor(f)) + plan_.layout[f].tile_offset(i, j);
}

template <class T>
const T* TriangularSolve<T>::upper(Index f, Index i, Index j) const {
  return (s_.kind == Kind::lu && !transpose_ ? s_.factor2(f) : s_.factor(f)) + plan_.layout[f].tile_offset(i, j);
}

template <class T>
void TriangularSolve<T>::finish_tile(Index f, Index tile, bool up) {
  tile_done_.set(plan_.first_tile[f] + tile);
  if (open_[f].fetch_sub(1, std::memory_order_acq_rel) != 1) return;
  done(f);
  if (up) finish_forward(f);
  front_done_.set(f);
}

// Adds the children's contributions for the rows [begin, end) of front f to `to`, whose row r - begin is row r.
template <class T>
void TriangularSolve<T>::add_children(Index f, Index begin, Index end, T* to, const Worker& w) const {
  for (Offset q = plan_.child_ptr[f]; q < plan_.child_ptr[f + 1]; ++q) {
    const Index child = plan_.children[q];
    if (!passes_up(child)) continue;  // it has left zeros
    front_done_.wait(child, s_.abort);
    const Index* relative = plan_.places_in_parent(child);
    const Index below = plan_.layout[child].below();
    const auto first = static_cast<Index>(std::lower_bound(relative, relative + below, begin) - relative);
    const T* from = (schedule_.on_stack(child) ? w.stack.data() : contributions_.data()) + schedule_.place(child) * nr_;
    if (nr_ == 1) {
      for (Index r = first; r < below && relative[r] < end; ++r) to[relative[r] - begin] += from[r];
      continue;
    }
    for (Index r = first; r < below && relative[r] < end; ++r) {
      T* row = to + static_cast<Offset>(relative[r] - begin) * nr_;
      for (Index c = 0; c < nr_; ++c) row[c] += from[static_cast<Offset>(r) * nr_ + c];
    }
  }
}

// y = (diagonal block of the forward matrix)^-1 b for tile j. `scratch` has room for the tile.
template <class T>
void TriangularSolve<T>::divide_forward(Index f, Index j, const T* b, T* y, T* scratch) const {
  const FrontLayout& l = plan_.layout[f];
  const Index n = l.width(j);
  if (s_.kind != Kind::llt && !transpose_) {
    const std::int32_t* perm = s_.pivot_order.data() + plan_.tree.first[f] + l.begin(j);
    const Index nr = nr_;
    for (Index k = 0; k < n; ++k)
      copy_row(b + static_cast<Offset>(perm[k]) * nr, nr, scratch + static_cast<Offset>(k) * nr);
    b = scratch;
  }
  s_.dense.apply_lower(n, nr_, lower(f, j, j), b, y);
}

// z = D^-1 y in place (ldlt).
template <class T>
void TriangularSolve<T>::start_backward(Index f, Index j, T* y) const {
  if (s_.kind != Kind::ldlt) return;
  const FrontLayout& l = plan_.layout[f];
  const Index at = plan_.tree.first[f] + l.begin(j);
  apply_inverse_d(s_.d_inverse.data() + at, s_.e_inverse.data() + at, l.width(j), nr_, y, s_.hermitian);
}

// x = (diagonal block of the backward matrix)^-1 b, stored at the tile's rows of x_. `y` has room for the tile.
template <class T>
void TriangularSolve<T>::divide_backward(Index f, Index j, const T* b, T* y) const {
  const FrontLayout& l = plan_.layout[f];
  const Index n = l.width(j);
  const Index at = plan_.tree.first[f] + l.begin(j);
  s_.dense.apply_lower_transposed(n, nr_, upper(f, j, j), b, y);
  T* x = x_ + static_cast<Offset>(at) * nr_;
  if (s_.kind == Kind::llt || (s_.kind == Kind::lu && !transpose_)) {
    std::copy_n(y, static_cast<Offset>(n) * nr_, x);
    return;
  }
  const std::int32_t* perm = s_.pivot_order.data() + at;
  for (Index k = 0; k < n; ++k) copy_row(y + Offset{k} * nr_, nr_, x + Offset{perm[k]} * nr_);
}

// A whole front at once, one block column after another: the factor is read in the order in which it is stored.
template <class T>
void TriangularSolve<T>::forward_front(Index f, Worker& w) {
  const FrontLayout& l = plan_.layout[f];
  T* t = w.front.data();
  T* x = x_ + static_cast<Offset>(plan_.tree.first[f]) * nr_;
  const Offset below_at = l.padded_begin(l.pivot_tiles);
  const Offset rows = l.padded_begin(l.tiles);
  std::copy_n(x, static_cast<Offset>(l.pivots) * nr_, t);
  std::fill_n(t + static_cast<Offset>(l.pivots) * nr_, (rows - l.pivots) * nr_, T(0));
  add_children(f, 0, l.pivots, t, w);
  add_children(f, l.pivots, l.rows, t + below_at * nr_, w);
  T* y = w.tile.data();
  T* scratch = y + static_cast<Offset>(schedule_.largest_tile()) * nr_;
  for (Index j = 0; j < l.pivot_tiles; ++j) {
    const Index n = l.width(j);
    divide_forward(f, j, t + static_cast<Offset>(l.begin(j)) * nr_, y, scratch);
    std::copy_n(y, static_cast<Offset>(n) * nr_, x + static_cast<Offset>(l.begin(j)) * nr_);
    if (j + 1 < l.tiles)
      s_.dense.apply(rows - l.padded_begin(j + 1), n, nr_, lower(f, j + 1, j), y, t + l.padded_begin(j + 1) * nr_);
  }
  std::copy_n(t + below_at * nr_, static_cast<Offset>(l.below()) * nr_,
              (schedule_.on_stack(f) ? w.stack.data() : contributions_.data()) + schedule_.place(f) * nr_);
}

// The rows of x_ below the pivots of front f. @return how many: those of a border are zero
template <class T>
Index TriangularSolve<T>::gather_below(Index f, T* to) const {
  const Index* below = plan_.rows_below(f);
  const Index known = plan_.layout[f].below() - plan_.tree.border_rows(f), nr = nr_;
  const T* x = x_;
  for (Index r = 0; r < known; ++r)
    copy_row(x + static_cast<Offset>(below[r]) * nr, nr, to + static_cast<Offset>(r) * nr);
  return known;
}

template <class T>
void TriangularSolve<T>::backward_front(Index f, Worker& w) {
  const FrontLayout& l = plan_.layout[f];
  if (plan_.tree.parent[f] >= 0) front_done_.wait(plan_.tree.parent[f], s_.abort);
  T* t = w.front.data();
  T* x = x_ + static_cast<Offset>(plan_.tree.first[f]) * nr_;
  const Offset rows = l.padded_begin(l.tiles);
  std::fill_n(t + static_cast<Offset>(l.pivots) * nr_, (rows - l.pivots) * nr_, T(0));
  std::copy_n(x, static_cast<Offset>(l.pivots) * nr_, t);
  gather_below(f, t + l.padded_begin(l.pivot_tiles) * nr_);
  T* y = w.tile.data();
  for (Index j = l.pivot_tiles - 1; j >= 0; --j) {
    const Index n = l.width(j);
    T* tj = t + static_cast<Offset>(l.begin(j)) * nr_;
    start_backward(f, j, tj);
    if (j + 1 < l.tiles)
      s_.dense.apply_transposed(rows - l.padded_begin(j + 1), n, nr_, upper(f, j + 1, j),
                                t + l.padded_begin(j + 1) * nr_, tj);
    divide_backward(f, j, tj, y);
    std::copy_n(x + static_cast<Offset>(l.begin(j)) * nr_, static_cast<Offset>(n) * nr_, tj);
  }
}

// One tile row of a split front: t = b_i + contributions - sum over k of L(i, k) y_k.
template <class T>
void TriangularSolve<T>::forward_tile(Index f, Index i, Worker& w) {
  const FrontLayout& l = plan_.layout[f];
  const Index n = l.width(i);
  const Index begin = l.begin(i);
  T* t = w.front.data();
  T* x = x_ + static_cast<Offset>(plan_.tree.first[f]) * nr_;
  const bool pivot = i < l.pivot_tiles;
  if (pivot)
    std::copy_n(x + static_cast<Offset>(begin) * nr_, static_cast<Offset>(n) * nr_, t);
  else
    std::fill_n(t, static_cast<Offset>(n) * nr_, T(0));
  add_children(f, begin, begin + n, t, w);
  for (Index k = 0; k < std::min(i, l.pivot_tiles); ++k) {
    tile_done_.wait(plan_.first_tile[f] + k, s_.abort);
    s_.dense.apply(n, l.width(k), nr_, lower(f, i, k), x + static_cast<Offset>(l.begin(k)) * nr_, t);
  }
  if (pivot) {
    T* y = w.tile.data();
    divide_forward(f, i, t, y, y + static_cast<Offset>(schedule_.largest_tile()) * nr_);
    std::copy_n(y, static_cast<Offset>(n) * nr_, x + static_cast<Offset>(begin) * nr_);
  } else {
    std::copy_n(t, static_cast<Offset>(n) * nr_, contributions_.data() + (schedule_.place(f) + begin - l.pivots) * nr_);
  }
  finish_tile(f, i, true);
}

// One tile column of a split front: t = z_j - sum over i > j of U(j, i) x_i; the rows below the pivots come first,
// since they are known from the start.
template <class T>
void TriangularSolve<T>::backward_tile(Index f, Index j, Worker& w) {
  const FrontLayout& l = plan_.layout[f];
  if (plan_.tree.parent[f] >= 0) front_done_.wait(plan_.tree.parent[f], s_.abort);
  const Index n = l.width(j);
  T* x = x_ + static_cast<Offset>(plan_.tree.first[f]) * nr_;
  T* t = w.tile.data();
  T* from = w.front.data();
  std::copy_n(x + static_cast<Offset>(l.begin(j)) * nr_, static_cast<Offset>(n) * nr_, t);
  start_backward(f, j, t);
  const Offset below_rows = l.padded_begin(l.tiles) - l.padded_begin(l.pivot_tiles);
  if (below_rows > 0) {
    const Index known = gather_below(f, from);
    std::fill_n(from + static_cast<Offset>(known) * nr_, (below_rows - known) * nr_, T(0));
    s_.dense.apply_transposed(below_rows, n, nr_, upper(f, l.pivot_tiles, j), from, t);
  }
  for (Index i = l.pivot_tiles - 1; i > j; --i) {
    tile_done_.wait(plan_.first_tile[f] + i, s_.abort);
    const Index m = l.width(i);
    std::copy_n(x + static_cast<Offset>(l.begin(i)) * nr_, static_cast<Offset>(m) * nr_, from);
    std::fill_n(from + static_cast<Offset>(m) * nr_, (l.padded(m) - m) * nr_, T(0));
    s_.dense.apply_transposed(m, n, nr_, upper(f, i, j), from, t);
  }
  // The padding of t is read by the transposed inverse and must be finite.
  std::fill_n(t + static_cast<Offset>(n) * nr_, (l.padded(n) - n) * nr_, T(0));
  divide_backward(f, j, t, t + static_cast<Offset>(schedule_.largest_tile()) * nr_);
  finish_tile(f, j, false);
}

#define ESPALIER_INSTANTIATE(T) template class TriangularSolve<T>;
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
