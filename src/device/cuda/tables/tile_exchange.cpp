#include "device/cuda/tables/tile_exchange.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <thread>
#include <utility>

namespace espalier::device::cuda {

namespace {

constexpr int kRoundsOfPatience = 64;

int seen(int* flag) { return std::atomic_ref(*flag).load(std::memory_order_acquire); }

}  // namespace

double patience_of_kernels(double patience) {
  constexpr double kMost = 1e9;  // the kernels count nanoseconds in 64 bits
  return std::min(2 * patience, kMost);
}

template <class T>
TileExchange<T>::TileExchange(ranks::Communicator& link, const ranks::Machines& machines, const plan::Plan& plan,
                              Kind kind, const DevicePlan& tables, CopyQueues& queues)
    : link_(link),
      kind_(kind),
      tables_(tables),
      messages_(plan, kind, tables),
      queues_(queues),
      landing_(machines, link.rank()) {
  for (const SentTile& tile : messages_.tiles(link.rank())) flag_of_.push_back(messages_.flag(tile));
  mirrored_at_.push_back(0);
  for (std::size_t r = 0; r < tables.place_space.size(); ++r)
    mirrored_at_.push_back(mirrored_at_.back() + ((apart() >> r & 1) != 0 ? tables.place_space[r] : 0));
  due_tiles_ = tiles_to_come();
}

template <class T>
TileExchange<T>::~TileExchange() {
  link_.forget_memory(this);
}

template <class T>
std::size_t TileExchange<T>::slot_bytes() const {
  return sizeof(ranks::Header) + std::max(kSlotBytes, static_cast<std::size_t>(messages_.largest()) * sizeof(T));
}

template <class T>
void TileExchange<T>::use(std::shared_ptr<MessageSlots> slots) {
  slots_ = std::move(slots);
}

template <class T>
void TileExchange<T>::begin(What what, const Arrivals& due) {
  what_ = what;
  first_unsent_ = 0;
  unsent_ = 0;
  due_ = due;
  link_.use_memory(this, [of = slots_](std::size_t bytes) { return of->take(bytes); });
  if (what != What::values)
    std::atomic_ref(memory_.control[memory_.aborted_at[what == What::tiles ? 1 : 0]])
        .store(0, std::memory_order_relaxed);
}

template <class T>
bool TileExchange<T>::given_up() const {
  return what_ != What::values && seen(memory_.control + memory_.aborted_at[what_ == What::tiles ? 1 : 0]) != 0;
}

template <class T>
void TileExchange<T>::begin_factor() {
  begin(What::tiles, due_tiles_);
  const auto& tiles = messages_.tiles(link_.rank());
  sent_.assign(tiles.size(), 0);
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    memory_.mirror[flag_of_[k]] = 0;
    if ((tiles[k].receivers & apart()) == 0)
      sent_[k] = 1;
    else
      ++unsent_;
  }
}

template <class T>
auto TileExchange<T>::parts_of(int rank, Index pass) const -> std::vector<UpdateMessage> {
  std::vector<UpdateMessage> list;
  const auto most = std::max<std::int64_t>(1, static_cast<std::int64_t>(body_bytes() / sizeof(T)) / pass);
  for (const SentUpdates& u : messages_.updates(rank))
    for (std::int64_t row = 0; row < u.below; row += most)
      list.push_back({(u.rows + row) * pass, std::min<std::int64_t>(most, u.below - row) * pass, u.receivers});
  return list;
}

template <class T>
void TileExchange<T>::begin_solve(Index pass) {
  if (parts_pass_ != pass) {
    parts_.clear();
    for (int r = 0; r < link_.size(); ++r) parts_.push_back(parts_of(r, pass));
    parts_pass_ = pass;
    due_updates_ = updates_to_come();
  }
  begin(What::updates, due_updates_);
  const auto& parts = parts_[static_cast<std::size_t>(link_.rank())];
  sent_.assign(parts.size(), 0);
  for (std::size_t k = 0; k < parts.size(); ++k)
    if ((parts[k].receivers & apart()) == 0)
      sent_[k] = 1;
    else
      ++unsent_;
}

