/// \file
/// The solver: analyze(pattern), factorize(values), solve(rhs).
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "espalier/matrix.hpp"
#include "espalier/ranks.hpp"
#include "espalier/types.hpp"

namespace espalier {

namespace solver {
struct SolverAccess;
}

/// Receives one line of log text (no newline). May be called from the thread that called the solver only.
using LogCallback = std::function<void(const std::string& line)>;

/// How several devices share one factorization. The defaults are what is fastest; the rest serves measurement.
struct Sharing {
  double additional_subtrees = 1;  ///< sub-trees per device beyond the first
  bool stealing = true;            ///< an idle device takes a sub-tree of another one
  bool shared_top = true;          ///< the top of the tree is dealt to all devices; else the first one does it
};

/// What a matrix that is singular to the rounding of its entries comes to.
enum class SingularMatrix {
  error,  ///< status singular; there is no factor
  /// Status ok, rank below n, inertia, rows, null vectors where they are few, and a factor that solves consistent
  /// systems. Structurally singular matrices are analyzed as well.
  report,
  null_vectors,  ///< a report with all null vectors, however many they are and long it takes
};

/// Which scaling a factorization of ldlt or lu takes. llt needs none.
enum class Rescale {
  off,  ///< that of the analysis
  /// One of its own values, of the analysis's sort: of a matching, or without `matching` equilibration. A matching can
  /// cost as much as the factorization of a sparse factor.
  on,
  equilibration,  ///< one of its own values, cheap and weaker; where pivots vanish, that of a matching after all
};

/// What the caller may choose. Every field has a default that suits mechanics.
struct Options {
  Kind kind = Kind::automatic;            ///< the factorization
  Precision precision = Precision::fp64;  ///< precision of the factor; automatic: see there
  std::string device = "auto";     ///< auto | cpu | host:N | host:N,M (threads per host device) | gpu:all | gpu:0,1
  Offset device_memory_bytes = 0;  ///< budget per device; 0: what is free
  /// Budgets that differ, one for each device in the order of `device`; empty: device_memory_bytes for all. With auto,
  /// as many GPUs at most.
  std::vector<Offset> device_memory_each_bytes;
  Offset host_memory_bytes = 0;  ///< budget on the host; 0: what is free
  /// How much of the host's memory that holds a factor out of core may be page-locked, which is done from the second
  /// factorization on: GPUs reach it without a detour, but it cannot be swapped out. -1: half of the machine's memory.
  Offset pinned_memory_bytes = -1;
  /// A folder for what of the factor does not fit in the host's memory; empty: there is none. Its files have no names,
  /// and are gone with the factor or the process. With a folder and no host_memory_bytes the budget is nine tenths of
  /// what the machine has free at first.
  std::string scratch;
  int threads = 0;  ///< host threads; 0: OMP_NUM_THREADS where that is set, else all cores this process may use
  /// Widest block column (= tile) of a front; 0: by front size. The kernels of a GPU know tiles of 32 and 64 columns:
  /// there a value below 64 means 32 for all fronts, any other the widths by front size.
  Index max_block_size = 0;
  double pivot_threshold = 0.01;  ///< u of threshold pivoting: entries of L stay below 1/u
  double perturbation = 0;        ///< relative size of a perturbed pivot; 0: sqrt(eps) of the factor's precision
  SingularMatrix singular = SingularMatrix::error;
  /// A bound of pivots as a number: smaller ones of the scaled matrix (entries of about 1) are zeros, all others are
  /// none, and the matrix is not judged. 0: our verdict. Optimisers that ask for the inertia of nearly singular
  /// matrices set it to 1e-20 or so.
  double zero_pivot = 0;
  /// Whether an analysis looks at values, for matching, scaling and the kind. Without it they may be anything.
  bool analyze_values = true;
  /// Whether each factorization scales its own values, in the order of the analysis: for values that wander over many
  /// decades. A GPU is then given scaled values.
  Rescale rescale = Rescale::off;
  bool matching = true;       ///< maximum product matching and scaling for ldlt and lu
  int refinement_steps = 10;  ///< most steps of iterative refinement
  /// A componentwise backward error at which refinement ends, though it could be made smaller. Where an FP64
  /// factor is out of core, the default ends at a normwise one of 1e-14, too.
  double refinement_target = 2e-16;
  double required_backward_error =
      1e-10;  ///< a normwise backward error above it ends in accuracy_not_reached; infinity
              ///< with refinement_steps = 0: residuals are not computed, errors are NaN
  /// Rates and latencies by which times are predicted and devices and plans chosen, where they differ from our tables:
  /// "key=value,key=value", for instance "gpu.flops=2e13,host.flops=3e10". `espalier info` lists the keys. Empty: the
  /// tables.
  std::string machine;
  bool record_timeline = false;  ///< keep one event per task for write_trace()
  /// Whether a factorization makes only those fronts again that new values reach; all others are kept, and the numbers
  /// are those of a whole factorization, to the last bit (FactorReport::work_share). What fronts leave for their
  /// parents then stays in memory as well, one to two times the size of the factor, and so does a copy of the values.
  /// On the host, one device or several, on ranks of hosts, and on one GPU, in core or not; else everything is made.
  bool partial_refactorization = false;
  Sharing sharing;                 ///< among several devices
  std::vector<Index> permutation;  ///< the caller's own elimination order (old index of the k-th); empty: ours
  LogCallback log;                 ///< where log lines go; empty: nowhere
  /// Whether to stop: asked now and then in the thread that calls; must not throw. Once it says yes, the call ends
  /// with status cancelled, as soon as the pieces of work in hand are done; what a GPU has begun it finishes. The
  /// solver stays usable: without an analysis if that was stopped, with it but without a factor if a factorization was;
  /// a stopped solve() leaves x undefined and the factor as it was. Clones ask, too, each for itself.
  std::function<bool()> interrupted;
  double interrupted_every = 0.02;  ///< seconds between two such questions; 0: asked at every border of work
};

/// Inertia of the factored matrix: counts of eigenvalues by sign (exact for ldlt and llt, -1 for lu).
struct Inertia {
  Index positive = -1;
  Index negative = -1;
  Index zero = -1;
};

/// One device's part in the last factorization.
struct DeviceReport {
  std::string name;            ///< for instance "host (2 threads)" or "NVIDIA H200 #0"
  double busy_seconds = 0;     ///< sum over its workers of time inside tasks, divided by the number of workers
  double idle_fraction = 0;    ///< 1 - busy / wall
  Offset peak_bytes = 0;       ///< most bytes of factor and work arrays that it held
  double waiting_seconds = 0;  ///< like busy_seconds: time inside tasks that wait for other tasks
  Index stolen_subtrees = 0;   ///< sub-trees of other devices that it did
  /// When the device's memory holds only a part of the factorization: what goes through the link to the host and back
  /// each time, the seconds that the link needs for it alone, and the peak of device memory that the plan predicted.
  Offset streamed_in_bytes = 0;
  Offset streamed_out_bytes = 0;
  double link_seconds = 0;
  Offset predicted_peak_bytes = 0;
  Offset transferred_bytes = 0;  ///< stored into and fetched from other GPUs in a factorization
  /// Where a part of the factor is on disk (Options::scratch): what the factorization has written, and read.
  Offset disk_written_bytes = 0;
  Offset disk_read_bytes = 0;
};

/// What analyze() found out.
struct AnalysisResult {
  Status status;
  Kind kind = Kind::automatic;  ///< the kind that factorize() will use
  double seconds = 0;           ///< whole call
  double matching_seconds = 0;  ///< matching and scaling
  double ordering_seconds = 0;  ///< compression, nested dissection, minimum degree
  double plan_seconds = 0;      ///< elimination tree, supernodes and plan
  Offset nonzeros_factor = 0;   ///< entries of L (of L + U for lu) in the fronts' pivot columns, without padding
  double flops = 0;  ///< floating-point operations of the factorization (multiply and add count as two, of complex
                     ///< numbers as eight)
  Index fronts = 0;  ///< number of fronts
  Index tiers = 0;   ///< height of the assembly tree
  Index largest_front = 0;     ///< rows of the largest front
  Offset predicted_bytes = 0;  ///< peak memory of factor and work arrays that factorize() will take
  /// What does not fit there goes to Options::scratch: bytes of the file, at most, what a factorization writes and
  /// reads, and what a solve reads for each way through the factor, of which it takes two, and two more for each step
  /// of refinement.
  Offset predicted_disk_bytes = 0, predicted_disk_written_bytes = 0, predicted_disk_read_bytes = 0;
  Offset predicted_way_read_bytes = 0;
  std::string device;            ///< where factorize() will work, and why, in one sentence
  double predicted_seconds = 0;  ///< time of the numeric factorization by the cost model
};

/// Where a factor lies: whoever makes values on several GPUs has each make those that are eliminated there.
struct GpuPlaces {
  std::vector<int> gpus;  ///< as the CUDA runtime counts, Solver::gpu() first; empty: none, or no factor was made yet
  /// n; the place in `gpus`, from 0, of the one that eliminates an unknown (a column); of those that several eliminate
  /// together, one. Empty: all are eliminated on the first.
  std::vector<Index> of_unknown;
};

/// What analyze_change() did.
struct ChangeResult {
  AnalysisResult analysis;   ///< that of the new pattern
  bool full = false;         ///< all of it was ordered anew
  std::string why;           ///< if so: the reason, in one sentence
  Offset added_entries = 0;  ///< of the pattern as it is stored, duplicates once; 0 where they were not counted
  Offset removed_entries = 0;
  Index moved_unknowns = 0;  ///< that went up into separators, since new entries cross these
  Index kept_fronts = 0;     ///< with the same pivots and rows as before
  /// An order that was made beside the work since an earlier change has taken the place of the one before.
  bool reordered = false;
  Offset entries_of_order = 0;  ///< of the factor, by the last order: what the promise counts from
};

/// What every factorize() and refactorize() tells, whatever the numbers.
struct FactorReport {
  Status status;
  double seconds = 0;           ///< whole call
  double flops_per_second = 0;  ///< flops of the analysis over seconds
  double work_share = 1;        ///< operations done, over those for all fronts (Options::partial_refactorization)
  std::string whole_reason;     ///< with that option: why all fronts were made, where none could be kept; else empty
  Inertia inertia;
  Index two_by_two = 0;        ///< 2x2 pivots taken
  Index perturbed = 0;         ///< pivots that were too small and were replaced, or stand for a zero
  Index delayed = 0;           ///< columns whose elimination was moved to a later front by re-analysis
  double determinant_log = 0;  ///< natural logarithm of |det A|; NaN if more pivots were replaced than A has zeros
  Index rank = -1;             ///< n less the singular values that are zero to the rounding of the entries
  /// The dependent rows of a singular matrix: n - rank rows (from 0, ascending) that depend on others. lu: as many
  /// columns, likewise; empty for a symmetric matrix, where they are the same.
  std::vector<Index> dependent_rows;
  std::vector<Index> dependent_columns;
  Precision precision = Precision::fp64;  ///< of this factor; never automatic
  Offset peak_host_bytes = 0;             ///< most bytes that this solver held on the host
  /// Where it was done, and why, in one sentence: other than the analysis said where devices could not be used.
  std::string device;
  std::vector<DeviceReport> devices;
};

/// What Solver::factorize() or refactorize() did.
struct FactorResult : FactorReport {
  double determinant_sign = 0;  ///< -1, 0 or 1
  /// The null space of a singular matrix: n - rank vectors v with A v = 0 to rounding, n values each, one after
  /// another, the largest 1 in magnitude. Fewer, or none, where they would take far longer than the factorization and
  /// were not asked for (more than eight, and n (n - rank)^2 above 4e6 and a sixteenth of its operations), or a factor
  /// gives no finite numbers.
  std::vector<double> null_vectors;
  /// lu: vectors w with A^T w = 0, likewise. Empty for a symmetric matrix, where they are the same.
  std::vector<double> left_null_vectors;
};

/// What solve() did.
struct SolveResult {
  Status status;
  double seconds = 0;              ///< whole call, refinement included
  double solve_seconds = 0;        ///< the first forward and backward substitution alone
  int refinement_steps = 0;        ///< steps of refinement (or of FGMRES / CG) taken
  double backward_error = 0;       ///< normwise: max over rhs of |b - A x|_inf / (|A|_inf |x|_inf + |b|_inf)
  double componentwise_error = 0;  ///< componentwise (Oettli-Prager): max |b - A x|_i / (|A| |x| + |b|)_i
};

/// What condition_estimate() found.
struct ConditionResult {
  Status status;
  double estimate = 0;  ///< 1-norm condition number, a lower bound that is rarely off by a factor of 3; exact to n = 64
};

/// The direct solver. One object serves one pattern at a time; objects are independent of each other, clones too, and
/// may be used in different threads at the same time. Not safe for concurrent calls on one object. One that was moved
/// from can be assigned to or destroyed, nothing else.
class Solver {
 public:
  enum class State { empty, analyzed, factorized };

