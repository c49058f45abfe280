/// \file
/// Forward and backward substitution on the host with the factors that a GPU has left in the host's store (tables.hpp
/// says how they lie there) after a factorization out of core. Needs no CUDA.
#pragma once

#include <vector>

#include "base/thread_pool.hpp"
#include "device/cuda/tables/tables.hpp"
#include "device/executor.hpp"
#include "out_of_core/front_reader.hpp"
#include "plan/plan.hpp"

namespace espalier::device::cuda {

/// Where the factors are; all outlive the solve.
template <class T>
struct HostFactors {
  const T* store = nullptr;
  const std::vector<Offset>* first = nullptr;   ///< fronts; place of the factor array in the store
  const std::vector<Offset>* second = nullptr;  ///< likewise of U^T (lu)
  const std::vector<T>* inverse_d = nullptr;    ///< n (ldlt)
  const std::vector<T>* inverse_e = nullptr;
};

/// What does other fronts meanwhile: with each front all above it, or whole sub-trees below these.
template <class T>
class Companion {
 public:
  virtual ~Companion() = default;
  /// Before the host's way up, and not to wait for. x: n rows of `columns` values: right-hand sides
  virtual void start(const T* x, Index columns, bool transpose) = 0;
  /// Between the host's ways: gets what its fronts leave for those above them (as many rows as all fronts have below),
  /// and writes to x what they need on the way down.
  virtual void turn(T* x, const T* updates, Index columns) = 0;
  /// After the host's way down: writes the rest of its part of x.
  virtual void finish(T* x, Index columns) = 0;
  /// Right-hand sides that it takes at a time.
  [[nodiscard]] virtual Index most_columns() const = 0;
};

/// Substitution, tier by tier: the fronts of a tier side by side, large ones by all threads together. The result does
/// not depend on the number of threads.
template <class T>
class StoreSolve {
 public:
  StoreSolve(const plan::Plan& plan, const std::vector<Front>& fronts, Kind kind, base::ThreadPool& pool);
  /// From now on another does some of the fronts; null: nobody. @param part  these fronts
  void share(const std::vector<Index>& part, Companion<T>* companion);
  /// From now on the store is not all in memory: fronts that stand near one another are taken together, to the same
  /// sums. The reader outlives this object.
  void set_reader(out_of_core::FrontReader* reader);
  /// Solves in place: n rows of `columns` values in elimination order.
  void run(const HostFactors<T>& factors, T* x, Index columns, bool transpose);
  /// Through the fronts on its paths alone, but for those of a companion: the factor of others is not read.
  void run(const HostFactors<T>& factors, const PathSolve<T>& solve);

 private:
  static constexpr Index kMost = 8;  // right-hand sides at one time
  struct Bench {
    std::vector<T> v, y;
  };
  void list_fronts(const std::vector<char>& elsewhere);
  [[nodiscard]] std::vector<std::size_t> levels_of(const std::vector<char>& elsewhere) const;
  void begin_way(bool up);
  void way(bool up, Index columns);
  void take(Index f, bool up, Index columns, Bench& bench, bool all_threads);
  void pass(const HostFactors<T>& factors, T* x, Index columns);
  void choose_way(bool transpose);
  void clear_updates(const FrontPaths& paths, Index columns);
  [[nodiscard]] bool passes(Index f, bool up) const {
    return paths_ == nullptr || (up ? paths_->up : paths_->down)[static_cast<std::size_t>(f)] != 0;
  }
  [[nodiscard]] Index most_columns() const {
    return companion_ != nullptr ? std::min(kMost, companion_->most_columns()) : kMost;
  }
  void forward(Index f, Index columns, Bench& bench, bool all_threads);
  void backward(Index f, Index columns, Bench& bench, bool all_threads);
  template <class Use>
  void over_panels(Index rows, bool all_threads, Use&& use);

  const plan::Plan& plan_;
  const std::vector<Front>& fronts_;
  Kind kind_;
  base::ThreadPool& pool_;
  std::vector<std::vector<Index>> small_, large_;  // by level: from the leaves to the roots
  std::vector<T> updates_;                         // rows below of all fronts
  std::vector<Bench> benches_;
  HostFactors<T> factors_;
  T* x_ = nullptr;
  Companion<T>* companion_ = nullptr;
  out_of_core::FrontReader* reader_ = nullptr;  // null: all of the store is in memory
  std::vector<char> elsewhere_;                 // fronts
  const FrontPaths* paths_ = nullptr;           // of this run; null: all
  std::vector<T> on_paths_;                     // n x columns of a pass
  bool up_second_ = false, down_second_ = false, transpose_ = false;
};

}  // namespace espalier::device::cuda
