#include "device/cuda/out_of_core/store_solve.hpp"

#include <algorithm>
#include <atomic>
#include <iterator>

#include "device/block_diagonal.hpp"
#include "device/cuda/out_of_core/panel_products.hpp"

namespace espalier::device::cuda {

namespace {

// A front with a larger factor is worked on by all threads: 4 MiB are some 0.3 ms of one core's memory traffic.
constexpr Offset kLargeElements = 1 << 19;
constexpr Index kPanelsPerRange = 32;
constexpr int kTogether = 8;  // tile columns between two meetings of all threads

}  // namespace

template <class T>
StoreSolve<T>::StoreSolve(const plan::Plan& plan, const std::vector<Front>& fronts, Kind kind, base::ThreadPool& pool)
    : plan_(plan), fronts_(fronts), kind_(kind), pool_(pool), benches_(static_cast<std::size_t>(pool.size())) {
  list_fronts(std::vector<char>(fronts.size(), 0));
}

template <class T>
void StoreSolve<T>::share(const std::vector<Index>& part, Companion<T>* companion) {
  std::vector<char> elsewhere(fronts_.size(), 0);
  for (const Index f : part) elsewhere[f] = 1;
  list_fronts(elsewhere);
  companion_ = companion;
}

template <class T>
void StoreSolve<T>::set_reader(out_of_core::FrontReader* reader) {
  reader_ = reader;
  list_fronts(elsewhere_);
}

// Tiers; of a store on disk, tiers of runs of fronts that fill some memory there, run after run.
template <class T>
std::vector<std::size_t> StoreSolve<T>::levels_of(const std::vector<char>& elsewhere) const {
  std::vector<std::size_t> level(fronts_.size());
  if (level.empty()) return level;
  const auto tiers = static_cast<std::size_t>(*std::max_element(plan_.tier.begin(), plan_.tier.end()) + 1);
  for (std::size_t f = 0; f < level.size(); ++f) level[f] = tiers - 1 - static_cast<std::size_t>(plan_.tier[f]);
  if (reader_ == nullptr) return level;
  constexpr Offset kRunElements = Offset{8} << 20;
  const std::span<const Offset> order = reader_->order();
  std::vector<std::size_t> list;
  for (std::size_t f = 0; f < level.size(); ++f)
    if (elsewhere[f] == 0) list.push_back(f);
  std::sort(list.begin(), list.end(), [&](std::size_t x, std::size_t y) { return order[x] < order[y]; });
  for (const std::size_t f : list) level[f] += static_cast<std::size_t>(order[f] / kRunElements) * tiers;
  return level;
}

template <class T>
void StoreSolve<T>::list_fronts(const std::vector<char>& elsewhere) {
  elsewhere_ = elsewhere;
  std::vector<std::size_t> level = levels_of(elsewhere), used;
  for (std::size_t f = 0; f < level.size(); ++f)
    if (elsewhere[f] == 0) used.push_back(level[f]);
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  std::vector<Offset> elements(used.size(), 0);
  for (std::size_t f = 0; f < level.size(); ++f) {
    if (elsewhere[f] != 0) continue;
    level[f] = static_cast<std::size_t>(std::lower_bound(used.begin(), used.end(), level[f]) - used.begin());
    elements[level[f]] += fronts_[f].factor_size();
  }
  small_.assign(used.size(), {});
  large_.assign(used.size(), {});
  for (Index f = 0; f < plan_.fronts(); ++f) {
    if (elsewhere[f] != 0) continue;
    const std::size_t at = level[f];
    // Alone, a thread would still be busy with it when the others have done the rest of the level.
    const Offset share = std::max(kLargeElements, elements[at] / (2 * pool_.size()));
    (fronts_[f].factor_size() > share ? large_ : small_)[at].push_back(f);
  }
  for (auto& list : small_)
    std::stable_sort(list.begin(), list.end(),
                     [&](Index x, Index y) { return fronts_[x].factor_size() > fronts_[y].factor_size(); });
}

template <class T>
void StoreSolve<T>::choose_way(bool transpose) {
  up_second_ = kind_ == Kind::lu && transpose;
  down_second_ = kind_ == Kind::lu && !transpose;
  transpose_ = transpose;
}

template <class T>
void StoreSolve<T>::run(const HostFactors<T>& factors, const PathSolve<T>& solve) {
  choose_way(solve.transpose);
  struct Whole {
    const FrontPaths*& paths;
    ~Whole() { paths = nullptr; }
  } const whole{paths_};
  paths_ = &solve.paths;
  const Index most = most_columns();
  for (Index c = 0; c < solve.columns; c += most) {
    const Index now = std::min(most, solve.columns - c);
    on_paths_.assign(static_cast<std::size_t>(plan_.tree.n) * static_cast<std::size_t>(now), T(0));
    for (std::size_t k = 0; k < solve.given.size(); ++k)
      std::copy_n(solve.b + static_cast<Offset>(k) * solve.columns + c, now,
                  on_paths_.data() + static_cast<Offset>(solve.given[k]) * now);
    pass(factors, on_paths_.data(), now);
    for (std::size_t k = 0; k < solve.wanted.size(); ++k)
      std::copy_n(on_paths_.data() + static_cast<Offset>(solve.wanted[k]) * now, now,
                  solve.x + static_cast<Offset>(k) * solve.columns + c);
  }
}

// What fronts that nothing reaches would leave for those that are passed, and for a companion's.
template <class T>
void StoreSolve<T>::clear_updates(const FrontPaths& paths, Index columns) {
  for (Index f = 0; f < plan_.fronts(); ++f) {
    const Index parent = plan_.tree.parent[f];
    if (parent < 0 || elsewhere_[f] != 0 || paths.up[static_cast<std::size_t>(f)] != 0) continue;
    if (elsewhere_[parent] == 0 && paths.up[static_cast<std::size_t>(parent)] == 0) continue;
    std::fill_n(updates_.data() + plan_.tree.row_ptr[f] * columns, Offset{plan_.tree.rows_below(f)} * columns, T(0));
  }
}

template <class T>
void StoreSolve<T>::run(const HostFactors<T>& factors, T* x, Index columns, bool transpose) {
  choose_way(transpose);
  const Index n = plan_.tree.n, most = most_columns();
  if (columns <= most) return pass(factors, x, columns);
  std::vector<T> part(static_cast<std::size_t>(n) * most);
  for (Index c = 0; c < columns; c += most) {
    const Index now = std::min(most, columns - c);
    for (Index k = 0; k < n; ++k)
      for (Index j = 0; j < now; ++j)
        part[static_cast<std::size_t>(k) * now + j] = x[static_cast<Offset>(k) * columns + c + j];
    pass(factors, part.data(), now);
    for (Index k = 0; k < n; ++k)
      for (Index j = 0; j < now; ++j)
        x[static_cast<Offset>(k) * columns + c + j] = part[static_cast<std::size_t>(k) * now + j];
  }
}

template <class T>
void StoreSolve<T>::pass(const HostFactors<T>& factors, T* x, Index columns) {
  factors_ = factors;
  x_ = x;
  const std::size_t size = plan_.tree.rows.size() * static_cast<std::size_t>(columns);
  if (updates_.size() < size) updates_.resize(size);
  if (paths_ != nullptr) clear_updates(*paths_, columns);
  if (companion_ != nullptr) companion_->start(x, columns, transpose_);
  way(true, columns);
  if (companion_ != nullptr) companion_->turn(x, updates_.data(), columns);
  way(false, columns);
  if (companion_ != nullptr) companion_->finish(x, columns);
}

// Large fronts of a level come last on the way up, and first on the way down.
template <class T>
void StoreSolve<T>::way(bool up, Index columns) {
  begin_way(up);
  const out_of_core::FrontReader::EndOfWay end(reader_);
  const auto small = [&](const std::vector<Index>& list) {
    std::atomic<std::size_t> next{0};
    pool_.run([&](int worker) {
      Bench& bench = benches_[static_cast<std::size_t>(worker)];
      try {
        for (std::size_t k = next++; k < list.size(); k = next++) take(list[k], up, columns, bench, false);
      } catch (const out_of_core::GivenUp&) {
      } catch (...) {
        if (reader_ != nullptr) reader_->give_up();
        throw;
      }
    });
  };
  const std::size_t levels = small_.size();
  for (std::size_t k = 0; k < levels; ++k) {
    const std::size_t at = up ? k : levels - 1 - k;
    if (up) small(small_[at]);
    for (const Index f : large_[at]) take(f, up, columns, benches_[0], true);
    if (!up) small(small_[at]);
  }
}

template <class T>
void StoreSolve<T>::take(Index f, bool up, Index columns, Bench& bench, bool all_threads) {
  if (!passes(f, up)) return;
  if (reader_ != nullptr) reader_->need(f);
  up ? forward(f, columns, bench, all_threads) : backward(f, columns, bench, all_threads);
  if (reader_ != nullptr) reader_->done(f);
}

template <class T>
void StoreSolve<T>::begin_way(bool up) {
  if (reader_ == nullptr) return;
  std::vector<Index> fronts;
  const auto add = [&](const std::vector<Index>& list) {
    std::copy_if(list.begin(), list.end(), std::back_inserter(fronts), [&](Index f) { return passes(f, up); });
  };
  const std::size_t levels = small_.size();
  for (std::size_t k = 0; k < levels; ++k) {
    const std::size_t at = up ? k : levels - 1 - k;
    if (up) add(small_[at]);
    add(large_[at]);
    if (!up) add(small_[at]);
  }
  reader_->begin_way(fronts, up ? up_second_ : down_second_);
}

// use(first panel, end) over ranges of `rows` / 8 panels.
template <class T>
template <class Use>
void StoreSolve<T>::over_panels(Index rows, bool all_threads, Use&& use) {
  const Index panels = rows / kPanel;
  if (!all_threads || panels <= kPanelsPerRange) {
    if (panels > 0) use(0, panels);
    return;
  }
  pool_.for_each_range(panels, kPanelsPerRange,
                       [&](std::int64_t b, std::int64_t e) { use(static_cast<Index>(b), static_cast<Index>(e)); });
}

template <class T>
void StoreSolve<T>::forward(Index f, Index columns, Bench& bench, bool all_threads) {
  const Front& x = fronts_[f];
  const T* factor = factors_.store + (up_second_ ? (*factors_.second)[f] : (*factors_.first)[f]);
  bench.v.assign(static_cast<std::size_t>(x.total_pad) * columns, T(0));
  T* v = bench.v.data();
  T* rhs = x_ + static_cast<Offset>(x.position) * columns;
  std::copy_n(rhs, static_cast<Offset>(x.pivots) * columns, v);
  const int gap = x.pivot_pad - x.pivots;
  for (Offset q = plan_.child_ptr[f]; q < plan_.child_ptr[f + 1]; ++q) {
    const Index child = plan_.children[q];
    const Offset first = plan_.tree.row_ptr[child];
    for (Index r = 0; r < plan_.tree.rows_below(child); ++r) {
      const Index to = plan_.relative[first + r];
      T* row = v + static_cast<Offset>(to + (to >= x.pivots ? gap : 0)) * columns;
      const T* from = updates_.data() + (first + r) * columns;
      for (Index c = 0; c < columns; ++c) row[c] += from[c];
    }
  }
  // Some tile columns together: their own rows first, by one thread, then all rows after them.
  bench.y.resize(static_cast<std::size_t>(kTogether + 1) * x.width * columns);
  T* y = bench.y.data();  // finished values of one tile column
  for (int first = 0; first < x.pivot_tiles; first += kTogether) {
    const int last = std::min<int>(first + kTogether, x.pivot_tiles), end = x.column_end(last - 1);
    const auto ordered = [&](int j) { return y + static_cast<Offset>(1 + j - first) * x.width * columns; };
    const auto subtract = [&](int j, Index row, Index panels) {
      const int col = x.column_begin(j);
      panels_forward(factor + x.chunk_offset(col / kChunk, row),
                     static_cast<Offset>(x.total_pad - j * x.width) * kChunk, (x.column_end(j) - col) / kChunk, panels,
                     ordered(j), columns, v + static_cast<Offset>(row) * columns);
    };
    for (int j = first; j < last; ++j) {
      const int col = x.column_begin(j), size = x.column_end(j) - col;
      T* in_order = ordered(j);
      for (int q = 0; q < size; q += kChunk)
        order_chunk(v + static_cast<Offset>(col + q) * columns, columns, in_order + q * columns);
      std::fill_n(y, static_cast<Offset>(size) * columns, T(0));
      panels_forward(factor + x.chunk_offset(col / kChunk, col),
                     static_cast<Offset>(x.total_pad - j * x.width) * kChunk, size / kChunk, size / kPanel, in_order,
                     columns, y);  // minus the solution
      for (int k = 0; k < size * columns; ++k) y[k] = -y[k];
      std::copy_n(y, static_cast<Offset>(std::min<int>(size, x.pivots - col)) * columns,
                  rhs + static_cast<Offset>(col) * columns);
      for (int q = 0; q < size; q += kChunk)
        order_chunk(y + static_cast<Offset>(q) * columns, columns, in_order + q * columns);
      subtract(j, col + size, (end - col - size) / kPanel);
    }
    over_panels(x.total_pad - end, all_threads, [&](Index b, Index e) {
      for (int j = first; j < last; ++j) subtract(j, end + b * kPanel, e - b);
    });
  }
  std::copy_n(v + static_cast<Offset>(x.pivot_pad) * columns, static_cast<Offset>(x.below) * columns,
              updates_.data() + plan_.tree.row_ptr[f] * columns);
}

template <class T>
void StoreSolve<T>::backward(Index f, Index columns, Bench& bench, bool all_threads) {
  const Front& x = fronts_[f];
  const T* factor = factors_.store + (down_second_ ? (*factors_.second)[f] : (*factors_.first)[f]);
  bench.v.assign(static_cast<std::size_t>(x.total_pad) * columns, T(0));
  T* v = bench.v.data();
  T* own = x_ + static_cast<Offset>(x.position) * columns;
  std::copy_n(own, static_cast<Offset>(x.pivots) * columns, v);
  if (kind_ == Kind::ldlt)
    apply_inverse_d(factors_.inverse_d->data() + x.position, factors_.inverse_e->data() + x.position, x.pivots, columns,
                    v);
  const Index* rows = plan_.tree.rows.data() + plan_.tree.row_ptr[f];
  for (Index r = 0; r < x.below; ++r)
    std::copy_n(x_ + static_cast<Offset>(rows[r]) * columns, columns,
                v + static_cast<Offset>(x.pivot_pad + r) * columns);
  // Some tile columns together: sums over the rows after them, by ranges whose number does not depend on the threads,
  // then their own rows.
  const int groups = (x.pivot_tiles + kTogether - 1) / kTogether;
  for (int g = groups - 1; g >= 0; --g) {
    const int first = g * kTogether, last = std::min<int>(first + kTogether, x.pivot_tiles);
    const int begin = x.column_begin(first), end = x.column_end(last - 1);
    const Index panels = (x.total_pad - end) / kPanel, ranges = (panels + kPanelsPerRange - 1) / kPanelsPerRange;
    const Offset each = static_cast<Offset>(end - begin) * columns;
    bench.y.assign(static_cast<std::size_t>((ranges + 1) * each), T(0));
    T* const sums = bench.y.data();
    const auto add = [&](int j, Index row, Index count, T* to) {
      const int col = x.column_begin(j);
      for (int q = col; q < x.column_end(j); q += kChunk)
        panels_backward(factor + x.chunk_offset(q / kChunk, row), count, v + static_cast<Offset>(row) * columns,
                        columns, to + static_cast<Offset>(q - begin) * columns);
    };
    const auto sum_range = [&](Index k) {
      const Index b = k * kPanelsPerRange, e = std::min(panels, b + kPanelsPerRange);
      for (int j = first; j < last; ++j) add(j, end + b * kPanel, e - b, sums + k * each);
    };
    if (all_threads && ranges > 1)
      pool_.for_each_range(ranges, 1, [&](std::int64_t b, std::int64_t) { sum_range(static_cast<Index>(b)); });
    else
      for (Index k = 0; k < ranges; ++k) sum_range(k);
    T* own_sum = sums + ranges * each;
    for (int j = last - 1; j >= first; --j) {
      const int col = x.column_begin(j), size = x.column_end(j) - col;
      const Offset skip = static_cast<Offset>(col - begin) * columns;
      T* vj = v + static_cast<Offset>(col) * columns;
      add(j, col + size, (end - col - size) / kPanel, own_sum);
      for (int q = 0; q < size; q += kChunk) {
        const Offset at = skip + static_cast<Offset>(q) * columns;
        for (Index k = 0; k <= ranges; ++k)
          put_chunk(sums + k * each + at, columns, T(-1), vj + static_cast<Offset>(q) * columns);
      }
      std::fill_n(own_sum + skip, static_cast<Offset>(size) * columns, T(0));
      add(j, col, size / kPanel, own_sum);
      std::fill_n(vj, static_cast<Offset>(size) * columns, T(0));
      for (int q = 0; q < size; q += kChunk)
        put_chunk(own_sum + skip + static_cast<Offset>(q) * columns, columns, T(1),
                  vj + static_cast<Offset>(q) * columns);
    }
  }
  std::copy_n(v, static_cast<Offset>(x.pivots) * columns, own);
}

template class StoreSolve<double>;
template class StoreSolve<float>;

}  // namespace espalier::device::cuda
