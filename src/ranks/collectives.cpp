// Calls that all ranks make: what each has, to all.
#include <fmt/format.h>

#include <algorithm>

#include "ranks/communicator.hpp"
#include "ranks/message_kinds.hpp"

namespace espalier::ranks {
namespace {

constexpr std::size_t kMostPart = std::size_t{1} << 22;  // bytes of a message of those that gather

}  // namespace

void Communicator::post_parts(std::span<const int> to, std::span<const std::byte> bytes) {
  for (std::size_t at = 0; at == 0 || at < bytes.size(); at += kMostPart) {
    const auto part = bytes.subspan(at, std::min(kMostPart, bytes.size() - at));
    Message m(part.size());
    Header h;
    h.kind = kPart;
    h.number = static_cast<std::int64_t>(bytes.size());
    m.set_header(h);
    Writer(m.body()).write(part.data(), part.size());
    post(to, m);
  }
}

// What every other rank has posted.
void Communicator::take_parts(std::vector<std::vector<std::byte>>& all) {
  int missing = size() - 1;
  const Handler take = [&](int from, const Message& m) {
    auto& to = all[static_cast<std::size_t>(from)];
    const auto bytes = static_cast<std::size_t>(m.header().number);
    if (to.empty()) to.reserve(bytes);
    to.insert(to.end(), m.body(), m.body() + m.body_bytes());
    if (to.size() >= bytes) --missing;
  };
  wait(take, [&] { return missing == 0; });
}

std::vector<std::vector<std::byte>> Communicator::all_gather(std::span<const std::byte> mine) {
  begin_operation();
  std::vector<std::vector<std::byte>> all(static_cast<std::size_t>(size()));
  all[static_cast<std::size_t>(rank())].assign(mine.begin(), mine.end());
  std::vector<int> others;  // each begins with its neighbour, so that not all send to the same one first
  for (int k = 1; k < size(); ++k) others.push_back((rank() + k) % size());
  post_parts(others, mine);
  take_parts(all);
  return all;
}

std::vector<std::vector<std::byte>> Communicator::all_to_all(std::span<const std::span<const std::byte>> mine) {
  begin_operation();
  std::vector<std::vector<std::byte>> all(static_cast<std::size_t>(size()));
  const auto own = mine[static_cast<std::size_t>(rank())];
  all[static_cast<std::size_t>(rank())].assign(own.begin(), own.end());
  for (int k = 1; k < size(); ++k) {
    const int to = (rank() + k) % size();
    post_parts(std::span<const int>(&to, 1), mine[static_cast<std::size_t>(to)]);
  }
  take_parts(all);
  return all;
}

std::vector<std::int64_t> Communicator::all_numbers(std::int64_t mine) {
  std::vector<std::int64_t> all;
  for (const auto& list : all_gather_of(std::span<const std::int64_t>(&mine, 1))) all.push_back(list.at(0));
  return all;
}

namespace {

// A status as bytes, and back. `echo` marks what only repeats another rank's failure.
std::vector<std::byte> packed(const Status& s, bool echo) {
  std::vector<std::byte> bytes(3 * sizeof(std::int32_t) + s.message.size());
  const std::int32_t head[3] = {static_cast<std::int32_t>(s.code), s.row, echo ? 1 : 0};
  Writer w(bytes.data());
  w.write(head, 3);
  w.write(s.message.data(), s.message.size());
  return bytes;
}

struct Unpacked {
  Status status;
  bool echo = false;
};

Unpacked unpacked(const std::vector<std::byte>& bytes) {
  std::int32_t head[3] = {};
  Reader r(bytes.data(), bytes.size());
  r.get(head, 3);
  std::string message(r.left(), ' ');
  r.get(message.data(), message.size());
  return {{static_cast<StatusCode>(head[0]), std::move(message), head[1]}, head[2] != 0};
}

}  // namespace

Status Communicator::meet(const Status& own) {
  const bool echo = !own.ok() && !aborted_.empty() && own.message == aborted_;
  if (!own.ok() && !echo) tell_all(kAbort, fmt::format("{} has given up: {}", name_of(rank()), own.message));
  {
    const std::lock_guard lock(mutex_);
    posted_.clear();  // of an operation that has failed; of others nothing is left
  }
  operation_ = kLeave - 1;
  const auto all = all_gather(packed(own, echo));
  int first = -1;
  bool same = true;
  std::vector<Unpacked> ends;
  for (const auto& bytes : all) ends.push_back(unpacked(bytes));
  for (std::size_t r = 0; r < ends.size(); ++r) {
    if (ends[r].status.ok() || ends[r].echo) continue;
    if (first < 0) first = static_cast<int>(r);
    same = same && ends[r].status.message == ends[static_cast<std::size_t>(first)].status.message;
  }
  if (first < 0) return {};
  const bool by_all =
      same && std::none_of(ends.begin(), ends.end(), [](const Unpacked& u) { return u.status.ok() || u.echo; });
  Status status = ends[static_cast<std::size_t>(first)].status;
  if (!by_all) status.message = fmt::format("{}: {}", name_of(first), status.message);
  return status;
}

Status Communicator::end_call(Status own) {
  if (lost_.empty()) {
    try {
      Status all = meet(own);
      // What was sent has been received: it takes a look to learn that.
      for (int k = 0; k < 1000 && !outgoing_.empty(); ++k) finish_sent();
      return all;
    } catch (const Error& e) {
      own = e.status();
    }
  }
  return lost_.empty() ? own : Status{StatusCode::device_error, lost_, -1};
}

void Communicator::expect_all(const std::function<void()>& body) {
  Status own;
  try {
    body();
  } catch (const Error& e) {
    own = e.status();
  } catch (const std::bad_alloc&) {
    own = {StatusCode::out_of_memory, "the machine refused memory", -1};
  }
  const auto all = all_gather(packed(own, false));
  for (std::size_t r = 0; r < all.size(); ++r) {
    const Unpacked u = unpacked(all[r]);
    if (u.status.ok()) continue;
    // The same text everywhere, so that the end of the call finds one failure of all.
    throw Error(u.status.code, fmt::format("{}: {}", name_of(static_cast<int>(r)), u.status.message), u.status.row);
  }
}

}  // namespace espalier::ranks
