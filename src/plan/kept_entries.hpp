/// \file
/// Entries of fronts that are the same in a plan for a changed pattern.
#pragma once

#include <span>
#include <vector>

#include "plan/plan.hpp"

namespace espalier::plan {

/// Where the entries of a pattern stand in one that differs here and there: runs of entries that moved together, and
/// entries one by one in columns that have changed. Positions are those of value arrays.
class SourceMap {
 public:
  /// The entries from `begin` on, up to the next call, have moved by `shift`. @pre begin rises
  void move(Offset begin, Offset shift);
  /// The entries from `begin` on, one by one; -1: gone. @pre likewise
  void list(Offset begin, std::span<const Offset> now);
  /// No more calls of these. @param entries  of the pattern before
  void close(Offset entries);

  [[nodiscard]] Offset operator()(Offset before) const {
    auto run = static_cast<std::size_t>(first_run_[static_cast<std::size_t>(before >> kBlock)]);
    while (run + 1 < runs_.size() && runs_[run + 1].begin <= before) ++run;
    const Run& r = runs_[run];
    return r.listed < 0 ? before + r.shift : listed_[static_cast<std::size_t>(r.listed + before - r.begin)];
  }

 private:
  static constexpr int kBlock = 9;  // runs are found from the first of each 512 entries on
  struct Run {
    Offset begin, shift, listed;  // listed: place in listed_; -1: all have moved by `shift`
  };
  std::vector<Run> runs_;
  std::vector<Offset> listed_;
  std::vector<Index> first_run_;
};

/// What place_entries() need not look for.
struct KeptEntries {
  const Plan& before;
  std::span<const Index> same;  ///< by front; that of `before` with the same pivots, rows and entries; -1: none
  const SourceMap& now;
};

}  // namespace espalier::plan
