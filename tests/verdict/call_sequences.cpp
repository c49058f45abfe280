#include "verdict/call_sequences.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "verdict/sequence.hpp"

namespace espalier::verdict {

template <class T>
Sequence<T>::Sequence(std::uint64_t seed, const std::string& device) : random_(seed) {
  options_ = random_options();
  if (!device.empty()) {
    options_.device = device;
    options_.device_memory_bytes = 0;
    about_ += ", on " + device;
  }
  actors_.push_back(Actor<T>{SolverOf<T>(options_), random_matrix(), {}, {}, true, false});
  analyze(actors_[0]);
}

template <class T>
SequenceVerdict Sequence<T>::run(int calls) {
  for (; out_.calls < calls && out_.wrong.empty(); ++out_.calls) {
    Actor<T>& actor = actors_[below(actors_.size())];
    step(actor, static_cast<int>(below(kSteps)));
    if (std::getenv("VERDICT_LOG") != nullptr)
      std::printf("%d solver %d: %s\n", out_.calls, static_cast<int>(&actor - actors_.data()), last_.c_str());
  }
  return out_;
}

template <class T>
T Sequence<T>::value(double low, double high) {
  if constexpr (std::is_same_v<T, double>)
    return number(low, high);
  else
    return {number(low, high), number(-0.3, 0.3)};
}

template <class T>
void Sequence<T>::wrong(const std::string& what) {
  if (out_.wrong.empty())
    out_.wrong = what + " (" + about_ + "; call " + std::to_string(out_.calls) + ", " + last_ + ")";
}

template <class T>
Options Sequence<T>::random_options() {
  Options o;
  sort_ = static_cast<int>(below(4));
  definite_ = sort_ == 0;
  static const Precision precisions[] = {Precision::fp64, Precision::fp64, Precision::fp64, Precision::fp32,
                                         Precision::mixed};
  o.precision = precisions[below(std::size(precisions))];
  static const char* const devices[] = {"cpu", "cpu", "cpu", "host:1,1", "host:2", "cpu"};
  o.device = devices[below(std::size(devices))];
  if (std::string(o.device).starts_with("host") && below(2) == 0) o.device_memory_bytes = 4'000'000;
  o.threads = 1 + static_cast<int>(below(3));
  o.partial_refactorization = below(2) == 0;
  o.rescale = static_cast<Rescale>(below(3));
  if (below(3) == 0) o.singular = SingularMatrix::report;
  if (below(3) == 0) o.max_block_size = 16;
  if (below(4) == 0) o.matching = false;
  o.refinement_steps = 0;
  o.required_backward_error = std::numeric_limits<double>::infinity();
  o.interrupted = [this] { return interrupt_; };
  o.interrupted_every = 0;
  // What pivots that fail change in the plan stays until the next analysis.
  o.log = [this](const std::string& line) {
    if (std::getenv("VERDICT_LOG") != nullptr) std::printf("  %s\n", line.c_str());
    for (const char* word : {"later front", "going on", "given up", "wider"})
      plan_changed_ = plan_changed_ || line.find(word) != std::string::npos;
  };
  about_ = "sort " + std::to_string(sort_) + ", " + o.device + ", budget " + std::to_string(o.device_memory_bytes) +
           ", precision " + std::to_string(static_cast<int>(o.precision)) + ", partial " +
           std::to_string(static_cast<int>(o.partial_refactorization)) + ", rescale " +
           std::to_string(static_cast<int>(o.rescale)) + ", singular " + std::to_string(static_cast<int>(o.singular)) +
           ", matching " + std::to_string(static_cast<int>(o.matching)) +
           (std::is_same_v<T, double> ? "" : ", complex");
  return o;
}

template <class T>
MatrixOf<T> Sequence<T>::random_matrix() {
  // Where pivots move far, which L U without matching leaves to them, 300 unknowns take a quarter of a second.
  const bool small = (sort_ == 3 && !options_.matching) || below(4) != 0;
  const auto n = static_cast<Index>(1 + below(small ? 40 : 300));
  const std::uint64_t seed = random_();
  SparseMatrix real;
  if (sort_ == 0) real = reference::random_system(n, 4, reference::Values::positive, seed);
  if (sort_ == 1) real = reference::random_system(n, 4, reference::Values::indefinite, seed);
  if (sort_ == 2) real = reference::saddle_point(n + 4, 1 + n / 5, seed);
  if (sort_ == 3) real = reference::random_system(n, 4, reference::Values::general, seed);
  split_ = below(4) == 0;
  if (sort_ < 3) {
    static const Storage storages[] = {Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both};
    real = reference::stored_as(real, storages[below(3)], split_);
  } else {
    split_ = false;
  }
  if constexpr (std::is_same_v<T, double>) {
    return real;
  } else {
    MatrixOf<T> a{real.rows, real.cols, real.col_ptr, real.row_ind, {}, real.storage};
    // Hermitian where it is definite; the imaginary parts leave it so. Else symmetric, or general.
    if (definite_) a.storage = static_cast<Storage>(static_cast<int>(real.storage) + 3);
    a.values.assign(real.values.begin(), real.values.end());
    return a;
  }
}

template <class T>
std::vector<T> Sequence<T>::other_values(const MatrixOf<T>& a, const std::vector<T>& from) {
  std::vector<double> d(static_cast<std::size_t>(a.rows));
  for (double& v : d) v = number(0.4, 2.5);
  std::vector<T> out = from;
  for (std::size_t j = 0; j < d.size(); ++j)
    for (auto q = static_cast<std::size_t>(a.col_ptr[j]); q < static_cast<std::size_t>(a.col_ptr[j + 1]); ++q)
      out[q] *= d[static_cast<std::size_t>(a.row_ind[q])] * d[j];
  return out;
}

template <class T>
void Sequence<T>::scribble(std::vector<T>& values) {
  for (T& v : values) v = kNaN;
}

template <class T>
void Sequence<T>::analyzed(Actor<T>& a, const Status& status, const char* what) {
  last_ = what;
  a.factored.clear();
  a.fresh.reset();
  a.moved_pivots = plan_changed_ = false;
  if (!status.ok()) return wrong(std::string(what) + ": " + status.message);
  if (a.solver.state() != SolverOf<T>::State::analyzed) wrong(std::string(what) + " left another state than analyzed");
  a.fresh = a.solver.clone();
  must_refuse_to_solve(a);
}

template <class T>
void Sequence<T>::analyze(Actor<T>& a) {
  analyzed(a, with_copy(a.matrix, [&](const MatrixOf<T>& m) { return a.solver.analyze(m); }).status, "analyze");
}

template <class T>
void Sequence<T>::must_refuse_to_solve(Actor<T>& a) {
  std::vector<T> b(static_cast<std::size_t>(a.matrix.rows), T(1)), x = b;
  try {
    const SolveResult r = a.solver.solve(b, x);
    if (r.status.ok()) wrong("a solution without a factor");
  } catch (const std::logic_error&) {
    ++out_.errors;
  }
}

template <class T>
void Sequence<T>::note_plan(Actor<T>& a) {
  a.moved_pivots = std::exchange(plan_changed_, false) || a.moved_pivots;
}

template <class T>
void Sequence<T>::lost(Actor<T>& a) {
  ++out_.errors;
  note_plan(a);
  a.moved_pivots = a.moved_pivots || last_ == "a singular matrix";
  if (a.solver.state() == SolverOf<T>::State::factorized && !a.factored.empty()) return check(a);
  if (a.solver.state() == SolverOf<T>::State::factorized)
    return wrong("a failed factorization left a factor of nothing");
  a.factored.clear();
  must_refuse_to_solve(a);
}

template <class T>
void Sequence<T>::check(Actor<T>& a) {
  if (a.factored.empty() || !a.regular) return;
  const auto columns = static_cast<Index>(1 + below(3));
  static const Transpose hows[] = {Transpose::no, Transpose::yes, Transpose::conjugate};
  const Transpose how = hows[below(3)];
  std::vector<T> b(static_cast<std::size_t>(a.matrix.rows) * static_cast<std::size_t>(columns));
  for (T& v : b) v = value(-1, 1);
  std::vector<T> x(b.size()), own = b;
  const bool in_place = below(2) == 0;
  const SolveResult r = in_place ? a.solver.solve(own, own, columns, how) : a.solver.solve(own, x, columns, how);
  if (in_place) x = own;
  if (!r.status.ok()) return wrong("solve: " + r.status.message);
  MatrixOf<T> truth = a.matrix;
  truth.values = a.factored;
  const bool single = a.solver.options().precision != Precision::fp64;
  const double error = backward_error<T>(truth, b, x, columns, how), bound = single ? 2e-3 : 1e-8;
  ++out_.solutions;
  std::vector<T> y(x.size());
  bool same_way = false;  // the fresh factor has the history of this one
  if (a.fresh && (!(error <= bound) || !(a.moved_pivots || single))) {
    SolverOf<T> fresh = a.fresh->clone();
    const auto f = fresh.refactorize(a.factored);
    if (f.status.ok()) (void)fresh.solve(b, y, columns, how);
    same_way = f.status.ok() && !a.moved_pivots && !single && f.delayed == 0 && f.perturbed == 0 && !plan_changed_;
    plan_changed_ = false;
  }
  // Without matching and refinement a factor may be a poor one, a fresh one as well.
  const bool poor = sort_ == 3 && !a.solver.options().matching;
  if (!(error <= bound) && !poor && !(error <= 10 * backward_error<T>(truth, b, y, columns, how)))
    return wrong("the solution is not that of the last values: " + std::to_string(error));
  if (!same_way) return;
  ++out_.bits;
  if (std::memcmp(x.data(), y.data(), x.size() * sizeof(T)) != 0) wrong("other bits than those of a fresh factor");
}

template <class T>
void Sequence<T>::step(Actor<T>& a, int which) {
  split_ = split_of(a);
  if (a.solver.state() == SolverOf<T>::State::empty) which = 0;
  switch (which) {
    case 0:
      if (below(2) == 0) {
        a.matrix = random_matrix();
      } else {
        a.matrix.values = other_values(a.matrix, a.matrix.values);
      }
      return analyze(a);
    case 1:
    case 2:
    case 3: {
      a.matrix.values = other_values(a.matrix, a.matrix.values);
      const auto result = with_copy(a.matrix, [&](const MatrixOf<T>& m) { return a.solver.factorize(m); });
      return factored(a, result, a.matrix.values, "factorize");
    }
    case 4:
    case 5: {
      std::vector<T> values = other_values(a.matrix, a.matrix.values), given = values;
      const auto result = a.solver.refactorize(given);
      scribble(given);
      return factored(a, result, std::move(values), "refactorize");
    }
    case 6:
    case 7:
    case 8:
      return some_entries(a, true);
    case 9:
      return some_entries(a, false);
    case 10:
      return not_finite(a);
    case 11:
      return other_pattern(a);
    case 12:
      return wrong_sizes(a);
    case 13:
      return singular(a);
    case 14:
      return interrupted(a);
    case 15:
      return change_pattern(a);
    case 16:
      return by_file(a);
    case 17: {
      last_ = "clone";
      if (actors_.size() >= 3) {
        if (&a != &actors_.back()) actors_.pop_back();
        return;
      }
      Actor<T> twin{a.solver.clone(), a.matrix, {}, {}, true, a.moved_pivots};
      twin.fresh = a.fresh ? std::optional(a.fresh->clone()) : std::nullopt;
      must_refuse_to_solve(twin);
      actors_.push_back(std::move(twin));
      return;
    }
    case 18: {
      last_ = "move";
      SolverOf<T> other(std::move(a.solver));
      a.solver = std::move(other);
      return check(a);
    }
    case 19:
      check_values(a);
      return check(a);
    case 20:
      return check_inverse(a);
    case 21:
    case 22:
      return check_rows(a);
    case 23:
      return change_around(a);
    case 24:
      return device_arrays(a);
    case 25:
    case 26:
      return saved(a);
    default:
      return check(a);
  }
}

template class Sequence<double>;
template class Sequence<std::complex<double>>;

SequenceVerdict run_sequence(std::uint64_t seed, int calls, const std::string& device) {
  try {
    if (seed % 4 == 3) return Sequence<std::complex<double>>(seed, device).run(calls);
    return Sequence<double>(seed, device).run(calls);
  } catch (const std::exception& e) {
    SequenceVerdict out;
    out.wrong = std::string("an exception: ") + e.what();
    return out;
  }
}

}  // namespace espalier::verdict
