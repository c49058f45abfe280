// The problems of the first hour by the C++ library: prints what was found as JSON, for ../first_hour.py. Argument: the
// folder with the models and bracket.inp.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <espalier/dynamics.hpp>
#include <espalier/espalier.hpp>
#include <string>
#include <vector>

namespace {

void need(const espalier::Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "%s\n", status.message.c_str());
  std::exit(1);
}

/// -1, 2, -1 on the diagonals of a matrix of n rows, and a right-hand side of ones.
void matrix(int n) {
  espalier::SparseMatrix a;
  a.rows = a.cols = n;
  a.col_ptr = {0};
  for (int column = 0; column < n; ++column) {
    for (const int row : {column - 1, column, column + 1})
      if (row >= 0 && row < n) a.row_ind.push_back(row), a.values.push_back(row == column ? 2 : -1);
    a.col_ptr.push_back(static_cast<espalier::Offset>(a.row_ind.size()));
  }
  std::vector<double> b(static_cast<std::size_t>(n), 1.0), x(b.size());
  espalier::Solver solver;
  need(solver.analyze(a).status);
  need(solver.factorize(a).status);
  need(solver.solve(b, x).status);
  std::printf("{\"largest unknown\": %.17g}", *std::max_element(x.begin(), x.end()));
}

/// The quantities of each step, by their short names: ../truths.py looks for the lowest point.
void pendulum(const std::string& folder) {
  espalier::Simulation simulation;
  need(simulation.load(folder + "/pendulum.toml"));
  std::vector<std::vector<double>> columns(4);
  need(simulation.run([&](const espalier::SimulationStep&) {
    columns[0].push_back(simulation.time());
    columns[1].push_back(simulation.value("tip.position.x"));
    columns[2].push_back(simulation.value("tip.velocity.x"));
    columns[3].push_back(simulation.value("hinge.force.z"));
    return true;
  }));
  std::printf("{\"steps\": [");
  for (std::size_t c = 0; c < columns.size(); ++c) {
    std::printf("%s[", c == 0 ? "" : ", ");
    for (std::size_t k = 0; k < columns[c].size(); ++k) std::printf("%s%.17g", k == 0 ? "" : ", ", columns[c][k]);
    std::printf("]");
  }
  std::printf("]}");
}

void bracket(const std::string& folder) {
  espalier::Simulation simulation;
  need(simulation.load(folder + "/bracket.toml"));
  need(simulation.run());
  std::printf("{\"stress in the fillet\": %.17g, \"force on the clamp\": %.17g}",
              simulation.value("bracket[nodes FILLET].stress.principal_1.max"), simulation.value("clamp.force.y"));
}

void plate(const std::string& folder) {
  espalier::Simulation simulation;
  need(simulation.load(folder + "/plate.toml"));
  need(simulation.run());
  int k = 0;
  for (const espalier::SimulationMode& mode : simulation.summary().modes)
    std::printf("%s\"frequency %d\": %.17g", k == 0 ? "{" : ", ", k + 1, mode.frequency), ++k;
  std::printf("}");
}

template <class Problem>
void timed(const char* name, const Problem& problem, const char* end) {
  const auto begin = std::chrono::steady_clock::now();
  std::printf("\"%s\": {\"values\": ", name);
  problem();
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  std::printf(", \"seconds\": %.6f}%s\n", seconds.count(), end);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string folder = argc > 1 ? argv[1] : ".";
  std::printf("{");
  timed(
      "matrix", [] { matrix(1000); }, ",");
  timed(
      "pendulum", [&] { pendulum(folder); }, ",");
  timed(
      "bracket", [&] { bracket(folder); }, ",");
  timed(
      "plate", [&] { plate(folder); }, "}");
}
