/// \file
/// The backend seam: one kind of device, and all that the layers above may ask about it. A backend is a folder
/// src/device/<name> with one line of CMake (cmake/EspalierBackend.cmake), which puts it into the registry; nobody
/// above asks which one it is.
#pragma once

#include <complex>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "analysis/assembly_tree.hpp"
#include "analysis/relocation.hpp"
#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "base/timeline.hpp"
#include "device/device_rates.hpp"
#include "device/executor.hpp"
#include "device/tall_space.hpp"
#include "espalier/solver.hpp"
#include "plan/front_cost.hpp"
#include "plan/machine_model.hpp"
#include "plan/plan.hpp"

namespace espalier::out_of_core {
class Factory;
}

namespace espalier::ranks {
class Communicator;
}

namespace espalier::device {

/// The devices of a backend that this process can use; when there are none, why.
struct FoundDevices {
  std::vector<std::string> names;
  std::string reason;
};

/// What no plan for a backend may pass, and what follows from where its devices live.
struct Limits {
  int most_devices = 1;       ///< that share one plan
  Index widest_tile = 0;      ///< that its kernels know; 0: any. A narrow one leaves pivots few partners to choose from
  bool keeps_border = false;  ///< in core, its executors leave contributions to a border of the plan
  /// The devices have memory of their own, so that a factorization may be too large without any budget. Else they live
  /// in the host's, and only a budget makes them small.
  bool own_memory = false;
  bool ranks = false;             ///< executors can share a plan with those of other processes (Job::link)
  bool complex = false;           ///< it has executors of complex numbers
  bool parts_with_zeros = false;  ///< they know PivotRule::in_place_of_zero
};

/// What the caller of a plan wants; the backend adds the layout of fronts and tiles that its kernels need.
struct PlanWish {
  Kind kind = Kind::llt;
  Precision precision = Precision::fp64;
  bool complex = false;
  Index max_block_size = 0;        ///< Options::max_block_size
  int devices = 1;                 ///< that share the plan, in this process
  int ranks = 1;                   ///< processes that share it
  int rank = 0;                    ///< this one
  bool unequal = false;            ///< they are not all of one kind, or not equally fast
  std::vector<double> speed = {};  ///< of the devices, relative to the fastest; empty: all are equal
  Sharing sharing = {};
  bool keep_contributions = false;  ///< Options::partial_refactorization
  int threads = 1;                  ///< of the host
  plan::Machine machine = {};       ///< rates by which times are predicted and fronts dealt
};

/// Predicted seconds of a factorization.
struct PredictedTime {
  double fixed = 0;         ///< whatever the number of devices
  bool shared = false;      ///< `time` counts
  plan::GpuTime time = {};  ///< what devices share

  [[nodiscard]] double on(int devices) const { return fixed + (shared ? time.on(devices) : 0); }
};

/// What an executor is made for. All references outlive it.
struct Job {
  const plan::Plan& plan;  ///< made with the backend's plan_options()
  Kind kind = Kind::llt;
  bool hermitian = false;  ///< complex: llt and ldlt are those of a Hermitian matrix, else ldlt of a symmetric one
  PivotRule rule = {};
  base::ThreadPool& pool;
  base::MemoryBudget* budget = nullptr;   ///< counts memory of the host; null: nobody counts
  base::Timeline* timeline = nullptr;     ///< gets every task; null: nothing is recorded
  std::vector<int> devices = {0};         ///< numbers of the devices, as many as the plan is for
  std::vector<Offset> memory_bytes = {};  ///< by device; its budget, 0: what is free. Empty: all are 0
  /// Ranks that share the plan (PlanOptions::ranks); null: this process alone. All of them make the executor.
  ranks::Communicator* link = nullptr;
  /// The sign of a pair: of a real form of a complex system (solver/analysis/real_form.hpp): 1, of a Hermitian one -1;
  /// else 0. For backends that can make one column of a number's two from the other.
  int pair_sign = 0;
};

/// Values whose pivots are to find their fronts. All references outlive the call. Value: double or complex<double>.
template <class Value>
struct PlacementJobOf {
  const plan::Plan& plan;  ///< of any backend
  Kind kind = Kind::ldlt;  ///< or lu
  bool hermitian = false;
  PivotRule rule = {};
  std::span<const Value> values;  ///< scaled, in the order of the plan's entries
  base::ThreadPool& pool;
  base::MemoryBudget* budget = nullptr;
  /// Positions of failed pivots, ascending. Not empty: only the sub-trees below them are eliminated, and fronts above
  /// as long as pivots arrive there; what fails above that has yet to show. Empty: the whole tree.
  std::span<const Index> failed = {};
  /// With `failed`: contributions that need not be made again, by fronts of the plan; null: there are none.
  const LeftContributions<Value>* left = nullptr;
};
using PlacementJob = PlacementJobOf<double>;
using ComplexPlacementJob = PlacementJobOf<std::complex<double>>;

/// Scalars of executors; a value of this type picks the overload.
template <class T>
using Scalar = std::type_identity<T>;

/// A kind of device. Objects have no state that changes; all calls are safe from any thread.
class Backend {
 public:
  virtual ~Backend() = default;
  /// As Options::device begins with it: "host", "gpu", "reference".
  [[nodiscard]] virtual std::string_view name() const = 0;
  /// One of its devices in a sentence: "GPU".
  [[nodiscard]] virtual std::string_view noun() const = 0;
  [[nodiscard]] virtual FoundDevices find() const = 0;
  [[nodiscard]] virtual Limits limits() const = 0;

