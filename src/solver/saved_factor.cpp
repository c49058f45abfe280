// What is in the file of a factor, and how a solver goes on with it.
#include <fmt/format.h>

#include <utility>

#include "espalier/factor_file.hpp"
#include "matrix/validate.hpp"
#include "solver/analysis_file.hpp"
#include "solver/factor_file.hpp"
#include "solver/session_calls.hpp"
#include "solver/solver_impl.hpp"
#include "solver/whole_plan.hpp"

namespace espalier {

namespace solver {

namespace {

struct FactorContents {
  Kind kind = Kind::llt;
  Precision precision = Precision::fp64;
  Index n = 0;
  bool transposed = false;
  Storage storage = Storage::general;
  std::vector<Offset> col_ptr;
  std::vector<Index> row_ind;
  std::vector<double> values;
  SavedAnalysis analysis;

  [[nodiscard]] MatrixView matrix() const { return {n, n, col_ptr, row_ind, values, storage}; }
};

// A list of numbers that stand for enumerations and sizes.
struct FactorFacts {
  std::int32_t kind, precision, storage, n, transposed;
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

FactorContents contents_of(Session& s) {
  const Analysis& a = s.current();
  const PreparedMatrix& p = a.system->prepared;
  FactorContents c;
  c.kind = a.kind();
  c.precision = s.factor->precision();
  c.n = a.n();
  const MatrixView m = p.a;
  c.storage = m.storage;
  c.col_ptr.assign(m.col_ptr.begin(), m.col_ptr.end());
  c.row_ind.assign(m.row_ind.begin(), m.row_ind.end());
  const std::span<const double> values = s.factor->values_of_entries();
  c.values.assign(values.begin(), values.end());
  c.analysis = {a.kind(), whole_tree(a.plan, nullptr), p.row_scale, p.col_scale, p.row_of_col};
  return c;
}

void write_contents(Session& s, const std::string& path, bool transposed) {
  FactorContents c = contents_of(s);
  const auto each_of_analysis = [](FactorContents& of, auto&& use) { each_array(of.analysis, use); };
  const auto each_of_matrix = [](FactorContents& of, auto&& use) { each_list(of, use); };
  Numeric& numeric = s.factor->numeric();
  const std::uint64_t layout = numeric.arrays_layout();
  std::uint64_t numbers = sizeof layout;
  if (layout != 0) numeric.visit_arrays([&](std::span<std::byte> bytes) { numbers += bytes.size(); });
  const std::vector<std::uint64_t> sizes{bytes_of_lists(c, each_of_matrix), bytes_of_lists(c, each_of_analysis),
                                         numbers};
  const FactorFacts facts{static_cast<std::int32_t>(c.kind), static_cast<std::int32_t>(c.precision),
                          static_cast<std::int32_t>(c.storage), c.n, transposed ? 1 : 0};
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

FactorContents read_contents(FactorReader& r, const std::string& path) {
  FactorContents c;
  r.begin_part("matrix");
  const auto facts = r.value<FactorFacts>();
  const auto inside = [](std::int32_t x, auto least, auto most) {
    return x >= static_cast<std::int32_t>(least) && x <= static_cast<std::int32_t>(most);
  };
  if (!inside(facts.kind, Kind::llt, Kind::lu) || !inside(facts.precision, Precision::fp64, Precision::mixed) ||
      !inside(facts.storage, Storage::general, Storage::symmetric_upper) || facts.n < 0)
    r.fail("its matrix is of a sort that there is not");
  c.kind = static_cast<Kind>(facts.kind);
  c.precision = static_cast<Precision>(facts.precision);
  c.storage = static_cast<Storage>(facts.storage);
  c.n = facts.n;
  c.transposed = facts.transposed != 0;
  each_list(c, [&](auto& v) { r.list(v); });
  r.end_part();
  r.begin_part("analysis");
  if (r.value<FactorFacts>().kind != facts.kind) r.fail("matrix and analysis are of different kinds");
  c.analysis.kind = c.kind;
  c.analysis.tree.n = c.n;
  each_array(c.analysis, [&](auto& v) { r.list(v); });
  r.end_part();
  if (c.col_ptr.size() != static_cast<std::size_t>(c.n) + 1 || c.values.size() != c.row_ind.size())
    r.fail("the sizes of its matrix do not fit each other");
  if (const std::string wrong = wrong_with(c.analysis); !wrong.empty()) r.fail("its analysis is not valid: " + wrong);
  try {
    matrix::validate(c.matrix());
  } catch (const Error& e) {
    throw Error(StatusCode::invalid_input, path + ": its matrix is not valid: " + e.what());
  }
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

void restore_contents(Session& s, FactorReader& r, const std::string& path, FactorContents contents,
                      LoadedFactor& loaded) {
  s.take_analysis(path, std::move(contents.analysis), contents.matrix());
  r.begin_part("numbers");
  const auto layout = r.value<std::uint64_t>();
  loaded.result =
      factor_by(s, [&](Factor& factor) { factor.restore(contents.values, layout, source_of(r, loaded.restored)); });
  if (!loaded.restored && loaded.result.status.ok())
    s.context.log(
        fmt::format("{}: the factor is not taken from it, since fronts are laid out otherwise here, or it has "
                    "none: the matrix was factorized again",
                    path));
}

}  // namespace

}  // namespace solver

Status save_factor(Solver& solver, const std::string& path, bool transposed) {
  solver::Session& s = solver::SolverAccess::session(solver);
  solver::check_factorized(s, "save_factor");
  if (s.parts || s.link() != nullptr) throw std::logic_error("save_factor: the matrix comes in parts");
  return guarded(s, [&] { solver::write_contents(s, path, transposed); });
}

LoadedFactor load_factor(const std::string& path, Options options) {
  LoadedFactor loaded;
  Status status;
  try {
    solver::FactorReader reader(path);
    solver::FactorContents contents = solver::read_contents(reader, path);
    loaded.transposed = contents.transposed;
    options.kind = contents.kind;
    options.precision = contents.precision;
    options.permutation.clear();
    loaded.solver = Solver(std::move(options));
    solver::Session& s = solver::SolverAccess::session(loaded.solver);
    status = guarded(s, [&] { solver::restore_contents(s, reader, path, std::move(contents), loaded); });
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

}  // namespace espalier
