/// \file
/// MUMPS' one function for real matrices in double precision, for a program that runs in one process. Problems that are
/// not ours (elements, distributed entries, Schur complements, null pivots) go to the real library.
#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>

#include "common/border.hpp"
#include "common/handles.hpp"
#include "common/log.hpp"
#include "common/real_library.hpp"
#include "mumps/instance.hpp"

namespace espalier::hosts::mumps {

namespace {

Handles<Instance>& instances() {
  static auto& live = *new Handles<Instance>;
  return live;
}

const void* handle_of(const DMUMPS_STRUC_C& id) {
  return reinterpret_cast<const void*>(static_cast<std::intptr_t>(id.instance_number));
}

bool ask_real(DMUMPS_STRUC_C& id) {
  static auto& library =
      *new RealLibrary("ESPALIER_MUMPS_LIBRARY", {"libdmumps_seq-" MUMPS_VERSION ".so", "libdmumps_seq-5.5.so"});
  auto* function = library.function<void(DMUMPS_STRUC_C*)>("dmumps_c");
  if (function != nullptr) function(&id);
  return function != nullptr;
}

// What several processes share is the real library's: their number stands in the environment of all.
bool several_processes() {
  for (const char* variable : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_SIZE", "MV2_COMM_WORLD_SIZE"}) {
    const char* text = std::getenv(variable);
    if (text != nullptr && std::atoi(text) > 1) return true;
  }
  return false;
}

// As MUMPS sets them, as far as hosts read and we heed them.
void set_defaults(DMUMPS_STRUC_C& id) {
  static std::atomic<int> last{0};
  std::fill_n(id.icntl, std::size(id.icntl), 0);
  std::fill_n(id.cntl, std::size(id.cntl), 0.0);
  const std::pair<int, int> values[] = {{1, 6},  {3, 6}, {4, 2},   {6, 7},    {7, 7},
                                        {8, 77}, {9, 1}, {14, 20}, {27, -32}, {28, 0}};
  for (const auto& [place, value] : values) id.icntl[place - 1] = value;
  id.cntl[0] = id.sym == 1 ? 0 : 0.01;
  id.cntl[1] = 1.4901161193847656e-08;
  id.irn = id.jcn = nullptr;
  id.a = id.rhs = nullptr;
  id.nrhs = 1;
  id.nnz = id.nz = 0;
  id.instance_number = ++last;
  std::strncpy(id.version_number, MUMPS_VERSION, sizeof id.version_number);
  report(id, kOk);
}

void begin(DMUMPS_STRUC_C& id) {
  if (!ask_real(id)) set_defaults(id);
  if (id.info[0] < 0 || several_processes()) return;
  if (std::strncmp(id.version_number, MUMPS_VERSION, sizeof MUMPS_VERSION) != 0)
    return complain("mumps", "left to the program's own MUMPS: ours was built for version " MUMPS_VERSION);
  instances().add(handle_of(id), std::make_shared<Instance>());
}

// The error that MUMPS has for a problem that is none.
void refuse(DMUMPS_STRUC_C& id) {
  if (id.n < 1) return report(id, kBadOrder, id.n);
  if (id.nz < 1 && id.nnz < 1) return report(id, kBadCount, id.nz);
  if (id.irn == nullptr || id.jcn == nullptr) return report(id, kBadPointer, id.irn == nullptr ? kRows : kColumns);
  report(id, kNotOffered);
}

// `analyzed`: this call began with the analysis.
void leave_to_real(DMUMPS_STRUC_C& id, Instance& instance, bool analyzed) {
  const int job = id.job;
  if (!analyzed) id.job = job == 2 ? 4 : 6;  // with the analysis that ours has stood for
  if (ask_real(id)) instance.real = true;
  id.job = job;
}

void run(DMUMPS_STRUC_C& id, Instance& instance) {
  const bool analyze = id.job == 1 || id.job == 4 || id.job == 6, solve = id.job == 3 || id.job == 5 || id.job == 6;
  const bool factorize = id.job == 2 || id.job >= 4;
  if (analyze) instance.real = false;
  const bool takes = analyze && Instance::takes(id);
  if (analyze && (!takes || Instance::small(id))) {
    instance.real = ask_real(id);
    if (instance.real) return;
    if (!takes) return refuse(id);
  }
  if (instance.real) {
    ask_real(id);
    return;
  }
  if (id.job < 1 || id.job > 6) return report(id, kBadJob, id.job);
  if (analyze && !instance.analyze(id)) return;
  if (factorize && !instance.factorize(id)) {
    // An optimiser probes singular matrices on purpose; others hear what MUMPS makes of theirs.
    if (id.sym != 2 && id.info[0] == kSingular) leave_to_real(id, instance, analyze);
    return;
  }
  if (solve) instance.solve(id);
}

}  // namespace

ESPALIER_HOST_CALL void dmumps_c(DMUMPS_STRUC_C* id) {
  ESPALIER_NOTE_CALLER;
  if (id == nullptr) return;
  guarded(
      [&] {
        if (id->job == -1) return begin(*id);
        const auto instance = instances().find(handle_of(*id));
        if (id->job == -2) instances().end(handle_of(*id));
        if (instance == nullptr || id->job == -2) {
          if (!ask_real(*id)) report(*id, instance == nullptr ? kBadJob : kOk, id->job);
          return;
        }
        run(*id, *instance);
      },
      [&] { report(*id, kNoMemory); }, [&] { report(*id, kNotOffered); });
}

}  // namespace espalier::hosts::mumps