template <class T>
void TileExchange<T>::run(const std::function<bool()>& kernels_done) {
  link_.begin_operation();
  link_.begin_waiting();
  for (int round = 1;; ++round) {
    link_.drive([&](int from, const ranks::Message& message) { take(from, message); });
    if (!taken_.empty()) in_.push_back({queues_.mark(Way::to_device), std::exchange(taken_, {})});
    // Asked before: what they made last shows now. Not always: the runtime has one lock for this and for copies.
    const bool done = (nothing_missing() || round % kRoundsOfKernels == 0) && kernels_done();
    finish_copies();
    tell_landed();
    if (what_ == What::tiles)
      look_for_tiles();
    else if (what_ == What::updates)
      look_for_updates();
    else
      look_for_values();
    if (done && given_up())
      throw Error(StatusCode::device_error,
                  fmt::format("the kernels gave up waiting: {} {} were still to be sent, {} to come", unsent_,
                              what_ == What::tiles ? "tiles" : "parts of vectors", due_.missing));
    if (done && nothing_missing()) return;
    if (round % kRoundsOfPatience == 0) link_.expect_patience();
    std::this_thread::yield();
  }
}

template <class T>
void TileExchange<T>::give_up() noexcept {
  queues_.finish();
  taken_.clear();
  in_.clear();
  out_.clear();
  sending_.clear();
}

template <class T>
void TileExchange<T>::share(std::span<std::byte* const> arrays, std::span<const Range> ranges) {
  arrays_ = arrays;
  ranges_ = ranges;
  begin(What::values, values_to_come());
  if (apart() != 0) unsent_ = parts_of_values(link_.rank());
  run([] { return true; });
}

// ---- copies
// ----------------------------------------------------------------------------------------------------------

template <class T>
T* TileExchange<T>::base_of(Piece::Array array, int maker, int rank) const {
  switch (array) {
    case Piece::Array::top:
      return side(rank).top;
    case Piece::Array::pivots:
      return side(rank).pivots;
    default:
      return maker == rank ? side(rank).places : side(rank).mirrored + mirrored_at(maker);
  }
}

template <class T>
void TileExchange<T>::copy_piece(Way way, const Piece& piece, int maker, std::byte* body) {
  T* const device = base_of(piece.array, maker, link_.rank()) + piece.offset;
  queues_.copy(way, {body, reinterpret_cast<std::byte*>(device), static_cast<std::size_t>(piece.pitch) * sizeof(T),
                     static_cast<std::size_t>(piece.width) * sizeof(T), static_cast<std::size_t>(piece.height)});
}

template <class T>
void TileExchange<T>::copy_list(Way way, void* device, const void* host, std::size_t bytes) {
  queues_.copy(way, {const_cast<std::byte*>(static_cast<const std::byte*>(host)), static_cast<std::byte*>(device),
                     bytes, bytes, 1});
}

template <class T>
ranks::Message TileExchange<T>::new_message(std::size_t bytes, std::size_t first, std::size_t count) {
  const std::size_t all = sizeof(ranks::Header) + bytes;
  ranks::Message message = ranks::Message::in(slots_->take(all), all);
  ranks::Header header;
  header.kind = static_cast<std::int32_t>(what_);
  header.number = static_cast<std::int64_t>(first);
  header.row = static_cast<std::int32_t>(count);
  message.set_header(header);
  return message;
}

// In the order in which they were begun, so that the first that is not done ends the search.
template <class T>
void TileExchange<T>::finish_copies() {
  forget_sent();
  while (!in_.empty() && queues_.is_done(in_.front().mark)) in_.pop_front();
  for (; !out_.empty() && queues_.is_done(out_.front().mark); out_.pop_front()) {
    const Leaving& copied = out_.front();
    if (what_ == What::updates && !is_complete(copied.message)) {
      sent_[copied.part] = 0;  // to be looked at again
      continue;
    }
    link_.post(landing_.elsewhere(copied.receivers, copied.key), copied.message);
    sending_.push_back(copied.message.watch());
    unsent_ -= copied.message.header().row;
  }
}

template <class T>
void TileExchange<T>::forget_sent() {
  std::erase_if(sending_, [](const auto& message) { return message.expired(); });
}

// ---- what this rank makes
// --------------------------------------------------------------------------------------------

template <class T>
bool TileExchange<T>::is_finished(std::size_t tile) const {
  return seen(memory_.mirror + flag_of_[tile]) != 0;
}

