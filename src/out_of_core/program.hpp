/// \file
/// What the parts of the planner share while they write the devices' operations: memory, waits, predicted
/// clocks, and where contributions are.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "out_of_core/arena.hpp"
#include "out_of_core/cut.hpp"
#include "out_of_core/plan.hpp"

namespace espalier::out_of_core {

/// Thrown where an arena has no room for what must be there.
struct NoRoom {};

/// What plans are made with; the candidates differ in it.
struct PlanParameters {
  double step = 0.3;    ///< bytes of an in-core step, of the device's arena
  double group = 0.4;   ///< bytes of a group, likewise
  int turns = 1;        ///< groups that each device gets of a front that several share, about
  Offset chunks = 3;    ///< slabs that are on a device at one time ...
  double chunk = 0;     ///< ... and bytes of one, of the arena; raised to one block column
  bool frugal = false;  ///< contributions go to the host at once
  int lanes = 1;        ///< queues that compute
  bool around = false;  ///< see Arena
  double resident = 0;  ///< bytes of factors that stay on the device, of its arena (one device)
};

/// Block columns of a front that lie on a device, in the host's store, or both.
struct Segment {
  Index front = 0;
  bool factor = false;  ///< else contribution
  Index device = 0;
  Index begin = 0, end = 0;
  std::array<Offset, 2> at{-1, -1};    ///< on the device
  std::array<Offset, 2> host{-1, -1};  ///< elements of the store
  Offset part_bytes = 0;
  Index next_unit = 0;  ///< where it is needed next
  bool resident = true;
  bool stored = false;
  Index left = -1;  ///< its place in OutOfCorePlan::left
  int pinned = 0;
};

/// A place that an operation touches: bytes of a device's arena, or elements of the store.
struct Access {
  Offset at, bytes;
  bool write;
};

class Program {
 public:
  Program(const OutOfCoreLayout& layout, const std::vector<Unit>& units, const std::vector<InCoreStep>& steps,
          const std::vector<OutOfCoreDevice>& devices, const PlanParameters& shape, const PlanningRates& rates,
          base::ThreadPool* pool);

  const OutOfCoreLayout& layout;
  const plan::Plan& plan;
  const std::vector<Unit>& units;
  const PlanParameters shape;
  const PlanningRates rates;
  const Offset element;                             ///< bytes
  const int contribution_parts, factor_parts;       ///< arrays of a front
  std::vector<OutOfCorePlan> plans;                 ///< devices
  std::vector<std::vector<Segment>> contributions;  ///< fronts
  std::vector<Segment> factors;                     ///< of the large front at hand, by rising columns
  Index unit = 0;                                   ///< at hand

  /// Whether the factors of the unit at hand stay on the device.
  [[nodiscard]] bool stays() const { return resident_[static_cast<std::size_t>(unit)] != 0; }
  [[nodiscard]] Index unit_of(Index front) const { return unit_of_[static_cast<std::size_t>(front)]; }
  [[nodiscard]] Offset contribution_bytes(Index f, Index begin, Index end) const {
    return (layout.contribution_offset(f, end) - layout.contribution_offset(f, begin)) * element;
  }
  [[nodiscard]] Offset factor_bytes(Index f, Index begin, Index end) const {
    return (layout.factor_offset(f, end) - layout.factor_offset(f, begin)) * element;
  }

  /// Appends an operation of a device: the places that it touches there and in the store, what it computes, and the
  /// seconds that its longest chain of pivots takes however many compute.
  void emit(Index device, Operation op, std::span<const Access> places, std::span<const Access> store = {},
            double flops = 0, double chain = 0);
  [[nodiscard]] Offset arena_bytes(Index device) const { return state(device).arena.size(); }
  /// When the device is predicted to be free to compute, in seconds.
  [[nodiscard]] double free_at(Index device) const;

  /// Room in a device's arena; sends away what is needed last. @returns the place, or -1
  Offset take(Index device, Offset bytes, bool lasting);
  /// Adds a need of memory in the same way. @throws NoRoom
  Offset need(Index device, Offset bytes, bool lasting = false);
  /// For what stays until the end of the factorization, or of its unit. @throws NoRoom
  Offset need_first(Index device, Offset bytes);
  void give_back(Index device, Offset at, Offset bytes) { state(device).arena.give_back(at, bytes); }
  /// The segment's place on its device is free afterwards.
  void release(Segment& s);

  void store_contribution(Segment& s);
  /// Copies columns [begin, end) of a stored segment to a device.
  void load_contribution(const Segment& s, Index device, Index begin, Index end, const std::array<Offset, 2>& at);
  /// The segment is read where it stands on its device.
  void read_in_place(const Segment& s) {
    if (s.left >= 0) plans[static_cast<std::size_t>(s.device)].left[static_cast<std::size_t>(s.left)].read_there = true;
  }
  /// Makes columns [begin, end) below of front f known as a contribution.
  void add_contribution(Index f, Index device, Index begin, Index end, const std::array<Offset, 2>& at, Offset bytes);
  /// The segment, or the whole contribution, has been used up.
  void forget(Segment& s);
  void forget_contribution(Index f);

  /// Tables and values of a unit.
  void load_inputs(Index device, const Operation& of, Offset tables_at, Offset tables, Offset values_at,
                   Offset entries);
  void store_outputs(Index device, const Operation& of, Offset scratch_at, Offset bytes);

  /// The finished plans.
  std::vector<OutOfCorePlan> finish();

 private:
  /// While plans are made, contributions in the store count from there for every device; finish() puts them together.
  static constexpr Offset kDeviceApart = Offset{1} << 52;

  struct DeviceState {
    DeviceState(Offset budget, double its_speed, bool around);
    Arena arena;
    Arena host;  // contributions in the store, counted from the device's own start
    Touches touches{kQueues};
    double speed;
    std::array<std::int64_t, kQueues> count{};
    std::array<double, kQueues> clock{};
    std::array<std::vector<double>, kQueues> finished;
  };
  [[nodiscard]] DeviceState& state(Index device) { return states_[static_cast<std::size_t>(device)]; }
  [[nodiscard]] const DeviceState& state(Index device) const { return states_[static_cast<std::size_t>(device)]; }
  [[nodiscard]] Queue queue_for(OperationType type) const;
  [[nodiscard]] double seconds_of(const DeviceState& s, const Operation& op, double flops, double chain) const;
  [[nodiscard]] double begin_of(Index device, const Operation& op, std::size_t queue) const;
  void wait_in_store(Index device, Operation& op, int queue, std::span<const Access> store);
  [[nodiscard]] Offset resident_bytes(std::size_t of_unit) const;
  void choose_residents();
  void plan_solve();
  void predict_solve();
  void lay_out_store();
  bool evict_one(Index device);
  void leave(Segment& s);
  void move_contributions();

  std::vector<DeviceState> states_;
  Touches store_touches_;       // queues of all devices
  std::vector<Index> unit_of_;  // fronts
  std::vector<char> resident_;  // units
  std::vector<Index> held_;     // fronts with contributions
  Offset factor_elements_ = 0;  // of the store
};

}  // namespace espalier::out_of_core
