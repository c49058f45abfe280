// What devices of different machines tell each other (tile_messages.hpp), without a GPU. Truth: the kernels' view of
// the tables. The lists of tasks are replayed by devices that know nothing but what they have made and what messages
// brought, in runs of random length, late and in any order between devices.
#include "device/cuda/tables/tile_messages.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <deque>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "analysis/ordering.hpp"
#include "cuda_plan_flags.hpp"
#include "matrix/generators/generate.hpp"
#include "parameters.hpp"

namespace espalier {
namespace tile_messages_test {

using device::cuda::DevicePlan;
using device::cuda::FactorTask;
using device::cuda::Front;
using device::cuda::Piece;
using device::cuda::SentTile;
using device::cuda::TileMessages;
using device::cuda::Work;

struct System {
  std::vector<std::string> words;
  Kind kind;
  Index devices;
  friend void PrintTo(const System& p, std::ostream* out) { test::print(*out, p.words, p.kind) << " on " << p.devices; }
};

class Machines : public ::testing::TestWithParam<System> {
 protected:
  // What a device has in its memory: how often each element was written. Its own parts of the top are counted like
  // those that come.
  struct Device {
    std::vector<std::uint8_t> top, pivots;
    std::vector<std::vector<std::uint8_t>> places;  // by maker
    std::vector<char> flags;
    std::size_t next_task = 0, next_tile = 0;
    std::vector<char> made;  // own tiles that may be sent
  };
  struct Run {
    std::size_t first, last;
  };

  void SetUp() override {
    const System& system = GetParam();
    const SparseMatrix a = matrix::generate(matrix::parse_generator(system.words), &pool_);
    device::cuda::DeviceTuning tuning;
    tuning.narrow_rows = 300;  // small systems, too, shall have wide fronts
    const auto options = device::cuda::cuda_plan_options(system.kind, tuning, system.devices);
    plan_ = plan::make_plan(analysis::build_tree(analysis::graph_of(a, pool_), {}, pool_), a, {}, options, pool_);
    tables_ = device::cuda::make_device_plan(plan_, system.kind, true, {}, nullptr, true);
    messages_.emplace(plan_, system.kind, tables_);
    for (int d = 0; d < system.devices; ++d) {
      Device device;
      device.top.assign(static_cast<std::size_t>(tables_.regions[0]), 0);
      device.pivots.assign(3 * static_cast<std::size_t>(plan_.tree.n), 0);
      for (const std::int64_t space : tables_.place_space) device.places.emplace_back(space, 0);
      device.flags.assign(2 * static_cast<std::size_t>(tables_.flags), 0);
      device.made.assign(messages_->tiles(d).size(), 0);
      devices_.push_back(std::move(device));
    }
  }

  [[nodiscard]] bool is_lu() const { return GetParam().kind == Kind::lu; }

  void write(int to, int maker, const SentTile& first, const SentTile& last) {
    Device& device = devices_[static_cast<std::size_t>(to)];
    messages_->for_pieces(first, last, [&](const Piece& p) {
      auto& memory = p.array == Piece::Array::top      ? device.top
                     : p.array == Piece::Array::pivots ? device.pivots
                                                       : device.places[static_cast<std::size_t>(maker)];
      for (std::int64_t h = 0; h < p.height; ++h)
        for (std::int64_t w = 0; w < p.width; ++w) ++memory.at(static_cast<std::size_t>(p.offset + h * p.pitch + w));
    });
  }

  // What finish_task() sets here.
  void set_own_flags(int d, const FactorTask& task) {
    auto& flags = devices_[static_cast<std::size_t>(d)].flags;
    const std::int64_t flag = PlanFlags(tables_).own_flag(task);
    flags[static_cast<std::size_t>(task.part * tables_.flags + flag)] = 1;
    if (is_lu() && task.work == Work::whole) flags[static_cast<std::size_t>(tables_.flags + flag)] = 1;
  }

