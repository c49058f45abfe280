#include "device/host/tile_factor.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>

#include "device/host/assembly.hpp"
#include "device/host/halting.hpp"
#include "device/host/pivoting.hpp"

namespace espalier::device::host {

namespace {

using plan::FrontLayout;
using plan::Task;

// One tile task. The scratch c (and c2 for the U^T part) gathers the tile; ld is its padded height.
template <class T>
class TileTask {
 public:
  TileTask(NumericState<T>& state, Workspace<T>& work, const Task& task)
      : s_(state),
        w_(work),
        plan_(state.plan),
        f_(task.front),
        i_(task.i),
        j_(task.j),
        layout_(plan_.layout[f_]),
        rows_(layout_.width(i_)),
        cols_(layout_.width(j_)),
        ld_(padded<T>(rows_)),
        lu_(state.kind == Kind::lu),
        c_(work.c.data()),
        c2_(work.c2.data()) {
    // A contribution tile is made in its place; its columns are as high as the scratch's.
    if (j_ >= layout_.pivot_tiles) {
      const Offset at = layout_.contribution_offset(i_ - layout_.pivot_tiles, j_ - layout_.pivot_tiles);
      c_ = s_.places + plan_.memory.contribution[f_] + at;
      if (lu_) c2_ = s_.places + plan_.memory.contribution2[f_] + at;
    }
  }

  void run() {
    if (s_.halting && !may_begin()) return finish();
    make();
    if (s_.halting && j_ < layout_.pivot_tiles && s_.open_pivot_tiles[f_].fetch_sub(1, std::memory_order_acq_rel) == 1)
      judge_front(s_, f_);
    finish();
  }

 private:
  // Contributions of a front whose pivots have failed are of no use.
  bool may_begin() {
    if (!memory_is_free(s_, f_, &w_.waited_seconds) || !children_are_good(s_, f_, &w_.waited_seconds)) {
      s_.verdict.set(f_, kVerdictHalted);
      return false;
    }
    if (j_ < layout_.pivot_tiles) return true;
    s_.verdict.wait(f_, s_.abort, &w_.waited_seconds);
    return s_.verdict.value(f_) == kVerdictGood;
  }

  void make() {
    wait_for_memory();
    gather();
    subtract_products();
    if (j_ >= layout_.pivot_tiles) {
      if (lu_ && i_ == j_) part_diagonal_contribution();
    } else if (i_ == j_)
      make_diagonal();
    else
      solve_with_diagonal();
  }

  // One after another, whoever makes them: what a front comes to is added up in their order.
  void make_diagonal() {
    const Index first = s_.window.front == f_ ? s_.window.first_column : 0;
    if (j_ > first) s_.tile_done.wait(number(j_ - 1, j_ - 1), s_.abort, &w_.waited_seconds);
    factor_diagonal(s_, w_, PivotBlock{f_, position(j_), cols_, ld_}, tile(i_, j_), lu_ ? tile2(i_, j_) : nullptr);
  }

  [[nodiscard]] Index position(Index j) const { return plan_.tree.first[f_] + layout_.begin(j); }
  [[nodiscard]] Offset number(Index i, Index j) const { return plan_.first_tile[f_] + layout_.tile_index(i, j); }
  [[nodiscard]] T* tile(Index i, Index j) { return s_.factor(f_) + layout_.tile_offset(i, j); }
  // L D of ldlt, U^T of lu
  [[nodiscard]] T* tile2(Index i, Index j) { return s_.factor2(f_) + layout_.tile_offset(i, j); }
  [[nodiscard]] bool two_parts() const { return lu_ && i_ != j_; }

  void wait_for_memory() {
    const auto& m = plan_.memory;
    for (Offset q = m.wait_ptr[f_]; q < m.wait_ptr[f_ + 1]; ++q)
      s_.front_done.wait(m.wait_fronts[q], s_.abort, &w_.waited_seconds);
  }

  // The part of the tile that was made before, where its place is not the scratch anyway.
  void take_from_place() {
    if (j_ >= layout_.pivot_tiles) return;
    const auto size = static_cast<std::size_t>(ld_ * cols_) * sizeof(T);
    std::memcpy(static_cast<void*>(c_), tile(i_, j_), size);
    if (two_parts()) std::memcpy(static_cast<void*>(c2_), tile2(i_, j_), size);
  }

