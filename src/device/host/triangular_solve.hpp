/// \file
/// Forward and backward substitution with the numeric factor, in parallel over sub-trees, fronts and tiles.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "base/thread_pool.hpp"
#include "device/host/numeric_state.hpp"
#include "device/host/solve_schedule.hpp"
#include "out_of_core/front_reader.hpp"

namespace espalier::device::host {

/// What others of the ranks that share a solve do not have.
template <class T>
class SolveSharing : public SolveShare {
 public:
  /// On the way up, by any thread: the contribution of a front that this rank takes is there, `rows` x `columns`.
  virtual void made(Index front, const T* rows, Index columns) = 0;
  /// In the thread that calls: drives messages until `done`.
  virtual void wait(const std::function<bool()>& done) = 0;
};

/// The solve phase. Right-hand sides are row-major with `nr` values per row, nr == 1 or a multiple of kPanel<T>.
template <class T>
class TriangularSolve {
 public:
  /// @param sharing  null: all fronts are here
  TriangularSolve(NumericState<T>& state, base::ThreadPool& pool, base::MemoryBudget* budget,
                  SolveSharing<T>* sharing = nullptr);

  /// Where the factor is not all in memory; outlives this object. From now on fronts are taken in the order in which
  /// they are stored. The numbers do not depend on it.
  void set_reader(out_of_core::FrontReader* reader);
  /// Memory for `nr` right-hand sides, where there is not enough.
  void prepare(Index nr);
  /// x (n x nr, elimination order) holds b on entry and the solution on return; unknowns of a border are zero.
  void run(T* x, Index nr, bool transpose) { run(x, nr, transpose, nullptr); }
  /// Through the fronts on its paths alone: the factor of others is not read.
  void run(const PathSolve<T>& solve);
  /// The contribution of a front that others take: as SolveSharing::made() told it there. During a run.
  void take(Index front, const std::byte* rows);

 private:
  struct Worker {
    base::Buffer<T> front;  // rows of a front in padded order
    base::Buffer<T> tile;   // rows of one tile
    base::Buffer<T> stack;  // contributions inside a range of fronts
  };

  [[nodiscard]] bool passes_up(Index f) const { return paths_ == nullptr || paths_->up[at(f)] != 0; }
  [[nodiscard]] bool passes_down(Index f) const { return paths_ == nullptr || paths_->down[at(f)] != 0; }
  void run(T* x, Index nr, bool transpose, const FrontPaths* paths);
  void begin_way(bool up);
  void need(Index f) {
    if (reader_ != nullptr) reader_->need(f);
  }
  void done(Index f) {
    if (reader_ != nullptr) reader_->done(f);
  }
  void sweep(const std::vector<SolveTask>& tasks, void (TriangularSolve::*one)(const SolveTask&, Worker&));
  void forward(const SolveTask& task, Worker& w);
  void backward(const SolveTask& task, Worker& w);
  void forward_front(Index f, Worker& w);
  void forward_tile(Index f, Index i, Worker& w);
  void backward_front(Index f, Worker& w);
  void backward_tile(Index f, Index j, Worker& w);

  void add_children(Index f, Index begin, Index end, T* to, const Worker& w) const;
  void divide_forward(Index f, Index j, const T* b, T* y, T* scratch) const;
  void start_backward(Index f, Index j, T* y) const;
  Index gather_below(Index f, T* to) const;
  void divide_backward(Index f, Index j, const T* b, T* y) const;
  [[nodiscard]] const T* lower(Index f, Index i, Index j) const;  // tile of the matrix of the forward sweep
  [[nodiscard]] const T* upper(Index f, Index i, Index j) const;  // tile whose transpose the backward sweep applies
  void finish_tile(Index f, Index tile, bool up);
  void finish_forward(Index f);

  NumericState<T>& s_;
  const plan::Plan& plan_;
  base::ThreadPool& pool_;
  base::MemoryBudget* budget_;
  SolveSharing<T>* sharing_;
  out_of_core::FrontReader* reader_ = nullptr;  // null: all of the factor is in memory
  SolveSchedule schedule_;
  base::Buffer<T> contributions_;  // contribution_rows() x nr
  std::vector<Worker> workers_;
  Index allocated_nr_ = 0;
  Progress tile_done_, front_done_;
  std::unique_ptr<std::atomic<Index>[]> open_;
  T* x_ = nullptr;
  Index nr_ = 1;
  bool transpose_ = false;
  const FrontPaths* paths_ = nullptr;     // of this run; null: all
  base::Buffer<T> on_paths_;              // n x columns; defined in the rows of fronts on the paths
  std::atomic<std::size_t> finished_{0};  // tasks of this sweep
};

}  // namespace espalier::device::host
