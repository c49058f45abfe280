// Ranks of different machines exchange what their kernels make (tile_exchange.hpp), without GPU and MPI: threads are
// the ranks, vectors the memory of devices, and copies take their time. "Kernels" replay the lists of tasks: a task
// that finds its flags set writes its tiles with numbers that only its place gives, and sets its flags. At the end
// everybody has everybody's numbers. Messages come late and in random order, few at a time, or not at all.
#include "device/cuda/tables/tile_exchange.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "analysis/ordering.hpp"
#include "cuda_plan_flags.hpp"
#include "device/cuda/kernels/factor_parameters.hpp"
#include "device/cuda/tables/copy_thread.hpp"
#include "matrix/generators/generate.hpp"
#include "ranks/thread_ranks.hpp"

namespace espalier {
namespace {

using device::cuda::CopyQueues;
using device::cuda::CopyThread;
using device::cuda::DevicePlan;
using device::cuda::FactorTask;
using device::cuda::Front;
using device::cuda::MessageSlots;
using device::cuda::Piece;
using device::cuda::SentTile;
using device::cuda::TileExchange;
using device::cuda::TileMessages;
using device::cuda::Way;
using device::cuda::Work;

constexpr Index kMostPass = 8;

// Copies are made some looks after they were begun, and in their order. A rectangle without a host fails.
class SlowQueues final : public CopyQueues {
 public:
  explicit SlowQueues(unsigned seed) : draw_(seed) {}
  void copy(Way way, const Rectangle& what) override {
    if (what.host == nullptr) throw Error(StatusCode::device_error, "no copy");
    queue(way).push_back({what, false, 0});
  }
  std::uint64_t mark(Way way) override {
    queue(way).push_back({{}, true, next_});
    return next_++;
  }
  bool is_done(std::uint64_t mark) override {
    for (auto& q : queues_)
      for (auto most = draw_() % 4; most > 0 && !q.empty(); --most) make_first(q);
    return std::erase(passed_, mark) > 0;
  }
  void finish() noexcept override {
    for (auto& q : queues_)
      while (!q.empty()) make_first(q);
    passed_.clear();
  }

 private:
  struct Entry {
    Rectangle what;
    bool is_mark;
    std::uint64_t mark;
  };
  std::deque<Entry>& queue(Way way) { return queues_[way == Way::to_host ? 0 : 1]; }
  void make_first(std::deque<Entry>& q) {
    const Entry e = q.front();
    q.pop_front();
    if (e.is_mark) {
      passed_.push_back(e.mark);
      return;
    }
    const bool to_host = &q == &queues_[0];
    for (std::size_t r = 0; r < e.what.rows; ++r) {
      std::byte *host = e.what.host + r * e.what.row_bytes, *device = e.what.device + r * e.what.pitch;
      std::memcpy(to_host ? host : device, to_host ? device : host, e.what.row_bytes);
    }
  }

  std::mt19937 draw_;
  std::deque<Entry> queues_[2];
  std::vector<std::uint64_t> passed_;
  std::uint64_t next_ = 0;
};

struct System {
  SparseMatrix a;
  plan::Plan plan;
  DevicePlan tables;
  Kind kind = Kind::llt;
  int ranks = 2;

