#include "device/cuda/executor/tile_exchange.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <thread>

namespace espalier::device::cuda {

namespace {

constexpr int kRoundsOfPatience = 64;

int seen(int* flag) { return std::atomic_ref(*flag).load(std::memory_order_acquire); }

std::vector<int> ranks_of(unsigned devices) {
  std::vector<int> list;
  for (int r = 0; devices != 0; ++r, devices >>= 1)
    if ((devices & 1) != 0) list.push_back(r);
  return list;
}

}  // namespace

template <class T>
TileExchange<T>::TileExchange(ranks::Link& link, const plan::Plan& plan, Kind kind, const DevicePlan& tables)
    : link_(link), plan_(plan), kind_(kind), tables_(tables), messages_(plan, kind, tables) {
  for (int r = 0; r < link.size(); ++r)
    if (link.machine_of(r) != link.machine_of(link.rank())) apart_ |= 1u << r;
}

template <class T>
TileExchange<T>::~TileExchange() {
  link_.use_memory({});
}

template <class T>
void TileExchange<T>::take_memory(DeviceBudget& budget) {
  const auto ranks = static_cast<std::size_t>(link_.size());
  places_.resize(ranks);
  place_starts_.assign(ranks, nullptr);
  for (std::size_t r = 0; r < ranks; ++r) {
    if (!is_apart(static_cast<int>(r)) || tables_.place_space[r] == 0) continue;
    const Offset size = tables_.place_space[r];
    places_[r] = DeviceArray<T>(size, budget, budget.held() + size * static_cast<Offset>(sizeof(T)));
    place_starts_[r] = places_[r].data();
  }
  const Offset flags = (kind_ == Kind::lu ? 2 : 1) * tables_.flags;
  flags_ = PinnedArray<int>(flags);
  control_ = PinnedArray<int>(2 * kCounters);
  Offset blocks = 1;
  for (const Front& f : tables_.fronts) blocks = std::max<Offset>(blocks, f.blocks);
  ones_ = PinnedArray<int>(blocks);
  std::fill(flags_.data(), flags_.data() + flags, 0);
  std::fill(control_.data(), control_.data() + control_.size(), 0);
  std::fill(ones_.data(), ones_.data() + ones_.size(), 1);
  const std::size_t largest = static_cast<std::size_t>(messages_.largest()) * sizeof(T);
  slots_ = std::make_shared<PinnedSlots>(kSlots, sizeof(ranks::Header) + std::max(kSlotBytes, largest));
  link_.use_memory([slots = slots_](std::size_t bytes) { return slots->take(bytes); });
  for (std::size_t k = 0; k < kSlots; ++k) {
    events_.push_back(std::make_unique<Event>());
    free_events_.push_back(k);
  }
}

template <class T>
void TileExchange<T>::mirror(const SideAddresses<T>& mine, std::vector<SideAddresses<T>>& sides) {
  mine_ = mine;
  for (std::size_t r = 0; r < sides.size(); ++r) {
    if (!is_apart(static_cast<int>(r))) continue;
    sides[r] = mine;
    sides[r].places = place_starts_[r];
    sides[r].control = control_.data();
    sides[r].flags = flags_.data();
    sides[r].solve_control = control_.data() + kCounters;
  }
}

template <class T>
void TileExchange<T>::begin(bool factor) {
  factor_ = factor;
  first_unsent_ = 0;
  unsent_ = missing_ = 0;
  std::fill(control_.data(), control_.data() + control_.size(), 0);
}

template <class T>
void TileExchange<T>::begin_factor() {
  begin(true);
  const auto& tiles = messages_.tiles(link_.rank());
  sent_.assign(tiles.size(), 0);
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    flags_.data()[messages_.flag(tiles[k])] = 0;
    if ((tiles[k].receivers & apart_) == 0)
      sent_[k] = 1;
    else
      ++unsent_;
  }
  for (const int r : ranks_of(apart_))
    for (const SentTile& tile : messages_.tiles(r)) missing_ += tile.receivers >> link_.rank() & 1;
}

