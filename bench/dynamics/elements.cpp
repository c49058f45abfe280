// Elements per second: internal force and tangent of one body, assembled, for every element, law and damping.
// Every answer is checked in the same program: the force against differences of the energy (undamped) and the tangent
// against differences of the force, along one random direction.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "base/thread_pool.hpp"
#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/meshers/parts.hpp"

namespace {

using namespace espalier;
using namespace espalier::dynamics;
using Vector = std::vector<double>;

struct Arguments {
  int elements = 4096;  // about that many in a body
  int threads = 1;
  double seconds = 0.3;  // at least that long per figure
  bool processor = false;
  std::string only, json, dump;
};

/// Every hexahedron cut into six tetrahedra around its diagonal, with nodes in the middle of edges where wanted.
Mesh tetrahedra(const Mesh& hexes, bool quadratic) {
  static constexpr int kCut[6][4] = {{0, 1, 2, 6}, {0, 2, 3, 6}, {0, 3, 7, 6},
                                     {0, 7, 4, 6}, {0, 4, 5, 6}, {0, 5, 1, 6}};
  static constexpr int kEdge[6][2] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
  Mesh mesh;
  mesh.nodes = hexes.nodes;
  std::map<std::pair<Index, Index>, Index> middles;
  for (Index e = 0; e < hexes.element_count(); ++e)
    for (const auto& cut : kCut) {
      std::vector<Index> nodes;
      for (const int a : cut) nodes.push_back(hexes.element(e)[static_cast<std::size_t>(a)]);
      for (const auto& edge : kEdge) {
        if (!quadratic) break;
        const auto [low, high] =
            std::minmax(nodes[static_cast<std::size_t>(edge[0])], nodes[static_cast<std::size_t>(edge[1])]);
        const auto [place, added] = middles.try_emplace({low, high}, static_cast<Index>(mesh.nodes.size()));
        if (added) {
          const Point &x = mesh.nodes[static_cast<std::size_t>(low)], &y = mesh.nodes[static_cast<std::size_t>(high)];
          mesh.nodes.push_back({(x[0] + y[0]) / 2, (x[1] + y[1]) / 2, (x[2] + y[2]) / 2});
        }
        nodes.push_back(place->second);
      }
      mesh.add_element(quadratic ? ElementType::tet10 : ElementType::tet4, nodes);
    }
  return mesh;
}

Mesh make_mesh(ElementType type, int elements) {
  const bool cut = type == ElementType::tet4 || type == ElementType::tet10;
  const int n = std::max(2, static_cast<int>(std::lround(std::cbrt(elements / (cut ? 6.0 : 1.0)))));
  const Mesh block = make_block({1, 1, 1}, n, n, n, cut ? ElementType::hex8 : type);
  return cut ? tetrahedra(block, type == ElementType::tet10) : block;
}

using MakeBody = std::function<std::unique_ptr<FlexibleBody>(const Material& material, base::ThreadPool* pool)>;

struct Case {
  std::string name;
  bool neo_hookean;  ///< it has this law, too
  double edge;       ///< of an element, about
  MakeBody make;
};

/// A cylinder of shells.
std::unique_ptr<FlexibleBody> make_cylinder(int elements, const Material& material) {
  const Index around = std::max(4, static_cast<Index>(std::lround(std::sqrt(elements)))), along = around;
  std::vector<Point> positions, directors;
  std::vector<std::array<Index, 4>> quads;
  const auto node = [&](Index i, Index k) { return i * around + k % around; };
  for (Index i = 0; i <= along; ++i)
    for (Index k = 0; k < around; ++k) {
      const double angle = 2 * std::numbers::pi * k / around;
      directors.push_back({0, std::cos(angle), std::sin(angle)});
      positions.push_back({static_cast<double>(i) / along, 0.2 * std::cos(angle), 0.2 * std::sin(angle)});
      if (i < along) quads.push_back({node(i, k), node(i, k + 1), node(i + 1, k + 1), node(i + 1, k)});
    }
  return make_shell_body("body", positions, directors, quads, material, 0.02);
}

std::vector<Case> cases(int elements) {
  std::vector<Case> all;
  const auto add_solid = [&](const std::string& name, ElementType type, const SolidOptions& options) {
    all.push_back({name, true, 1 / std::cbrt(elements), [=](const Material& material, base::ThreadPool* pool) {
                     return make_solid_body("body", make_mesh(type, elements), material, options, {}, pool);
                   }});
  };
  add_solid("tet4", ElementType::tet4, {});
  add_solid("tet10", ElementType::tet10, {});
  add_solid("hex20", ElementType::hex20, {});
  add_solid("hex20 reduced", ElementType::hex20, {Hex8Formulation::full, true});
  const std::pair<const char*, Hex8Formulation> forms[] = {{"hex8 full", Hex8Formulation::full},
                                                           {"hex8 mean", Hex8Formulation::mean_dilatation},
                                                           {"hex8 enhanced", Hex8Formulation::enhanced},
                                                           {"hex8 shell", Hex8Formulation::shell}};
  for (const auto& [name, form] : forms) add_solid(name, ElementType::hex8, {form, false});
  all.push_back({"ANCF shell", true, 1 / std::sqrt(elements),
                 [=](const Material& material, base::ThreadPool*) { return make_cylinder(elements, material); }});
  const Index line = std::min(elements, 500);  // far nodes have few digits for differences
  const Point start{0, 0, 0}, end{static_cast<double>(line), 0, 0}, side{0, 1, 0};
  all.push_back({"ANCF cable", false, 1, [=](const Material&, base::ThreadPool*) {
                   return make_cable_body("body", start, end, line, {150, 3, 2});
                 }});
  all.push_back({"ANCF beam", false, 1, [=](const Material& material, base::ThreadPool*) {
                   return make_beam_body("body", start, end, side, line, rectangular_section(material, 0.4, 0.2));
                 }});
  return all;
}

/// A body in a random state near its reference, with the directions that the check uses.
class Probe {
 public:
  Probe(const Case& c, SolidLaw law, bool damped, base::ThreadPool* pool) {
    auto owned = c.make({law, 200, 0.3, 1}, pool);
    if (damped) owned->set_damping({0, 1e-3});
    body_ = &system_.add(std::move(owned));
    system_.finish();
    const auto n = static_cast<std::size_t>(system_.sizes().velocity);
    q_.resize(n);
    v_.resize(n);
    system_.initial(q_, v_);
    const double size = 0.05 * c.edge;
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> uniform(-size, size);
    for (double& x : q_) x += 0.3 * uniform(generator);
    for (double& x : v_) x = 30 * uniform(generator);
    for (std::size_t i = 0; i < n; ++i) direction_.push_back(uniform(generator));
    values_.resize(static_cast<std::size_t>(system_.tangent_pattern().nonzeros()));
    force_.resize(n);
  }

