#include "solver/options/option_check.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "plan/machine_model.hpp"

namespace espalier::solver {

namespace {

/// NaN is in no range.
template <class T>
void require(const char* field, T value, T least, T most, const char* range) {
  if (!(value >= least && value <= most))
    throw std::invalid_argument(fmt::format("Options::{} is {}; it must be {}", field, value, range));
}

void require_bytes(const char* field, Offset value) {
  if (value < 0) throw std::invalid_argument(fmt::format("Options::{} is {}; bytes are counted from 0", field, value));
}

void check_machine(const std::string& text) {
  try {
    (void)plan::machine_with(text);
  } catch (const Error& e) {
    throw std::invalid_argument(std::string("Options::") + e.what());
  }
}

}  // namespace

void check_options(const Options& o) {
  require("kind", static_cast<int>(o.kind), 0, static_cast<int>(Kind::lu), "one of the enumeration");
  require("precision", static_cast<int>(o.precision), 0, static_cast<int>(Precision::automatic),
          "one of the enumeration");
  require("threads", o.threads, 0, kMostThreads, "0 (all cores) to 4096");
  require<double>("max_block_size", o.max_block_size, 0, INFINITY, "0 (our choice) or greater");
  require("pivot_threshold", o.pivot_threshold, 0.0, 1.0, "from 0 to 1");
  require("perturbation", o.perturbation, 0.0, 1.0, "from 0 (our choice) to 1");
  require("singular", static_cast<int>(o.singular), 0, static_cast<int>(SingularMatrix::null_vectors),
          "one of the enumeration");
  require("rescale", static_cast<int>(o.rescale), 0, static_cast<int>(Rescale::equilibration),
          "one of the enumeration");
  require("zero_pivot", o.zero_pivot, 0.0, 1.0, "from 0 (our verdict) to 1");
  require<double>("refinement_steps", o.refinement_steps, 0, INFINITY, "0 or greater");
  require("refinement_target", o.refinement_target, 0.0, 1.0, "from 0 to 1");
  require<double>("required_backward_error", o.required_backward_error, 0, INFINITY, "0 or greater");
  require("interrupted_every", o.interrupted_every, 0.0, 3600.0, "from 0 to 3600 seconds");
  require("sharing.additional_subtrees", o.sharing.additional_subtrees, 0.0, 1e6, "from 0 to 1e6");
  require_bytes("device_memory_bytes", o.device_memory_bytes);
  for (const Offset bytes : o.device_memory_each_bytes) require_bytes("device_memory_each_bytes", bytes);
  require_bytes("host_memory_bytes", o.host_memory_bytes);
  check_machine(o.machine);
  if (o.pinned_memory_bytes != -1) require_bytes("pinned_memory_bytes", o.pinned_memory_bytes);
}

}  // namespace espalier::solver
