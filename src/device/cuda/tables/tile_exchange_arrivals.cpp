#include <fmt/format.h>

#include "device/cuda/tables/tile_exchange.hpp"

namespace espalier::device::cuda {

// ---- what is to come: sender and receivers count alike
// ----------------------------------------------------------------

template <class T>
Arrivals TileExchange<T>::tiles_to_come() const {
  Arrivals due;
  for (const int r : ranks_of(apart()))
    for (const SentTile& tile : messages_.tiles(r)) due.add(landing_, link_.rank(), tile.receivers, key_of(tile));
  return due;
}

template <class T>
Arrivals TileExchange<T>::updates_to_come() const {
  Arrivals due;
  for (const int r : ranks_of(apart())) {
    const auto& parts = parts_[static_cast<std::size_t>(r)];
    for (std::size_t k = 0; k < parts.size(); ++k) due.add(landing_, link_.rank(), parts[k].receivers, k);
  }
  return due;
}

template <class T>
Arrivals TileExchange<T>::values_to_come() const {
  Arrivals due;
  for (const int r : ranks_of(apart()))
    for (std::int64_t part = 0; part < parts_of_values(r); ++part)
      due.add(landing_, link_.rank(), ~std::uint32_t{0}, static_cast<std::size_t>(part));
  return due;
}

template <class T>
std::int64_t TileExchange<T>::parts_of_values(int rank) const {
  const auto most = static_cast<std::int64_t>(body_bytes());
  return (ranges_[static_cast<std::size_t>(rank)].count + most - 1) / most;
}

// The number of the part that begins there.
template <class T>
std::size_t TileExchange<T>::key_of_values(int rank, std::int64_t at) const {
  return static_cast<std::size_t>(at - ranges_[static_cast<std::size_t>(rank)].first) / body_bytes();
}

// ---- what comes
// -------------------------------------------------------------------------------------------------------

template <class T>
void TileExchange<T>::take(int from, const ranks::Message& message) {
  const ranks::Header header = message.header();
  if (header.kind == kLanded) return take_word(from, message);
  if (header.kind != static_cast<std::int32_t>(what_) || header.row < 1 || header.row > due_.missing)
    throw other_calls(from);
  if (what_ == What::tiles)
    take_tiles(from, message);
  else if (what_ == What::updates)
    take_updates(from, message);
  else
    take_values(from, message);
  due_.missing -= header.row;
  taken_.push_back(message);
}

template <class T>
void TileExchange<T>::take_tiles(int from, const ranks::Message& message) {
  const auto& tiles = messages_.tiles(from);
  const auto first = static_cast<std::size_t>(message.header().number);
  std::size_t last = first;
  for (int k = 1; k < message.header().row; ++k) last = static_cast<std::size_t>(messages_.below(from, last));
  const auto for_pieces = [&](auto&& use) { messages_.for_pieces(tiles.at(first), tiles.at(last), use); };
  const auto for_flags = [&](auto&& use) { messages_.for_flags(tiles[first], tiles[last], use); };
  auto* body = const_cast<std::byte*>(message.body());
  for_pieces([&](const Piece& piece) {
    copy_piece(Way::to_device, piece, from, body);
    body += static_cast<std::size_t>(piece.elements()) * sizeof(T);
  });
  int* const flags = side(link_.rank()).flags;
  for_flags([&](std::int64_t flag, std::int64_t count) {
    copy_list(Way::to_device, flags + flag, memory_.ones, static_cast<std::size_t>(count) * sizeof(int));
  });
  for (const int to : beside(tiles[first].receivers)) {
    for_pieces([&](const Piece& piece) { pass_on_piece(piece, from, to); });
    for_flags([&](std::int64_t flag, std::int64_t count) {
      pass_on_list(flags + flag, side(to).flags + flag, static_cast<std::size_t>(count) * sizeof(int));
    });
  }
}

template <class T>
void TileExchange<T>::take_updates(int from, const ranks::Message& message) {
  const UpdateMessage& part =
      parts_[static_cast<std::size_t>(from)].at(static_cast<std::size_t>(message.header().number));
  T* const here = side(link_.rank()).updates + part.first;
  copy_list(Way::to_device, here, message.body(), message.body_bytes());
  for (const int to : beside(part.receivers)) pass_on_list(here, side(to).updates + part.first, message.body_bytes());
}

template <class T>
void TileExchange<T>::take_values(int from, const ranks::Message& message) {
  const Range& theirs = ranges_[static_cast<std::size_t>(from)];
  const std::int64_t at = message.header().number, bytes = static_cast<std::int64_t>(message.body_bytes());
  if (at < theirs.first || at + bytes > theirs.first + theirs.count) throw other_calls(from);
  std::byte* const here = arrays_[static_cast<std::size_t>(link_.rank())] + at;
  copy_list(Way::to_device, here, message.body(), message.body_bytes());
  for (const int to : beside(~std::uint32_t{0}))
    pass_on_list(here, arrays_[static_cast<std::size_t>(to)] + at, message.body_bytes());
}

template <class T>
Error TileExchange<T>::other_calls(int rank) const {
  return {StatusCode::device_error, fmt::format("{} makes other calls", link_.name_of(rank))};
}

// ---- what goes on to the ranks beside this one
// ------------------------------------------------------------------------

template <class T>
void TileExchange<T>::pass_on_piece(const Piece& piece, int maker, int to) {
  queues_.pass_on({reinterpret_cast<const std::byte*>(base_of(piece.array, maker, link_.rank()) + piece.offset),
                   reinterpret_cast<std::byte*>(base_of(piece.array, maker, to) + piece.offset),
                   static_cast<std::size_t>(piece.pitch) * sizeof(T), static_cast<std::size_t>(piece.width) * sizeof(T),
                   static_cast<std::size_t>(piece.height)});
}

template <class T>
void TileExchange<T>::pass_on_list(const void* from, void* to, std::size_t bytes) {
  queues_.pass_on({static_cast<const std::byte*>(from), static_cast<std::byte*>(to), bytes, bytes, 1});
}

// Once all that lands here is in everybody's memory. They cannot see it, and what they do next may overwrite that
// memory.
template <class T>
void TileExchange<T>::tell_landed() {
  if (due_.for_others == 0 || due_.missing != 0 || !in_.empty()) return;
  ranks::Message word(0);
  ranks::Header header;
  header.kind = kLanded;
  header.number = static_cast<std::int64_t>(what_);
  word.set_header(header);
  link_.post(ranks_of(due_.for_others), word);
  sending_.push_back(word.watch());
  due_.for_others = 0;
}

template <class T>
void TileExchange<T>::take_word(int from, const ranks::Message& message) {
  const std::uint32_t bit = 1U << from;
  if (message.header().number != static_cast<std::int64_t>(what_) || (due_.from_others & bit) == 0)
    throw other_calls(from);
  due_.from_others &= ~bit;
}

template class TileExchange<double>;
template class TileExchange<float>;

}  // namespace espalier::device::cuda
