#include "out_of_core/arena.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace espalier::out_of_core {

Offset Arena::cut(std::map<Offset, Offset>::iterator hole, Offset at, Offset bytes) {
  const Offset begin = hole->first, end = begin + hole->second;
  holes_.erase(hole);
  if (at > begin) holes_[begin] = at - begin;
  if (at + bytes < end) holes_[at + bytes] = end - at - bytes;
  peak_ = std::max(peak_, at + bytes);
  return at;
}

Offset Arena::take_passing(Offset bytes) {
  bytes = round(bytes);
  if (bytes == 0) return 0;
  auto it = holes_.lower_bound(cursor_);
  if (around_ && it != holes_.begin()) {  // the rest of the hole in which the cursor stands
    const auto here = std::prev(it);
    if (here->first + here->second >= cursor_ + bytes) {
      const Offset at = cursor_;
      cursor_ += bytes;
      return cut(here, at, bytes);
    }
  }
  for (std::size_t k = 0; k <= holes_.size(); ++k, ++it) {
    if (it == holes_.end()) it = holes_.begin();
    if (it == holes_.end()) return -1;
    if (it->second < bytes) continue;
    cursor_ = it->first + bytes;
    return cut(it, it->first, bytes);
  }
  return -1;
}

Offset Arena::take_lasting(Offset bytes) {
  bytes = round(bytes);
  if (bytes == 0) return 0;
  for (auto it = holes_.end(); it != holes_.begin();) {
    --it;
    if (it->second >= bytes) return cut(it, it->first + it->second - bytes, bytes);
  }
  return -1;
}

Offset Arena::take_lowest(Offset bytes) {
  cursor_ = 0;
  return take_passing(bytes);
}

Offset Arena::take_first(Offset bytes) {
  bytes = round(bytes);
  if (bytes == 0) return 0;
  for (auto it = holes_.begin(); it != holes_.end(); ++it)
    if (it->second >= bytes) return cut(it, it->first, bytes);
  return -1;
}

void Arena::give_back(Offset at, Offset bytes) {
  bytes = round(bytes);
  if (bytes == 0) return;
  auto next = holes_.lower_bound(at);
  if (next != holes_.begin()) {
    const auto before = std::prev(next);
    if (before->first + before->second == at) {
      at = before->first;
      bytes += before->second;
      holes_.erase(before);
    }
  }
  if (next != holes_.end() && at + bytes == next->first) {
    bytes += next->second;
    holes_.erase(next);
  }
  holes_[at] = bytes;
}

void Touches::split(Offset at) {
  auto it = regions_.lower_bound(at);
  if (it == regions_.begin()) return;
  --it;
  if (it->second.end <= at) return;
  Region upper = it->second;
  it->second.end = at;
  regions_[at] = upper;
}

void Touches::touch(Offset at, Offset size, int queue, std::int64_t number, bool write, std::span<std::int64_t> waits) {
  if (size == 0) return;
  const Offset end = at + size;
  split(at);
  split(end);
  Region mine{end, Numbers(queues_, 0), Numbers(queues_, 0)};
  const auto first = regions_.lower_bound(at);
  auto it = first;
  for (; it != regions_.end() && it->first < end; ++it)
    for (std::size_t q = 0; q < queues_; ++q) {
      mine.read[q] = std::max(mine.read[q], it->second.read[q]);
      mine.written[q] = std::max(mine.written[q], it->second.written[q]);
    }
  regions_.erase(first, it);
  const auto self = static_cast<std::size_t>(queue);
  for (std::size_t q = 0; q < queues_; ++q) {
    if (q == self) continue;
    waits[q] = std::max(waits[q], mine.written[q]);
    if (write) waits[q] = std::max(waits[q], mine.read[q]);
  }
  (write ? mine.written : mine.read)[self] = number;
  regions_[at] = std::move(mine);
}

}  // namespace espalier::out_of_core