  /// @throws std::invalid_argument for numbers and enumerations that no option can be
  explicit Solver(Options options = {});
  /// A solver that all ranks share (`Solver solver(espalier::on(MPI_COMM_WORLD), options)`): each holds a part of the
  /// factor. All ranks give the same options, except for threads, budgets, log and interruption, and make the same
  /// calls; every call that returns a result or a status is collective and ends on all ranks with the same status. The
  /// numbers are those of one process, to the last bit.
  ///
  /// analyze(MatrixView), factorize(MatrixView) and load_analysis() then take the matrix of rank 0 and look at no
  /// other; of values, right-hand sides and solutions each rank gives and gets its part (analyze(LocalRows)).
  ///
  /// A rank that dies, or sends nothing for Ranks' patience, ends the call of all others with device_error, which names
  /// it; the solver cannot be used any more then. What fails on one rank alone (memory, a wrong part of the input)
  /// fails on all, and the solver stays usable.
  Solver(const Ranks& ranks, Options options = {});
  ~Solver();
  Solver(Solver&&) noexcept;
  Solver& operator=(Solver&&) noexcept;

  /// Orders the matrix and lays out the plan. `a` must be square. Values are used (where present) for matching and
  /// scaling and for the choice of kind. A copy of pattern and values is kept.
  AnalysisResult analyze(const MatrixView& a);
  /// Analyzes a pattern that differs from the analyzed one here and there: contacts come and go, elements are added.
  /// Kept are the order, but for unknowns that new entries couple across a separator (they go into it), scaling and
  /// matching, kind and devices; only fronts that the change touches are made anew. It takes a small part of
  /// analyze(). The factor is as accurate; it has at most 1.05 times the entries and its work is at most 1.15 times
  /// that of the last order.
  /// Where the pattern drifts away from the one that was ordered (the factor grows, or many entries have come and
  /// gone), an order for it is made beside the work, on threads of its own, and taken some changes later if it is
  /// better. When is counted in changes and entries: the numbers do not depend on the time that it takes. Ranks order
  /// nothing beside.
  /// Does all of analyze() instead, and says why, where that promise would not hold, where more than a tenth of the
  /// entries have come or gone, or the number of unknowns, the storage or a matched entry; likewise with the caller's
  /// permutation. The solver is analyzed then, not factorized, as after analyze(). Errors (see `analysis.status`) are
  /// those of analyze(); rows of which no entry is left are named (singular). The analysis and its factor are then as
  /// before; on ranks the solver is empty. @pre state() != empty
  ChangeResult analyze_change(const MatrixView& a);
  /// The same of a matrix of which each rank has rows, or entries: `refactorize` takes values in their order. Vectors
  /// of right-hand sides and solutions have the rows that the rank's part has; of entries, rank 0 has all rows. Without
  /// ranks there is one part.
  AnalysisResult analyze(const LocalRows& part);
  AnalysisResult analyze(const LocalEntries& part);
  /// From the next solve on, this rank gives and gets these rows of vectors, whatever its part of the matrix: columns
  /// of `rows.count` values. Ranges may overlap: right-hand sides are summed where several ranks have a row. Every row
  /// must be somebody's. Not collective; holds until the next analysis.
  /// @pre state() != empty. @throws std::invalid_argument for rows that the matrix does not have
  void set_rows(RowRange rows);
  /// The rows of vectors on this rank. @pre state() != empty
  [[nodiscard]] RowRange rows() const;
  /// Factorizes `a`, whose pattern must be the analyzed one (checked). @pre state() != empty
  FactorResult factorize(const MatrixView& a);
  /// Same pattern, new values in the order of the analyzed matrix; allocates nothing. @pre state() != empty
  FactorResult refactorize(std::span<const double> values);
  /// refactorize() with the values of the last factorization but for some: values[k] stands at places[k] of the
  /// analyzed matrix's value array. Of a symmetric matrix that is stored in both triangles, both places are needed.
  /// Places that the matrix does not have, and values that are not finite, end in invalid_input; so do places with
  /// duplicates, of whose sum one part alone is not known. The factor is as it was then. Where the matrix becomes
  /// singular (or not positive definite, with Kind::llt), the result says so, and the factor is made again of the
  /// values before. With Options::partial_refactorization only fronts that these values reach are made again. Not for
  /// ranks or parts.
  /// @param places  from 0, any order; the last of equal ones counts
  /// @pre state() == factorized
  FactorResult refactorize_entries(std::span<const Offset> places, std::span<const double> values);
  /// Solves for `columns` right-hand sides stored column by column, n values each (with ranks: rows().count values);
  /// x may alias b.
  /// @pre state() == factorized
  SolveResult solve(std::span<const double> b, std::span<double> x, Index columns = 1,
                    Transpose transpose = Transpose::no);

