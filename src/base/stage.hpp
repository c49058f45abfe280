/// \file
/// Stages of work that takes long, as a ProgressListener hears of them.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <string_view>

#include "espalier/progress.hpp"

namespace espalier::base {

class StageBoard;

/// A stage lasts from the constructor to the destructor; stages of a thread are nested. Where the thread that makes it
/// has no listener, nothing happens.
class Stage {
 public:
  /// @param name, unit  of static life; without a unit nothing is counted, and a stage inside that counts is told of
  /// instead  @param total  0: nobody knows  @param predicted  seconds; 0: nobody knows
  explicit Stage(std::string_view name, double total = 0, std::string_view unit = {}, double predicted = 0);
  ~Stage();
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  /// So much of the total is done. What is less than before is passed over. In any thread, as add() and add_share().
  void reach(double done);
  void add(double amount);
  /// A part, 0 to 1, of the total.
  void add_share(double share) { add(share * total_); }
  /// Where the total becomes known, or another one, later. In the thread that made it.
  void expect(double total) { total_ = total; }

  /// The innermost stage of this thread, if it has that name; null: it has not, or nobody listens.
  static Stage* current(std::string_view name);

 private:
  friend class StageBoard;
  StageBoard* board_;  // of the thread; null: nobody listens
  std::string_view name_, unit_;
  double total_, predicted_;
  std::atomic<double> done_{0};
  std::chrono::steady_clock::time_point begin_;
};

/// Has the listener told, if it is time. In any thread.
void tell_progress();

/// A question for Interruption in which the listener of this thread, if there is one, is told as well; else `ask`.
std::function<bool()> telling(std::function<bool()> ask);

}  // namespace espalier::base