  void force() { system_.residual(state(), force_); }
  void tangent() { system_.tangent(state(), {0, velocity_weight, 1}, values_); }
  [[nodiscard]] Index elements() const { return body_->assembly().elements(); }

  /// The mesh, the state, a direction, and what the last force() and tangent() made of them: for another program.
  [[nodiscard]] nlohmann::json values() const {
    std::vector<Point> nodes;
    const std::span<const double> x = body_->reference();
    for (std::size_t k = 0; k < x.size(); k += 3) nodes.push_back({x[k], x[k + 1], x[k + 2]});
    std::vector<std::vector<Index>> elements;
    body_->assembly().for_each_group([&](const ElementGroup& group, std::span<const Index>) {
      for (Index e = 0; e < group.count(); ++e)
        elements.emplace_back(group.vertices(e).begin(), group.vertices(e).end());
    });
    return {{"nodes", nodes},   {"elements", elements},    {"positions", q_},
            {"forces", force_}, {"direction", direction_}, {"tangent_times_direction", times_direction()}};
  }

  /// Largest difference, relative to the largest entry, of K d from the difference of two forces; undamped also of
  /// f . d from that of two energies. Steps h with errors h^2 + eps / h.
  double check(bool damped) {
    const double h = 1e-5;
    const Vector keep_q = q_, keep_v = v_;
    tangent();
    force();
    const double slope = dot(force_, direction_);
    const Vector product = times_direction();
    Vector sides[2];
    double energy[2];
    for (int side = 0; side < 2; ++side) {
      for (std::size_t i = 0; i < q_.size(); ++i) {
        const double step = (side == 0 ? h : -h) * direction_[i];
        q_[i] = keep_q[i] + step;
        v_[i] = keep_v[i] + velocity_weight * step;
      }
      force();
      sides[side] = force_;
      energy[side] = system_.energy(state()).potential;
    }
    q_ = keep_q;
    v_ = keep_v;
    double worst = 0, largest = 0;
    for (std::size_t i = 0; i < product.size(); ++i) {
      largest = std::max(largest, std::abs(product[i]));
      const double difference = std::abs(product[i] - (sides[0][i] - sides[1][i]) / (2 * h));
      if (!(difference <= worst)) worst = difference;
    }
    worst /= largest;
    if (damped) return worst;
    const double difference = std::abs(slope - (energy[0] - energy[1]) / (2 * h));
    return std::max(worst, difference / std::abs(slope));
  }