  System(const std::vector<std::string>& words, Kind sort, int count) : kind(sort), ranks(count) {
    base::ThreadPool pool(2);
    a = matrix::generate(matrix::parse_generator(words), &pool);
    device::cuda::DeviceTuning tuning;
    tuning.narrow_rows = 300;  // small systems, too, shall have wide fronts
    plan = plan::make_plan(analysis::build_tree(analysis::graph_of(a, pool), {}, pool), a, {},
                           device::cuda::cuda_plan_options(kind, tuning, count), pool);
    tables = device::cuda::make_device_plan(plan, kind, true, {}, nullptr, true);
  }
};

// One rank: its memory, its kernels, and what it says at the end.
class Machine {
 public:
  Machine(const System& system, const espalier_rank_functions& functions, double patience, std::size_t slots)
      : s_(system),
        link_(functions, patience),
        queues_(static_cast<unsigned>(functions.rank) + 1),
        thread_(queues_, [] {}),
        draw_(static_cast<unsigned>(functions.rank) + 11),
        messages_(s_.plan, s_.kind, s_.tables) {
    link_.set_machines(1);
    exchange_.emplace(link_, ranks::Machines::agreed(link_), s_.plan, s_.kind, s_.tables,
                      rank() % 2 == 0 ? static_cast<CopyQueues&>(thread_) : queues_);
    const auto flags = 2 * static_cast<std::size_t>(s_.tables.flags);
    top_.resize(static_cast<std::size_t>(s_.tables.regions[0]));
    pivots_.resize(3 * static_cast<std::size_t>(s_.plan.tree.n));
    updates_.resize(kMostPass * s_.plan.relative.size());
    for (const std::int64_t space : s_.tables.place_space) places_.emplace_back(static_cast<std::size_t>(space));
    flags_.resize(flags);
    mirror_.resize(flags);
    control_.resize(2);
    ones_.assign(1000, 1);
    memory_.top = top_.data();
    memory_.pivots = pivots_.data();
    for (auto& p : places_) memory_.places.push_back(p.data());
    memory_.updates = updates_.data();
    memory_.flags = flags_.data();
    memory_.mirror = mirror_.data();
    memory_.control = control_.data();
    memory_.ones = ones_.data();
    memory_.aborted_at[1] = 1;
    exchange_->use(memory_);
    const std::size_t tiles = slots < 10 ? 1 : 4;  // that fit into one
    const std::size_t bytes =
        sizeof(ranks::Header) + tiles * static_cast<std::size_t>(messages_.largest()) * sizeof(double);
    exchange_->use(
        std::make_shared<MessageSlots>(std::make_shared_for_overwrite<std::byte[]>(slots * bytes), slots, bytes));
  }

  ranks::Link& link() { return link_; }
  [[nodiscard]] int rank() const { return link_.rank(); }

  // Numbers are other ones in every run.
  void factorize(int run) {
    run_ = run;
    std::fill(flags_.begin(), flags_.end(), 0);
    next_task_ = next_tile_ = 0;
    (void)link_.all_numbers(1);  // all are clear
    exchange_->begin_factor();
    exchange_->run([&] { return work(); });
    expect_numbers_of_all();
    (void)link_.all_numbers(1);
  }

  // Each speaker's updates, in random pieces.
  void solve(int run, Index pass) {
    run_ = run;
    std::memset(updates_.data(), 0xff, updates_.size() * sizeof(double));
    (void)link_.all_numbers(1);
    const auto& mine = messages_.updates(rank());
    std::size_t front = 0;
    std::int64_t made = 0;
    exchange_->begin_solve(pass);
    exchange_->run([&] {
      for (auto most = draw_() % 40; most > 0 && front < mine.size(); --most) {
        const std::int64_t at = mine[front].rows * pass + made;
        updates_[static_cast<std::size_t>(at)] = number(rank(), at);
        if (++made < mine[front].below * pass) continue;
        made = 0;
        ++front;
      }
      return front == mine.size();
    });
    for (int r = 0; r < link_.size(); ++r)
      for (const auto& u : messages_.updates(r)) {
        if ((u.receivers >> rank() & 1) == 0) continue;
        for (std::int64_t at = u.rows * pass; at < (u.rows + u.below) * pass; ++at)
          ASSERT_EQ(updates_[static_cast<std::size_t>(at)], number(r, at)) << "rank " << rank() << " from " << r;
      }
    (void)link_.all_numbers(1);
  }

