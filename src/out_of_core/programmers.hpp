/// \file
/// The two sorts of units of an out-of-core plan.
#pragma once

#include <vector>

#include "out_of_core/program.hpp"

namespace espalier::out_of_core {

/// Writes in-core steps.
class StepProgrammer {
 public:
  explicit StepProgrammer(Program& program);
  /// The step of the program's unit at hand. @throws NoRoom
  void write();

 private:
  struct Room {  // bytes
    Offset tables = 0, values = 0, scratch = 0, work = 0;
  };
  [[nodiscard]] bool leaves_step(Index f) const;
  std::array<Offset, 2> bring_external(Index device, Index child, std::vector<Access>& loaded);
  Offset keep(Index device, const InCoreStep& s);
  void finish(Index device, InCoreStep& s, const Room& room, const std::vector<Access>& loaded);
  double count_chain(Index f);

  Program& p_;
  std::vector<double> chain_;  // fronts: seconds of the longest chain of pivots below, within the step
};

/// Writes large fronts.
class FrontProgrammer {
 public:
  explicit FrontProgrammer(Program& program) : p_(program), chunks_(program.plans.size()) {}
  /// The front of the program's unit at hand. @throws NoRoom
  void write();

 private:
  struct Chunks {  // of one device
    std::vector<Offset> at;
    Offset bytes = 0;
    std::size_t next = 0;
  };
  /// A group in the making.
  struct Group {
    Index device = 0;
    Operation op;  // with the group's number
    ColumnGroup columns;
  };

  void take_whole(Index f);
  void keep_whole(Index f);
  void take_chunks(Index device, Index f);
  Offset next_chunk(Index device);
  [[nodiscard]] Index next_device() const;
  [[nodiscard]] Offset group_bytes(Index f, Index begin, Index end) const;
  [[nodiscard]] Index columns_of(Index f) const;
  [[nodiscard]] Index choose_end(Index device, Index f, Index begin) const;
  [[nodiscard]] double elements_of(const ColumnGroup& g) const;
  void count_entries(ColumnGroup& g) const;
  bool place(Index device, ColumnGroup& g, Offset tables, Offset scratch);
  Index one_group(Index device, Index f, Index begin);
  void run(const Group& g, OperationType type, const Operation& more, std::vector<Access> reads, double flops,
           double chain = 0);
  [[nodiscard]] Index first_row(Index child, Index parent, Index row) const;
  void add_child(const Group& g, Index child);
  Index add_columns(const Group& g, const Segment& s, Index begin, Index last);
  void update(const Group& g);
  Index update_columns(const Group& g, const Segment& s, Index begin);
  [[nodiscard]] Offset slab_bytes(Index f, Index begin, Index end, Index row);
  void load_slab(Index device, const Operation& of, Offset bytes);
  void finish(const Group& g);
  void store(const Group& g, Index end);

  Program& p_;
  std::vector<Chunks> chunks_;        // devices
  std::array<Offset, 2> whole_at_{};  // of the factor arrays of the front at hand, where they stay
  std::vector<Extent> extents_;
};

}  // namespace espalier::out_of_core
