#include "plan/machine_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <utility>

namespace espalier::plan {

// One AVX-512 core. The rates of fronts fit refactorizations on 2 and 16 cores (docs/notebook/cpu.md) and traces of
// elasticity 14^3 and a plate of 60 x 60 on one thread: fronts of 10^5 flops (some 60 rows) run at 8 GFLOP/s, of 5 10^5
// (120 rows) at 17, of 10^7 (400 rows) at 29.
//
// Host devices with small memories stand in for GPUs in tests: out of core they have the rates of an H200's link, so
// that they take the same plans.
MachineModel host_thread() {
  MachineModel m;
  m.name = "one AVX-512 core";
  m.flops = 6e10;
  m.single = 2;
  m.half_rows = 300;
  m.front = 1.5e-6;
  m.dealt_front = 1.5e-6;
  m.thread_rows = 160;  // the tiles of large fronts have 128 to 192
  m.multiprocessors = 1;
  m.blocks = 1;
  m.out_of_core = h200().out_of_core;
  m.out_of_core.pinned = 1;
  m.out_of_core.flops = 3e13;
  m.out_of_core.pivot = {};
  return m;
}

namespace {

// The link fits nine points on one and two H200s of one host within 10 %, with a tenth of whichever of queues and
// memory is faster added to the slower. A byte crosses the host's memory three times on its way, once where the store
// is page-locked. The time of a pivot is by the sums of the times of all steps and groups of elasticity 64^3, KKT 400
// and gyroscopic 40^3.
OutOfCoreRates h200_out_of_core() {
  OutOfCoreRates r;
  r.bytes_in = 5.5e10;
  r.bytes_out = 5.5e10;
  r.host_bytes = 6.5e10;
  r.pinned = 3;
  r.flops = 3.6e13;
  r.start = 2e-5;
  r.copy_start = 6e-5;  // host threads are woken up for it
  r.pivot = {9e-7, 5e-7, 1.8e-6};
  r.share = 4e-3;
  return r;
}

// From the times of tasks of elasticity 40^3 (L L^T) and the KKT chain of 20 bodies (L D L^T) on two H200s joined by
// NVLink: means over tasks in work at full load, waits left out. Tails: from the last operand to the end, on the chain
// of the root of elasticity 40^3, whose diagonal tiles follow each other after 50 us on one device, 72 us across two.
KernelRates h200_kernels() {
  KernelRates r;
  r.block32 = {{12e-6, 16e-6, 16e-6}, {1.35e-6, 1.6e-6, 1.6e-6}, {8e-6, 9e-6, 9e-6}};
  r.block64 = {{26e-6, 30e-6, 30e-6}, {1.43e-6, 1.43e-6, 1.43e-6}, {10e-6, 10e-6, 10e-6}};
  r.diagonal32 = {{24e-6, 17e-6, 31e-6}, {1e-6, 1.5e-6, 1.5e-6}, {18e-6, 11e-6, 25e-6}};
  r.diagonal64 = {{62e-6, 50e-6, 88e-6}, {0.93e-6, 0.93e-6, 0.93e-6}, {41e-6, 35e-6, 68e-6}};
  r.whole = {20e-6, 16.5e-6, 17.6e-6};
  r.half_block = 0.6;
  r.kernel = 8e-6;
  r.hop = 18e-6;
  r.narrow_blocks = 3;
  return r;
}

}  // namespace

// Fronts fit what two H200s gain over one on elasticity 24^3, 40^3 and 64^3 and the KKT chains of 20 and 400 bodies,
// within 20 %. A small front is one task of some 20 microseconds on one of 264 blocks: KKT chains of 200 bodies of
// (3,2,2) and 1,000 of (2,1,1) with 468 and 1,037 fronts take 0.31 and 0.37 ms, 0.22 and 0.23 of it in the chain.
//
// Pivots on a chain wait for each other. KKT chains (L D L^T) of 2 and 200 bodies, 1,860 and 494 pivots in a chain,
// take 0.8 and 0.3 ms however little else there is to do; elasticity 24^3, 4,977 pivots by L L^T, about 2.8. A shared
// front takes two hops: the 0.31 ms of KKT 200 on one GPU become 0.33 on two.
MachineModel h200() {
  MachineModel m;
  m.name = "one NVIDIA H200";
  m.flops = 4e13;
  m.single = 2;  // elasticity 64^3: 339 ms in FP64, 163 in FP32
  m.half_rows = 1800;
  m.front = 1e-7;
  m.dealt_front = 5e-7;
  m.pivot = {5.5e-7, 4.3e-7, 9e-7};
  m.start = 2e-4;
  m.launch = 2e-5;
  m.imbalance = 0.04;
  m.hand_over = 4e-5;
  m.multiprocessors = 132;
  m.blocks = 2;
  m.out_of_core = h200_out_of_core();
  m.kernels = h200_kernels();
  return m;
}

namespace {

constexpr const char* kPerSecond = "1/s";
constexpr const char* kBytesPerSecond = "B/s";
constexpr const char* kSeconds = "s";
constexpr const char* kCount = "number";
constexpr const char* kFactor = "factor";

class Lister {
 public:
  void add(const std::string& key, const char* unit, const char* meaning, Rate& rate) {
    list.push_back({key, unit, meaning, &rate});
  }
  void add(const std::string& key, const char* unit, const char* meaning, RateByKind& rate) {
    add(key + ".llt", unit, meaning, rate.llt);
    add(key + ".ldlt", unit, meaning, rate.ldlt);
    add(key + ".lu", unit, meaning, rate.lu);
  }
  void add(const std::string& key, const char* meaning, TaskRates& rates) {
    add(key + ".fixed", kSeconds, meaning, rates.fixed);
    add(key + ".chunk", kSeconds, "for every 16 columns of products", rates.chunk);
    add(key + ".tail", kSeconds, "after the last operand", rates.tail);
  }
  std::vector<NamedRate> list;
};

void list_out_of_core(OutOfCoreRates& r, Lister& l) {
  l.add("out_of_core.bytes_in", kBytesPerSecond, "link to the device", r.bytes_in);
  l.add("out_of_core.bytes_out", kBytesPerSecond, "link from the device", r.bytes_out);
  l.add("out_of_core.host_bytes", kBytesPerSecond, "host's memory, all devices and directions", r.host_bytes);
  l.add("out_of_core.pinned", kFactor, "the same with page-locked memory", r.pinned);
  l.add("out_of_core.flops", kPerSecond, "operations", r.flops);
  l.add("out_of_core.start", kSeconds, "start of an operation", r.start);
  l.add("out_of_core.copy_start", kSeconds, "start of a copy", r.copy_start);
  l.add("out_of_core.pivot", kSeconds, "a pivot on the longest chain", r.pivot);
  l.add("out_of_core.share", kSeconds, "a front that takes longer is shared", r.share);
}

void list_kernels(KernelRates& r, Lister& l) {
  l.add("kernels.block32", "row block of a tile column of 32", r.block32);
  l.add("kernels.block64", "row block of a tile column of 64", r.block64);
  l.add("kernels.diagonal32", "diagonal tile of 32", r.diagonal32);
  l.add("kernels.diagonal64", "diagonal tile of 64", r.diagonal64);
  l.add("kernels.whole", kSeconds, "a whole small front", r.whole);
  l.add("kernels.half_block", kFactor, "chunks of a row block of at most 64 rows", r.half_block);
  l.add("kernels.kernel", kSeconds, "start of a kernel", r.kernel);
  l.add("kernels.hop", kSeconds, "from one GPU to another", r.hop);
  l.add("kernels.narrow_blocks", kCount, "tasks of narrow fronts on a multiprocessor", r.narrow_blocks);
}

}  // namespace

std::vector<NamedRate> rates_of(MachineModel& m) {
  Lister l;
  l.add("flops", kPerSecond, "operations in large fronts, FP64", m.flops);
  l.add("single", kFactor, "the same in FP32", m.single);
  l.add("half_rows", kCount, "rows of a front at half of that rate", m.half_rows);
  l.add("front", kSeconds, "every front, among many", m.front);
  l.add("dealt_front", kSeconds, "every front, where a tree is dealt to devices", m.dealt_front);
  l.add("thread_rows", kCount, "rows of a front for every thread that works on it (host)", m.thread_rows);
  l.add("pivot", kSeconds, "a pivot on the longest chain", m.pivot);
  l.add("start", kSeconds, "values to the device, outcome back", m.start);
  l.add("launch", kSeconds, "start of every device", m.launch);
  l.add("imbalance", kFactor, "added to the work by every further device", m.imbalance);
  l.add("hand_over", kSeconds, "for every doubling of the devices", m.hand_over);
  l.add("multiprocessors", kCount, "of the device", m.multiprocessors);
  l.add("blocks", kCount, "tasks on a multiprocessor", m.blocks);
  list_out_of_core(m.out_of_core, l);
  if (m.kernels.kernel > 0) list_kernels(m.kernels, l);
  return std::move(l.list);
}

namespace {

struct Bounds {
  double least, most;
};

// Wide enough for any machine, narrow enough that no prediction overflows.
Bounds range_of(std::string_view unit) {
  if (unit == kPerSecond || unit == kBytesPerSecond) return {1e3, 1e24};
  if (unit == kCount) return {1, 1e6};
  return {0, 1e6};
}

[[noreturn]] void refuse(const std::string& message) { throw Error(StatusCode::invalid_input, "machine: " + message); }

void set(std::vector<NamedRate>& known, std::string_view key, std::string_view value) {
  const auto found = std::find_if(known.begin(), known.end(), [&](const NamedRate& r) { return r.key == key; });
  if (found == known.end()) {
    std::string keys;
    for (const NamedRate& r : known) keys += (keys.empty() ? "" : ", ") + r.key;
    refuse(fmt::format("there is no rate '{}'; the rates are {}", key, keys));
  }
  double number = 0;
  const char* const last = value.data() + value.size();
  const auto [end, error] = std::from_chars(value.data(), last, number);
  const Bounds range = range_of(found->unit);
  if (error != std::errc() || end != last || !(number >= range.least && number <= range.most))
    refuse(fmt::format("{}: '{}' is not understood; give a number from {:g} to {:g}", key, value, range.least,
                       range.most));
  *found->rate = {number, Rate::Source::caller};
}

}  // namespace

Machine machine_with(std::string_view text) {
  Machine machine;
  if (text.empty()) return machine;
  std::vector<NamedRate> known;
  for (auto [name, model] : {std::pair{"host.", &machine.host}, std::pair{"gpu.", &machine.gpu}})
    for (NamedRate& r : rates_of(*model)) known.push_back({name + r.key, r.unit, r.meaning, r.rate});
  for (std::string_view rest = text;;) {
    const std::size_t comma = rest.find(',');
    const std::string_view one = rest.substr(0, comma);
    const std::size_t equals = one.find('=');
    if (equals == std::string_view::npos)
      refuse(fmt::format("'{}' is not understood; give key=value,key=value, for instance gpu.flops=2e13", one));
    set(known, one.substr(0, equals), one.substr(equals + 1));
    if (comma == std::string_view::npos) return machine;
    rest.remove_prefix(comma + 1);
  }
}

std::string_view name_of(Rate::Source source) {
  switch (source) {
    case Rate::Source::table:
      return "table";
    case Rate::Source::measured:
      return "measured";
    case Rate::Source::caller:
      return "caller";
  }
  return "unknown";
}

}  // namespace espalier::plan
