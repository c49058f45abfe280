#include "device/cuda/tables/tile_messages.hpp"

#include <algorithm>
#include <bit>
#include <unordered_map>

#include "plan/rank_parts.hpp"

namespace espalier::device::cuda {

TileMessages::TileMessages(const plan::Plan& plan, Kind kind, const DevicePlan& tables)
    : plan_(plan),
      kind_(kind),
      tables_(tables),
      tiles_(tables.lists.size()),
      below_(tables.lists.size()),
      updates_(tables.lists.size()) {
  for (std::size_t d = 0; d < tiles_.size(); ++d) {
    list_tiles(static_cast<int>(d));
    join_tiles(static_cast<int>(d));
  }
  list_updates();
}

void TileMessages::list_tiles(int device) {
  auto& list = tiles_[at(device)];
  const auto add = [&](const FactorTask& task, bool contribution, unsigned devices) {
    devices &= ~(1u << device);
    if (devices == 0) return;
    list.push_back({task, contribution, static_cast<std::uint16_t>(devices)});
    largest_ = std::max(largest_, elements(list.back(), list.back()));
  };
  std::int32_t front = -1, column = -1;
  std::uint16_t readers = 0;  // of that column, whose row blocks follow each other
  for (const FactorTask& task : tables_.lists[at(device)].tasks) {
    const Front& f = tables_.fronts[at(task.front)];
    const bool below = task.work == Work::whole ? f.below > 0 : task.column >= f.pivot_tiles;
    if (f.region == 0 && (task.work == Work::whole || !below)) add(task, false, f.members);
    if (!below || f.readers == 0) continue;
    if (task.front != front || task.column != column) readers = readers_of(task);
    front = task.front;
    column = task.column;
    add(task, true, readers);
  }
}

// Flags of the row blocks of a column are neighbours.
void TileMessages::join_tiles(int device) {
  const auto& tiles = tiles_[at(device)];
  auto& below = below_[at(device)];
  below.assign(tiles.size(), -1);
  std::unordered_map<std::int64_t, std::int32_t> of_flag;
  for (std::size_t k = 0; k < tiles.size(); ++k)
    if (tiles[k].task.work == Work::block) of_flag.emplace(flag(tiles[k]), static_cast<std::int32_t>(k));
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    if (tiles[k].task.work != Work::block) continue;
    const auto found = of_flag.find(flag(tiles[k]) + 1);
    if (found != of_flag.end() && joined(tiles[k], tiles[at(found->second)])) below[k] = found->second;
  }
}

// Who makes a column of the parent that a tile column of the contribution reaches.
std::uint16_t TileMessages::readers_of(const FactorTask& task) const {
  const Front& f = tables_.fronts[at(task.front)];
  unsigned devices = 0;
  for (const Index d : plan::readers(plan_, task.front, task.work == Work::whole ? -1 : task.column - f.pivot_tiles))
    devices |= 1u << d;
  return static_cast<std::uint16_t>(devices & f.readers);
}

// The member with the lowest number speaks for a front (SolveState::speaks_for).
void TileMessages::list_updates() {
  for (const Front& f : tables_.fronts) {
    const unsigned receivers = static_cast<unsigned>(f.readers) & ~static_cast<unsigned>(f.members);
    if (f.below == 0 || receivers == 0) continue;
    updates_[static_cast<std::size_t>(std::countr_zero(f.members))].push_back(
        {f.rows, f.below, static_cast<std::uint16_t>(receivers)});
  }
}

std::int64_t TileMessages::flag(const SentTile& tile) const {
  const Front& f = front_of(tile);
  const FactorTask& task = tile.task;
  switch (task.work) {
    case Work::whole:
      return f.below > 0 ? f.flag(f.pivot_blocks, f.pivot_tiles) : f.diagonal_flag(0);
    case Work::diagonal:
      return f.diagonal_flag(task.column);
    default:
      return task.part * tables_.flags + f.flag(task.block, task.column);
  }
}