  /// The same with arrays in the memory of the (first) GPU that holds the factor, in core: no value goes through the
  /// host unless pivots fail, and refinement happens there too. `count` values, as many as for refactorize(); columns
  /// as for solve(). The calls wait for what is enqueued on `stream` (a cudaStream_t; null: the default stream) and
  /// return when the GPU is done. Without a factor on a GPU the status is device_error. Krylov methods (mixed
  /// precision) are left out.
  /// With ranks on GPUs: this rank's values and rows of vectors, in the memory of its GPU; those of a rank that has
  /// none may be null. Values that are all rank 0's go from GPU to GPU, others and vectors by way of the hosts.
  /// @pre state() != empty; state() == factorized
  /// @throws std::invalid_argument for arrays in pageable host memory
  FactorResult refactorize_device(const double* values, Offset count, void* stream = nullptr);
  SolveResult solve_device(const double* b, double* x, Index columns = 1, Transpose transpose = Transpose::no,
                           void* stream = nullptr);
  /// The GPU (as the CUDA runtime counts) whose arrays these two take; -1: none, or no factor was made yet.
  [[nodiscard]] int gpu() const;
  /// All GPUs of this process that hold a part of the factor, and which parts.
  [[nodiscard]] GpuPlaces gpu_places() const;

  /// Sets options().refinement_steps and required_backward_error for the solves to come.
  /// @throws std::invalid_argument for values that they cannot have
  void set_refinement(int steps, double required_backward_error);