// Tasks are taken in the order of the list, so what is unfinished of those taken is as much as blocks run.
template <class T>
void TileExchange<T>::look_for_tiles() {
  const auto& tiles = messages_.tiles(link_.rank());
  while (first_unsent_ < tiles.size() && sent_[first_unsent_] != 0) ++first_unsent_;
  std::size_t unfinished = 0;
  for (std::size_t k = first_unsent_; k < tiles.size() && unfinished < kWindow && has_room(); ++k) {
    if (sent_[k] != 0) continue;
    if (!is_finished(k))
      ++unfinished;
    else if (tiles[k].task.work != Work::block || !is_busy())
      send_from(k);
  }
}

// With the tiles below it that are finished, as many as a slot holds.
template <class T>
void TileExchange<T>::send_from(std::size_t first) {
  const int rank = link_.rank();
  const auto& tiles = messages_.tiles(rank);
  const auto bytes_to = [&](std::size_t last) {
    return static_cast<std::size_t>(messages_.elements(tiles[first], tiles[last])) * sizeof(T);
  };
  std::size_t last = first, count = 1;
  sent_[first] = 1;
  for (std::int64_t next = messages_.below(rank, first); next >= 0; next = messages_.below(rank, last)) {
    const auto k = static_cast<std::size_t>(next);
    if (sent_[k] != 0 || !is_finished(k) || sizeof(ranks::Header) + bytes_to(k) > slots_->bytes()) break;
    sent_[k] = 1;
    last = k;
    ++count;
  }
  ranks::Message message = new_message(bytes_to(last), first, count);
  std::byte* body = message.body();
  messages_.for_pieces(tiles[first], tiles[last], [&](const Piece& piece) {
    copy_piece(Way::to_host, piece, rank, body);
    body += static_cast<std::size_t>(piece.elements()) * sizeof(T);
  });
  out_.push_back({queues_.mark(Way::to_host), std::move(message), tiles[first].receivers, key_of(tiles[first]), 0});
}

// Brings the next parts to the host as they are; those that are not complete come again.
template <class T>
void TileExchange<T>::look_for_updates() {
  if (!out_.empty()) return;
  const auto& parts = parts_[static_cast<std::size_t>(link_.rank())];
  while (first_unsent_ < parts.size() && sent_[first_unsent_] != 0) ++first_unsent_;
  std::size_t looked = 0;
  for (std::size_t k = first_unsent_; k < parts.size() && looked < kPartsAtOnce && has_room(); ++k) {
    if (sent_[k] != 0) continue;
    ++looked;
    const auto bytes = static_cast<std::size_t>(parts[k].count) * sizeof(T);
    ranks::Message message = new_message(bytes, k, 1);
    copy_list(Way::to_host, side(link_.rank()).updates + parts[k].first, message.body(), bytes);
    sent_[k] = 1;
    out_.push_back({queues_.mark(Way::to_host), std::move(message), parts[k].receivers, k, k});
  }
}

// Messages count by the first byte of the array.
template <class T>
void TileExchange<T>::look_for_values() {
  const int rank = link_.rank();
  const Range& mine = ranges_[static_cast<std::size_t>(rank)];
  const auto all = apart() != 0 ? static_cast<std::size_t>(mine.count) : 0;
  for (; first_unsent_ < all && !is_busy() && has_room();) {
    const std::size_t bytes = std::min(body_bytes(), all - first_unsent_);
    const std::size_t at = static_cast<std::size_t>(mine.first) + first_unsent_;
    ranks::Message message = new_message(bytes, at, 1);
    copy_list(Way::to_host, arrays_[static_cast<std::size_t>(rank)] + at, message.body(), bytes);
    out_.push_back({queues_.mark(Way::to_host), std::move(message), apart(),
                    key_of_values(rank, static_cast<std::int64_t>(at)), 0});
    first_unsent_ += bytes;
  }
}

template <class T>
bool TileExchange<T>::is_complete(const ranks::Message& message) const {
  std::byte missing[sizeof(T)];
  std::memset(missing, 0xff, sizeof missing);
  const std::byte* const end = message.body() + message.body_bytes();
  for (const std::byte* at = message.body(); at < end; at += sizeof(T))
    if (std::memcmp(at, missing, sizeof(T)) == 0) return false;
  return true;
}

template class TileExchange<double>;
template class TileExchange<float>;

}  // namespace espalier::device::cuda