  // Rank 1 has nothing, the others more than a slot holds, and not whole numbers of them.
  void share(int run) {
    std::vector<TileExchange<double>::Range> ranges;
    std::int64_t all = 0;
    for (int r = 0; r < link_.size(); ++r) {
      ranges.push_back({all, r == 1 ? 0 : 5 * exchange_->largest_part() + 8 * r + 3});
      all += ranges.back().count;
    }
    std::vector<std::byte> array(static_cast<std::size_t>(all));
    const auto number_of = [&](int r, std::int64_t at) { return static_cast<std::byte>((at * 7 + r + run) % 251); };
    const auto& mine = ranges[static_cast<std::size_t>(rank())];
    for (std::int64_t k = mine.first; k < mine.first + mine.count; ++k)
      array[static_cast<std::size_t>(k)] = number_of(rank(), k);
    exchange_->share(array.data(), ranges);
    for (int r = 0; r < link_.size(); ++r)
      for (std::int64_t k = ranges[static_cast<std::size_t>(r)].first, left = ranges[static_cast<std::size_t>(r)].count;
           left > 0; ++k, --left)
        ASSERT_EQ(array[static_cast<std::size_t>(k)], number_of(r, k)) << "rank " << rank() << " from " << r;
    (void)link_.all_numbers(1);
  }

  void give_up() { exchange_->give_up(); }
  // The kernels end before they are done.
  void abort_after(std::size_t tasks) { most_tasks_ = tasks; }

 private:
  [[nodiscard]] double number(int maker, std::int64_t at) const {
    return static_cast<double>(at) + 1e7 * (maker + 1) + 1e9 * run_;
  }

  template <class Use>
  void for_elements(int maker, const SentTile& first, const SentTile& last, Use&& use) {
    messages_.for_pieces(first, last, [&](const Piece& p) {
      auto& memory = p.array == Piece::Array::top      ? top_
                     : p.array == Piece::Array::pivots ? pivots_
                                                       : places_[static_cast<std::size_t>(maker)];
      for (std::int64_t h = 0; h < p.height; ++h)
        for (std::int64_t w = 0; w < p.width; ++w) {
          const std::int64_t at = p.offset + h * p.pitch + w;
          use(memory.at(static_cast<std::size_t>(at)), at);
        }
    });
  }

  // A kernel's block, now and then. @returns whether all is done
  bool work() {
    const auto& tasks = s_.tables.lists[static_cast<std::size_t>(rank())].tasks;
    for (auto most = draw_() % 8; most > 0 && next_task_ < tasks.size() && next_task_ < most_tasks_; --most) {
      if (!is_ready(tasks[next_task_])) return false;
      finish(tasks[next_task_++]);
    }
    if (next_task_ == most_tasks_) control_[1] = 1;
    return next_task_ == tasks.size() || next_task_ == most_tasks_;
  }

  bool is_ready(const FactorTask& task) const {
    bool ready = true;
    PlanFlags(s_.tables).needed_flags(task, [&](std::int64_t flag, std::int32_t front) {
      const bool diagonal = flag >= s_.tables.fronts[static_cast<std::size_t>(front)].diagonal_flag(0);
      ready = ready && flags_[static_cast<std::size_t>(flag)] != 0;
      if (s_.kind == Kind::lu && !diagonal)
        ready = ready && flags_[static_cast<std::size_t>(s_.tables.flags + flag)] != 0;
    });
    return ready;
  }

  void finish(const FactorTask& task) {
    const auto& tiles = messages_.tiles(rank());
    for (; next_tile_ < tiles.size(); ++next_tile_) {
      const FactorTask& t = tiles[next_tile_].task;
      if (t.front != task.front || t.work != task.work || t.block != task.block || t.column != task.column ||
          t.part != task.part)
        break;
      for_elements(rank(), tiles[next_tile_], tiles[next_tile_],
                   [&](double& to, std::int64_t at) { to = number(rank(), at); });
    }
    const auto flag = static_cast<std::size_t>(task.part * s_.tables.flags + PlanFlags(s_.tables).own_flag(task));
    flags_[flag] = mirror_[flag] = 1;
    if (s_.kind == Kind::lu && task.work == Work::whole) flags_[flag + static_cast<std::size_t>(s_.tables.flags)] = 1;
  }

