#include "device/host/ranks/rank_traffic.hpp"

#include <algorithm>
#include <type_traits>

#include "device/host/halting.hpp"
#include "plan/rank_parts.hpp"

namespace espalier::device::host {

namespace {

using plan::FrontLayout;
using ranks::Header;
using ranks::Message;
using ranks::Reader;
using ranks::Writer;

static_assert(std::is_trivially_copyable_v<FrontOutcome>);

Message message_of(Cargo cargo, Index f, Index i, Index j, std::size_t bytes) {
  Message m(bytes);
  Header h;
  h.kind = static_cast<std::int32_t>(cargo);
  h.front = f;
  h.row = i;
  h.column = j;
  m.set_header(h);
  return m;
}

auto count_of(Offset n) { return static_cast<std::size_t>(n); }

}  // namespace

template <class T>
RankTraffic<T>::RankTraffic(NumericState<T>& state, ranks::Communicator& link)
    : s_(state),
      plan_(state.plan),
      link_(link),
      announced_(std::make_unique<std::atomic<bool>[]>(count_of(state.plan.fronts()))) {}

template <class T>
void RankTraffic<T>::reset() {
  for (Index f = 0; f < plan_.fronts(); ++f) announced_[count_of(f)] = false;
  done_ = 0;
  halted_ = false;
}

template <class T>
std::vector<int> RankTraffic<T>::others(const std::vector<Index>& ranks) const {
  std::vector<int> list;
  for (const Index r : ranks)
    if (r != me()) list.push_back(r);
  return list;
}

// Whether other ranks may work on what is above the front.
template <class T>
bool RankTraffic<T>::passes_on(Index f) const {
  const Index parent = plan_.tree.parent[f];
  return parent >= 0 && is_shared(parent);
}

template <class T>
void RankTraffic<T>::send_made(const plan::Task& task) {
  const Index f = task.front;
  if (!is_shared(f) && !passes_on(f)) return;
  const std::uint8_t verdict = s_.halting ? s_.verdict.value(f) : std::uint8_t{kVerdictGood};
  if (task.is_range()) {
    if (verdict == kVerdictGood || verdict == kVerdictFailed) send_range(f);
  } else if (task.j < plan_.layout[f].pivot_tiles) {
    if (verdict != kVerdictHalted && is_shared(f)) send_factor_tile(task);
  } else if (verdict == kVerdictGood && passes_on(f)) {
    send_contribution(f, task.i - plan_.layout[f].pivot_tiles, task.j - plan_.layout[f].pivot_tiles);
  }
  if (s_.halting) announce(f);
}

template <class T>
void RankTraffic<T>::send_range(Index f) {
  if (is_shared(f)) send_whole_factor(f);
  if (passes_on(f) && plan_.layout[f].below() > 0) send_contribution(f, -1, -1);
}

// What belongs to the pivots of a tile column, and, of its diagonal tile, to the front.
template <class T>
std::size_t RankTraffic<T>::pivot_bytes(const Pivots& p) const {
  const auto n = count_of(p.count);
  std::size_t bytes = n;  // states of columns
  if (!p.booked) return bytes;
  bytes += sizeof(FrontOutcome);
  if (s_.kind != Kind::llt) bytes += n * sizeof(std::int32_t);
  if (s_.kind == Kind::ldlt) bytes += 2 * n * sizeof(T);
  return bytes;
}

template <class T>
bool RankTraffic<T>::makes_pivots(Index f, Index j) const {
  return j < plan_.layout[f].pivot_tiles && plan::maker(plan_, f, j) == me();
}

template <class T>
void RankTraffic<T>::put_pivots(Index f, const Pivots& p, Writer& to) const {
  const auto n = count_of(p.count);
  for (std::size_t k = 0; k < n; ++k) {  // others may be adding marks of their tiles
    const char state = std::atomic_ref<char>(s_.column_state[count_of(p.position) + k]).load(std::memory_order_relaxed);
    to.write(&state, 1);
  }
  if (!p.booked) return;
  // Where the next column is made here, another thread may be adding to it, and nobody goes on from it elsewhere.
  const FrontOutcome outcome = p.go_on_here ? FrontOutcome{} : s_.fronts[count_of(f)];
  to.write(&outcome, 1);
  if (s_.kind != Kind::llt) to.write(s_.pivot_order.data() + p.position, n);
  if (s_.kind != Kind::ldlt) return;
  to.write(s_.d_inverse.data() + p.position, n);
  to.write(s_.e_inverse.data() + p.position, n);
}

template <class T>
void RankTraffic<T>::get_pivots(Index f, const Pivots& p, Reader& from) {
  const auto n = count_of(p.count);
  for (std::size_t k = 0; k < n; ++k) {
    char state = 0;
    from.get(&state, 1);
    std::atomic_ref<char>(s_.column_state[count_of(p.position) + k]).fetch_or(state, std::memory_order_relaxed);
  }
  if (!p.booked) return;
  FrontOutcome outcome;
  from.get(&outcome, 1);
  if (p.go_on_here) s_.fronts[count_of(f)] = outcome;
  if (s_.kind != Kind::llt) from.get(s_.pivot_order.data() + p.position, n);
  if (s_.kind != Kind::ldlt) return;
  from.get(s_.d_inverse.data() + p.position, n);
  from.get(s_.e_inverse.data() + p.position, n);
}

template <class T>
void RankTraffic<T>::send_factor_tile(const plan::Task& task) {
  const Index f = task.front;
  const std::vector<int> to = others(plan::keepers(plan_, f));
  if (to.empty()) return;
  const FrontLayout& l = plan_.layout[f];
  const Pivots p{plan_.tree.first[f] + l.begin(task.j), l.width(task.j), task.i == task.j, makes_pivots(f, task.j + 1)};
  const std::size_t size = count_of(padded<T>(l.width(task.i)) * l.width(task.j));
  // In ldlt the diagonal tile has one part.
  const bool second = s_.kind == Kind::lu || (s_.kind == Kind::ldlt && task.i != task.j);
  Message m = message_of(Cargo::factor_tile, f, task.i, task.j, size * sizeof(T) * (second ? 2 : 1) + pivot_bytes(p));
  Writer w(m.body());
  const Offset at = l.tile_offset(task.i, task.j);
  w.write(s_.factor(f) + at, size);
  if (second) w.write(s_.factor2(f) + at, size);
  put_pivots(f, p, w);
  link_.post(to, std::move(m));
}

template <class T>
void RankTraffic<T>::take_factor_tile(const Header& h, Reader from) {
  const Index f = h.front;
  const FrontLayout& l = plan_.layout[f];
  // Who makes the next column adds to what the front came to so far; all others hear of it at the end.
  const Pivots p{plan_.tree.first[f] + l.begin(h.column), l.width(h.column), h.row == h.column,
                 makes_pivots(f, h.column + 1)};
  const std::size_t size = count_of(padded<T>(l.width(h.row)) * l.width(h.column));
  const bool second = s_.kind == Kind::lu || (s_.kind == Kind::ldlt && h.row != h.column);
  const Offset at = l.tile_offset(h.row, h.column);
  from.get(s_.factor(f) + at, size);
  if (second) from.get(s_.factor2(f) + at, size);
  get_pivots(f, p, from);
  close_pivot_tile(f);
  s_.tile_done.set(plan_.first_tile[f] + l.tile_index(h.row, h.column));
  if (s_.open_tiles[f].fetch_sub(1, std::memory_order_acq_rel) == 1) s_.front_done.set(f);
}

// As TileTask does for tiles that are made here.
template <class T>
void RankTraffic<T>::close_pivot_tile(Index f) {
  if (!s_.halting || s_.open_pivot_tiles[f].fetch_sub(1, std::memory_order_acq_rel) != 1) return;
  judge_front(s_, f);
  announce(f);
}

template <class T>
void RankTraffic<T>::send_whole_factor(Index f) {
  const std::vector<int> to = others(plan::keepers(plan_, f));
  if (to.empty()) return;
  const FrontLayout& l = plan_.layout[f];
  const Pivots p{plan_.tree.first[f], l.pivots, true};
  const std::size_t size = count_of(l.factor_size()), parts = s_.kind == Kind::lu ? 2 : 1;
  Message m = message_of(Cargo::whole_factor, f, 0, 0, parts * size * sizeof(T) + pivot_bytes(p));
  Writer w(m.body());
  w.write(s_.factor(f), size);
  if (parts == 2) w.write(s_.factor2(f), size);
  put_pivots(f, p, w);
  link_.post(to, std::move(m));
}

template <class T>
void RankTraffic<T>::take_whole_factor(Index f, Reader from) {
  const FrontLayout& l = plan_.layout[f];
  const std::size_t size = count_of(l.factor_size());
  from.get(s_.factor(f), size);
  if (s_.kind == Kind::lu) from.get(s_.factor2(f), size);
  get_pivots(f, {plan_.tree.first[f], l.pivots, true}, from);
  if (s_.halting) judge_front(s_, f);
}

// Tile (i, j) below the pivots, or all of a front that is taken whole (i < 0).
template <class T>
void RankTraffic<T>::send_contribution(Index f, Index i, Index j) {
  const std::vector<int> to = others(plan::readers(plan_, f, j));
  if (to.empty()) return;
  const FrontLayout& l = plan_.layout[f];
  const bool whole = i < 0;
  const Offset at = whole ? 0 : l.contribution_offset(i, j);
  const std::size_t size =
      count_of(whole ? l.contribution_size() : l.contribution_ld(i) * static_cast<Offset>(l.below_rows(j)));
  const std::size_t parts = s_.kind == Kind::lu ? 2 : 1;
  Message m =
      message_of(whole ? Cargo::whole_contribution : Cargo::contribution_tile, f, i, j, parts * size * sizeof(T));
  Writer w(m.body());
  w.write(s_.places + plan_.memory.contribution[f] + at, size);
  if (parts == 2) w.write(s_.places + plan_.memory.contribution2[f] + at, size);
  link_.post(to, std::move(m));
}

template <class T>
void RankTraffic<T>::take_contribution(const Header& h, Reader from, bool whole) {
  const Index f = h.front;
  const FrontLayout& l = plan_.layout[f];
  const Offset at = whole ? 0 : l.contribution_offset(h.row, h.column);
  const std::size_t size =
      count_of(whole ? l.contribution_size() : l.contribution_ld(h.row) * static_cast<Offset>(l.below_rows(h.column)));
  from.get(s_.places + plan_.memory.contribution[f] + at, size);
  if (s_.kind == Kind::lu) from.get(s_.places + plan_.memory.contribution2[f] + at, size);
  if (whole) return s_.front_done.set(f);
  s_.tile_done.set(plan_.first_tile[f] + l.tile_index(l.pivot_tiles + h.row, l.pivot_tiles + h.column));
  if (s_.open_tiles[f].fetch_sub(1, std::memory_order_acq_rel) == 1) s_.front_done.set(f);
}

// The maker of its first column tells the verdict over a front, once, to all that may work above it.
template <class T>
void RankTraffic<T>::announce(Index f) {
  if (!passes_on(f) || plan::maker(plan_, f, 0) != me()) return;
  const std::uint8_t verdict = s_.verdict.value(f);
  if (verdict == kVerdictOpen || announced_[count_of(f)].exchange(true)) return;
  const std::vector<int> to = others(plan::keepers(plan_, plan_.tree.parent[f]));
  if (!to.empty()) link_.post(to, message_of(Cargo::verdict, f, verdict, 0, 0));
}

// Who knows first what a front came to: the maker of its last pivots.
template <class T>
Index RankTraffic<T>::reporter(Index f) const {
  return plan::maker(plan_, f, std::max<Index>(plan_.layout[f].pivot_tiles, 1) - 1);
}

// take(begin, end): positions of pivots that the rank has eliminated.
template <class T>
template <class Take>
void RankTraffic<T>::for_each_own_column(int rank, const Take& take) const {
  for (Index f = 0; f < plan_.fronts(); ++f) {
    const FrontLayout& l = plan_.layout[f];
    const Index at = plan_.tree.first[f];
    if (!is_shared(f) || plan_.whole[f] != 0) {
      if (plan::maker(plan_, f, 0) == rank) take(at, at + l.pivots);
      continue;
    }
    for (Index j = 0; j < l.pivot_tiles; ++j)
      if (plan::maker(plan_, f, j) == rank) take(at + l.begin(j), at + l.begin(j) + l.width(j));
  }
}

template <class T>
void RankTraffic<T>::send_done() {
  bool halted = false;
  for (Index f = 0; f < plan_.fronts() && !halted; ++f) halted = s_.verdict.value(f) == kVerdictHalted;
  halted_ = halted_ || halted;
  std::vector<FrontOutcome> outcomes;
  for (Index f = 0; f < plan_.fronts(); ++f)
    if (reporter(f) == me()) outcomes.push_back(s_.fronts[count_of(f)]);
  std::vector<Index> positions;
  std::vector<char> states;
  for_each_own_column(me(), [&](Index begin, Index end) {
    for (Index p = begin; p < end; ++p) {
      if (s_.column_state[count_of(p)] == kColumnFine) continue;
      positions.push_back(p);
      states.push_back(s_.column_state[count_of(p)]);
    }
  });
  Message m = message_of(Cargo::done, 0, halted ? 1 : 0, 0,
                         outcomes.size() * sizeof(FrontOutcome) + positions.size() * (sizeof(Index) + 1));
  Writer w(m.body());
  w.write(outcomes.data(), outcomes.size());
  w.write(positions.data(), positions.size());
  w.write(states.data(), states.size());
  std::vector<int> all;
  for (int r = 0; r < link_.size(); ++r)
    if (r != me()) all.push_back(r);
  link_.post(all, std::move(m));
}

template <class T>
void RankTraffic<T>::take_done(int from, Reader reader) {
  for (Index f = 0; f < plan_.fronts(); ++f)
    if (reporter(f) == from) reader.get(&s_.fronts[count_of(f)], 1);
  std::vector<Index> positions(reader.left() / (sizeof(Index) + 1));
  std::vector<char> states(positions.size());
  reader.get(positions.data(), positions.size());
  reader.get(states.data(), states.size());
  for (std::size_t k = 0; k < positions.size(); ++k)
    std::atomic_ref<char>(s_.column_state[count_of(positions[k])]).fetch_or(states[k], std::memory_order_relaxed);
  ++done_;
}

template <class T>
void RankTraffic<T>::take(int from, const Message& message) {
  const Header h = message.header();
  const Reader reader(message.body(), message.body_bytes());
  switch (static_cast<Cargo>(h.kind)) {
    case Cargo::factor_tile:
      return take_factor_tile(h, reader);
    case Cargo::whole_factor:
      return take_whole_factor(h.front, reader);
    case Cargo::contribution_tile:
      return take_contribution(h, reader, false);
    case Cargo::whole_contribution:
      return take_contribution(h, reader, true);
    case Cargo::verdict:
      return s_.verdict.set(h.front, static_cast<std::uint8_t>(h.row));
    case Cargo::done:
      halted_ = halted_ || h.row != 0;
      return take_done(from, reader);
    case Cargo::solution_rows:
      break;
  }
}

#define ESPALIER_INSTANTIATE(T) template class RankTraffic<T>;
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
