/// \file
/// What ranks send each other in a factorization: every block once to each rank that needs it.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "device/host/numeric_state.hpp"
#include "ranks/communicator.hpp"

namespace espalier::device::host {

/// Kinds of messages (ranks::Header::kind).
enum class Cargo : std::int32_t {
  factor_tile,         ///< of the top, to all that keep the front; front, row, column
  whole_factor,        ///< likewise of a front that is taken whole
  contribution_tile,   ///< to those who gather from it
  whole_contribution,  ///< likewise
  verdict,             ///< over a front, to those who work above it; row: its value
  done,                ///< this rank's tasks are done; what its fronts came to
  solution_rows,       ///< of a solve: a contribution to the right-hand side
};

/// Sends what this rank makes, and puts what others have made in its place and sets the flags.
template <class T>
class RankTraffic {
 public:
  RankTraffic(NumericState<T>& state, ranks::Communicator& link);

  /// Before a factorization.
  void reset();
  /// Any thread: after a task of this rank.
  void send_made(const plan::Task& task);
  /// When all tasks of this rank are done.
  void send_done();
  /// In the thread that calls.
  void take(int from, const ranks::Message& message);
  /// Whether all other ranks are done, and everything that they sent has been taken.
  [[nodiscard]] bool all_done() const { return done_ + 1 == link_.size(); }
  /// Whether some rank has not made some front. @pre all_done()
  [[nodiscard]] bool halted() const { return halted_; }

 private:
  [[nodiscard]] int me() const { return link_.rank(); }
  [[nodiscard]] std::vector<int> others(const std::vector<Index>& ranks) const;
  [[nodiscard]] bool is_shared(Index f) const { return plan_.ownership.subtree(f) < 0; }
  [[nodiscard]] bool passes_on(Index f) const;
  [[nodiscard]] bool two_parts() const { return s_.kind != Kind::llt; }

  void send_range(Index f);
  void send_factor_tile(const plan::Task& task);
  void send_contribution(Index f, Index i, Index j);
  void send_whole_factor(Index f);
  void announce(Index f);
  struct Pivots {
    Index position, count;
    bool booked;  // with what the pivoting has found
    bool go_on_here = false;
  };
  [[nodiscard]] bool makes_pivots(Index f, Index j) const;
  [[nodiscard]] std::size_t pivot_bytes(const Pivots& p) const;
  void put_pivots(Index f, const Pivots& p, ranks::Writer& to) const;
  void get_pivots(Index f, const Pivots& p, ranks::Reader& from);
  void take_factor_tile(const ranks::Header& h, ranks::Reader from);
  void take_whole_factor(Index f, ranks::Reader from);
  void take_contribution(const ranks::Header& h, ranks::Reader from, bool whole);
  void take_done(int from, ranks::Reader reader);
  void close_pivot_tile(Index f);
  [[nodiscard]] Index reporter(Index f) const;
  template <class Take>
  void for_each_own_column(int rank, const Take& take) const;

  NumericState<T>& s_;
  const plan::Plan& plan_;
  ranks::Communicator& link_;
  std::unique_ptr<std::atomic<bool>[]> announced_;  // fronts
  int done_ = 0;
  bool halted_ = false;
};

}  // namespace espalier::device::host
