// What is in the file of a factor, and how a solver goes on with it.
#include <fmt/format.h>

#include <utility>

#include "espalier/factor_file.hpp"
#include "matrix/validate.hpp"
#include "solver/analysis/analysis_file.hpp"
#include "solver/factor/factor_file.hpp"
#include "solver/ranks/whole_plan.hpp"
#include "solver/session/complex_results.hpp"
#include "solver/session/session_calls.hpp"
#include "solver/session/solver_impl.hpp"

namespace espalier {

namespace solver {

namespace {

struct FactorContents {
  Kind kind = Kind::llt;
  Precision precision = Precision::fp64;
  base::Numbers numbers = base::Numbers::real;
  Index n = 0;
  bool by_rows = false;
  Storage storage = Storage::general;  // Hermitian ones are called symmetric, see GivenMatrix
  std::vector<Offset> col_ptr;
  std::vector<Index> row_ind;
  std::vector<double> values;  // of complex matrices the parts
  SavedAnalysis analysis;

  [[nodiscard]] GivenMatrix matrix() const { return {{n, n, col_ptr, row_ind, values, storage}, numbers}; }
};

// A list of numbers that stand for enumerations and sizes.
struct FactorFacts {
  std::int32_t kind, precision, storage, n, by_rows, numbers;
};

template <class List>
void each_list(FactorContents& c, List&& list) {
  list(c.col_ptr);
  list(c.row_ind);
  list(c.values);
}

template <class List>
std::uint64_t bytes_of_lists(FactorContents& c, List&& each) {
  std::uint64_t bytes = sizeof(FactorFacts);
  each(c, [&](const auto& v) { bytes += FactorWriter::list_bytes(v); });
  return bytes;
}

void take_matrix(Session& s, FactorContents& c) {
  const PreparedMatrix& p = s.current().system->prepared;
  const MatrixView m = p.a;
  c.numbers = p.numbers;
  c.n = p.n();
  // As the caller gave it, so that its pattern is known. Hermitian storage is said, since values alone may be both.
  c.storage = p.symmetric_values && p.numbers != base::Numbers::hermitian ? Storage::general : m.storage;
  c.col_ptr.assign(m.col_ptr.begin(), m.col_ptr.end());
  c.row_ind.assign(m.row_ind.begin(), m.row_ind.end());
  const std::span<const double> values = s.factor->values_of_entries();
  c.values.assign(values.begin(), values.end());
}

FactorContents contents_of(Session& s, bool by_rows) {
  const Analysis& a = s.current();
  const PreparedMatrix& p = a.system->prepared;
  FactorContents c;
  c.kind = a.kind();
  c.precision = s.factor->precision();
  // A symmetric one for lu: its rows are its columns. What was Hermitian is not known there.
  c.by_rows = by_rows && (p.source.empty() || p.numbers != base::Numbers::real);
  take_matrix(s, c);
  const auto& real_form = a.system->real_form;
  const Scales& scales = s.factor->numeric().scales();  // of these numbers, which may not be that of the analysis
  c.analysis = {a.kind(), real_form ? real_form->tree : whole_tree(a.plan, nullptr), scales.row, scales.col,
                p.row_of_col};
  return c;
}

void write_contents(Session& s, const std::string& path, bool by_rows) {
  FactorContents c = contents_of(s, by_rows);
  const auto each_of_analysis = [](FactorContents& of, auto&& use) { each_array(of.analysis, use); };
  const auto each_of_matrix = [](FactorContents& of, auto&& use) { each_list(of, use); };
  Numeric& numeric = s.factor->numeric();
  const std::uint64_t layout = numeric.arrays_layout();
  std::uint64_t numbers = sizeof layout;
  if (layout != 0) numeric.visit_arrays([&](std::span<std::byte> bytes) { numbers += bytes.size(); });
  const std::vector<std::uint64_t> sizes{bytes_of_lists(c, each_of_matrix), bytes_of_lists(c, each_of_analysis),
                                         numbers};
  const FactorFacts facts{static_cast<std::int32_t>(c.kind),
                          static_cast<std::int32_t>(c.precision),
                          static_cast<std::int32_t>(c.storage),
                          c.n,
                          c.by_rows ? 1 : 0,
                          static_cast<std::int32_t>(c.numbers)};
  FactorWriter w(path, sizes);
  const auto list = [&](const auto& v) { w.list(v); };
  w.begin_part("matrix", sizes[0]);
  w.value(facts);
  each_list(c, list);
  w.end_part();
  w.begin_part("analysis", sizes[1]);
  w.value(facts);
  each_array(c.analysis, list);
  w.end_part();
  w.begin_part("numbers", sizes[2]);
  w.value(layout);
  if (layout != 0)
    numeric.visit_arrays([&](std::span<std::byte> bytes) {
      s.pool.check();
      w.bytes(bytes);
    });
  w.end_part();
  w.commit();
}

void take_facts(const FactorReader& r, const FactorFacts& facts, FactorContents& c) {
  const auto inside = [](std::int32_t x, auto least, auto most) {
    return x >= static_cast<std::int32_t>(least) && x <= static_cast<std::int32_t>(most);
  };
  using base::Numbers;
  if (!inside(facts.kind, Kind::llt, Kind::lu) || !inside(facts.precision, Precision::fp64, Precision::mixed) ||
      !inside(facts.storage, Storage::general, Storage::symmetric_both) ||
      !inside(facts.numbers, Numbers::real, Numbers::hermitian) || facts.n < 0)
    r.fail("its matrix is of a sort that there is not");
  c.kind = static_cast<Kind>(facts.kind);
  c.precision = static_cast<Precision>(facts.precision);
  c.storage = static_cast<Storage>(facts.storage);
  c.numbers = static_cast<Numbers>(facts.numbers);
  c.n = facts.n;
  c.by_rows = facts.by_rows != 0;
  if (c.numbers == Numbers::hermitian && (c.storage == Storage::general || c.kind == Kind::lu))
    r.fail("its matrix is of a sort that there is not");
}

void check_contents(const FactorReader& r, const std::string& path, const FactorContents& c) {
  const auto parts = at(base::parts_of(c.numbers));
  if (c.col_ptr.size() != at(c.n) + 1 || c.values.size() != parts * c.row_ind.size())
    r.fail("the sizes of its matrix do not fit each other");
  if (const std::string wrong = wrong_with(c.analysis); !wrong.empty()) r.fail("its analysis is not valid: " + wrong);
  try {
    if (c.numbers == base::Numbers::real)
      matrix::validate(c.matrix().a);
    else
      matrix::validate(complex_view(c.matrix()));
  } catch (const Error& e) {
    throw Error(StatusCode::invalid_input, path + ": its matrix is not valid: " + e.what());
  }
}

FactorContents read_contents(FactorReader& r, const std::string& path, bool complex) {
  FactorContents c;
  r.begin_part("matrix");
  const auto facts = r.value<FactorFacts>();
  take_facts(r, facts, c);
  each_list(c, [&](auto& v) { r.list(v); });
  r.end_part();
  if ((c.numbers != base::Numbers::real) != complex)
    throw Error(StatusCode::invalid_input,
                path + (complex ? ": its matrix is real; load_factor() takes it"
                                : ": its matrix is complex; load_complex_factor() takes it"));
  r.begin_part("analysis");
  if (r.value<FactorFacts>().kind != facts.kind) r.fail("matrix and analysis are of different kinds");
  c.analysis.kind = c.kind;
  c.analysis.tree.n = c.n;
  each_array(c.analysis, [&](auto& v) { r.list(v); });
  r.end_part();
  check_contents(r, path, c);
  return c;
}

// Bytes of the factor, in the order in which they were written.
device::ArrayVisit source_of(FactorReader& r, bool& restored) {
  return [&r, &restored](std::span<std::byte> bytes) {
    r.bytes(bytes);
    if (r.left() > 0) return;
    r.end_part();
    restored = true;
  };
}

FactorResult result_of(const Solver&, FactorResult result) { return result; }
ComplexFactorResult result_of(ComplexSolver& solver, FactorResult result) {
  return complex_result(std::move(result), *SolverAccess::session(solver).factor);
}

template <class Loaded>
void restore_contents(Session& s, FactorReader& r, const std::string& path, FactorContents contents, Loaded& loaded) {
  s.take_analysis(path, std::move(contents.analysis), contents.matrix());
  r.begin_part("numbers");
  const auto layout = r.value<std::uint64_t>();
  loaded.result = result_of(loaded.solver, factor_by(s, [&](Factor& factor) {
                              factor.restore(contents.values, layout, source_of(r, loaded.restored));
                            }));
  if (!loaded.restored && loaded.result.status.ok())
    s.context.log(
        fmt::format("{}: the factor is not taken from it, since fronts are laid out otherwise here, or it has "
                    "none: the matrix was factorized again",
                    path));
}

template <class AnySolver>
Session& whole_session(AnySolver& solver, const char* call) {
  Session& s = SolverAccess::session(solver);
  check_factorized(s, call);
  if (s.parts || s.link() != nullptr)
    throw std::logic_error(fmt::format(
        "{}: the matrix comes in parts, and so does its factor; save_analysis() keeps its order, with which it is "
        "factorized again",
        call));
  return s;
}

template <class AnySolver>
Status save(AnySolver& solver, const std::string& path, bool by_rows) {
  Session& s = whole_session(solver, "save_factor");
  return guarded(s, [&] {
    s.expect_usable();
    write_contents(s, path, by_rows);
  });
}

Storage storage_of(const FactorContents& c) {
  return c.numbers == base::Numbers::real ? c.storage : complex_view(c.matrix()).storage;
}

template <class Value>
LoadedFactorOf<Value> load(const std::string& path, Options options) {
  LoadedFactorOf<Value> loaded;
  Status status;
  try {
    FactorReader reader(path);
    FactorContents contents = read_contents(reader, path, !std::is_same_v<Value, double>);
    loaded.by_rows = contents.by_rows;
    loaded.storage = storage_of(contents);
    if (options.kind != Kind::automatic) options.kind = contents.kind;  // else llt may turn to ldlt later
    options.precision = contents.precision;
    options.permutation.clear();
    loaded.solver = SolverOf<Value>(std::move(options));
    Session& s = SolverAccess::session(loaded.solver);
    status = guarded(s, [&] { restore_contents(s, reader, path, std::move(contents), loaded); });
  } catch (const Error& e) {
    status = e.status();
  } catch (const std::bad_alloc&) {
    status = {StatusCode::out_of_memory, path + ": the machine has too little memory for what the file holds", -1};
  }
  if (!status.ok()) loaded.result.status = std::move(status);
  Status& end = loaded.result.status;
  if (end.code == StatusCode::invalid_input && !end.message.starts_with(path)) end.message = path + ": " + end.message;
  if (!end.ok()) loaded.restored = false;
  return loaded;
}

FactorContents matrix_of(Session& s) {
  FactorContents c;
  s.expect_usable();
  take_matrix(s, c);
  return c;
}

}  // namespace

}  // namespace solver

Status save_factor(Solver& solver, const std::string& path, bool by_rows) {
  return solver::save(solver, path, by_rows);
}
Status save_factor(ComplexSolver& solver, const std::string& path, bool by_rows) {
  return solver::save(solver, path, by_rows);
}

LoadedFactor load_factor(const std::string& path, Options options) {
  return solver::load<double>(path, std::move(options));
}
LoadedComplexFactor load_complex_factor(const std::string& path, Options options) {
  return solver::load<std::complex<double>>(path, std::move(options));
}

bool is_complex_factor(const std::string& path) {
  solver::FactorReader reader(path);
  reader.begin_part("matrix");
  solver::FactorContents c;
  solver::take_facts(reader, reader.value<solver::FactorFacts>(), c);
  return c.numbers != base::Numbers::real;
}

SparseMatrix factorized_matrix(Solver& solver) {
  solver::FactorContents c = solver::matrix_of(solver::whole_session(solver, "factorized_matrix"));
  return {c.n, c.n, std::move(c.col_ptr), std::move(c.row_ind), std::move(c.values), c.storage};
}

ComplexSparseMatrix factorized_matrix(ComplexSolver& solver) {
  solver::FactorContents c = solver::matrix_of(solver::whole_session(solver, "factorized_matrix"));
  const Storage storage = solver::storage_of(c);
  return {c.n, c.n, std::move(c.col_ptr), std::move(c.row_ind), solver::numbers_of(c.values), storage};
}

}  // namespace espalier
