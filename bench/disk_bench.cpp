// Factors that lie partly on disk, beside what the disk's rate allows.
//   espalier_bench_disk [N [FOLDER [REPEATS [THREADS]]]]     default: elasticity 28^3, /var/tmp, 3, all cores
// Host memory of 1/2, 1/4 and 1/8 of what a factor in core takes; where that is too little, no line. Refactorizations
// and solves without refinement in turns with those in core, and with measurements of the folder's rates. The floor is
// max(bytes / rate, seconds in core): arithmetic and disk side by side. Medians of the seconds and of the ratios, each
// of which is of one turn. Bytes of a factorization are those counted, of a solve two predicted ways. The answer is
// judged by its backward error.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "base/scratch_file.hpp"
#include "in_turns.hpp"

namespace {

using namespace espalier;
using bench::check;
using bench::median;
using bench::seconds_of;

// The turns of one sort of call.
struct Turns {
  std::vector<double> seconds, in_core, disk, ratio;
  void add(double elapsed, double arithmetic, double of_disk) {
    seconds.push_back(elapsed);
    in_core.push_back(arithmetic);
    disk.push_back(of_disk);
    ratio.push_back(elapsed / std::max(arithmetic, of_disk));
  }
  void print(const char* what, double written, double read) const {
    constexpr double kMiB = 1 << 20;
    fmt::print(
        "  {:15s} {:7.3f} s; {:7.1f} MiB written, {:7.1f} read: {:7.3f} s of the disk; in core {:7.3f} s; "
        "{:5.2f} of the floor ({})\n",
        what, median(seconds), written / kMiB, read / kMiB, median(disk), median(in_core), median(ratio),
        median(disk) > median(in_core) ? "disk" : "arithmetic");
  }
};

void measure(const SparseMatrix& a, Options options, Offset in_core_bytes, int share, int repeats) {
  options.refinement_steps = 0;
  const std::string folder = options.scratch;
  options.scratch.clear();
  Solver core(options);
  check(core.analyze(a).status);
  check(core.factorize(a).status);
  options.scratch = folder;
  options.host_memory_bytes = in_core_bytes / share;
  Solver kept(options);
  const AnalysisResult analysis = kept.analyze(a);
  check(analysis.status);
  FactorResult f = kept.factorize(a);
  if (!f.status.ok()) {
    fmt::print("1/{}: {}\n", share, f.status.message);
    return;
  }
  std::vector<double> values = a.values, b(static_cast<std::size_t>(a.cols), 1.0), x(b.size());
  const MatrixView view{a.rows, a.cols, a.col_ptr, a.row_ind, values, a.storage};
  Turns factorizations, solves;
  double written = 0, read = 0, error = 0;
  const auto way = 2 * static_cast<double>(analysis.predicted_way_read_bytes);
  for (int k = 0; k < repeats; ++k) {
    for (double& v : values) v *= 1 + 1e-12;
    const double of_core = seconds_of([&] { check(core.factorize(view).status); });
    const double solve_in_core = seconds_of([&] { check(core.solve(b, x).status); });
    const base::DiskRates rates = base::measure_disk(folder);
    const double of_disk = seconds_of([&] { check((f = kept.factorize(view)).status); });
    SolveResult solved;
    const double solve_on_disk = seconds_of([&] { check((solved = kept.solve(b, x)).status); });
    written = read = 0;
    for (const DeviceReport& device : f.devices) {
      written += static_cast<double>(device.disk_written_bytes);
      read += static_cast<double>(device.disk_read_bytes);
    }
    factorizations.add(of_disk, of_core, written / rates.write + read / rates.read);
    solves.add(solve_on_disk, solve_in_core, way / rates.read);
    error = std::max(error, solved.backward_error);
  }
  fmt::print("1/{} of the memory, {:.0f} MiB; backward error {:.1e}\n", share,
             static_cast<double>(options.host_memory_bytes) / (1 << 20), error);
  factorizations.print("refactorization", written, read);
  solves.print("solve", 0, way);
}

}  // namespace

int main(int argc, char** argv) {
  const auto word = [&](int k, const char* otherwise) { return std::string(argc > k ? argv[k] : otherwise); };
  try {
    Options options;
    options.device = "cpu";
    options.scratch = word(2, "/var/tmp");
    const int repeats = std::max(1, std::atoi(word(3, "3").c_str()));
    options.threads = std::atoi(word(4, "0").c_str());
    const SparseMatrix a =
        matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", word(1, "28")}));
    Solver solver(options);
    const AnalysisResult whole = solver.analyze(a);
    check(whole.status);
    fmt::print("elasticity {}^3, {} unknowns, {:.0f} MiB in core\n", word(1, "28"), a.cols,
               static_cast<double>(whole.predicted_bytes) / (1 << 20));
    for (const int share : {2, 4, 8}) measure(a, options, whole.predicted_bytes, share, repeats);
  } catch (const std::exception& e) {
    fmt::print(stderr, "espalier_bench_disk: {}\n", e.what());
    return 1;
  }
  return 0;
}