template <class T>
auto TileExchange<T>::parts_of(int rank, Index pass) const -> std::vector<Part> {
  std::vector<Part> list;
  const auto most = std::max<std::int64_t>(1, static_cast<std::int64_t>(kSlotBytes / sizeof(T)) / pass);
  for (const SentUpdates& u : messages_.updates(rank))
    for (std::int64_t row = 0; row < u.below; row += most)
      list.push_back({(u.rows + row) * pass, std::min<std::int64_t>(most, u.below - row) * pass, u.receivers});
  return list;
}

template <class T>
void TileExchange<T>::begin_solve(Index pass) {
  begin(false);
  pass_ = pass;
  if (parts_pass_ != pass) {
    parts_.clear();
    for (int r = 0; r < link_.size(); ++r) parts_.push_back(parts_of(r, pass));
    parts_pass_ = pass;
  }
  const auto& parts = parts_[static_cast<std::size_t>(link_.rank())];
  sent_.assign(parts.size(), 0);
  for (std::size_t k = 0; k < parts.size(); ++k)
    if ((parts[k].receivers & apart_) == 0)
      sent_[k] = 1;
    else
      ++unsent_;
  for (const int r : ranks_of(apart_))
    for (const Part& part : parts_[static_cast<std::size_t>(r)]) missing_ += part.receivers >> link_.rank() & 1;
}

template <class T>
void TileExchange<T>::run(const std::function<bool()>& kernels_done) {
  link_.begin_operation();
  link_.begin_waiting();
  for (int round = 1;; ++round) {
    link_.drive([&](int from, const ranks::Message& message) { take(from, message); });
    const bool done = kernels_done();  // asked before: what they made last shows now
    finish_copies();
    if (factor_)
      look_for_tiles();
    else
      look_for_updates();
    if (done && seen(control_.data() + (factor_ ? int{kAborted} : kCounters + 1)) != 0)
      throw Error(StatusCode::device_error,
                  fmt::format("the kernels gave up waiting: {} {} were still to be sent, {} to come", unsent_,
                              factor_ ? "tiles" : "parts of vectors", missing_));
    if (done && nothing_missing()) return;
    if (round % kRoundsOfPatience == 0) link_.expect_patience();
    std::this_thread::yield();
  }
}

template <class T>
void TileExchange<T>::give_up() noexcept {
  (void)cudaStreamSynchronize(sending_.get());
  (void)cudaStreamSynchronize(receiving_.get());
  (void)cudaGetLastError();
  for (auto* list : {&in_, &out_}) {
    for (const Copying& c : *list) free_events_.push_back(c.event);
    list->clear();
  }
}

// ---- copies
// ----------------------------------------------------------------------------------------------------------

template <class T>
std::size_t TileExchange<T>::record(const Stream& stream) {
  if (free_events_.empty()) {
    events_.push_back(std::make_unique<Event>());
    free_events_.push_back(events_.size() - 1);
  }
  const std::size_t event = free_events_.back();
  events_[event]->record(stream.get());
  free_events_.pop_back();
  return event;
}

template <class T>
bool TileExchange<T>::is_done(std::size_t event) const {
  const auto e = cudaEventQuery(events_[event]->get());
  if (e == cudaErrorNotReady) return false;
  check(e, "copies between this rank's GPU and its host");
  return true;
}

template <class T>
T* TileExchange<T>::base_of(Piece::Array array, int maker) const {
  switch (array) {
    case Piece::Array::top:
      return mine_.top;
    case Piece::Array::pivots:
      return mine_.pivots;
    default:
      return maker == link_.rank() ? mine_.places : place_starts_[static_cast<std::size_t>(maker)];
  }
}

