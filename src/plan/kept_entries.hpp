/// \file
/// Entries of fronts that are the same in a plan for a changed pattern.
#pragma once

#include <limits>
#include <span>
#include <utility>
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

  [[nodiscard]] Offset operator()(Offset before) const { return place_in(run_of(before), before); }

  /// Looks up neighbours one after another: most are in the run of the one before.
  class Cursor {
   public:
    explicit Cursor(const SourceMap& map) : map_(map) {}
    [[nodiscard]] Offset operator()(Offset before) {
      if (before < begin_ || before >= end_) {
        run_ = map_.run_of(before);
        begin_ = map_.runs_[run_].begin;
        end_ = run_ + 1 < map_.runs_.size() ? map_.runs_[run_ + 1].begin : std::numeric_limits<Offset>::max();
      }
      return map_.place_in(run_, before);
    }

   private:
    const SourceMap& map_;
    std::size_t run_ = 0;
    Offset begin_ = 0, end_ = 0;
  };

 private:
  [[nodiscard]] std::size_t run_of(Offset before) const {
    auto run = static_cast<std::size_t>(first_run_[at(before >> kBlock)]);
    while (run + 1 < runs_.size() && runs_[run + 1].begin <= before) ++run;
    return run;
  }
  [[nodiscard]] Offset place_in(std::size_t run, Offset before) const {
    const Run& r = runs_[run];
    return r.listed < 0 ? before + r.shift : listed_[at(r.listed + before - r.begin)];
  }

  static constexpr int kBlock = 9;  // runs are found from the first of each 512 entries on
  struct Run {
    Offset begin, shift, listed;  // listed: place in listed_; -1: all have moved by `shift`
  };
  std::vector<Run> runs_;
  std::vector<Offset> listed_;
  std::vector<Index> first_run_;
};

/// What place_entries() need not look for, and make_plan() need not place.
struct KeptEntries {
  const Plan& before;
  std::span<const Index> same;  ///< by front; that of `before` with the same pivots, rows and entries; -1: none
  const SourceMap& now;
  /// By front; that of `before` with the same pivots in the same order, whose entries were these but for `added` and
  /// `removed`; -1: none. Empty: not known.
  std::span<const Index> with_pivots = {};
  std::span<const std::pair<Index, Index>> added = {}, removed = {};  ///< row, column
  bool places = false;  ///< fronts that are the same keep their places in memory, where they can (plan/kept_places.hpp)
};

}  // namespace espalier::plan