  void expect_numbers_of_all() {
    for (int r = 0; r < link_.size(); ++r)
      for (const SentTile& tile : messages_.tiles(r)) {
        if (r != rank() && (tile.receivers >> rank() & 1) == 0) continue;
        for_elements(r, tile, tile, [&](double& found, std::int64_t at) {
          ASSERT_EQ(found, number(r, at)) << "rank " << rank() << " from " << r;
        });
      }
  }

  const System& s_;
  ranks::Link link_;
  SlowQueues queues_;
  CopyThread thread_;
  std::mt19937 draw_;
  TileMessages messages_;
  std::optional<TileExchange<double>> exchange_;
  device::cuda::ExchangeMemory<double> memory_;
  std::vector<double> top_, pivots_, updates_;
  std::vector<std::vector<double>> places_;
  std::vector<int> flags_, mirror_, control_, ones_;
  std::size_t next_task_ = 0, next_tile_ = 0, most_tasks_ = ~std::size_t{0};
  int run_ = 0;
};

using Table = espalier_rank_functions;

// body(machine) on every rank. @returns how the calls have ended, by rank
std::vector<Status> on_machines(
    const System& system, const ranks::Faults& faults, double patience, std::size_t slots,
    const std::function<void(Machine&)>& body,
    const std::function<Table(const Table&)>& around = [](const Table& table) { return table; }) {
  const ranks::ThreadRanks shared(system.ranks, faults);
  std::vector<Status> ends(static_cast<std::size_t>(system.ranks));
  std::vector<std::thread> threads;
  for (int r = 0; r < system.ranks; ++r)
    threads.emplace_back([&, r] {
      Status& end = ends[static_cast<std::size_t>(r)];
      try {
        Machine machine(system, around(shared.table(r)), patience, slots);
        machine.link().begin_call();
        try {
          body(machine);
        } catch (const Error& e) {
          machine.give_up();
          end = e.status();
        }
        end = machine.link().end_call(end);
      } catch (const Error& e) {
        end = e.status();
      }
    });
  for (std::thread& t : threads) t.join();
  return ends;
}

// Sends of row blocks of tiles end late. most(): how many messages were open to all of `receivers` ranks, and had been
// so for some time, when another one began.
class LateSends {
 public:
  LateSends(const Table& inner, const TileMessages& messages, std::size_t receivers)
      : inner_(inner), messages_(messages), receivers_(receivers) {}
  [[nodiscard]] std::size_t most() const { return most_; }
  Table table() {
    Table t = inner_;
    t.context = this;
    t.send = [](void* c, const void* data, std::size_t bytes, std::int32_t to, void** request) {
      return of(c).send(data, bytes, to, request);
    };
    t.test = [](void* c, void** request, std::int32_t* done) { return of(c).test(request, done); };
    t.probe = [](void* c, std::int32_t* from, std::size_t* bytes) {
      return of(c).inner_.probe(of(c).inner_.context, from, bytes);
    };
    t.receive = [](void* c, void* data, std::size_t bytes, std::int32_t from, void** request) {
      return of(c).inner_.receive(of(c).inner_.context, data, bytes, from, request);
    };
    t.dead_rank = nullptr;
    t.release = [](void* c) { of(c).inner_.release(of(c).inner_.context); };
    return t;
  }

 private:
  struct Open {
    void* request = nullptr;        // of the inner table
    const void* message = nullptr;  // null: none of those
    int looks = 0;                  // for which it stays open
  };
  static constexpr int kLooks = 1500, kCopy = 500;  // what was begun before the copy for the next message

