// Thousands of random changes of values on random trees: after each, a solver that makes what has changed alone
// (Options::partial_refactorization) must have the bits and the verdicts of one that makes everything. Prints what
// differs and a table; exit code 1 where anything did.
//   espalier_value_changes [CHANGES [SEED [DEVICE [LARGEST_N [PATTERNS [FOLDER]]]]]]
// Each fourth matrix is complex: symmetric, Hermitian or general.
// default: 10000, seed 1, cpu, n up to 400, and of a hundred changes 0 change the pattern (Solver::analyze_change()).
// With a folder all has a random budget: of the GPUs or devices of the host that DEVICE names; of cpu, of a device of
// the host, or of the host with the factor on disk. The other solver is then a new one with the same options, up to the
// first pivot that moves.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "reference/reference.hpp"
#include "verdict/complex_twin.hpp"
#include "verdict/value_changes.hpp"

namespace {

using namespace espalier;  // NOLINT(google-build-using-namespace): a program of one file

struct Tally {
  int changes = 0, some = 0, none = 0, all = 0, refused = 0, wrong = 0;
  int patterns = 0, followed = 0;  // of the changes; of these, factorizations that have kept fronts
};

struct Case {
  std::string name;
  SparseMatrix a;
  Options options;
  bool complex = false, hermitian = false;  // then it stands for its twin
};

class Campaign {
 public:
  Campaign(unsigned seed, std::string device, Index largest, int patterns, std::string folder)
      : seed_(seed),
        device_(std::move(device)),
        largest_(largest),
        patterns_(static_cast<std::size_t>(patterns)),
        folder_(std::move(folder)) {}

  int run(int changes) {
    for (unsigned k = 0; all_.changes < changes; ++k) {
      random_.seed(seed_ + k);
      const Case c = draw(k);
      if (c.complex)
        go_through<std::complex<double>>(c, changes - all_.changes);
      else
        go_through<double>(c, changes - all_.changes);
    }
    for (const auto& [kind, t] : by_kind_) print(kind, t);
    print("all", all_);
    return all_.wrong > 0 || all_.some == 0 || (patterns_ > 0 && all_.followed == 0) ? 1 : 0;
  }

 private:
  std::size_t below(std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random_); }

  SparseMatrix matrix_for(Kind kind, std::string& name) {
    const auto n = static_cast<Index>(20 + below(static_cast<std::size_t>(largest_)));
    const auto generated = [&](std::vector<std::string> words) {
      for (const std::string& w : words) name += ", " + w;
      return matrix::generate(matrix::parse_generator(words));
    };
    const auto side = [&](double power) {
      return std::to_string(2 + below(static_cast<std::size_t>(std::pow(largest_ / 3.0, 1 / power))));
    };
    name += ", n about " + std::to_string(n);
    switch (below(5)) {
      case 0:
        return generated({"elasticity", side(3), side(3), side(3)});
      case 1:
        return generated({"plate", side(2), side(2)});
      case 2:
        if (kind != Kind::llt) return reference::saddle_point(n, n / 5 + 1, random_());
        break;
      case 3:
        if (kind == Kind::lu) return reference::random_system(n, 4, reference::Values::general, random_());
        if (kind == Kind::ldlt) return reference::random_system(n, 4, reference::Values::indefinite, random_());
        break;
      default:
        break;
    }
    return reference::random_system(n, 3 + static_cast<Index>(below(3)), reference::Values::positive, random_());
  }

  Case draw(unsigned k) {
    constexpr Kind kKinds[] = {Kind::llt, Kind::ldlt, Kind::lu};
    constexpr const char* kNames[] = {"llt", "ldlt", "lu"};
    constexpr Precision kPrecisions[] = {Precision::fp64, Precision::fp64, Precision::fp32, Precision::mixed};
    constexpr Index kBlocks[] = {0, 0, 8, 32};
    const std::size_t kind = below(3);
    Case c;
    c.name = fmt::format("seed {}, {}", seed_ + k, kNames[kind]);
    c.options.kind = kKinds[kind];
    c.options.device = device_;
    c.options.precision = kPrecisions[below(4)];
    c.options.max_block_size = kBlocks[below(4)];
    c.options.rescale = below(4) == 0 ? Rescale::on : Rescale::off;
    c.options.threads = 1 + static_cast<int>(below(3));
    c.options.refinement_steps = 0;
    c.options.required_backward_error = std::numeric_limits<double>::infinity();
    c.options.singular = below(3) == 0 ? SingularMatrix::error : SingularMatrix::report;
    c.name += fmt::format(", precision {}, blocks {}, rescale {}", static_cast<int>(c.options.precision),
                          c.options.max_block_size, static_cast<int>(c.options.rescale));
    c.a = matrix_for(c.options.kind, c.name);
    c.complex = k % 4 == 3;
    c.hermitian = c.complex && (c.options.kind == Kind::llt || below(2) == 0);
    if (c.complex) c.name += c.hermitian ? ", Hermitian" : ", complex";
    return c;
  }

