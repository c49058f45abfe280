// Thousands of random matrices of known rank, each in several disguises (kind, units, numbering, precision), judged by
// the solver. "late" are singular matrices of which the solution told, not the factorization. Prints a line for every
// wrong verdict and a table at the end; exit code 1 where one was wrong.
//   espalier_verdict [CASES [SEED [LARGEST_N [any|dense [DEVICE]]]]]     default: 2000 cases, seed 1, n up to 400
// dense: n lies near LARGEST_N, and the rank by construction is held against the dense eigenvalues (Eigen) as well.
// DEVICE: as the solver's option takes it, gpu:0 for one; default: the first core of the host.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include "espalier/espalier.hpp"
#include "matrix/generators/random.hpp"
#include "verdict/cases.hpp"

namespace {

using namespace espalier;  // NOLINT(google-build-using-namespace): a program of one file

struct Tally {
  int runs = 0, verdicts = 0, inertias = 0, vectors = 0, answers = 0, late = 0;
  double worst_vector = 0, worst_answer = 0;
};

// What is allowed is 16 times the bound of a zero (16 eps): see solver/deficiency/deficiency.hpp.
constexpr double kVectorError = 1e-13;

struct Run {
  std::string name;
  SparseMatrix a;
  Index zeros, negative;
  Options options;
};

// |A v|_i / (|A| |v|)_i would be nothing for rows that v does not touch: the largest |A v| / (|A| |v|)_inf. Or of A^T.
double null_error(const SparseMatrix& a, const double* v, bool transpose) {
  const auto n = static_cast<std::size_t>(a.rows);
  const std::vector<double> zero(n, 0.0);
  const std::vector<double> r = reference::residual(a, zero.data(), v, transpose);
  std::vector<double> size(n, 0.0);
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const auto i = static_cast<std::size_t>(a.row_ind[static_cast<std::size_t>(q)]), j = static_cast<std::size_t>(c);
      const double w = std::abs(a.values[static_cast<std::size_t>(q)]);
      const bool both = a.storage != Storage::general && i != j;
      if (both || !transpose) size[i] += w * std::abs(v[j]);
      if (both || transpose) size[j] += w * std::abs(v[i]);
    }
  double most = 0, scale = 0;
  for (std::size_t i = 0; i < n; ++i) {
    most = std::max(most, std::abs(r[i]));
    scale = std::max(scale, size[i]);
  }
  return most / scale;
}

void judge(const Run& run, Tally& tally, bool vectors) {
  ++tally.runs;
  Solver s(run.options);
  const auto say = [&](const char* what, const std::string& detail) {
    std::printf("WRONG %-10s n %d, %s: %s\n", what, run.a.rows, run.name.c_str(), detail.c_str());
  };
  const AnalysisResult analysis = s.analyze(run.a);
  if (!analysis.status.ok()) {  // structurally singular: right where there are zeros
    if (analysis.status.code != StatusCode::singular || run.zeros == 0) {
      ++tally.verdicts;
      say("analysis", analysis.status.message);
    }
    return;
  }
  const FactorResult f = s.factorize(run.a);
  if (run.zeros > 0 && f.rank == run.a.rows) {  // what no pivot shows, a solution shows
    Options strict = run.options;
    strict.singular = SingularMatrix::error;
    Solver again(strict);
    (void)again.analyze(run.a);
    (void)again.factorize(run.a);
    const std::vector<double> b = reference::random_vector(run.a.rows, 7);
    std::vector<double> x(b.size());
    const StatusCode code = again.solve(b, x).status.code;
    const bool mixed = run.options.precision == Precision::mixed;  // may say that its accuracy ends
    if (code == StatusCode::singular || (mixed && code == StatusCode::accuracy_not_reached)) {
      ++tally.late;
      return;
    }
  }
  const Index zeros = run.a.rows - f.rank;
  if (!f.status.ok() || zeros != run.zeros) {
    ++tally.verdicts;
    return say("verdict",
               std::to_string(zeros) + " zeros instead of " + std::to_string(run.zeros) + " " + f.status.message);
  }
  if (f.inertia.zero >= 0 && run.negative >= 0 && (f.inertia.negative != run.negative || f.inertia.zero != run.zeros)) {
    ++tally.inertias;
    say("inertia", std::to_string(f.inertia.negative) + " negative instead of " + std::to_string(run.negative));
  }
  if (zeros > 0 && vectors) {
    const auto check_vectors = [&](const std::vector<double>& all, bool transpose) {
      for (std::size_t at = 0; at < all.size(); at += static_cast<std::size_t>(run.a.rows)) {
        const double error = null_error(run.a, all.data() + at, transpose);
        tally.worst_vector = std::max(tally.worst_vector, error);
        if (error < kVectorError) continue;
        ++tally.vectors;
        say("vector", std::string(transpose ? "|A^T w|" : "|A v|") + " is " + std::to_string(error * 1e16) + "e-16");
      }
    };
    check_vectors(f.null_vectors, false);
    check_vectors(f.left_null_vectors, true);
    const bool two_sided = analysis.kind == Kind::lu;
    if (f.left_null_vectors.size() != (two_sided ? f.null_vectors.size() : 0)) say("left", "vectors are missing");
    if (static_cast<Index>(f.dependent_rows.size()) != zeros) say("rows", std::to_string(f.dependent_rows.size()));
  }
  if (zeros > 0) return;
  const std::vector<double> b = reference::random_vector(run.a.rows, 5);
  std::vector<double> x(b.size());
  (void)s.solve(b, x);
  const double error = reference::backward_error(run.a, b, x);
  tally.worst_answer = std::max(tally.worst_answer, error);
  if (!(error < 1e-14)) {
    ++tally.answers;
    say("answer", "backward error " + std::to_string(error * 1e16) + "e-16");
  }
}