  static LateSends& of(void* context) { return *static_cast<LateSends*>(context); }
  int send(const void* data, std::size_t bytes, std::int32_t to, void** request) {
    auto open = std::make_unique<Open>();
    const int error = inner_.send(inner_.context, data, bytes, to, &open->request);
    ranks::Header header;
    std::memcpy(&header, data, sizeof header);
    if (error == 0 && header.kind == 1 &&
        messages_.tiles(inner_.rank).at(static_cast<std::size_t>(header.number)).task.work == Work::block) {
      open->looks = kLooks;
      open->message = data;
      std::map<const void*, std::size_t> old;  // receivers by message
      for (const auto& other : opened_)
        if (other->message != nullptr && other->looks < kLooks - kCopy) ++old[other->message];
      const auto whole = std::count_if(old.begin(), old.end(), [&](const auto& m) { return m.second == receivers_; });
      most_ = std::max(most_, static_cast<std::size_t>(whole));
    }
    *request = open.get();
    opened_.push_back(std::move(open));
    return error;
  }
  int test(void** request, std::int32_t* done) {
    const auto found =
        std::find_if(opened_.begin(), opened_.end(), [&](const auto& open) { return open.get() == *request; });
    if (found == opened_.end()) return inner_.test(inner_.context, request, done);  // a receipt
    *done = 0;
    if (--(*found)->looks > 0) return 0;
    const int error = inner_.test(inner_.context, &(*found)->request, done);
    if (*done == 0) return error;
    opened_.erase(found);
    *request = nullptr;
    return error;
  }