  void gather() {
    if (s_.window.front == f_) return take_from_place();
    const auto size = static_cast<std::size_t>(ld_ * cols_) * sizeof(T);
    std::memset(static_cast<void*>(c_), 0, size);
    if (two_parts()) std::memset(static_cast<void*>(c2_), 0, size);
    const Offset me = number(i_, j_);
    const std::span<const plan::EntryPlace> entries(
        plan_.entries.data() + plan_.entry_ptr[me],
        static_cast<std::size_t>(plan_.entry_ptr[me + 1] - plan_.entry_ptr[me]));
    if (!entries.empty()) {
      add_entries(entries, s_.values, c_, ld_, lu_ && i_ == j_ ? EntryPart::square : EntryPart::lower);
      if (two_parts()) add_entries(entries, s_.values, c2_, ld_, EntryPart::transposed);
    }
    for (Offset c = plan_.child_ptr[f_]; c < plan_.child_ptr[f_ + 1]; ++c) gather_child(plan_.children[c]);
  }

  // Whether the child has columns in this tile: else another rank need not have sent it here.
  [[nodiscard]] bool reaches_here(Index child) const {
    const Index* begin = plan_.places_in_parent(child);
    const Index* end = begin + plan_.layout[child].below();
    const Index* first = std::lower_bound(begin, end, layout_.begin(j_));
    return first != end && *first < layout_.begin(j_) + cols_;
  }

  void gather_child(Index child) {
    if (!reaches_here(child)) return;
    wait_for_child(child);
    const Index rb = layout_.begin(i_);
    const Index cb = layout_.begin(j_);
    FrontBlock<T> part{c_, ld_, rb, rb + rows_, cb, cb + cols_};
    const T* lower = s_.places + plan_.memory.contribution[child];
    add_contribution(plan_, child, lower, part, false, w_.runs);
    if (!lu_) return;
    const T* upper = s_.places + plan_.memory.contribution2[child];
    if (i_ == j_) {
      add_contribution(plan_, child, upper, part, true, w_.runs);
    } else {
      part.data = c2_;
      add_contribution(plan_, child, upper, part, false, w_.runs);
    }
  }

  // Waits for those contribution tiles of the child that reach into this tile.
  void wait_for_child(Index child) {
    if (plan_.whole[child] != 0 || s_.front_done.is_set(child)) {
      s_.front_done.wait(child, s_.abort, &w_.waited_seconds);
      return;
    }
    const FrontLayout& l = plan_.layout[child];
    const Index* relative = plan_.places_in_parent(child);
    const auto range = [&](Index begin, Index width, Index& first, Index& last) {
      const auto b = std::lower_bound(relative, relative + l.below(), begin) - relative;
      const auto e = std::lower_bound(relative, relative + l.below(), begin + width) - relative;
      first = static_cast<Index>(b) / l.below_width;
      last = b < e ? static_cast<Index>(e - 1) / l.below_width : first - 1;
    };
    Index r0 = 0, r1 = 0, c0 = 0, c1 = 0;
    range(layout_.begin(i_), rows_, r0, r1);
    range(layout_.begin(j_), cols_, c0, c1);
    for (Index c = c0; c <= c1; ++c)
      for (Index r = std::max(r0, c); r <= r1; ++r)
        s_.tile_done.wait(plan_.first_tile[child] + l.tile_index(l.pivot_tiles + r, l.pivot_tiles + c), s_.abort,
                          &w_.waited_seconds);
  }

  void subtract_products() {
    const Index last = std::min(j_, layout_.pivot_tiles);
    for (Index k = s_.window.front == f_ ? s_.window.first_column : 0; k < last; ++k) {
      s_.tile_done.wait(number(i_, k), s_.abort, &w_.waited_seconds);
      s_.tile_done.wait(number(j_, k), s_.abort, &w_.waited_seconds);
      const Index depth = layout_.width(k);
      switch (s_.kind) {
        case Kind::lu:
          s_.dense.gemm_nt(rows_, cols_, depth, tile(i_, k), tile2(j_, k), c_, ld_);
          if (i_ != j_) s_.dense.gemm_nt(rows_, cols_, depth, tile2(i_, k), tile(j_, k), c2_, ld_);
          break;
        default: {
          const T* a = s_.kind == Kind::ldlt ? tile2(i_, k) : tile(i_, k);
          if (i_ == j_)
            s_.dense.syrk_nt(rows_, cols_, depth, a, tile(j_, k), c_, ld_);
          else
            s_.dense.gemm_nt(rows_, cols_, depth, a, tile(j_, k), c_, ld_);
        }
      }
    }
  }

