#include "ranks/communicator.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "base/at.hpp"
#include "ranks/message_kinds.hpp"

namespace espalier::ranks {

namespace {

constexpr std::size_t kMostIncoming = std::size_t{1} << 29;  // bytes in receipt at a time, beyond one message
constexpr std::size_t kTested = 8;                           // requests looked at in one round

std::string host_name() {
  char name[256] = {};
  return ::gethostname(name, sizeof name - 1) == 0 ? name : "unknown";
}

Message text_message(std::int32_t kind, const std::string& text) {
  Message m(text.size());
  Header h;
  h.kind = kind;
  m.set_header(h);
  Writer(m.body()).write(text.data(), text.size());
  return m;
}

std::string text_of(const Message& m) { return {reinterpret_cast<const char*>(m.body()), m.body_bytes()}; }

}  // namespace

Communicator::Communicator(const espalier_rank_functions& functions, double patience)
    : table_(functions), patience_(patience) {
  const bool whole = functions.size >= sizeof(espalier_rank_functions) && functions.send != nullptr &&
                     functions.probe != nullptr && functions.receive != nullptr && functions.test != nullptr &&
                     functions.explain != nullptr && functions.release != nullptr;
  if (!whole || functions.ranks < 1 || functions.rank < 0 || functions.rank >= functions.ranks)
    throw Error(StatusCode::invalid_input,
                "the table of functions for messages between ranks is not whole; espalier/mpi.h fills one");
  if (!(patience > 0) || !std::isfinite(patience)) {
    table_.release(table_.context);
    throw Error(StatusCode::invalid_input, "the patience with other ranks must be a number of seconds above 0");
  }
  incoming_.resize(at(size()));
  heard_.assign(at(size()), now());
  try {
    exchange_hosts();
  } catch (...) {
    table_.release(table_.context);
    throw;
  }
}

Communicator::~Communicator() {
  // Whoever left a call in good order has received all; after a failure the rest is left to itself.
  const double begin = now();
  try {
    while (lost_.empty() && !outgoing_.empty() && now() - begin < std::min(1.0, patience_)) finish_sent();
  } catch (const Error&) {
  }
  keep_what_is_open();
  if (lost_.empty()) table_.release(table_.context);  // else it could wait for the dead
}

// What is still being sent or received must stay where it is, to the end of the process.
void Communicator::keep_what_is_open() {
  static std::mutex mutex;
  static auto& sent = *new std::vector<std::deque<Outgoing>>;
  static auto& received = *new std::vector<std::deque<Incoming>>;
  const std::lock_guard lock(mutex);
  static auto& lost = *new std::vector<void*>;
  if (!lost_.empty()) lost.push_back(table_.context);
  if (!outgoing_.empty()) sent.push_back(std::move(outgoing_));
  for (auto& queue : incoming_)
    if (!queue.empty()) received.push_back(std::move(queue));
}

double Communicator::now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string Communicator::name_of(int rank) const {
  const auto r = at(rank);
  return r < hosts_.size() ? fmt::format("rank {} on host {}", rank, hosts_[r]) : fmt::format("rank {}", rank);
}

int Communicator::machine_of(int rank) const {
  if (machine_ranks_ > 0) return rank / machine_ranks_;
  const auto found = std::find(hosts_.begin(), hosts_.end(), hosts_[at(rank)]);
  return static_cast<int>(found - hosts_.begin());
}

void Communicator::exchange_hosts() {
  begin_call();
  const std::string mine = host_name();
  for (const auto& bytes : all_gather(std::as_bytes(std::span(mine))))
    hosts_.emplace_back(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  cpu_set_t cores;
  CPU_ZERO(&cores);
  (void)::sched_getaffinity(0, sizeof cores, &cores);
  neighbours_ = 0;
  const auto all = all_gather(std::as_bytes(std::span(&cores, 1)));
  const auto me = at(rank());
  for (std::size_t r = 0; r < all.size(); ++r) neighbours_ += hosts_[r] == hosts_[me] && all[r] == all[me] ? 1 : 0;
}

void Communicator::begin_call() {
  if (!lost_.empty()) throw Error(StatusCode::device_error, lost_);
  ++call_;
  operation_ = 0;
  aborts_.erase(aborts_.begin(), aborts_.lower_bound(call_));
  aborted_ = aborts_.count(call_) != 0 ? aborts_[call_] : std::string();
  early_.erase(early_.begin(), early_.lower_bound({call_, 0}));
}

void Communicator::begin_operation() { ++operation_; }

void Communicator::post(std::span<const int> to, Message message) {
  Header h = message.header();
  h.call = call_;
  h.operation = operation_;
  message.set_header(h);
  const std::lock_guard lock(mutex_);
  for (const int r : to) posted_.emplace_back(r, message);
}

void Communicator::check(int error) {
  if (error == 0) return;
  char text[512] = {};
  table_.explain(table_.context, error, text, sizeof text);
  const int dead = table_.dead_rank != nullptr ? table_.dead_rank(table_.context) : -1;
  lose(dead >= 0 && dead < size() ? fmt::format("{} has died ({})", name_of(dead), text)
                                  : fmt::format("messages of {} fail: {}", name_of(rank()), text));
}

void Communicator::lose(const std::string& why) {
  if (lost_.empty()) {
    lost_ = why + "; this solver cannot be used any more, make a new one with ranks that answer";
    try {
      tell_all(kLost, lost_);
    } catch (const Error&) {  // to whom it may concern
    }
  }
  throw Error(StatusCode::device_error, lost_);
}

// Best effort: whoever is there hears of it.
void Communicator::tell_all(std::int32_t kind, const std::string& text) {
  Message m = text_message(kind, text);
  Header h = m.header();
  h.call = call_;
  m.set_header(h);
  for (int to = 0; to < size(); ++to) {
    if (to == rank()) continue;
    void* request = nullptr;
    if (table_.send(table_.context, m.data(), m.bytes(), to, &request) == 0) outgoing_.push_back({m, request});
  }
}

void Communicator::send_posted() {
  std::vector<std::pair<int, Message>> list;
  {
    const std::lock_guard lock(mutex_);
    list.swap(posted_);
  }
  for (auto& [to, message] : list) {
    void* request = nullptr;
    check(table_.send(table_.context, message.data(), message.bytes(), to, &request));
    sent_bytes_ += static_cast<std::int64_t>(message.bytes());
    outgoing_.push_back({message, request});
  }
}

void Communicator::finish_sent() {
  for (std::size_t k = 0, most = std::min(kTested, outgoing_.size()); k < most; ++k) {
    Outgoing o = std::move(outgoing_.front());
    outgoing_.pop_front();
    std::int32_t done = 0;
    const int error = table_.test(table_.context, &o.request, &done);
    if (done == 0 && error == 0)
      outgoing_.push_back(std::move(o));
    else
      ++moved_;
    check(error);
  }
}

void Communicator::receive() {
  while (incoming_bytes_ < kMostIncoming) {
    std::int32_t from = -1;
    std::size_t bytes = 0;
    check(table_.probe(table_.context, &from, &bytes));
    if (from < 0) return;
    if (from >= size() || bytes < sizeof(Header))
      lose("a message came that is none of ours: use a communicator of your own");
    std::shared_ptr<std::byte[]> memory = take_ ? take_(bytes) : nullptr;
    Incoming in{memory != nullptr ? Message::in(std::move(memory), bytes) : Message::of_bytes(bytes), nullptr, false};
    check(table_.receive(table_.context, in.message.data(), bytes, from, &in.request));
    incoming_bytes_ += bytes;
    ++moved_;
    incoming_[at(from)].push_back(std::move(in));
  }
}

// Messages of a rank are handed out in the order in which it sent them, whichever arrives first.
void Communicator::deliver(const Handler& handler) {
  for (int from = 0; from < size(); ++from) {
    auto& queue = incoming_[at(from)];
    std::size_t tested = 0;
    for (Incoming& in : queue) {
      if (in.done) continue;
      if (++tested > kTested) break;
      std::int32_t done = 0;
      check(table_.test(table_.context, &in.request, &done));
      in.done = done != 0;
      if (!in.done) continue;
      ++moved_;
      heard_[at(from)] = now();
    }
    while (!queue.empty() && queue.front().done) {
      const Message message = std::move(queue.front().message);
      queue.pop_front();
      incoming_bytes_ -= message.bytes();
      hand_out(from, message, handler);
    }
  }
}

void Communicator::hand_out(int from, const Message& message, const Handler& handler) {
  const Header h = message.header();
  if (h.kind == kSign) return;
  if (h.kind == kAbort || h.kind == kLost) return take_abort(message);
  if (h.call == call_ && h.operation == operation_)
    handler(from, message);
  else if (h.call > call_ || (h.call == call_ && h.operation > operation_))
    early_[{h.call, h.operation}].emplace_back(from, message);
}

void Communicator::take_abort(const Message& message) {
  const Header h = message.header();
  if (h.kind == kLost) {
    lost_ = text_of(message);
    throw Error(StatusCode::device_error, lost_);
  }
  if (h.call < call_) return;
  aborts_.try_emplace(h.call, text_of(message));
  if (h.call == call_) aborted_ = aborts_[call_];
}

void Communicator::hand_out_early(const Handler& handler) {
  const auto found = early_.find({call_, operation_});
  if (found == early_.end()) return;
  const auto list = std::move(found->second);
  early_.erase(found);
  for (const auto& [from, message] : list) handler(from, message);
}

void Communicator::drive(const Handler& handler) {
  if (!lost_.empty()) throw Error(StatusCode::device_error, lost_);
  send_posted();
  if (!outgoing_.empty()) finish_sent();
  receive();
  hand_out_early(handler);  // before what has come since, so that the order stays
  deliver(handler);
  give_sign_of_life();
  if (!aborted_.empty() && operation_ != kLeave) throw Error(StatusCode::device_error, aborted_);
}

void Communicator::give_sign_of_life() {
  const double time = now();
  if (time - signed_ < patience_ / 4) return;
  signed_ = time;
  for (int to = 0; to < size(); ++to) {
    if (to == rank()) continue;
    Message m(0);
    Header h;
    h.kind = kSign;
    h.call = call_;
    m.set_header(h);
    void* request = nullptr;
    check(table_.send(table_.context, m.data(), m.bytes(), to, &request));
    outgoing_.push_back({m, request});
  }
}

void Communicator::expect_patience() {
  const double time = now();
  if (time - waiting_since_ <= patience_) return;
  std::string silent;
  for (int r = 0; r < size(); ++r)
    if (r != rank() && time - heard_[at(r)] > patience_) silent += (silent.empty() ? "" : " and ") + name_of(r);
  if (!silent.empty())
    lose(fmt::format("nothing has come for {:.3g} s from {}: it has died, is stopped, or makes other calls", patience_,
                     silent));
}

// It sleeps when nothing has moved for some rounds: a long message moves in its rounds alone.
void Communicator::wait(const Handler& handler, const std::function<bool()>& done) {
  constexpr int kSpins = 2000, kYields = 4000;
  begin_waiting();
  std::int64_t moved = moved_;
  for (int rounds = 0, idle = 0;; ++rounds) {
    drive(handler);
    if (done()) return;
    if (rounds % 64 == 63) expect_patience();
    idle = moved_ == moved ? idle + 1 : 0;
    moved = moved_;
    if (idle > kSpins + kYields)
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    else if (idle > kSpins / (size() > 1 ? 100 : 1))
      std::this_thread::yield();
  }
}

}  // namespace espalier::ranks