  static bool same(const void* a, const void* b, std::size_t bytes) { return std::memcmp(a, b, bytes) == 0; }

  template <class T>
  void go_through(const Case& c, int changes) {
    if (folder_.empty())
      follow<T>(c, std::min(30, changes));
    else
      follow_in_budget<T>(c, std::min(12, changes));
  }

  template <class T>
  static std::vector<T> numbers(const Case& c, SparseMatrix a, const std::vector<double>& values) {
    a.values = values;
    return verdict::twin_of<T>(a, c.hermitian).values;
  }
  template <class T>
  static std::vector<T> right_hand_side(const Case& c) {
    std::vector<T> b;
    for (const double v : reference::random_vector(c.a.rows, 7)) b.push_back(v);
    return b;
  }

  // What differs; empty: nothing.
  template <class T>
  std::string compare(SolverOf<T>& partial, SolverOf<T>& whole, const FactorReport& p, const FactorReport& w,
                      const std::vector<T>& b) {
    if (p.status.code != w.status.code) return "status: " + p.status.message + " / " + w.status.message;
    if (p.rank != w.rank) return fmt::format("rank {} / {}", p.rank, w.rank);
    if (p.inertia.negative != w.inertia.negative)
      return fmt::format("negative eigenvalues {} / {}", p.inertia.negative, w.inertia.negative);
    if (p.two_by_two != w.two_by_two) return fmt::format("2 x 2 pivots {} / {}", p.two_by_two, w.two_by_two);
    if (p.perturbed != w.perturbed || p.delayed != w.delayed) return "replaced or moved pivots";
    if (!same(&p.determinant_log, &w.determinant_log, sizeof(double)))
      return fmt::format("determinant {} / {}", p.determinant_log, w.determinant_log);
    if (!p.status.ok()) return {};
    for (const Transpose t : {Transpose::no, Transpose::yes}) {
      std::vector<T> x(b.size()), y(b.size());
      (void)partial.solve(b, x, 1, t);
      (void)whole.solve(b, y, 1, t);
      for (std::size_t k = 0; k < x.size(); ++k)
        if (!same(&x[k], &y[k], sizeof(T))) return fmt::format("x[{}]: {} / {}", k, std::real(x[k]), std::real(y[k]));
    }
    return {};
  }

  template <class T>
  void follow(const Case& c, int changes) {
    Options options = c.options;
    SolverOf<T> whole(options);
    options.partial_refactorization = true;
    options.threads = 1 + static_cast<int>(below(3));
    SolverOf<T> partial(options);
    const verdict::MatrixOf<T> first = verdict::twin_of<T>(c.a, c.hermitian);
    if (!whole.analyze(first).status.ok() || !partial.analyze(first).status.ok()) return;
    const std::vector<T> b = right_hand_side<T>(c);
    SparseMatrix a = c.a;
    std::vector<double> now = a.values;
    bool other_pattern = false;
    Tally& tally = tally_of(c);
    for (int k = 0; k <= changes; ++k) {
      const std::vector<T> values = numbers<T>(c, a, now);
      const auto w = whole.refactorize(values), p = partial.refactorize(values);
      if (!count(c, tally, k, compare<T>(partial, whole, p, w, b), p, other_pattern)) return;
      other_pattern = below(100) < patterns_;
      if (!other_pattern) {
        verdict::change_values(now, a.values, random_);
        continue;
      }
      for (std::size_t times = 1 + below(8) / 7; times > 0; --times) {  // now and then nobody factorizes in between
        verdict::change_pattern(a, now, c.a, random_);
        if (!follow_pattern<T>(partial, whole, verdict::twin_of<T>(a, c.hermitian))) return;
      }
    }
  }

  Tally& tally_of(const Case& c) {
    if (c.complex) return by_kind_["complex"];
    return by_kind_[c.options.kind == Kind::llt ? "llt" : c.options.kind == Kind::lu ? "lu" : "ldlt"];
  }