  /// Another solver for the same pattern, with the same options, which shares this one's analysis and has a factor of
  /// its own: for batches of systems, for load cases, for threads. Nothing is ordered again; what the clone takes at
  /// once is memory for its values. It is analyzed (or empty, as this one), not factorized. What either does later,
  /// even another analysis, does not touch the other. Several threads may clone one solver at the same time, as long as
  /// nobody calls anything else on it.
  /// @param threads  host threads of the clone, which are its own; 0: as many as this solver has. Where many clones
  ///                 work at the same time, 1 serves best
  /// @throws std::invalid_argument for fewer than 0 or more than 4096 threads; std::bad_alloc
  [[nodiscard]] Solver clone(int threads = 0) const;

  [[nodiscard]] State state() const;
  /// Whether `a` has the pattern that was analyzed, entry by entry. @pre state() != empty
  [[nodiscard]] bool has_pattern(const MatrixView& a) const;
  /// The values of the last factorization in the order of refactorize(); of an entry that is stored twice the sum
  /// stands at the first place, and zero at the other. @pre state() == factorized
  [[nodiscard]] std::vector<double> values() const;
  /// As they were given to the constructor: what the solver chose itself stands in the results.
  [[nodiscard]] const Options& options() const;
  [[nodiscard]] const AnalysisResult& analysis() const;
  /// 1-norm condition estimate of the factored matrix (Hager-Higham); costs a few solves. @pre state() == factorized
  [[nodiscard]] ConditionResult condition_estimate();
  /// The tree as figures per tier, for people: one row per tier from the root.
  struct TierRow {
    Index tier = 0, fronts = 0, largest_front = 0;
    double flops = 0;
    Offset factor_entries = 0;
  };
  [[nodiscard]] std::vector<TierRow> tiers() const;

  /// Saves the analysis of the current pattern; load_analysis() of the same pattern then needs no ordering.
  Status save_analysis(const std::string& path) const;
  AnalysisResult load_analysis(const std::string& path, const MatrixView& a);
  /// The same of a matrix in parts, in place of analyze(). Rank 0 writes a file, which all ranks read.
  AnalysisResult load_analysis(const std::string& path, const LocalRows& part);
  AnalysisResult load_analysis(const std::string& path, const LocalEntries& part);
  /// Writes the recorded tasks as a Chrome trace that Perfetto opens (options.record_timeline must be set).
  Status write_trace(const std::string& path) const;

 private:
  struct Impl;
  friend struct solver::SolverAccess;
  explicit Solver(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace espalier