 private:
  static constexpr double velocity_weight = 3;
  [[nodiscard]] StateView state() const { return {0, q_, v_, {}, {}}; }
  static double dot(const Vector& a, const Vector& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
  }
  [[nodiscard]] Vector times_direction() const {
    const SparsePattern& p = system_.tangent_pattern();
    Vector product(q_.size(), 0.0);
    for (std::size_t c = 0; c < q_.size(); ++c)
      for (Offset k = p.ptr[c]; k < p.ptr[c + 1]; ++k)
        product[static_cast<std::size_t>(p.ind[static_cast<std::size_t>(k)])] +=
            values_[static_cast<std::size_t>(k)] * direction_[c];
    return product;
  }

  AssembledSystem system_;
  FlexibleBody* body_ = nullptr;
  Vector q_, v_, direction_, force_, values_;
};

/// Seconds of the fastest call within the time given; of the processor, if that is wanted.
double fastest(const Arguments& a, const std::function<void()>& call) {
  const auto now = [&] {
    if (a.processor) return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  };
  call();
  const double start = now();
  double best = std::numeric_limits<double>::infinity();
  for (int calls = 0; calls < 3 || now() - start < a.seconds; ++calls) {
    const double begin = now();
    call();
    best = std::min(best, now() - begin);
  }
  return best;
}

Arguments parse(int argc, char** argv) {
  Arguments a;
  CLI::App app{"Elements per second: internal force and tangent, assembled"};
  app.add_option("--elements", a.elements, "elements of each body, about");
  app.add_option("--threads", a.threads, "threads of the assembly");
  app.add_option("--seconds", a.seconds, "time spent on each figure, at least");
  app.add_flag("--processor-time", a.processor,
               "time of the processor, of all threads: for a machine that is not idle");
  app.add_option("--only", a.only, "cases whose names begin so");
  app.add_option("--json", a.json, "file for the figures");
  app.add_option("--dump", a.dump, "folder for the forces and tangents of the undamped cases");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    std::exit(app.exit(e));
  }
  return a;
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments a = parse(argc, argv);
  constexpr double kWrong = 1e-6;  // of differences: h^2 = 1e-10 and eps / (h * strain)
  base::ThreadPool pool(a.threads);
  nlohmann::json out = nlohmann::json::array();
  bool right = true;
  fmt::print("microseconds an element, {} thread(s)\n{:34}{:>8}{:>9}{:>9}{:>13}{:>13}{:>10}\n", a.threads, "",
             "elements", "force", "tangent", "forces/s", "tangents/s", "error");
  for (const Case& c : cases(a.elements))
    for (const SolidLaw law : {SolidLaw::st_venant_kirchhoff, SolidLaw::neo_hookean})
      for (const bool damped : {false, true}) {
        if (law == SolidLaw::neo_hookean && !c.neo_hookean) continue;
        const std::string name =
            c.name + (law == SolidLaw::neo_hookean ? ", neo-Hookean" : ", SVK") + (damped ? ", damped" : "");
        if (!name.starts_with(a.only)) continue;
        Probe probe(c, law, damped, &pool);
        const double error = probe.check(damped);
        const double n = probe.elements();
        const double force = fastest(a, [&] { probe.force(); }) / n;
        const double tangent = fastest(a, [&] { probe.tangent(); }) / n;
        if (!a.dump.empty() && !damped) std::ofstream(a.dump + "/" + name + ".json") << probe.values().dump() << "\n";
        const bool good = error < kWrong;
        right = right && good;
        fmt::print("{:34}{:8}{:9.3f}{:9.3f}{:13.3e}{:13.3e}{:10.1e}{}\n", name, probe.elements(), 1e6 * force,
                   1e6 * tangent, 1 / force, 1 / tangent, error, good ? "" : "  WRONG");
        out.push_back({{"case", name},
                       {"elements", probe.elements()},
                       {"threads", a.threads},
                       {"force_seconds", force},
                       {"tangent_seconds", tangent},
                       {"error", error}});
      }
  if (!a.json.empty()) std::ofstream(a.json) << out.dump(1) << "\n";
  return right ? 0 : 1;
}
