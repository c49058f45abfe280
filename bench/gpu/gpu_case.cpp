#include "gpu/gpu_case.hpp"

#include <sstream>

#include "base/timeline.hpp"
#include "matrix/generators/generate.hpp"

namespace espalier::bench {
namespace {

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string w; in >> w;) words.push_back(w);
  return words;
}

}  // namespace

GpuCase prepare_case(const std::string& name, Kind wish, base::ThreadPool& pool) {
  GpuCase c;
  c.name = name;
  c.a = matrix::generate(matrix::parse_generator(words_of(name)), &pool);
  c.kind = solver::choose_kind(c.a, wish, pool);
  const double start = base::now_seconds();
  c.prepared = solver::prepare_matrix(c.a.view(), c.kind, pool);
  solver::scale_and_match(c.prepared, c.kind, Options{}, pool);
  analysis::TreeOptions options;
  options.pair = c.prepared.pair;
  options.zero_diagonal = c.prepared.zero_diagonal;
  c.tree = analysis::build_tree(analysis::graph_of(c.prepared.a, pool, c.prepared.row_of_col), options, pool);
  c.analysis_seconds = base::now_seconds() - start;
  return c;
}

void lay_out_for_gpus(GpuCase& c, int devices, const device::cuda::DeviceTuning& tuning, base::ThreadPool& pool) {
  const double start = base::now_seconds();
  c.devices = devices;
  c.plan = plan::make_plan(c.tree, c.prepared.a, c.prepared.row_of_col,
                           device::cuda::cuda_plan_options(c.kind, tuning, devices), pool);
  c.plan_seconds = base::now_seconds() - start;
}

void lay_out_for_host(GpuCase& c, bool single, base::ThreadPool& pool) {
  plan::PlanOptions options;
  options.tiles.panel = single ? 16 : 8;  // one cache line, as the host kernels ask for
  options.unsymmetric = c.kind == Kind::lu;
  options.ldlt = c.kind == Kind::ldlt;
  c.devices = 1;
  c.plan = plan::make_plan(c.tree, c.prepared.a, c.prepared.row_of_col, options, pool);
}

template <class T>
GpuNumbers<T>::GpuNumbers(const GpuCase& c, base::ThreadPool& pool)
    : values(static_cast<std::size_t>(c.prepared.a.nonzeros())) {
  const solver::PreparedMatrix& p = c.prepared;
  const solver::Scales scales{p.row_scale, p.col_scale, p.transform_log, p.wide};
  const double largest = solver::scale_values(p, scales, p.a.values, values.data(), pool);
  rule = {0.01, (c.kind == Kind::llt ? 0 : unit_of<T>()) * largest};
}

template <class T>
std::vector<T> to_plan_order(const GpuCase& c, const std::vector<double>& b, Index columns) {
  const Index n = c.plan.tree.n;
  std::vector<T> x(static_cast<std::size_t>(n) * columns);
  for (Index k = 0; k < n; ++k) {
    const Index row = c.prepared.row_of(c.plan.tree.order[k]);
    const double scale = c.prepared.row_scale.empty() ? 1.0 : c.prepared.row_scale[row];
    for (Index j = 0; j < columns; ++j)
      x[static_cast<std::size_t>(k) * columns + j] = static_cast<T>(scale * b[static_cast<std::size_t>(j) * n + row]);
  }
  return x;
}

template <class T>
std::vector<double> from_plan_order(const GpuCase& c, const std::vector<T>& x, Index columns) {
  const Index n = c.plan.tree.n;
  std::vector<double> out(x.size());
  for (Index k = 0; k < n; ++k) {
    const Index col = c.plan.tree.order[k];
    const double scale = c.prepared.col_scale.empty() ? 1.0 : c.prepared.col_scale[col];
    for (Index j = 0; j < columns; ++j)
      out[static_cast<std::size_t>(j) * n + col] =
          scale * static_cast<double>(x[static_cast<std::size_t>(k) * columns + j]);
  }
  return out;
}

std::vector<double> test_right_hand_sides(Index n, Index columns) {
  std::vector<double> b(static_cast<std::size_t>(n) * static_cast<std::size_t>(columns));
  for (std::size_t k = 0; k < b.size(); ++k) b[k] = 1.0 + static_cast<double>(k % 7) * 0.25;
  return b;
}

const char* name_of(Kind kind) { return kind == Kind::llt ? "llt" : kind == Kind::ldlt ? "ldlt" : "lu"; }

Kind kind_of(const std::string& name) {
  return name == "llt" ? Kind::llt : name == "ldlt" ? Kind::ldlt : name == "lu" ? Kind::lu : Kind::automatic;
}

template struct GpuNumbers<double>;
template struct GpuNumbers<float>;
template std::vector<double> to_plan_order<double>(const GpuCase&, const std::vector<double>&, Index);
template std::vector<float> to_plan_order<float>(const GpuCase&, const std::vector<double>&, Index);
template std::vector<double> from_plan_order<double>(const GpuCase&, const std::vector<double>&, Index);
template std::vector<double> from_plan_order<float>(const GpuCase&, const std::vector<float>&, Index);

}  // namespace espalier::bench
