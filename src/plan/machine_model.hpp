/// \file
/// The machine model: what one device of a kind does per second and what it waits for. Whatever predicts a time reads
/// it: which device is chosen, how a tree is cut and dealt, how a factor goes through a small memory, the simulator of
/// GPUs. No constant of speed stands anywhere else.
///
/// `espalier info` prints it; Options::machine overrides it. The numbers choose plans and devices, they never change
/// what a given plan computes.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::plan {

/// One number of the model and who says so.
struct Rate {
  enum class Source : char {
    table,     ///< stands in the source code, with the measurement that it fits
    measured,  ///< on this machine, when the program started
    caller     ///< Options::machine
  };
  double value = 0;
  Source source = Source::table;

  constexpr Rate() = default;
  constexpr Rate(double v, Source s = Source::table) : value(v), source(s) {}
  constexpr operator double() const { return value; }
};

/// A number that depends on the kind of factorization.
struct RateByKind {
  Rate llt, ldlt, lu;
  [[nodiscard]] constexpr double of(Kind kind) const {
    return kind == Kind::llt ? llt : kind == Kind::ldlt ? ldlt : lu;
  }
};

/// Through a memory that holds only a part of the factorization (out_of_core/).
struct OutOfCoreRates {
  Rate bytes_in, bytes_out;  ///< bytes per second of the link, by direction
  Rate host_bytes;           ///< bytes per second through the host's memory, of all devices and both directions
  Rate pinned;               ///< so many times as many where the host's store is page-locked
  Rate flops;                ///< per second, of steps and groups
  Rate start, copy_start;    ///< seconds of an operation besides what it computes; of a copy besides what it moves
  RateByKind pivot;          ///< seconds of a pivot, which waits for the one before it
  /// A front above the sub-trees that takes one device longer than so many seconds is shared. Two hand-overs through
  /// the host take about as long.
  Rate share;
};

/// What one block of threads needs for a task of the CUDA kernels, in seconds: `fixed`, and `chunk` for every 16
/// columns of products. When the last operand comes late, the task ends `tail` after it.
struct TaskRates {
  RateByKind fixed, chunk, tail;
};

/// The tasks of the CUDA kernels one by one, for virtual time.
struct KernelRates {
  TaskRates block32, block64;  ///< row blocks of tile columns of 32 and 64
  TaskRates diagonal32, diagonal64;
  RateByKind whole;    ///< seconds of a whole small front
  Rate half_block;     ///< part of `chunk` that a row block of at most 64 rows takes
  Rate kernel;         ///< seconds until a kernel has started
  Rate hop;            ///< seconds from the end of a task to when another GPU's block has what it made
  Rate narrow_blocks;  ///< blocks of the narrow kernel on a multiprocessor at a time
};

/// One device: a host thread, or a GPU. Seconds where nothing else is said.
struct MachineModel {
  std::string name;  ///< what the table was measured on
  /// A front takes front + flops_of(front) / flops * (1 + half_rows / rows).
  Rate flops;        ///< per second, in large fronts, FP64
  Rate single;       ///< so many times as many in FP32
  Rate half_rows;    ///< rows of a front that runs at half of that
  Rate front;        ///< of every front, among many
  Rate dealt_front;  ///< likewise, when a tree is cut and dealt to devices
  Rate thread_rows;  ///< host: rows of a front for every thread that works on it; a smaller one occupies one thread
  RateByKind pivot;  ///< of a pivot on the longest chain from a leaf to the root
  Rate start;        ///< of a factorization: values to the device, outcome back
  Rate launch;       ///< of every device, by one host thread
  Rate imbalance;    ///< part of the shared work by which every further device prolongs it
  Rate hand_over;    ///< through a shared front, for every doubling of the devices
  Rate multiprocessors;
  Rate blocks;  ///< tasks in work on each of them at a time
  OutOfCoreRates out_of_core;
  KernelRates kernels;  ///< zero where the device has none

  /// Tasks that a device works on at a time.
  [[nodiscard]] Index tasks_at_once() const { return static_cast<Index>(multiprocessors * blocks); }
};

/// The tables: one AVX-512 core, and one H200.
MachineModel host_thread();
MachineModel h200();

/// A number of a model with its name, for printing and overriding.
struct NamedRate {
  std::string key;           ///< "flops", "out_of_core.bytes_in", "pivot.lu"
  const char* unit = "";     ///< "1/s", "B/s", "s", "number" or "factor"
  const char* meaning = "";  ///< half a sentence
  Rate* rate = nullptr;      ///< in the model
};
std::vector<NamedRate> rates_of(MachineModel& model);

/// The models that the solver chooses between, by the names that keys begin with: "host.flops", "gpu.pivot.ldlt".
struct Machine {
  MachineModel host = host_thread();
  MachineModel gpu = h200();
};

/// The tables, changed by a text such as "host.flops=3e10,gpu.out_of_core.bytes_in=2.5e10". Empty: the tables.
/// @throws Error(invalid_input) for a key that is not there (names those that are) or a value that is no number above
///         zero (latencies: zero or above)
Machine machine_with(std::string_view text);

/// "table", "measured", "caller".
std::string_view name_of(Rate::Source source);

}  // namespace espalier::plan
