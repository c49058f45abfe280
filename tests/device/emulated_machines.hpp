/// \file
/// Ranks of several machines, without GPU and MPI: threads are the ranks, and vectors the memory of devices. "Kernels"
/// replay the lists of tasks: a task that finds its flags set writes its tiles with numbers that only its place gives,
/// here and on ranks of its machine, and sets its flags.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "analysis/ordering.hpp"
#include "cuda_plan_flags.hpp"
#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "device/cuda/tables/copy_thread.hpp"
#include "device/cuda/tables/tile_exchange.hpp"
#include "matrix/generators/generate.hpp"
#include "ranks/thread_ranks.hpp"
#include "slow_queues.hpp"

namespace espalier::emulated {

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

inline constexpr Index kMostPass = 8;

struct System {
  SparseMatrix a;
  plan::Plan plan;
  DevicePlan tables;
  Kind kind = Kind::llt;
  int ranks = 2, per_machine = 1;

  System(const std::vector<std::string>& words, Kind sort, int count, int of_machine = 1)
      : kind(sort), ranks(count), per_machine(of_machine) {
    base::ThreadPool pool(2);
    a = matrix::generate(matrix::parse_generator(words), &pool);
    device::cuda::DeviceTuning tuning;
    tuning.narrow_rows = 300;  // small systems, too, shall have wide fronts
    plan = plan::make_plan(analysis::build_tree(analysis::graph_of(a, pool), {}, pool), a, {},
                           device::cuda::cuda_plan_options(kind, tuning, count), pool);
    tables = device::cuda::make_device_plan(plan, kind, true, {}, nullptr, true);
  }
  [[nodiscard]] bool are_near(int rank, int other) const { return rank / per_machine == other / per_machine; }
};

/// The memory of a rank's device.
struct DeviceMemory {
  std::vector<double> top, pivots, updates, places, mirrored;
  std::vector<int> flags;
  std::vector<std::byte> values;
};

/// The devices of all of them; outlives all ranks, as memory does that others have open.
struct Devices {
  std::mutex mutex;  // between kernels and copies
  std::vector<DeviceMemory> memory;
};

/// One rank: its kernels, and what it says at the end.
class Rank {
 public:
  Rank(const System& system, const espalier_rank_functions& functions, double patience, std::size_t slots,
       Devices& devices)
      : s_(system),
        devices_(devices),
        link_(functions, patience),
        queues_(static_cast<unsigned>(functions.rank) + 1, devices.mutex),
        thread_(queues_, [] {}),
        draw_(static_cast<unsigned>(functions.rank) + 11),
        messages_(s_.plan, s_.kind, s_.tables) {
    link_.set_machines(s_.per_machine);
    exchange_.emplace(link_, ranks::Machines::agreed(link_), s_.plan, s_.kind, s_.tables,
                      number() % 2 == 0 ? static_cast<CopyQueues&>(thread_) : queues_);
    const auto flags = 2 * static_cast<std::size_t>(s_.tables.flags);
    DeviceMemory& m = mine();
    m.top.resize(static_cast<std::size_t>(s_.tables.regions[0]));
    m.pivots.resize(3 * static_cast<std::size_t>(s_.plan.tree.n));
    m.updates.resize(kMostPass * s_.plan.relative.size());
    m.places.resize(static_cast<std::size_t>(s_.tables.place_space[static_cast<std::size_t>(number())]));
    m.mirrored.resize(static_cast<std::size_t>(exchange_->mirrored_size()));
    m.flags.resize(flags);
    mirror_.resize(flags);
    control_.resize(2);
    ones_.assign(1000, 1);
    (void)link_.all_numbers(1);  // all have their memory
    device::cuda::ExchangeMemory<double> memory;
    memory.sides.resize(devices_.memory.size());
    for (const int r : near()) {
      DeviceMemory& d = of(r);
      memory.sides[static_cast<std::size_t>(r)] = {d.top.data(),    d.pivots.data(),   d.updates.data(),
                                                   d.places.data(), d.mirrored.data(), d.flags.data()};
    }
    memory.mirror = mirror_.data();
    memory.control = control_.data();
    memory.ones = ones_.data();
    memory.aborted_at[1] = 1;
    exchange_->use(memory);
    const std::size_t tiles = slots < 10 ? 1 : 4;  // that fit into one
    const std::size_t bytes =
        sizeof(ranks::Header) + tiles * static_cast<std::size_t>(messages_.largest()) * sizeof(double);
    exchange_->use(
        std::make_shared<MessageSlots>(std::make_shared_for_overwrite<std::byte[]>(slots * bytes), slots, bytes));
  }

  ranks::Communicator& link() { return link_; }
  [[nodiscard]] int number() const { return link_.rank(); }

  /// Numbers are other ones in every run.
  void factorize(int run) {
    run_ = run;
    std::fill(mine().flags.begin(), mine().flags.end(), 0);
    next_task_ = next_tile_ = 0;
    (void)link_.all_numbers(1);  // all are clear
    exchange_->begin_factor();
    exchange_->run([&] { return work(); });
    expect_tiles(false);
    (void)link_.all_numbers(1);
    expect_tiles(true);
    (void)link_.all_numbers(1);
  }

