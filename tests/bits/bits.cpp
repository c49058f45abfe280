// Prints a hash of the bits of factors and solutions for a table of systems, one line a case: the same source must give
// the same bits, whatever was moved inside the library. Uses the public interface alone.
//   espalier_bits [--gpu] [CASE...]       a case is run when its name contains one of the words
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"

namespace {

using espalier::Index;

/// FNV-1a, 64 bits (Fowler, Noll, Vo).
class Hash {
 public:
  template <class T>
  void add(const T& value) {
    unsigned char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    for (const unsigned char b : bytes) state_ = (state_ ^ b) * 0x100000001b3U;
  }
  [[nodiscard]] std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0xcbf29ce484222325U;
};

struct Case {
  std::string name;
  std::string system;
  espalier::Options options;
  bool out_of_core = false;
};

espalier::Options options_for(espalier::Kind kind, espalier::Precision precision, const std::string& device,
                              int threads, espalier::Offset device_memory) {
  espalier::Options o;
  o.kind = kind;
  o.precision = precision;
  o.device = device;
  o.threads = threads;
  o.device_memory_bytes = device_memory;
  o.refinement_steps = 0;
  o.required_backward_error = std::numeric_limits<double>::infinity();
  return o;
}

std::vector<Case> table(bool gpu) {
  using espalier::Kind;
  using espalier::Precision;
  struct System {
    const char* spec;
    Kind kind;
    espalier::Offset budget;  // in which it does not fit: out of core
  };
  constexpr espalier::Offset kMiB = 1 << 20;
  const std::vector<System> systems = {{"elasticity 8", Kind::llt, 0},        {"elasticity 14", Kind::llt, 3 * kMiB},
                                       {"elasticity 10", Kind::ldlt, 0},      {"elasticity 10", Kind::lu, 0},
                                       {"plate 60", Kind::llt, 2 * kMiB},     {"poisson 40 40 1", Kind::llt, 0},
                                       {"kkt 6 8 5 5", Kind::ldlt, 2 * kMiB}, {"kkt 40 3 2 2", Kind::ldlt, 0},
                                       {"gyroscopic 8", Kind::lu, 3 * kMiB},  {"gyroscopic 12 12 2", Kind::lu, 0}};
  struct Place {
    const char* device;
    int threads;
    bool out_of_core;
  };
  const std::vector<Place> host = {{"cpu", 1, false},      {"cpu", 2, false},   {"host:2", 2, false},
                                   {"host:3,1", 3, false}, {"host:1", 2, true}, {"host:2", 2, true}};
  const std::vector<Place> one_gpu = {{"gpu:0", 2, false}, {"gpu:0", 2, true}};
  std::vector<Case> cases;
  for (const System& s : systems)
    for (const Precision precision : {Precision::fp64, Precision::fp32})
      for (const Place& p : gpu ? one_gpu : host) {
        if (p.out_of_core && s.budget == 0) continue;
        const char* kind = s.kind == Kind::llt ? "llt" : s.kind == Kind::ldlt ? "ldlt" : "lu";
        const bool single = precision == Precision::fp32;
        const espalier::Offset budget = p.out_of_core ? s.budget / (single ? 2 : 1) : 0;
        cases.push_back({std::string(s.spec) + "; " + kind + (single ? "; fp32" : "; fp64") + "; " + p.device + " " +
                             std::to_string(p.threads) + (p.out_of_core ? " out of core" : ""),
                         s.spec, options_for(s.kind, precision, p.device, p.threads, budget), p.out_of_core});
      }
  return cases;
}

// Two right-hand sides, solved plainly and with the transpose, after a factorization and after a refactorization.
std::string run(const Case& c) {
  std::istringstream in(c.system);
  const std::vector<std::string> words{std::istream_iterator<std::string>(in), {}};
  const espalier::SparseMatrix made = espalier::matrix::generate(espalier::matrix::parse_generator(words));
  const espalier::MatrixView a = made;
  espalier::Solver solver(c.options);
  if (const auto r = solver.analyze(a); !r.status.ok()) return "analysis: " + r.status.message;
  const auto n = static_cast<std::size_t>(a.rows);
  std::vector<double> b(2 * n), x(2 * n);
  for (std::size_t k = 0; k < b.size(); ++k)
    b[k] = 1.0 / static_cast<double>(1 + k % 97) - 0.25 * static_cast<double>(k % 5);
  std::vector<double> values(a.values.begin(), a.values.end());
  Hash hash;
  for (int round = 0; round < 2; ++round) {
    const espalier::FactorResult f = solver.refactorize(values);
    if (!f.status.ok()) return "factorization: " + f.status.message;
    if (c.out_of_core && (f.devices.empty() || f.devices.front().streamed_in_bytes == 0)) return "stayed in core";
    for (const Index count : {f.inertia.negative, f.two_by_two, f.perturbed, f.delayed}) hash.add(count);
    hash.add(f.determinant_log);
    hash.add(f.determinant_sign);
    for (const espalier::Transpose t : {espalier::Transpose::no, espalier::Transpose::yes}) {
      if (const auto s = solver.solve(b, x, 2, t); !s.status.ok()) return "solve: " + s.status.message;
      for (const double value : x) hash.add(value);
    }
    for (double& value : values) value *= 1.0 + 0x1p-20;
  }
  char text[20];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash.value()));
  return text;
}

}  // namespace

int main(int count, char** arguments) {
  std::vector<std::string> words(arguments + 1, arguments + count);
  const bool gpu = std::erase(words, "--gpu") > 0;
  for (const Case& c : table(gpu)) {
    bool wanted = words.empty();
    for (const std::string& word : words) wanted = wanted || c.name.find(word) != std::string::npos;
    if (!wanted) continue;
    std::printf("%s\t%s\n", c.name.c_str(), run(c).c_str());
    std::fflush(stdout);
  }
  return 0;
}