  // Whether what the task polls is set on its device; of lu each flag of a block in both parts, which is more than it
  // polls, but for diagonal tiles, which have one.
  [[nodiscard]] bool is_ready(int d, const FactorTask& task) const {
    const auto& flags = devices_[static_cast<std::size_t>(d)].flags;
    bool ready = true;
    PlanFlags(tables_).needed_flags(task, [&](std::int64_t flag, std::int32_t front) {
      const Front& f = tables_.fronts[static_cast<std::size_t>(front)];
      const bool diagonal = flag >= f.diagonal_flag(0);
      ready = ready && flags[static_cast<std::size_t>(flag)] != 0;
      if (is_lu() && !diagonal) ready = ready && flags[static_cast<std::size_t>(tables_.flags + flag)] != 0;
    });
    return ready;
  }

  // The messages that a device's task makes possible, and what its memory has then.
  void finish(int d, const FactorTask& task) {
    set_own_flags(d, task);
    Device& device = devices_[static_cast<std::size_t>(d)];
    const auto& tiles = messages_->tiles(d);
    for (std::size_t k = device.next_tile; k < tiles.size(); ++k) {
      const FactorTask& t = tiles[k].task;
      if (t.front != task.front || t.work != task.work || t.block != task.block || t.column != task.column ||
          t.part != task.part)
        break;
      write(d, d, tiles[k], tiles[k]);
      device.made[k] = 1;
      device.next_tile = k + 1;
    }
  }

  // Every member has every element of a shared front's factor, once; and the pivots.
  void expect_whole_tops() const {
    for (const Front& f : tables_.fronts) {
      if (f.region != 0 || std::popcount(f.members) < 2) continue;
      const bool second = is_lu() || (GetParam().kind == Kind::ldlt && f.whole == 0);
      for (int d = 0; d < GetParam().devices; ++d) {
        if ((f.members >> d & 1) == 0) continue;
        const Device& device = devices_[static_cast<std::size_t>(d)];
        const auto all_once = [&](const std::vector<std::uint8_t>& memory, std::int64_t from, std::int64_t elements) {
          return std::count(memory.begin() + from, memory.begin() + from + elements, 1) == elements;
        };
        EXPECT_TRUE(all_once(device.top, f.factor, f.factor_size())) << "device " << d << ", front at " << f.position;
        EXPECT_TRUE(all_once(device.pivots, f.position, f.pivots)) << "device " << d << ", front at " << f.position;
        if (!second) continue;
        std::int64_t diagonal = 0;  // of ldlt, diagonal tiles have no second part
        if (!is_lu())
          for (int j = 0; j < f.pivot_tiles; ++j) {
            const std::int64_t size = f.column_end(j) - f.column_begin(j);
            diagonal += size * size;
          }
        EXPECT_EQ(std::count(device.top.begin() + f.second, device.top.begin() + f.second + f.factor_size(), 1),
                  f.factor_size() - diagonal)
            << "device " << d << ", front at " << f.position;
      }
    }
  }

  // Who makes a column of a parent in the top has all that the children pass on to it.
  void expect_contributions() const {
    std::int64_t checked = 0;
    for (Index p = 0; p < plan_.fronts(); ++p) {
      const Front& parent = tables_.fronts[static_cast<std::size_t>(p)];
      if (parent.region != 0) continue;
      for (int l = parent.link_begin; l < parent.link_end; ++l) {
        const auto& link = tables_.links[static_cast<std::size_t>(l)];
        const Front& child = tables_.fronts[static_cast<std::size_t>(link.child)];
        for (int j = 0; j < parent.tiles; ++j) {
          const int d = plan_.ownership.owner(p, parent.whole != 0 ? 0 : j);
          for (int c = tables_.bounds[link.bound + j]; c < tables_.bounds[link.bound + j + 1]; ++c)
            checked += expect_column(d, child, c);
        }
      }
    }
    EXPECT_GT(checked, 0);
  }
  // @returns elements that come from another device
  [[nodiscard]] std::int64_t expect_column(int d, const Front& child, int c) const {
    const int b = c / child.width, first = b * child.width;
    std::int64_t checked = 0;
    for (int part = 0; part < (is_lu() ? 2 : 1); ++part) {
      const auto& place = tables_.places[static_cast<std::size_t>(child.place(b, part))];
      if (place.device == d) continue;
      const auto& memory = devices_[static_cast<std::size_t>(d)].places[static_cast<std::size_t>(place.device)];
      for (int r = c; r < child.below; ++r, ++checked)
        EXPECT_EQ(memory[place.offset + std::int64_t{c - first} * (child.below_ld - first) + r - first], 1)
            << "device " << d << ", contribution at " << child.position << ", (" << r << ", " << c << ")";
    }
    return checked;
  }

