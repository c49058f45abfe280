#include "mpi/launched_ranks.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "common/checked_options.hpp"
#include "ranks/communicator.hpp"
#include "solver/ranks/on_all_ranks.hpp"

namespace espalier::cli {

namespace {

namespace fs = std::filesystem;

int number_in(const char* name) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::atoi(text) : -1;
}

// What launchers tell the programs that they start: Open MPI; MPICH, Intel MPI, Cray and others by PMI; Slurm.
int launched_ranks() {
  int ranks = 1;
  for (const char* name :
       {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS", "PALS_NRANKS", "SLURM_STEP_NUM_TASKS"})
    ranks = std::max(ranks, number_in(name));
  return ranks;
}

// The adapters of the launcher's own MPI first.
std::vector<std::string> adapters() {
  if (const char* given = std::getenv("ESPALIER_MPI_ADAPTER")) return {given};
  std::error_code error;
  const fs::path binary = fs::read_symlink("/proc/self/exe", error).parent_path();
  std::vector<std::string> list;
  for (const fs::path& folder : {fs::path(adapter_folder()), binary, binary.parent_path() / "lib" / "espalier"})
    for (const auto& entry : fs::directory_iterator(folder, error)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with("espalier_mpi_") && name.ends_with(".so")) list.push_back(entry.path().string());
    }
  const bool open_mpi = number_in("OMPI_COMM_WORLD_SIZE") > 0;
  std::stable_partition(list.begin(), list.end(), [&](const std::string& path) {
    return (path.find("openmpi") != std::string::npos) == open_mpi;
  });
  return list;
}

template <class Function>
Function symbol(void* library, const char* name) {
  return reinterpret_cast<Function>(::dlsym(library, name));
}

}  // namespace

void RankOptions::add_to(CLI::App& app) {
  app.add_option("--patience", patience, "under mpirun: seconds after which a rank that is silent is lost")
      ->type_name("S")
      ->check(positive());
  app.add_option_function<std::string>(
         "--nodes", [this](const std::string& text) { nodes = text == "process" ? Nodes::process : Nodes::host; },
         "under mpirun, on GPUs: ranks of a host reach each other's GPUs ('host', the default), or each rank is a "
         "machine of its own")
      ->type_name("WHAT")
      ->check(CLI::IsMember({"host", "process"}));
}

void expect_one_process(const char* command) {
  if (const int ranks = launched_ranks(); ranks > 1)
    throw Error(StatusCode::invalid_input,
                fmt::format("'{}' works in one process, and this is one of {} ranks: start it without mpirun (srun); "
                            "'solve' and 'simulate' share their factorizations",
                            command, ranks));
}

std::string adapter_folder() {
  const char* cache = std::getenv("XDG_CACHE_HOME");
  if (cache != nullptr && *cache != '\0') return std::string(cache) + "/espalier";
  const char* home = std::getenv("HOME");
  return std::string(home != nullptr ? home : ".") + "/.cache/espalier";
}

LaunchedRanks::LaunchedRanks(const RankOptions& options) {
  if (launched_ranks() > 1) load(options);
}

LaunchedRanks::~LaunchedRanks() {
  ranks_ = Ranks();
  if (end_ != nullptr) end_();
}

void LaunchedRanks::load(const RankOptions& options) {
  std::string why;
  for (const std::string& path : adapters()) {
    // Libraries of MPIs look for each other's symbols in the program.
    void* library = ::dlopen(path.c_str(), RTLD_NOW | RTLD_GLOBAL);
    if (library == nullptr) {
      why += fmt::format("; {}", ::dlerror());
      continue;
    }
    const auto begin = symbol<int (*)(espalier_rank_functions*)>(library, "espalier_mpi_adapter_begin");
    end_ = symbol<void (*)()>(library, "espalier_mpi_adapter_end");
    espalier_rank_functions table{};
    if (begin == nullptr || end_ == nullptr) {
      why += fmt::format("; {} is no adapter", path);
      continue;
    }
    if (const int error = begin(&table); error != 0)
      throw Error(StatusCode::device_error, fmt::format("{}: MPI does not begin (error {})", path, error));
    if (table.ranks == 1) {  // of another MPI than the launcher's: every process would be alone
      table.release(table.context);
      std::exchange(end_, nullptr)();
      why += fmt::format("; {} is of another MPI than the launcher, it sees one rank", path);
      continue;
    }
    ranks_ = Ranks(table, options.patience);
    set_nodes(ranks_, options.nodes);
    return;
  }
  throw Error(StatusCode::invalid_input,
              fmt::format("started on {} ranks, but there is no adapter for their MPI: make one by 'espalier "
                          "mpi-adapter --cc mpicc', or name one in ESPALIER_MPI_ADAPTER{}",
                          launched_ranks(), why));
}

Status LaunchedRanks::on_all(const std::function<Status()>& body) const {
  const auto caught = [&]() -> Status {
    try {
      return body();
    } catch (const Error& error) {
      return error.status();
    } catch (const std::bad_alloc&) {
      return {StatusCode::out_of_memory, "the machine's memory is too small for this system", -1};
    }
  };
  return ranks_.size() > 1 ? solver::on_all_ranks(*ranks_.link(), caught) : caught();
}

Offset LaunchedRanks::from_first(Offset number) const {
  return ranks_.size() > 1 ? ranks_.link()->all_numbers(number).front() : number;
}

}  // namespace espalier::cli
