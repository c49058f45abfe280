#include "verdict/changes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "matrix/generators/generate.hpp"
#include "verdict/complex_twin.hpp"

namespace espalier::verdict {

namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

SparseMatrix generated(const std::vector<std::string>& words) {
  return matrix::generate(matrix::parse_generator(words));
}

std::vector<reference::Triple> triples(const SparseMatrix& a, Index shift = 0) {
  std::vector<reference::Triple> t;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      t.push_back({a.row_ind[static_cast<std::size_t>(q)] + shift, c + shift, a.values[static_cast<std::size_t>(q)]});
  return t;
}

// Two systems that do not touch.
SparseMatrix side_by_side(const SparseMatrix& a, const SparseMatrix& b) {
  std::vector<reference::Triple> t = triples(a);
  for (const reference::Triple& e : triples(b, a.cols)) t.push_back(e);
  return reference::from_triples(a.cols + b.cols, t, a.storage);
}

}  // namespace

int ChangingSystem::sorts() { return 7; }

ChangingSystem::ChangingSystem(int sort, Index n, std::uint64_t seed) : random_(seed) {
  using reference::Values;
  const auto box = static_cast<int>(std::max(1.0, std::cbrt(n / 3.0) - 1));
  switch (sort) {
    case 0:
      name_ = "random, definite";
      base_ = reference::random_system(n, 3, Values::positive, seed);
      break;
    case 1:
      name_ = "random, indefinite";
      kind_ = Kind::ldlt;
      definite_ = false;
      base_ = reference::random_system(n, 3, Values::indefinite, seed);
      break;
    case 2:
      name_ = "random, unsymmetric";
      kind_ = Kind::lu;
      symmetric_ = definite_ = false;
      base_ = reference::random_system(n, 3, Values::general, seed);
      break;
    case 3:
      name_ = "elasticity";
      base_ = generated({"elasticity", std::to_string(box)});
      break;
    case 4:
      name_ = "two bodies";
      base_ = side_by_side(generated({"elasticity", std::to_string(box), "1", "1"}),
                           generated({"elasticity", std::to_string(box), "2", "1"}));
      break;
    case 5:
      name_ = "saddle point";
      kind_ = Kind::ldlt;
      definite_ = false;
      base_ = reference::saddle_point(std::max<Index>(4, n - n / 4), std::max<Index>(1, n / 4), seed);
      break;
    default:
      name_ = "plate, lu";
      kind_ = Kind::lu;
      base_ = generated({"poisson", std::to_string(std::max(2, static_cast<int>(std::sqrt(n)))),
                         std::to_string(std::max(2, static_cast<int>(std::sqrt(n)))), "1"});
  }
}

void ChangingSystem::add(Index u, Index v) {
  if (u == v) return;
  double scale = 0;
  for (const double x : base_.values) scale = std::max(scale, std::abs(x));
  const double part = static_cast<double>(random_() % 1000 + 1) / 1000;
  contacts_.push_back({u, v, scale * part});
}

void ChangingSystem::change() {
  const Index n = base_.cols;
  const auto any = [&](std::size_t below) { return static_cast<Index>(random_() % std::max<std::size_t>(1, below)); };
  for (std::size_t k = contacts_.size(); k-- > 0;)
    if (random_() % 3 == 0) contacts_.erase(contacts_.begin() + static_cast<std::ptrdiff_t>(k));
  const Index count = 1 + any(static_cast<std::size_t>(1 + n / 50));
  const std::uint64_t how = random_() % 3;
  const Index here = any(static_cast<std::size_t>(n));
  for (Index k = 0; k < count; ++k) {
    const Index u = how == 2 ? any(static_cast<std::size_t>(n)) : (here + any(20)) % n;
    const Index v = how == 0 ? (u + 1 + any(6)) % n : any(static_cast<std::size_t>(n));
    add(u, v);
  }
}

// Springs, which keep a definite matrix so; of others entries off the diagonal.
SparseMatrix ChangingSystem::matrix() const {
  std::vector<reference::Triple> t = triples(base_);
  for (const Contact& c : contacts_) {
    if (definite_) {
      t.push_back({c.u, c.u, c.value});
      t.push_back({c.v, c.v, c.value});
    }
    const bool lower = base_.storage == Storage::symmetric_lower;
    t.push_back({lower ? std::max(c.u, c.v) : c.u, lower ? std::min(c.u, c.v) : c.v, definite_ ? -c.value : c.value});
  }
  return reference::from_triples(base_.cols, t, base_.storage);
}

template <class T>
ChangeVerdict follow(SolverOf<T>& solver, const ChangingSystem& system, Offset& fill_of_ordering, bool hermitian) {
  ChangeVerdict verdict;
  const MatrixOf<T> a = twin_of<T>(system.matrix(), hermitian);
  const ChangeResult changed = solver.analyze_change(a);
  SolverOf<T> fresh(solver.options());
  const AnalysisResult analysis = fresh.analyze(a);
  const auto wrong = [&](const std::string& what) {
    verdict.wrong += fmt::format("{} of {} unknowns: {}; ", system.name(), a.cols, what);
  };
  verdict.full = changed.full;
  if (changed.analysis.status.code != analysis.status.code) wrong("analysis: " + changed.analysis.status.message);
  if (!changed.analysis.status.ok() || !analysis.status.ok()) return verdict;
  if (changed.full && changed.entries_of_order != changed.analysis.nonzeros_factor) wrong("promised from elsewhere");
  fill_of_ordering = changed.entries_of_order;
  if (changed.full == changed.why.empty()) wrong("no reason is given, or one too many: " + changed.why);
  verdict.fill = static_cast<double>(changed.analysis.nonzeros_factor) /
                 static_cast<double>(std::max<Offset>(1, fill_of_ordering));
  if (verdict.fill > 1.0501) wrong(fmt::format("{} times the entries that were promised", verdict.fill));
  const auto mine = solver.factorize(a), theirs = fresh.factorize(a);
  if (mine.status.code != theirs.status.code) {
    wrong("factor: " + mine.status.message + " / " + theirs.status.message);
    return verdict;
  }
  if (!mine.status.ok()) return verdict;
  if (mine.rank != theirs.rank) wrong(fmt::format("rank {}, not {}", mine.rank, theirs.rank));
  if (mine.inertia.negative != theirs.inertia.negative || mine.inertia.positive != theirs.inertia.positive)
    wrong(fmt::format("inertia {} {}, not {} {}", mine.inertia.positive, mine.inertia.negative, theirs.inertia.positive,
                      theirs.inertia.negative));
  std::vector<T> b;
  for (const double v : reference::random_vector(a.cols, 3)) b.push_back(v);
  std::vector<T> x(b.size());
  const SolveResult solved = solver.solve(b, x);
  if (!solved.status.ok()) wrong("solve: " + solved.status.message);
  if (const double error = backward_error<T>(a, b, x, 1, Transpose::no); !(error <= 8 * kEps))
    wrong(fmt::format("backward error {:.1e}", error));
  return verdict;
}

template ChangeVerdict follow<double>(Solver&, const ChangingSystem&, Offset&, bool);
template ChangeVerdict follow<std::complex<double>>(ComplexSolver&, const ChangingSystem&, Offset&, bool);

}  // namespace espalier::verdict