  /// Each speaker's updates, in random pieces.
  void solve(int run, Index pass) {
    run_ = run;
    std::memset(mine().updates.data(), 0xff, mine().updates.size() * sizeof(double));
    (void)link_.all_numbers(1);
    const auto& own = messages_.updates(number());
    std::size_t front = 0;
    std::int64_t made = 0;
    exchange_->begin_solve(pass);
    exchange_->run([&] {
      const std::lock_guard lock(devices_.mutex);
      for (auto most = draw_() % 40; most > 0 && front < own.size(); --most) {
        const std::int64_t at = own[front].rows * pass + made;
        for (const int r : near())
          if (r == number() || (own[front].receivers >> r & 1) != 0)
            of(r).updates[static_cast<std::size_t>(at)] = value(number(), at);
        if (++made < own[front].below * pass) continue;
        made = 0;
        ++front;
      }
      return front == own.size();
    });
    expect_updates(pass, false);
    (void)link_.all_numbers(1);
    expect_updates(pass, true);
    (void)link_.all_numbers(1);
  }

  /// Rank 1 has nothing, the others more than a slot holds, and not whole numbers of them.
  void share(int run) {
    std::vector<TileExchange<double>::Range> ranges;
    std::int64_t all = 0;
    for (int r = 0; r < link_.size(); ++r) {
      ranges.push_back({all, r == 1 ? 0 : 5 * exchange_->largest_part() + 8 * r + 3});
      all += ranges.back().count;
    }
    auto& array = mine().values;
    array.assign(static_cast<std::size_t>(all), std::byte{0});
    const auto byte_of = [&](int r, std::int64_t at) { return static_cast<std::byte>((at * 7 + r + run) % 251); };
    const auto& own = ranges[static_cast<std::size_t>(number())];
    for (std::int64_t k = own.first; k < own.first + own.count; ++k)
      array[static_cast<std::size_t>(k)] = byte_of(number(), k);
    (void)link_.all_numbers(1);
    std::vector<std::byte*> arrays(devices_.memory.size(), nullptr);
    for (const int r : near()) arrays[static_cast<std::size_t>(r)] = of(r).values.data();
    exchange_->share(arrays, ranges);
    for (int r = 0; r < link_.size(); ++r) {  // those of one machine read each other's
      const auto& theirs = ranges[static_cast<std::size_t>(r)];
      for (std::int64_t k = theirs.first; k < theirs.first + theirs.count && !s_.are_near(r, number()); ++k)
        ASSERT_EQ(array[static_cast<std::size_t>(k)], byte_of(r, k)) << "rank " << number() << " from " << r;
    }
    (void)link_.all_numbers(1);
  }

  void give_up() { exchange_->give_up(); }
  /// The kernels end before they are done.
  void abort_after(std::size_t tasks) { most_tasks_ = tasks; }

 private:
  [[nodiscard]] DeviceMemory& of(int rank) const { return devices_.memory[static_cast<std::size_t>(rank)]; }
  [[nodiscard]] DeviceMemory& mine() const { return of(number()); }
  // The ranks of this machine.
  [[nodiscard]] std::vector<int> near() const {
    std::vector<int> list;
    for (int r = 0; r < s_.ranks; ++r)
      if (s_.are_near(r, number())) list.push_back(r);
    return list;
  }
  [[nodiscard]] double value(int maker, std::int64_t at) const {
    return static_cast<double>(at) + 1e7 * (maker + 1) + 1e9 * run_;
  }

  // use(element of the memory of `rank`, where it is in its array), for what a task of `maker` makes.
  template <class Use>
  void for_elements(int rank, int maker, const SentTile& tile, Use&& use) const {
    DeviceMemory& m = of(rank);
    messages_.for_pieces(tile, tile, [&](const Piece& p) {
      const bool here = maker == rank, place = p.array == Piece::Array::places;
      auto& memory = p.array == Piece::Array::top ? m.top : place ? (here ? m.places : m.mirrored) : m.pivots;
      const std::int64_t begin = place && !here ? exchange_->mirrored_at(maker) : 0;
      for (std::int64_t h = 0; h < p.height; ++h)
        for (std::int64_t w = 0; w < p.width; ++w) {
          const std::int64_t at = p.offset + h * p.pitch + w;
          use(memory.at(static_cast<std::size_t>(begin + at)), at);
        }
    });
  }

  // A kernel's block, now and then. @returns whether all is done
  bool work() {
    const std::lock_guard lock(devices_.mutex);
    const auto& tasks = s_.tables.lists[static_cast<std::size_t>(number())].tasks;
    for (auto most = draw_() % 8; most > 0 && next_task_ < tasks.size() && next_task_ < most_tasks_; --most) {
      if (!is_ready(tasks[next_task_])) return false;
      finish(tasks[next_task_++]);
    }
    if (next_task_ == most_tasks_) control_[1] = 1;
    return next_task_ == tasks.size() || next_task_ == most_tasks_;
  }