  /// Its part of a machine.
  [[nodiscard]] virtual const plan::MachineModel& model(const plan::Machine& machine) const = 0;
  /// By that model; infinity: the backend is not taken unless it was asked for.
  [[nodiscard]] virtual PredictedTime predict(const analysis::AssemblyTree& tree, const PlanWish& wish) const = 0;
  /// How a plan for this backend is to be made; its executors accept no other.
  [[nodiscard]] virtual plan::PlanOptions plan_options(const PlanWish& wish) const = 0;

  /// Most bytes of factor and work arrays that an executor of this plan takes in core, on all devices together.
  /// @param threads  of the host
  [[nodiscard]] virtual Offset executor_bytes(const plan::Plan& plan, Kind kind, Precision precision,
                                              int threads) const = 0;
  /// The same of complex numbers: only where limits().complex says so.
  [[nodiscard]] virtual Offset complex_executor_bytes(const plan::Plan& /*plan*/, Kind /*kind*/,
                                                      Precision /*precision*/, int /*threads*/) const {
    refuse_complex();
  }

  /// Starts the devices, which may take a second, while the caller does something else. What fails here fails again,
  /// with its name, where an executor needs it.
  virtual void open(const std::vector<int>& /*devices*/) const noexcept {}
  /// How fast a device is, so that unequal ones get unequal parts. Asked only where several share a plan.
  [[nodiscard]] virtual DeviceRates measure(int /*device*/) const { return {1, 1, {}}; }
  /// Tall blocks of so many rows in the memory of a device. @param memory_bytes  budget for them; 0: what is free
  /// @returns null where the backend has none
  [[nodiscard]] virtual std::unique_ptr<TallSpace> make_tall_space(Index /*rows*/, int /*device*/,
                                                                   Offset /*memory_bytes*/) const {
    return nullptr;
  }
  /// Bytes of its own memory that are free. Asked only where Limits::own_memory.
  [[nodiscard]] virtual Offset free_bytes(int /*device*/) const { return 0; }

  /// In core. @throws Error(out_of_memory) naming the bytes needed; Error(device_error) with the failing call
  [[nodiscard]] virtual std::unique_ptr<Executor<double>> make_executor(const Job& job, Scalar<double>) const = 0;
  [[nodiscard]] virtual std::unique_ptr<Executor<float>> make_executor(const Job& job, Scalar<float>) const = 0;
  /// The same of complex numbers: only where limits().complex says so. @throws Error(device_error) elsewhere
  [[nodiscard]] virtual std::unique_ptr<Executor<std::complex<double>>> make_executor(
      const Job& /*job*/, Scalar<std::complex<double>>) const {
    refuse_complex();
  }
  [[nodiscard]] virtual std::unique_ptr<Executor<std::complex<float>>> make_executor(
      const Job& /*job*/, Scalar<std::complex<float>>) const {
    refuse_complex();
  }
  /// Where pivots that are not stable in the fronts of the plan have to go, found in one elimination with delayed
  /// pivots. An empty list: none has to move, or this backend does not know; the host does. No list: the search is
  /// given up, since it takes too much work.
  /// @throws Error(out_of_memory)
  [[nodiscard]] virtual std::optional<std::vector<analysis::PivotMove>> place_pivots(
      const PlacementJob& /*job*/) const {
    return std::vector<analysis::PivotMove>{};
  }
  [[nodiscard]] virtual std::optional<std::vector<analysis::PivotMove>> place_pivots(
      const ComplexPlacementJob& /*job*/) const {
    return std::vector<analysis::PivotMove>{};
  }

  /// Where a device's memory holds only a part of the factorization (out_of_core/factory.hpp); null: it must hold all.
  [[nodiscard]] virtual const out_of_core::Factory* out_of_core() const { return nullptr; }

 protected:
  [[noreturn]] void refuse_complex() const {
    throw Error(StatusCode::device_error, std::string(noun()) + ": no complex numbers there; use device cpu");
  }
};

}  // namespace espalier::device