  // Options under which a part of the factor has no room, and which suffice for these values. @returns false: none of
  // some do
  template <class T>
  bool take_budget(const Case& c, Options& options) {
    const verdict::MatrixOf<T> a = verdict::twin_of<T>(c.a, c.hermitian);
    const bool named = device_ != "cpu", disk = !named && below(2) == 0;
    options.partial_refactorization = true;
    options.device = named ? device_ : disk ? "cpu" : "host:1";
    const Offset all = SolverOf<T>(options).analyze(a).predicted_bytes;
    if (disk) options.scratch = folder_;
    double part = 0.05 * static_cast<double>(1 + below(12));
    for (int k = 0; k < 12; ++k, part *= 1.3) {
      const auto bytes = static_cast<Offset>(part * static_cast<double>(all));
      (disk ? options.host_memory_bytes : options.device_memory_bytes) = bytes;
      SolverOf<T> probe(options);
      if (!probe.analyze(a).status.ok()) return false;
      const auto f = probe.factorize(a);
      if (f.status.code != StatusCode::out_of_memory)
        return !f.devices.empty() && f.devices.front().streamed_out_bytes > 0;
    }
    return false;
  }

  template <class T>
  void follow_in_budget(const Case& c, int changes) {
    Options options = c.options;
    if (options.precision == Precision::mixed) options.precision = Precision::fp32;  // a factor may stay in FP64
    if (!take_budget<T>(c, options)) return;
    SolverOf<T> partial(options);
    const verdict::MatrixOf<T> a = verdict::twin_of<T>(c.a, c.hermitian);
    (void)partial.analyze(a);
    const std::vector<T> b = right_hand_side<T>(c);
    std::vector<double> now = c.a.values;
    Tally& tally = tally_of(c);
    for (int k = 0; k <= changes; ++k) {
      SolverOf<T> whole(options);
      (void)whole.analyze(a);
      const std::vector<T> values = numbers<T>(c, c.a, now);
      const auto w = whole.refactorize(values), p = partial.refactorize(values);
      if (w.delayed > 0 || p.delayed > 0) return;
      if (p.status.code == StatusCode::out_of_memory) return;  // pivots have moved, and need more
      if (!count(c, tally, k, compare<T>(partial, whole, p, w, b), p)) return;
      verdict::change_values(now, c.a.values, random_);
    }
  }

  // @returns whether nothing was wrong
  bool count(const Case& c, Tally& tally, int change, const std::string& wrong, const FactorReport& p,
             bool other_pattern = false) {
    for (Tally* t : {&tally, &all_}) {
      if (!wrong.empty()) ++t->wrong;
      if (change == 0) continue;
      ++t->changes;
      ++(!p.status.ok() ? t->refused : p.work_share == 0 ? t->none : p.work_share < 1 ? t->some : t->all);
      if (other_pattern) ++t->patterns;
      if (other_pattern && p.work_share < 1) ++t->followed;
    }
    if (!wrong.empty())
      fmt::print("{}, change {}{}, share {:.3f}: {}\n", c.name, change, other_pattern ? " of the pattern" : "",
                 p.work_share, wrong);
    return wrong.empty();
  }

  // Whether there is an analysis.
  template <class T>
  static bool follow_pattern(SolverOf<T>& partial, SolverOf<T>& whole, const verdict::MatrixOf<T>& a) {
    const ChangeResult p = partial.analyze_change(a), w = whole.analyze_change(a);
    if (p.analysis.status.code != w.analysis.status.code || p.full != w.full || p.reordered != w.reordered)
      throw std::runtime_error("analyze_change() depends on partial_refactorization");
    return p.analysis.status.ok();
  }

  static void print(const std::string& kind, const Tally& t) {
    fmt::print("{:7} {:7} changes: {} made some fronts, {} none, {} all, {} without a factor; {} wrong", kind,
               t.changes, t.some, t.none, t.all, t.refused, t.wrong);
    fmt::print("; {} of the pattern, {} of which kept some\n", t.patterns, t.followed);
  }

  unsigned seed_;
  std::string device_;
  Index largest_;
  std::size_t patterns_;  // of a hundred changes
  std::string folder_;    // for factors on disk; empty: there are no budgets
  std::mt19937 random_;
  Tally all_;
  std::map<std::string, Tally> by_kind_;
};

}  // namespace

int main(int argc, char** argv) {
  const auto number = [&](int k, int otherwise) { return argc > k ? std::atoi(argv[k]) : otherwise; };
  const int changes = number(1, 10000), seed = number(2, 1), largest = number(4, 400), patterns = number(5, 0);
  if (changes < 1 || largest < 20 || patterns < 0 || patterns > 100) {
    fmt::print(stderr,
               "espalier_value_changes [CHANGES [SEED [DEVICE [LARGEST_N [PATTERNS [FOLDER]]]]]], LARGEST_N from 20, "
               "PATTERNS of 100 changes\n");
    return 2;
  }
  return Campaign(static_cast<unsigned>(seed), argc > 3 ? argv[3] : "cpu", largest, patterns, argc > 6 ? argv[6] : "")
      .run(changes);
}