  bool is_ready(const FactorTask& task) const {
    const auto& flags = mine().flags;
    bool ready = true;
    PlanFlags(s_.tables).needed_flags(task, [&](std::int64_t flag, std::int32_t front) {
      const bool diagonal = flag >= s_.tables.fronts[static_cast<std::size_t>(front)].diagonal_flag(0);
      ready = ready && flags[static_cast<std::size_t>(flag)] != 0;
      if (s_.kind == Kind::lu && !diagonal)
        ready = ready && flags[static_cast<std::size_t>(s_.tables.flags + flag)] != 0;
    });
    return ready;
  }

  // Copies of the top are on all that need it; contributions stay here, and others of this machine read them here.
  void finish(const FactorTask& task) {
    unsigned receivers = 1U << number();
    const auto& tiles = messages_.tiles(number());
    for (; next_tile_ < tiles.size(); ++next_tile_) {
      const SentTile& tile = tiles[next_tile_];
      const FactorTask& t = tile.task;
      if (t.front != task.front || t.work != task.work || t.block != task.block || t.column != task.column ||
          t.part != task.part)
        break;
      receivers |= tile.receivers;
      for (const int r : near())
        if (r == number() || (!tile.contribution && (tile.receivers >> r & 1) != 0))
          for_elements(r, number(), tile, [&](double& to, std::int64_t at) { to = value(number(), at); });
    }
    const auto flag = static_cast<std::size_t>(task.part * s_.tables.flags + PlanFlags(s_.tables).own_flag(task));
    const bool both = s_.kind == Kind::lu && task.work == Work::whole;
    for (const int r : near()) {
      if ((receivers >> r & 1) == 0) continue;
      of(r).flags[flag] = 1;
      if (both) of(r).flags[flag + static_cast<std::size_t>(s_.tables.flags)] = 1;
    }
    mirror_[flag] = 1;
  }

  // What ranks of this machine make, or those of others: all that this one needs is in its memory, or theirs.
  void expect_tiles(bool of_near) const {
    const std::lock_guard lock(devices_.mutex);
    for (int r = 0; r < link_.size(); ++r) {
      if (s_.are_near(r, number()) != of_near) continue;
      for (const SentTile& tile : messages_.tiles(r)) {
        if (r != number() && (tile.receivers >> number() & 1) == 0) continue;
        const bool there = of_near && tile.contribution;
        for_elements(there ? r : number(), r, tile, [&](double& found, std::int64_t at) {
          ASSERT_EQ(found, value(r, at)) << "rank " << number() << " from " << r;
        });
      }
    }
  }

  void expect_updates(Index pass, bool of_near) const {
    for (int r = 0; r < link_.size(); ++r) {
      if (s_.are_near(r, number()) != of_near) continue;
      for (const auto& u : messages_.updates(r)) {
        if ((u.receivers >> number() & 1) == 0) continue;
        for (std::int64_t at = u.rows * pass; at < (u.rows + u.below) * pass; ++at)
          ASSERT_EQ(mine().updates[static_cast<std::size_t>(at)], value(r, at)) << "rank " << number() << " from " << r;
      }
    }
  }

  const System& s_;
  Devices& devices_;
  ranks::Communicator link_;
  SlowQueues queues_;
  CopyThread thread_;
  std::mt19937 draw_;
  TileMessages messages_;
  std::optional<TileExchange<double>> exchange_;
  std::vector<int> mirror_, control_, ones_;
  std::size_t next_task_ = 0, next_tile_ = 0, most_tasks_ = ~std::size_t{0};
  int run_ = 0;
};

using Table = espalier_rank_functions;

/// body(rank) on every rank. @returns how the calls have ended, by rank
inline std::vector<Status> on_ranks(
    const System& system, const ranks::Faults& faults, double patience, std::size_t slots,
    const std::function<void(Rank&)>& body,
    const std::function<Table(const Table&)>& around = [](const Table& table) { return table; }) {
  const ranks::ThreadRanks shared(system.ranks, faults);
  Devices devices;
  devices.memory.resize(static_cast<std::size_t>(system.ranks));
  std::vector<Status> ends(devices.memory.size());
  std::vector<std::thread> threads;
  for (int r = 0; r < system.ranks; ++r)
    threads.emplace_back([&, r] {
      Status& end = ends[static_cast<std::size_t>(r)];
      try {
        Rank rank(system, around(shared.table(r)), patience, slots, devices);
        rank.link().begin_call();
        try {
          body(rank);
        } catch (const Error& e) {
          rank.give_up();
          end = e.status();
        }
        end = rank.link().end_call(end);
      } catch (const Error& e) {
        end = e.status();
      }
    });
  for (std::thread& t : threads) t.join();
  return ends;
}

}  // namespace espalier::emulated