TileMessages::Rows TileMessages::rows_of(const SentTile& tile) const {
  const Front& f = front_of(tile);
  const int j = tile.task.column;
  return {std::max(f.block_begin(tile.task.block), j < f.pivot_tiles ? f.column_end(j) : f.column_begin(j)),
          f.block_end(tile.task.block)};
}

bool TileMessages::joined(const SentTile& tile, const SentTile& next) const {
  const FactorTask &a = tile.task, &b = next.task;
  return a.work == Work::block && b.work == Work::block && a.front == b.front && a.part == b.part &&
         a.column == b.column && a.block + 1 == b.block && tile.receivers == next.receivers &&
         rows_of(tile).end == rows_of(next).begin;
}

std::int64_t TileMessages::elements(const SentTile& first, const SentTile& last) const {
  std::int64_t sum = 0;
  for (const Piece& p : pieces(first, last)) sum += p.elements();
  return sum;
}

TileMessages::Pieces TileMessages::pieces(const SentTile& first, const SentTile& last) const {
  Pieces list;
  if (first.task.work == Work::whole)
    add_whole(first, list);
  else if (first.task.work == Work::diagonal)
    add_diagonal(first, list);
  else
    add_blocks(first, last, list);
  return list;
}

void TileMessages::add_whole(const SentTile& tile, Pieces& to) const {
  const Front& f = front_of(tile);
  const int arrays = kind_ == Kind::lu ? 2 : 1;
  for (int part = 0; part < arrays; ++part) {
    if (!tile.contribution) {
      to.add({Piece::Array::top, part == 0 ? f.factor : f.second, 0, f.factor_size(), 1});
      continue;
    }
    const Place& place = tables_.places[at(f.place(0, part))];
    to.add({Piece::Array::places, place.offset, f.below_ld, f.below, f.below});
  }
  if (!tile.contribution)
    to.add({Piece::Array::pivots, f.position, plan_.tree.n, f.pivots, kind_ == Kind::ldlt ? 3 : 1});
}

void TileMessages::add_diagonal(const SentTile& tile, Pieces& to) const {
  const Front& f = front_of(tile);
  const int j = tile.task.column, col = f.column_begin(j), size = f.column_end(j) - col;
  for (int part = 0; part < (kind_ == Kind::lu ? 2 : 1); ++part)
    to.add({Piece::Array::top, (part == 0 ? f.factor : f.second) + f.chunk_offset(col / kChunk, col),
            static_cast<std::int64_t>(f.total_pad - col) * kChunk, static_cast<std::int64_t>(size) * kChunk,
            size / kChunk});
  to.add({Piece::Array::pivots, f.position + col, plan_.tree.n, std::min(f.pivots - col, size),
          kind_ == Kind::ldlt ? 3 : 1});
}

void TileMessages::add_blocks(const SentTile& first, const SentTile& last, Pieces& to) const {
  const Front& f = front_of(first);
  const int j = first.task.column, part = first.task.part;
  const int col = f.column_begin(j), cols = f.column_end(j) - col, row = rows_of(first).begin, end = rows_of(last).end;
  if (j >= f.pivot_tiles) {
    const int r0 = row - f.pivot_pad, c0 = col - f.pivot_pad;
    const Place& place = tables_.places[at(f.place(j - f.pivot_tiles, part))];
    to.add({Piece::Array::places, place.offset + (r0 - c0), f.below_ld - c0, std::min(end - row, f.below - r0),
            std::min(cols, f.below - c0)});
    return;
  }
  const auto add = [&](std::int64_t array) {
    to.add({Piece::Array::top, array + f.chunk_offset(col / kChunk, row),
            static_cast<std::int64_t>(f.total_pad - j * f.width) * kChunk,
            static_cast<std::int64_t>(end - row) * kChunk, cols / kChunk});
  };
  if (kind_ != Kind::lu || part == 0) add(f.factor);
  if (kind_ == Kind::ldlt || part == 1) add(f.second);
}

}  // namespace espalier::device::cuda