  Table inner_;
  const TileMessages& messages_;
  std::size_t receivers_, most_ = 0;
  std::vector<std::unique_ptr<Open>> opened_;
};

void expect_exchange(const System& system, const ranks::Faults& faults, std::size_t slots) {
  const auto ends = on_machines(system, faults, 60, slots, [](Machine& machine) {
    machine.factorize(1);
    machine.share(1);
    machine.solve(1, 1);
    machine.solve(2, kMostPass);
    machine.share(2);
    machine.factorize(2);
  });
  for (const Status& end : ends) EXPECT_TRUE(end.ok()) << end.message;
}

TEST(TileExchange, BringsEverythingToEverybody) {
  expect_exchange(System({"elasticity", "7", "6", "6"}, Kind::llt, 2), {}, 64);
  expect_exchange(System({"elasticity", "7", "6", "6"}, Kind::ldlt, 3), {}, 64);
  expect_exchange(System({"gyroscopic", "7", "6", "6"}, Kind::lu, 4), {}, 64);
}

TEST(TileExchange, LateMessagesInAnyOrderAndFewAtATime) {
  ranks::Faults faults;
  faults.most_delay = 0.0005;
  faults.reorder = true;
  faults.credits = 2;
  expect_exchange(System({"elasticity", "7", "6", "6"}, Kind::llt, 3), faults, 64);
}

// How many messages leave at a time does not depend on how many ranks get each.
TEST(TileExchange, AMessageToManyRanksIsOneMessage) {
  const System system({"elasticity", "8", "7", "7"}, Kind::llt, 5);
  const TileMessages messages(system.plan, system.kind, system.tables);
  std::mutex mutex;
  std::deque<LateSends> late;
  const auto ends = on_machines(
      system, {}, 60, 64, [](Machine& machine) { machine.factorize(1); },
      [&](const Table& table) {
        const std::lock_guard lock(mutex);
        return late.emplace_back(table, messages, 4).table();
      });
  std::size_t most = 0;
  for (const LateSends& of_rank : late) most = std::max(most, of_rank.most());
  for (const Status& end : ends) EXPECT_TRUE(end.ok()) << end.message;
  EXPECT_GE(most, 2U);  // were it receivers, one is the most
}

TEST(TileExchange, AlmostNoRoomForMessages) {
  expect_exchange(System({"gyroscopic", "7", "6", "6"}, Kind::lu, 3), {}, 4);
}

TEST(TileExchange, ARankThatDiesIsNamedByAllOthers) {
  const System system({"elasticity", "7", "6", "6"}, Kind::llt, 3);
  ranks::Faults faults;
  faults.dead_rank = 1;
  faults.dies_at = 12;
  const auto ends = on_machines(system, faults, 0.3, 64, [](Machine& machine) {
    for (int run = 1; run < 5; ++run) machine.factorize(run);
  });
  for (const int survivor : {0, 2}) {
    EXPECT_EQ(ends[static_cast<std::size_t>(survivor)].code, StatusCode::device_error);
    EXPECT_NE(ends[static_cast<std::size_t>(survivor)].message.find("rank 1 on host"), std::string::npos)
        << ends[static_cast<std::size_t>(survivor)].message;
  }
}

// A rank dies while values go around: all others say so, and their copies have ended.
TEST(TileExchange, ARankThatDiesBetweenValues) {
  const System system({"elasticity", "7", "6", "6"}, Kind::llt, 3);
  ranks::Faults faults;
  faults.dead_rank = 0;
  faults.dies_at = 20;
  const auto ends = on_machines(system, faults, 0.3, 64, [](Machine& machine) {
    for (int run = 1; run < 20; ++run) machine.share(run);
  });
  for (const int survivor : {1, 2}) {
    EXPECT_EQ(ends[static_cast<std::size_t>(survivor)].code, StatusCode::device_error);
    EXPECT_NE(ends[static_cast<std::size_t>(survivor)].message.find("rank 0 on host"), std::string::npos)
        << ends[static_cast<std::size_t>(survivor)].message;
  }
}

// One rank is in another operation than the others expect: an error on all, no number in a wrong place.
TEST(TileExchange, ARankThatMakesOtherCallsIsNamed) {
  const System system({"elasticity", "7", "6", "6"}, Kind::llt, 3);
  const auto ends = on_machines(system, {}, 60, 64, [](Machine& machine) {
    if (machine.rank() == 2) (void)machine.link().all_numbers(1);  // what factorize() begins with
    machine.rank() == 2 ? machine.share(1) : machine.factorize(1);
  });
  for (const Status& end : ends) {
    EXPECT_EQ(end.code, StatusCode::device_error);
    EXPECT_NE(end.message.find("makes other calls"), std::string::npos) << end.message;
  }
}

TEST(TileExchange, KernelsWaitLongerThanTheLink) {
  EXPECT_GT(device::cuda::patience_of_kernels(0.5), 0.5);
  EXPECT_GT(device::cuda::patience_of_kernels(300), 300);
  EXPECT_LT(device::cuda::patience_of_kernels(1e300), 9e9);  // nanoseconds fit into 64 bits
}

// Commands in their order, marks by way, and a failure that the next look tells.
TEST(CopyThread, CopiesInOrderAndTellsFailures) {
  SlowQueues slow(3);
  bool begun = false;
  CopyThread copies(slow, [&] { begun = true; });
  std::vector<std::byte> from(64), host(64), to(64);
  for (int run = 1; run < 200; ++run) {
    std::fill(from.begin(), from.end(), static_cast<std::byte>(run));
    copies.copy(Way::to_host, {host.data(), from.data(), 64, 64, 1});
    const std::uint64_t out = copies.mark(Way::to_host);
    while (!copies.is_done(out)) std::this_thread::yield();
    copies.copy(Way::to_device, {host.data(), to.data(), 16, 16, 4});
    const std::uint64_t in = copies.mark(Way::to_device);
    EXPECT_NE(in, out);
    while (!copies.is_done(in)) std::this_thread::yield();
    ASSERT_EQ(to, from);
    if (run % 50 != 0) continue;
    copies.copy(Way::to_host, {nullptr, nullptr, 0, 0, 0});
    const std::uint64_t failed = copies.mark(Way::to_host);
    EXPECT_THROW(while (!copies.is_done(failed)) std::this_thread::yield(), Error);
    copies.finish();
  }
  EXPECT_TRUE(begun);
}

TEST(TileExchange, KernelsThatGiveUpEndTheCallOnAllRanks) {
  const System system({"elasticity", "7", "6", "6"}, Kind::llt, 3);
  const auto ends = on_machines(system, {}, 60, 64, [](Machine& machine) {
    if (machine.rank() == 2) machine.abort_after(3);
    machine.factorize(1);
  });
  for (const Status& end : ends) {
    EXPECT_EQ(end.code, StatusCode::device_error);
    EXPECT_NE(end.message.find("rank 2 on host"), std::string::npos) << end.message;
    EXPECT_NE(end.message.find("gave up waiting"), std::string::npos) << end.message;
  }
}

}  // namespace
}  // namespace espalier