template <class T>
void TileExchange<T>::copy_piece(const Piece& piece, int maker, std::byte* body, bool out, const Stream& stream) const {
  T* const device = base_of(piece.array, maker) + piece.offset;
  const std::size_t row = static_cast<std::size_t>(piece.width) * sizeof(T);
  const auto rows = static_cast<std::size_t>(piece.height);
  const std::size_t pitch = rows > 1 ? static_cast<std::size_t>(piece.pitch) * sizeof(T) : row;
  call("cudaMemcpy2DAsync", [&] {
    return out ? cudaMemcpy2DAsync(body, row, device, pitch, row, rows, cudaMemcpyDeviceToHost, stream.get())
               : cudaMemcpy2DAsync(device, pitch, body, row, row, rows, cudaMemcpyHostToDevice, stream.get());
  });
}

template <class T>
ranks::Message TileExchange<T>::new_message(std::size_t bytes, std::int32_t kind, std::int64_t first,
                                            std::int32_t count) {
  const std::size_t all = sizeof(ranks::Header) + bytes;
  ranks::Message message = ranks::Message::in(slots_->take(all), all);
  ranks::Header header;
  header.kind = kind;
  header.number = first;
  header.row = count;
  message.set_header(header);
  return message;
}

// In the order in which they were begun, so that the first that is not done ends the search.
template <class T>
void TileExchange<T>::finish_copies() {
  for (; !in_.empty() && is_done(in_.front().event); in_.pop_front()) free_events_.push_back(in_.front().event);
  for (; !out_.empty() && is_done(out_.front().event); out_.pop_front()) {
    const Copying& copied = out_.front();
    free_events_.push_back(copied.event);
    if (factor_ || is_complete(copied.message))
      post(copied);
    else
      sent_[copied.part] = 0;  // to be looked at again
  }
}

template <class T>
void TileExchange<T>::post(const Copying& copied) {
  link_.post(ranks_of(copied.receivers & apart_), copied.message);
  unsent_ -= copied.message.header().row;
}

// ---- what this rank makes
// --------------------------------------------------------------------------------------------

// Tasks are taken in the order of the list, so what is unfinished of those taken is as much as blocks run.
template <class T>
void TileExchange<T>::look_for_tiles() {
  const auto& tiles = messages_.tiles(link_.rank());
  const auto finished = [&](std::size_t k) { return seen(flags_.data() + messages_.flag(tiles[k])) != 0; };
  while (first_unsent_ < tiles.size() && sent_[first_unsent_] != 0) ++first_unsent_;
  std::size_t unfinished = 0;
  for (std::size_t k = first_unsent_; k < tiles.size() && unfinished < kWindow && has_room(); ++k) {
    if (sent_[k] != 0) continue;
    if (!finished(k)) {
      ++unfinished;
      continue;
    }
    std::size_t last = k;
    const auto fits = [&](std::size_t to) {
      const auto bytes = static_cast<std::size_t>(messages_.elements(tiles[k], tiles[to])) * sizeof(T);
      return sizeof(ranks::Header) + bytes <= slots_->bytes();
    };
    while (last + 1 < tiles.size() && sent_[last + 1] == 0 && messages_.joined(tiles[last], tiles[last + 1]) &&
           fits(last + 1) && finished(last + 1))
      ++last;
    send_tiles(k, last);
    k = last;
  }
}

template <class T>
void TileExchange<T>::send_tiles(std::size_t first, std::size_t last) {
  const auto& tiles = messages_.tiles(link_.rank());
  const auto bytes = static_cast<std::size_t>(messages_.elements(tiles[first], tiles[last])) * sizeof(T);
  ranks::Message message =
      new_message(bytes, kTiles, static_cast<std::int64_t>(first), static_cast<std::int32_t>(last - first + 1));
  std::byte* body = message.body();
  messages_.for_pieces(tiles[first], tiles[last], [&](const Piece& piece) {
    copy_piece(piece, link_.rank(), body, true, sending_);
    body += static_cast<std::size_t>(piece.elements()) * sizeof(T);
  });
  std::fill(sent_.begin() + static_cast<std::ptrdiff_t>(first), sent_.begin() + static_cast<std::ptrdiff_t>(last) + 1,
            1);
  out_.push_back({record(sending_), std::move(message), tiles[first].receivers, 0});
}

