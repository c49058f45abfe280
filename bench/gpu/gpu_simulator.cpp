#include "gpu/gpu_simulator.hpp"

#include <algorithm>
#include <functional>
#include <queue>

namespace espalier::bench {

namespace {

using device::cuda::DevicePlan;
using device::cuda::FactorTask;
using device::cuda::Front;
using device::cuda::kChunk;
using device::cuda::kRowBlock;
using device::cuda::Work;

constexpr double kNotYet = -1;

/// Blocks of one GPU and how far it is in its list.
struct Device {
  const device::cuda::TaskLists* list = nullptr;
  std::int64_t next = 0;
  std::priority_queue<double, std::vector<double>, std::greater<>> free;  ///< when each block is
  std::size_t blocks = 1;                                                 ///< most at a time
  double end = 0, busy = 0, waiting = 0;
};

class Run {
 public:
  Run(const DevicePlan& tables, const GpuRates& rates)
      : tables_(tables),
        rates_(rates),
        made_(static_cast<std::size_t>(tables.flags), kNotYet),
        maker_(static_cast<std::size_t>(tables.flags), 0) {
    for (const auto& list : tables.lists) {
      devices_.emplace_back();
      devices_.back().list = &list;
    }
  }

  // Devices go on in turn as far as they get. What a task reads stands earlier in the order of all lists, so somebody
  // always gets on.
  SimulatedRun run() {
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t d = 0; d < devices_.size(); ++d)
        while (step(static_cast<int>(d))) moved = true;
    }
    SimulatedRun result;
    for (const Device& d : devices_) {
      result.seconds = std::max(result.seconds, d.end);
      result.busy.push_back(d.busy / static_cast<double>(d.blocks));
      result.waiting.push_back(d.waiting / static_cast<double>(d.blocks));
    }
    return result;
  }

 private:
  // A kernel begins when the one before has ended, with as many blocks as fit.
  void start_kernel(Device& d, std::int64_t tasks, int blocks) const {
    d.free = {};
    const auto count = std::min<std::int64_t>(tasks, blocks);
    for (std::int64_t k = 0; k < count; ++k) d.free.push(d.end + rates_.kernel);
    d.blocks = std::max(d.blocks, static_cast<std::size_t>(count));
  }

  bool step(int device) {
    Device& d = devices_[static_cast<std::size_t>(device)];
    const auto tasks = static_cast<std::int64_t>(d.list->tasks.size()), narrow = d.list->narrow_tasks;
    if (d.next == tasks) return false;
    const FactorTask& task = d.list->tasks[static_cast<std::size_t>(d.next)];
    here_ = device;
    const double wanted = last_operand(task);
    if (wanted == kNotYet) return false;
    if (d.next == 0 && narrow > 0) start_kernel(d, narrow, rates_.narrow_blocks);
    if (d.next == narrow) start_kernel(d, tasks - narrow, rates_.wide_blocks);
    const double begin = d.free.top(), alone = rate_.fixed + rate_.chunk * chunks_;
    const double end = std::max(begin + alone, wanted);
    d.free.pop();
    d.free.push(end);
    d.end = std::max(d.end, end);
    d.busy += alone;
    d.waiting += end - begin - alone;
    const auto flag = static_cast<std::size_t>(flag_of(task));
    made_[flag] = std::max(made_[flag], end);
    maker_[flag] = static_cast<std::uint8_t>(device);
    ++d.next;
    return true;
  }

  [[nodiscard]] std::int64_t flag_of(const FactorTask& t) const {
    const Front& f = tables_.fronts[static_cast<std::size_t>(t.front)];
    if (t.work == Work::diagonal) return f.diagonal_flag(t.column);
    if (t.work == Work::block) return f.flag(t.block, t.column);
    return f.below > 0 ? f.flag(f.pivot_blocks, f.pivot_tiles) : f.diagonal_flag(0);
  }

  void choose_rate(const Front& f, const FactorTask& t) {
    const int j = t.column;
    chunks_ = (j < f.pivot_tiles ? f.column_begin(j) : f.pivot_pad) / kChunk;
    rate_ = {rates_.whole, 0, rates_.whole};
    if (t.work == Work::diagonal) rate_ = f.width == 64 ? rates_.diagonal64 : rates_.diagonal32;
    if (t.work != Work::block) return;
    rate_ = f.width == 64 ? rates_.block64 : rates_.block32;
    const int from = std::max(f.block_begin(t.block), j < f.pivot_tiles ? f.column_end(j) : f.column_begin(j));
    if (f.block_end(t.block) - from <= kRowBlock / 2) rate_.chunk *= rates_.half_block;
  }

