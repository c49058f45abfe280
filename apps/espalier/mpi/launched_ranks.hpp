/// \file
/// The ranks on which mpirun has started this program.
#pragma once

#include <functional>
#include <string>

#include "espalier/nodes.hpp"
#include "espalier/ranks.hpp"

namespace CLI {
class App;
}

namespace espalier::cli {

/// What a command that works on several ranks is told of them.
struct RankOptions {
  double patience = Ranks::kPatience;
  Nodes nodes = Nodes::host;

  /// Options --patience and --nodes. This object outlives `app`.
  void add_to(CLI::App& app);
};

/// Ranks of the launcher, through an adapter (espalier_mpi_NAME.so) that is loaded: the binary itself knows no MPI. One
/// rank, and nothing loaded, where no launcher has started several.
class LaunchedRanks {
 public:
  /// @throws Error(invalid_input) where there are several ranks but no adapter for their MPI; Error(device_error)
  explicit LaunchedRanks(const RankOptions& options);
  /// Ends MPI, unless a rank was lost.
  ~LaunchedRanks();
  LaunchedRanks(const LaunchedRanks&) = delete;
  LaunchedRanks& operator=(const LaunchedRanks&) = delete;

  [[nodiscard]] const Ranks& ranks() const { return ranks_; }
  [[nodiscard]] bool first() const { return ranks_.rank() == 0; }
  /// How `body`, which may fail here alone, has ended: the same on all ranks.
  Status on_all(const std::function<Status()>& body) const;
  /// The number that rank 0 has. Inside of on_all() alone.
  [[nodiscard]] Offset from_first(Offset number) const;
  /// A rank was lost: MPI cannot be ended.
  void leave_open() { end_ = nullptr; }

 private:
  void load(const RankOptions& options);

  void (*end_)() = nullptr;
  Ranks ranks_;
};

/// For commands that work in one process. @throws Error(invalid_input) where a launcher has started several
void expect_one_process(const char* command);

/// Where `espalier mpi-adapter` puts what it makes: $XDG_CACHE_HOME/espalier or ~/.cache/espalier.
std::string adapter_folder();

}  // namespace espalier::cli