  base::ThreadPool pool_{2};
  plan::Plan plan_;
  DevicePlan tables_;
  std::optional<TileMessages> messages_;
  std::vector<Device> devices_;
};

TEST_P(Machines, MessagesTellAllThatIsNeeded) {
  const auto count = static_cast<std::size_t>(GetParam().devices);
  std::mt19937 draw(7);
  std::vector<std::size_t> sent(count, 0);
  std::vector<std::vector<std::deque<Run>>> under_way(count, std::vector<std::deque<Run>>(count));
  const auto work = [&](std::size_t d) {
    Device& device = devices_[d];
    const auto& tasks = tables_.lists[d].tasks;
    for (auto burst = draw() % 200; burst > 0 && device.next_task < tasks.size(); --burst) {
      const FactorTask& task = tasks[device.next_task];
      if (!is_ready(static_cast<int>(d), task)) return;
      finish(static_cast<int>(d), task);
      ++device.next_task;
    }
  };
  const auto send = [&](std::size_t d) {
    const auto& tiles = messages_->tiles(static_cast<int>(d));
    while (sent[d] < tiles.size() && devices_[d].made[sent[d]] != 0 && draw() % 8 != 0) {
      const std::size_t first = sent[d];
      std::size_t last = first;
      while (last + 1 < tiles.size() && devices_[d].made[last + 1] != 0 && draw() % 4 != 0 &&
             messages_->joined(tiles[last], tiles[last + 1]))
        ++last;
      for (std::size_t to = 0; to < count; ++to)
        if ((tiles[first].receivers >> to & 1) != 0) under_way[d][to].push_back({first, last});
      sent[d] = last + 1;
    }
  };
  const auto receive = [&](std::size_t from, std::size_t to) {
    const auto& tiles = messages_->tiles(static_cast<int>(from));
    for (auto& queue = under_way[from][to]; !queue.empty() && draw() % 4 != 0; queue.pop_front()) {
      const auto [first, last] = queue.front();
      write(static_cast<int>(to), static_cast<int>(from), tiles[first], tiles[last]);
      messages_->for_flags(tiles[first], tiles[last], [&](std::int64_t flag, std::int64_t flags) {
        for (std::int64_t k = 0; k < flags; ++k) devices_[to].flags.at(static_cast<std::size_t>(flag + k)) = 1;
      });
    }
  };
  for (int round = 0; round < 20000; ++round) {
    const std::size_t d = draw() % count, other = draw() % count;
    work(d);
    send(d);
    receive(d, other);
  }
  for (std::size_t d = 0; d < count; ++d) {
    EXPECT_EQ(devices_[d].next_task, tables_.lists[d].tasks.size()) << "device " << d << " waits for ever";
    EXPECT_EQ(sent[d], messages_->tiles(static_cast<int>(d)).size());
  }
  expect_whole_tops();
  expect_contributions();
}

INSTANTIATE_TEST_SUITE_P(Systems, Machines,
                         ::testing::Values(System{{"elasticity", "9", "8", "8"}, Kind::llt, 2},
                                           System{{"elasticity", "9", "8", "8"}, Kind::llt, 5},
                                           System{{"elasticity", "9", "8", "8"}, Kind::ldlt, 3},
                                           System{{"gyroscopic", "9", "8", "8"}, Kind::lu, 4},
                                           System{{"poisson", "5"}, Kind::lu, 2}));

}  // namespace tile_messages_test
}  // namespace espalier
