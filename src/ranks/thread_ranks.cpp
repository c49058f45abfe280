#include "ranks/thread_ranks.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <deque>
#include <map>
#include <mutex>
#include <random>
#include <utility>
#include <vector>

#include "base/at.hpp"

namespace espalier::ranks {

namespace {

constexpr int kIAmDead = 1, kOtherIsDead = 2, kMisuse = 3;

using Clock = std::chrono::steady_clock;

// A message on its way.
struct Letter {
  std::vector<char> bytes;
  Clock::time_point arrives;
};

// A request of a table: a send that waits for credit, or a receipt.
struct Request {
  int to = -1;  // of a send
  Letter letter;
  Clock::time_point ends;  // of a receipt
};

}  // namespace

class ThreadRanks::Shared {
 public:
  Shared(int ranks, const Faults& faults)
      : ranks_(ranks), faults_(faults), random_(faults.seed), mail_(at(ranks * ranks)) {}

  int send(int me, const void* data, std::size_t bytes, int to, void** request) {
    const std::lock_guard lock(mutex_);
    if (me == faults_.dead_rank && ++sent_by_dead_ >= faults_.dies_at) dead_ = true;
    if (const int error = state_of(me); error != 0) return error;
    if (to < 0 || to >= ranks_ || to == me) return kMisuse;
    const char* from = static_cast<const char*>(data);
    auto open = std::make_unique<Request>();
    open->to = to;
    open->letter = {std::vector<char>(from, from + bytes), Clock::now() + delay()};
    // Behind a send that waits for credit, all others wait.
    if (blocked(me, to) || !has_credit(me, to)) {
      waiting_[{me, to}].push_back(open.get());
      *request = keep(std::move(open));
      return 0;
    }
    mail(me, to).push_back(std::move(open->letter));
    *request = nullptr;
    return 0;
  }

  int probe(int me, std::int32_t* from, std::size_t* bytes) {
    const std::lock_guard lock(mutex_);
    *from = -1;
    if (const int error = state_of(me); error != 0) return error;
    for (int k = 0; k < ranks_ && *from < 0; ++k) {
      const int r = (turn_ + k) % ranks_;
      const auto& box = mail(r, me);
      if (box.empty() || box.front().arrives > Clock::now()) continue;
      *from = r;
      *bytes = box.front().bytes.size();
    }
    ++turn_;
    return 0;
  }

  int receive(int me, void* data, std::size_t bytes, int from, void** request) {
    const std::lock_guard lock(mutex_);
    if (const int error = state_of(me); error != 0) return error;
    auto& box = mail(from, me);
    if (box.empty() || box.front().bytes.size() != bytes) return kMisuse;
    std::memcpy(data, box.front().bytes.data(), bytes);
    box.pop_front();
    grant(from, me);
    auto open = std::make_unique<Request>();
    open->ends = Clock::now() + (faults_.reorder ? delay() : Clock::duration{});
    *request = keep(std::move(open));
    return 0;
  }

  int test(int me, void** request, std::int32_t* done) {
    const std::lock_guard lock(mutex_);
    *done = 0;
    if (const int error = state_of(me); error != 0) return error;
    auto* open = static_cast<Request*>(*request);
    if (open != nullptr) {
      if (open->to >= 0 && !posted(me, open)) return 0;
      if (open->to < 0 && open->ends > Clock::now()) return 0;
      requests_.erase(open);
    }
    *request = nullptr;
    *done = 1;
    return 0;
  }

  std::int32_t dead_rank() {
    const std::lock_guard lock(mutex_);
    return dead_ ? faults_.dead_rank : -1;
  }

 private:
  Request* keep(std::unique_ptr<Request> open) {
    Request* const kept = open.get();
    requests_.emplace(kept, std::move(open));
    return kept;
  }
  [[nodiscard]] std::deque<Letter>& mail(int from, int to) { return mail_[at(from * ranks_ + to)]; }
  [[nodiscard]] int state_of(int me) const {
    if (!dead_) return 0;
    if (me == faults_.dead_rank) return kIAmDead;
    return faults_.deaths_are_told ? kOtherIsDead : 0;
  }
  Clock::duration delay() {
    if (faults_.most_delay <= 0) return {};
    return std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(std::uniform_real_distribution<double>(0, faults_.most_delay)(random_)));
  }
  [[nodiscard]] bool has_credit(int from, int to) {
    return faults_.credits <= 0 || static_cast<int>(mail(from, to).size()) < faults_.credits;
  }
  [[nodiscard]] bool blocked(int from, int to) { return !waiting_[{from, to}].empty(); }
  // The next send that waits goes on its way.
  void grant(int from, int to) {
    auto& queue = waiting_[{from, to}];
    while (!queue.empty() && has_credit(from, to)) {
      mail(from, to).push_back(std::move(queue.front()->letter));
      queue.pop_front();
    }
  }
  [[nodiscard]] bool posted(int from, const Request* open) {
    const auto& queue = waiting_[{from, open->to}];
    return std::find(queue.begin(), queue.end(), open) == queue.end();
  }

  const int ranks_;
  const Faults faults_;
  std::mutex mutex_;
  std::mt19937_64 random_;
  std::vector<std::deque<Letter>> mail_;  // [from * ranks + to]
  std::map<std::pair<int, int>, std::deque<Request*>> waiting_;
  std::map<Request*, std::unique_ptr<Request>> requests_;  // those of ranks that died, too
  std::int64_t sent_by_dead_ = 0;
  bool dead_ = false;
  int turn_ = 0;
};

namespace {

// What a table's context points to.
struct Rank {
  std::shared_ptr<ThreadRanks::Shared> shared;
  int rank;
};

Rank& rank_of(void* context) { return *static_cast<Rank*>(context); }

void explain(void*, int error, char* text, std::size_t size) {
  const char* what = error == kIAmDead       ? "this rank is dead"
                     : error == kOtherIsDead ? "another rank is dead"
                                             : "a call that makes no sense";
  std::snprintf(text, size, "%s", what);
}

}  // namespace

ThreadRanks::ThreadRanks(int ranks, const Faults& faults)
    : ranks_(ranks), shared_(std::make_shared<Shared>(ranks, faults)) {}

espalier_rank_functions ThreadRanks::table(int rank) const {
  espalier_rank_functions t{};
  t.size = sizeof t;
  t.context = new Rank{shared_, rank};
  t.rank = rank;
  t.ranks = ranks_;
  t.send = [](void* c, const void* data, std::size_t bytes, std::int32_t to, void** request) {
    return rank_of(c).shared->send(rank_of(c).rank, data, bytes, to, request);
  };
  t.probe = [](void* c, std::int32_t* from, std::size_t* bytes) {
    return rank_of(c).shared->probe(rank_of(c).rank, from, bytes);
  };
  t.receive = [](void* c, void* data, std::size_t bytes, std::int32_t from, void** request) {
    return rank_of(c).shared->receive(rank_of(c).rank, data, bytes, from, request);
  };
  t.test = [](void* c, void** request, std::int32_t* done) {
    return rank_of(c).shared->test(rank_of(c).rank, request, done);
  };
  t.explain = explain;
  t.dead_rank = [](void* c) { return rank_of(c).shared->dead_rank(); };
  t.release = [](void* c) { delete static_cast<Rank*>(c); };
  return t;
}

}  // namespace espalier::ranks