// Whether the dense eigenvalues of the equilibrated matrix are what the construction says.
bool confirmed(const verdict::Case& c, const std::string& name) {
  if (c.a.storage == Storage::general) return true;
  const reference::Signs signs = reference::signs(c.a, 1e-14);
  if (signs.zero == c.zeros && (c.negative < 0 || signs.negative == c.negative)) return true;
  std::printf("WRONG truth      n %d, %s: %d zero and %d negative eigenvalues\n", c.a.rows, name.c_str(), signs.zero,
              signs.negative);
  return false;
}

void campaign(std::uint64_t seed, Index largest, bool dense, const std::string& device,
              std::map<std::string, Tally>& tallies) {
  const auto structure = static_cast<Index>(matrix::random_unit(seed, 0) * verdict::structures());
  const double least = dense ? 0.7 * largest : 6;
  const auto n = static_cast<Index>(least * std::pow(largest / least, matrix::random_unit(seed, 1)));
  const verdict::Case c = verdict::make_case(structure, n, seed);
  Tally& tally = tallies[c.name];
  Options plain;
  plain.threads = 1;
  plain.singular = SingularMatrix::report;
  plain.device = device;
  if (std::getenv("VERDICT_LOG") != nullptr)
    plain.log = [](const std::string& line) { std::printf("  %s\n", line.c_str()); };
  const std::string name = c.name + ", seed " + std::to_string(seed);
  if (dense && !confirmed(c, name)) ++tally.verdicts;
  const auto with = [&](Kind kind, bool matching, Precision precision) {
    Options o = plain;
    o.kind = kind;
    o.matching = matching;
    o.precision = precision;
    return o;
  };
  const bool symmetric = c.a.storage != Storage::general;
  const SparseMatrix hidden = verdict::disguised(c.a, 30, seed), far = verdict::disguised(c.a, 200, seed + 1);
  judge({name, c.a, c.zeros, c.negative, plain}, tally, true);
  judge({name + ", lu", c.a, c.zeros, -1, with(Kind::lu, true, Precision::fp64)}, tally, true);
  judge({name + ", mixed", c.a, c.zeros, c.negative, with(Kind::automatic, true, Precision::mixed)}, tally, true);
  judge({name + ", 2^30", hidden, c.zeros, c.negative, plain}, tally, false);
  judge({name + ", 2^200", far, c.zeros, c.negative, plain}, tally, false);
  judge({name + ", lu 2^200", far, c.zeros, -1, with(Kind::lu, true, Precision::fp64)}, tally, false);
  constexpr int kFar = 498;  // 2^498 is about 1e150
  judge({name + ", 1e150", verdict::in_units(c.a, kFar), c.zeros, c.negative, plain}, tally, false);
  judge({name + ", 1e-150", verdict::in_units(c.a, -kFar), c.zeros, c.negative, plain}, tally, false);
  if (!symmetric) return;
  if (c.definite) {  // one row and column more take one zero away, or make one eigenvalue negative
    const auto row = static_cast<Index>(seed % static_cast<std::uint64_t>(c.a.rows));
    const bool connected = c.zeros == 0 || c.name.find("free") != std::string::npos || c.name.find("graph") == 0;
    if (connected)
      judge({name + ", bordered", verdict::bordered(c.a, row), std::max<Index>(0, c.zeros - 1), 1, plain}, tally, true);
  }
  judge({name + ", ldlt", c.a, c.zeros, c.negative, with(Kind::ldlt, true, Precision::fp64)}, tally, true);
  judge({name + ", ldlt unmatched", c.a, c.zeros, c.negative, with(Kind::ldlt, false, Precision::fp64)}, tally, true);
  judge({name + ", ldlt 2^30", hidden, c.zeros, c.negative, with(Kind::ldlt, true, Precision::fp64)}, tally, false);
}

}  // namespace

int main(int argc, char** argv) {
  const int cases = argc > 1 ? std::atoi(argv[1]) : 2000;
  const auto seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : std::uint64_t{1};
  const Index largest = argc > 3 ? std::atoi(argv[3]) : 400;
  const bool dense = argc > 4 && std::string(argv[4]) == "dense";
  const std::string device = argc > 5 ? argv[5] : "host:1";
  std::map<std::string, Tally> tallies;
  for (int k = 0; k < cases; ++k) campaign(seed + static_cast<std::uint64_t>(k), largest, dense, device, tallies);
  Tally all;
  std::printf("%-26s %7s %6s %9s %9s %8s %8s %10s %10s\n", "structure", "runs", "late", "verdicts", "inertias",
              "vectors", "answers", "|A v|", "error");
  const auto row = [](const std::string& name, const Tally& t) {
    std::printf("%-26s %7d %6d %9d %9d %8d %8d %10.1e %10.1e\n", name.c_str(), t.runs, t.late, t.verdicts, t.inertias,
                t.vectors, t.answers, t.worst_vector, t.worst_answer);
  };
  for (const auto& [name, t] : tallies) {
    row(name, t);
    all.runs += t.runs;
    all.late += t.late;
    all.verdicts += t.verdicts;
    all.inertias += t.inertias;
    all.vectors += t.vectors;
    all.answers += t.answers;
    all.worst_vector = std::max(all.worst_vector, t.worst_vector);
    all.worst_answer = std::max(all.worst_answer, t.worst_answer);
  }
  row("all (wrong ones counted)", all);
  return all.verdicts + all.inertias + all.vectors + all.answers == 0 ? 0 : 1;
}