  // The upper triangle of a square contribution tile goes, transposed, where the upper contributions are.
  void part_diagonal_contribution() {
    for (Index c = 0; c < cols_; ++c)
      for (Index r = c + 1; r < rows_; ++r) c2_[c * ld_ + r] = c_[r * ld_ + c];
  }

  // Packs the columns of scratch in the pivot order of the diagonal tile.
  void pack_pivoted(const base::Buffer<T>& from, base::Buffer<T>& to) {
    const std::int32_t* perm = s_.pivot_order.data() + position(j_);
    for (Index k = 0; k < cols_; ++k)
      std::memcpy(static_cast<void*>(to.data() + k * ld_), from.data() + perm[k] * ld_,
                  static_cast<std::size_t>(rows_) * sizeof(T));
    s_.dense.pack(rows_, cols_, to.data(), ld_, w_.panels.data());
  }

  void solve_with_diagonal() {
    s_.tile_done.wait(number(j_, j_), s_.abort, &w_.waited_seconds);
    const T* inverse = tile(j_, j_);
    if (s_.kind == Kind::llt) {
      s_.dense.pack(rows_, cols_, w_.c.data(), ld_, w_.panels.data());
      s_.dense.trmm_nt(rows_, cols_, w_.panels.data(), inverse, tile(i_, j_));
      return;
    }
    const Index at = position(j_);
    if (s_.kind == Kind::ldlt) {
      pack_pivoted(w_.c, w_.c2);
      s_.dense.trmm_nt(rows_, cols_, w_.panels.data(), inverse, tile2(i_, j_));
      s_.dense.scale_columns(rows_, cols_, tile2(i_, j_), s_.d_inverse.data() + at, s_.e_inverse.data() + at,
                             tile(i_, j_));
    } else {
      s_.dense.pack(rows_, cols_, w_.c.data(), ld_, w_.panels.data());
      s_.dense.trmm_nt(rows_, cols_, w_.panels.data(), tile2(j_, j_), tile(i_, j_));
      pack_pivoted(w_.c2, w_.c);
      s_.dense.trmm_nt(rows_, cols_, w_.panels.data(), inverse, tile2(i_, j_));
    }
    std::fill_n(w_.growth(), cols_, RealOf<T>(0));
    const Index counted = std::clamp<Index>(layout_.rows - plan_.tree.border_rows(f_) - layout_.begin(i_), 0, rows_);
    if (counted == rows_)
      s_.dense.column_max(rows_, cols_, tile(i_, j_), w_.growth());
    else
      add_growth(s_, counted, cols_, tile(i_, j_), w_.growth());
    mark_growth(s_, at, cols_, w_.growth());
    if (!lu_ || !has_parted(s_, at, cols_)) return;
    std::fill_n(w_.growth(), cols_, RealOf<T>(0));
    s_.dense.column_max(rows_, cols_, tile2(i_, j_), w_.growth());
    mark_rows(s_, at, cols_, w_.growth());
  }

  void finish() {
    s_.tile_done.set(number(i_, j_));
    if (s_.open_tiles[f_].fetch_sub(1, std::memory_order_acq_rel) == 1) s_.front_done.set(f_);
  }

  NumericState<T>& s_;
  Workspace<T>& w_;
  const plan::Plan& plan_;
  Index f_, i_, j_;
  const FrontLayout& layout_;
  Index rows_, cols_;
  Offset ld_;
  bool lu_;
  T* c_;   // the tile: in the scratch, or in its place among the contributions
  T* c2_;  // its U^T part (lu)
};

}  // namespace

template <class T>
void make_tile(NumericState<T>& state, Workspace<T>& work, const Task& task) {
  TileTask<T>(state, work, task).run();
}

#define ESPALIER_INSTANTIATE(T) template void make_tile(NumericState<T>&, Workspace<T>&, const Task&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