// Brings the next parts to the host as they are; those that are not complete come again.
template <class T>
void TileExchange<T>::look_for_updates() {
  const auto& parts = parts_[static_cast<std::size_t>(link_.rank())];
  const T* updates = mine_.vectors + 2 * Offset{plan_.tree.n} * pass_;
  while (first_unsent_ < parts.size() && sent_[first_unsent_] != 0 && out_.empty()) ++first_unsent_;
  if (!out_.empty()) return;
  std::size_t looked = 0;
  for (std::size_t k = first_unsent_; k < parts.size() && looked < kPartsAtOnce && has_room(); ++k) {
    if (sent_[k] != 0) continue;
    ++looked;
    const Part& part = parts[k];
    const auto bytes = static_cast<std::size_t>(part.count) * sizeof(T);
    ranks::Message message = new_message(bytes, kUpdates, static_cast<std::int64_t>(k), 1);
    call("cudaMemcpyAsync", [&] {
      return cudaMemcpyAsync(message.body(), updates + part.first, bytes, cudaMemcpyDeviceToHost, sending_.get());
    });
    sent_[k] = 1;
    out_.push_back({record(sending_), std::move(message), part.receivers, k});
  }
}

template <class T>
bool TileExchange<T>::is_complete(const ranks::Message& message) const {
  T missing;
  std::memset(&missing, 0xff, sizeof missing);
  const std::byte* const end = message.body() + message.body_bytes();
  for (const std::byte* at = message.body(); at < end; at += sizeof(T))
    if (std::memcmp(at, &missing, sizeof(T)) == 0) return false;
  return true;
}

// ---- what others make
// ------------------------------------------------------------------------------------------------

template <class T>
void TileExchange<T>::take(int from, const ranks::Message& message) {
  const ranks::Header header = message.header();
  if (header.kind == kTiles && factor_)
    take_tiles(from, message);
  else if (header.kind == kUpdates && !factor_)
    take_updates(from, message);
  else
    throw Error(StatusCode::device_error, fmt::format("{} makes other calls", link_.name_of(from)));
  missing_ -= header.row;
  in_.push_back({record(receiving_), message, 0, 0});
}

template <class T>
void TileExchange<T>::take_tiles(int from, const ranks::Message& message) {
  const auto& tiles = messages_.tiles(from);
  const auto first = static_cast<std::size_t>(message.header().number);
  const std::size_t last = first + static_cast<std::size_t>(message.header().row) - 1;
  auto* body = const_cast<std::byte*>(message.body());
  messages_.for_pieces(tiles.at(first), tiles.at(last), [&](const Piece& piece) {
    copy_piece(piece, from, body, false, receiving_);
    body += static_cast<std::size_t>(piece.elements()) * sizeof(T);
  });
  messages_.for_flags(tiles[first], tiles[last], [&](std::int64_t flag, std::int64_t count) {
    call("cudaMemcpyAsync", [&] {
      return cudaMemcpyAsync(mine_.flags + flag, ones_.data(), static_cast<std::size_t>(count) * sizeof(int),
                             cudaMemcpyHostToDevice, receiving_.get());
    });
  });
}

template <class T>
void TileExchange<T>::take_updates(int from, const ranks::Message& message) {
  const Part& part = parts_[static_cast<std::size_t>(from)].at(static_cast<std::size_t>(message.header().number));
  T* updates = mine_.vectors + 2 * Offset{plan_.tree.n} * pass_;
  call("cudaMemcpyAsync", [&] {
    return cudaMemcpyAsync(updates + part.first, message.body(), message.body_bytes(), cudaMemcpyHostToDevice,
                           receiving_.get());
  });
}

template class TileExchange<double>;
template class TileExchange<float>;

}  // namespace espalier::device::cuda