  // When the task can end at the earliest by what it reads; kNotYet: not known.
  double last_operand(const FactorTask& t) {
    const Front& f = tables_.fronts[static_cast<std::size_t>(t.front)];
    choose_rate(f, t);
    double end = 0;
    const auto need = [&](std::int64_t flag, double rest) {
      const double made = made_[static_cast<std::size_t>(flag)];
      if (made == kNotYet) return false;
      end = std::max(end, made + (maker_[static_cast<std::size_t>(flag)] == here_ ? 0 : rates_.hop) + rest);
      return true;
    };
    if (!children_made(f, t, need)) return kNotYet;
    if (t.work == Work::whole) return end;
    const int j = t.column, columns = std::min(j, f.pivot_tiles), per_column = f.width / kChunk;
    const int row = f.block_of_column(j), a = t.work == Work::diagonal ? row : t.block;
    for (int k = columns - 1; k >= 0; --k) {  // the last ones are likely to be missing
      const double rest = rate_.tail + rate_.chunk * (columns - 1 - k) * per_column;
      if (!need(f.flag(a, k), rest) || !need(f.flag(row, k), rest)) return kNotYet;
    }
    if (t.work == Work::block && j < f.pivot_tiles && !need(f.diagonal_flag(j), rate_.tail)) return kNotYet;
    return end;
  }

  template <class Need>
  bool children_made(const Front& f, const FactorTask& t, const Need& need) const {
    int row = 0, row_end = f.tiles, col = 0, col_end = f.tiles;
    if (t.work != Work::whole) {
      const int per_block = kRowBlock / f.width, j = t.column, a = t.block;
      const int first = a < f.pivot_blocks ? a * per_block : f.pivot_tiles + (a - f.pivot_blocks) * per_block;
      const bool diagonal = t.work == Work::diagonal;
      row = diagonal ? j : std::max(first, j < f.pivot_tiles ? j + 1 : j);
      row_end = diagonal ? j + 1 : std::min(first + per_block, a < f.pivot_blocks ? f.pivot_tiles : f.tiles);
      col = j;
      col_end = j + 1;
    }
    const double rest = rate_.fixed + rate_.chunk * chunks_;
    for (int l = f.link_begin; l < f.link_end; ++l) {
      const auto& link = tables_.links[static_cast<std::size_t>(l)];
      const Front& c = tables_.fronts[static_cast<std::size_t>(link.child)];
      const std::int32_t* b = tables_.bounds.data() + link.bound;
      const int r0 = std::max(b[row], b[col]), r1 = b[row_end], c0 = b[col], c1 = b[col_end];
      if (r0 >= r1 || c0 >= c1) continue;
      for (int x = c0 / c.width; x <= (c1 - 1) / c.width; ++x)
        for (int y = r0 / kRowBlock; y <= (r1 - 1) / kRowBlock; ++y)
          if ((y + 1) * kRowBlock > x * c.width && !need(c.flag(c.pivot_blocks + y, c.pivot_tiles + x), rest))
            return false;
    }
    return true;
  }

  const DevicePlan& tables_;
  const GpuRates& rates_;
  std::vector<double> made_;         // flags; when, kNotYet
  std::vector<std::uint8_t> maker_;  // flags; the device
  std::vector<Device> devices_;
  // The device of the task at hand.
  int here_ = 0;
  int chunks_ = 0;
  TaskRate rate_{};
};

}  // namespace

GpuRates gpu_rates(const plan::MachineModel& machine, Kind kind) {
  const plan::KernelRates& k = machine.kernels;
  const auto of = [kind](const plan::TaskRates& t) {
    return TaskRate{t.fixed.of(kind), t.chunk.of(kind), t.tail.of(kind)};
  };
  GpuRates r{};
  r.narrow_blocks = static_cast<int>(k.narrow_blocks * machine.multiprocessors);
  r.wide_blocks = static_cast<int>(machine.tasks_at_once());
  r.block32 = of(k.block32);
  r.block64 = of(k.block64);
  r.diagonal32 = of(k.diagonal32);
  r.diagonal64 = of(k.diagonal64);
  r.whole = k.whole.of(kind);
  r.half_block = k.half_block;
  r.kernel = k.kernel;
  r.hop = k.hop;
  return r;
}

SimulatedRun simulate(const device::cuda::DevicePlan& tables, const GpuRates& rates) {
  return Run(tables, rates).run();
}

}  // namespace espalier::bench
