// Elements that fail. Truth: bars of one dimension in closed form (when an element fails, what energy goes with it, how
// the released ends vibrate), momenta before and after, bodies without the elements, finite differences.
#include "dynamics/model/erosion/erosion.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <set>

#include "base/at.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"
#include "dynamics/model/output/quantities.hpp"
#include "dynamics/page/failing_faces.hpp"
#include "espalier/sensitivities.hpp"

namespace espalier::dynamics {
namespace erosion_test {

/// A bar of unit cubes along x, of hexahedra with eight nodes; the middle one alone is in the set SOFT, all others in
/// REST. Their number is odd.
std::string bar_mesh(int cubes) {
  std::string text = "*NODE\n";
  for (int k = 0; k <= cubes; ++k)
    for (int c = 0; c < 4; ++c)
      text += fmt::format("{},{},{},{}\n", 4 * k + c + 1, k, c == 1 || c == 2 ? 1 : 0, c > 1 ? 1 : 0);
  for (const bool soft : {false, true}) {
    text += fmt::format("*ELEMENT, TYPE=C3D8, ELSET={}\n", soft ? "SOFT" : "REST");
    for (int e = 0; e < cubes; ++e) {
      if ((e == cubes / 2) != soft) continue;
      text += fmt::format("{}", e + 1);
      for (const int section : {e, e + 1})
        for (int c = 0; c < 4; ++c) text += fmt::format(",{}", 4 * section + c + 1);
      text += "\n";
    }
  }
  return text;
}

/// With modulus and density 1 (waves have the speed 1), the soft element with half the modulus, and no contraction: all
/// is of one dimension. The left end is held, the right one moves by `motion`.
class Bar {
 public:
  explicit Bar(int cubes) : cubes_(cubes) {
    std::ofstream(folder_.path() + "/bar.inp") << bar_mesh(cubes);
    const double soft = std::exp(kLimit);
    const double force = 0.5 * 0.5 * soft * (soft * soft - 1);
    double hard = 1;
    for (int k = 0; k < 20; ++k) hard -= (0.5 * hard * (hard * hard - 1) - force) / (0.5 * (3 * hard * hard - 1));
    way_ = soft - 1 + (cubes - 1) * (hard - 1);
    const double green = 0.5 * (soft * soft - 1);
    energy_ = 0.5 * 0.5 * green * green;
  }
  static constexpr double kLimit = 1e-3;
  /// The way of the right end, at which the soft element is strained to the limit; St. Venant and Kirchhoff: P = E l
  /// (l^2 - 1) / 2 with the stretch l is the same in all elements.
  [[nodiscard]] double way() const { return way_; }
  [[nodiscard]] double energy() const { return energy_; }  ///< of strain in the soft element there
  [[nodiscard]] std::string text(const std::string& motion, const std::string& rest) const {
    return fmt::format(
        "[bodies.bar]\ntype = \"solid\"\nmesh = {{ file = \"{}/bar.inp\" }}\nhex8 = \"full\"\n"
        "material = {{ young = 1, density = 1 }}\nmaterials = {{ SOFT = {{ young = 0.5, density = 1 }} }}\n"
        "erosion = {{ strain = {} }}\n[supports]\nleft = {{ body = \"bar\", face = \"x0\", hold = \"all\" }}\n"
        "right = {{ body = \"bar\", face = \"x1\", motion = {{ x = \"{}\", y = 0, z = 0 }} }}\n"
        "[markers.tip]\nbody = \"bar\"\nnode = {}\n{}",
        folder_.path(), kLimit, motion, 4 * (cubes_ / 2) + 1, rest);
  }

 private:
  ScratchFolder folder_;
  int cubes_;
  double way_, energy_;
};

SimulationOptions kept(const std::vector<std::string>& quantities) {
  SimulationOptions options;
  options.quantities = quantities;
  options.keep_series = true;
  return options;
}

/// The column of a quantity.
std::vector<double> column(Simulation& run, const std::string& name) {
  const SimulationSeries& s = run.series();
  const auto at = static_cast<std::size_t>(std::find(s.names.begin(), s.names.end(), name) - s.names.begin());
  EXPECT_LT(at, s.names.size()) << name;
  std::vector<double> out;
  for (std::size_t k = 0; k < s.t.size(); ++k) out.push_back(s.values[k * s.names.size() + at]);
  return out;
}

/// The first row with a failed element.
std::size_t first_failed(Simulation& run) {
  const std::vector<double> failed = column(run, "bar.failed_elements");
  return static_cast<std::size_t>(std::find_if(failed.begin(), failed.end(), [](double n) { return n > 0; }) -
                                  failed.begin());
}

// Pulled slowly at constant speed. Waves of the start strain by v / c, 0.2 % of the limit.
TEST(Erosion, ABarFailsWhenTheoryHasIt) {
  const Bar bar(11);
  const double duration = 4000, truth = duration, speed = bar.way() / duration;
  std::vector<double> found;
  for (const int steps : {200, 400}) {
    const double step = duration / steps;
    Simulation run = simulated(bar.text(fmt::format("{:.17g}*t", speed),
                                        fmt::format("[integrator]\nmethod = \"generalized-alpha\"\nspectral_radius = "
                                                    "0\nstep = {}\nend = {}\n",
                                                    step, 1.05 * duration)),
                               kept({"bar.failed_elements"}));
    const std::size_t row = first_failed(run);
    ASSERT_LT(row, run.series().t.size());
    found.push_back(run.series().t[row]);
    EXPECT_GT(found.back(), 0.996 * truth);
    EXPECT_LT(found.back(), 1.004 * truth + step);
    EXPECT_EQ(run.value("bar.failed_elements"), 1);
    const std::vector<std::string>& notices = run.summary().notices;
    const std::string says = "'bar': 1 of 11 elements failed, the first, element 6, at t = ";
    EXPECT_TRUE(std::any_of(notices.begin(), notices.end(),
                            [&](const std::string& n) { return n.find(says) != std::string::npos; }));
  }
  EXPECT_LE(std::abs(found[0] - found[1]), duration / 200);
}

/// The angular frequency at which a signal of even steps is strongest, near a guess; Hann's window.
double strongest(const std::vector<double>& signal, double step, double guess) {
  double mean = 0;
  for (const double x : signal) mean += x / static_cast<double>(signal.size());
  const auto power = [&](double omega) {
    std::complex<double> sum = 0;
    for (std::size_t k = 0; k < signal.size(); ++k) {
      const double window =
          1 - std::cos(2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(signal.size()));
      sum += window * (signal[k] - mean) * std::polar(1.0, -omega * step * static_cast<double>(k));
    }
    return std::norm(sum);
  };
  double best = guess;
  for (double omega = 0.8 * guess; omega < 1.2 * guess; omega += 1e-4 * guess)
    if (power(omega) > power(best)) best = omega;
  return best;
}

// Pulled smoothly to the limit, from 99 % of it at rest. The left half then is a bar held at one end, of length l = 10,
// with half the mass of the soft element at the other: x tan x = 20 with x = omega l / c.
TEST(Erosion, ReleasedEndsVibrateAsFreeBars) {
  const Bar bar(21);
  const double rise = 840, step = 0.5, before = 0.99 * bar.way(), more = 0.02 * bar.way();
  double x = 1.5;
  for (int k = 0; k < 50; ++k) x = std::atan(20 / x);
  for (const char* method : {"method = \"generalized-alpha\"\nspectral_radius = 1\nstep = 0.5\n",
                             "relative = 1e-7\nabsolute = 1e-9\nmax_step = 1\n"}) {
    const std::string text =
        bar.text(fmt::format("{0:.17g}+{1:.17g}*(t/{2})^2*(3-2*t/{2})", before, more, rise),
                 fmt::format("[initial]\nstatics = true\n[integrator]\nend = {}\n{}", rise, method));
    Simulation whole(kept({"bar.failed_elements", "energy.total", "energy.failed", "tip.position.x"}));
    ASSERT_TRUE(whole.load_text(text, "m.toml").ok());
    const Status status = whole.run();
    ASSERT_TRUE(status.ok()) << status.message;
    const std::size_t row = first_failed(whole);
    ASSERT_LT(row, whole.series().t.size());
    EXPECT_NEAR(whole.series().t[row], 0.5 * rise, 0.02 * rise);
    EXPECT_EQ(whole.value("bar.failed_elements"), 1);
    // What the element held is lost, and nothing else. The support works by P v h in a step.
    const std::vector<double> energy = column(whole, "energy.total"), failed = column(whole, "energy.failed");
    EXPECT_NEAR(failed[row], bar.energy(), 0.01 * bar.energy());
    EXPECT_EQ(failed[row - 1], 0);
    const double work = 0.5 * Bar::kLimit * 1.5 * more / rise * (whole.series().t[row] - whole.series().t[row - 1]);
    EXPECT_NEAR(energy[row] + failed[row], energy[row - 1] + work, 1e-3 * work + 1e-5 * energy[row]);
    // Even samples of the left end.
    Simulation even;
    ASSERT_TRUE(even.load_text(text, "m.toml").ok());
    const double begin = whole.series().t[row] + step;
    ASSERT_TRUE(even.step_to(begin).ok());
    std::vector<double> signal;
    for (double t = begin; t < begin + 300; t += step) {
      ASSERT_TRUE(even.step_to(t).ok());
      signal.push_back(even.value("tip.position.x"));
    }
    EXPECT_NEAR(strongest(signal, step, x / 10), x / 10, 0.01 * x / 10) << method;
  }
}

/// Meshes of all shapes that are simulated: cells of a block are cut into elements.
class CutBlock {
 public:
  /// @param corners  4: tetrahedra, 6: wedges
  CutBlock(int corners, bool second_order) : second_(second_order) {
    for (int z = 0; z <= 2; ++z)
      for (int y = 0; y <= 2; ++y)
        for (int x = 0; x <= 4; ++x) node({1.0 * x, 1.1 * y, 0.9 * z});
    text_ =
        fmt::format("*ELEMENT, TYPE={}\n", corners == 4 ? (second_ ? "C3D10" : "C3D4") : (second_ ? "C3D15" : "C3D6"));
    for (int z = 0; z < 2; ++z)
      for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 4; ++x) {
          const auto at = [&](int i, int j, int k) { return (z + k) * 15 + (y + j) * 5 + x + i + 1; };
          const int c[8] = {at(0, 0, 0), at(1, 0, 0), at(1, 1, 0), at(0, 1, 0),
                            at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)};
          if (corners == 6) {
            add({c[0], c[1], c[2], c[4], c[5], c[6]});
            add({c[0], c[2], c[3], c[4], c[6], c[7]});
          } else {  // Kuhn's six around the diagonal 0-6
            for (const auto& [a, b] : {std::pair{1, 2}, {2, 3}, {3, 7}, {7, 4}, {4, 5}, {5, 1}})
              add({c[0], c[a], c[b], c[6]});
          }
        }
  }
  [[nodiscard]] std::string text() const {
    std::string all = "*NODE\n";
    for (std::size_t k = 0; k < nodes_.size(); ++k)
      all += fmt::format("{},{},{},{}\n", k + 1, nodes_[k][0], nodes_[k][1], nodes_[k][2]);
    return all + text_;
  }

 private:
  int node(const std::array<double, 3>& x) {
    nodes_.push_back(x);
    return static_cast<int>(nodes_.size());
  }
  int middle(int a, int b) {
    const auto [it, fresh] = middles_.try_emplace(std::minmax(a, b), 0);
    if (fresh) {
      const auto &p = nodes_[static_cast<std::size_t>(a - 1)], &q = nodes_[static_cast<std::size_t>(b - 1)];
      it->second = node({0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), 0.5 * (p[2] + q[2])});
    }
    return it->second;
  }
  void add(std::vector<int> corners) {
    using Edges = std::vector<std::pair<int, int>>;
    const Edges edges = corners.size() == 4
                            ? Edges{{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}
                            : Edges{{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}};
    std::vector<int> all = corners;
    for (const auto& [a, b] : edges)
      if (second_) all.push_back(middle(corners[static_cast<std::size_t>(a)], corners[static_cast<std::size_t>(b)]));
    text_ += fmt::format("{}", ++elements_);
    for (const int n : all) text_ += fmt::format(",{}", n);
    text_ += "\n";
  }

  bool second_;
  std::vector<std::array<double, 3>> nodes_;
  std::map<std::pair<int, int>, int> middles_;
  std::string text_;
  int elements_ = 0;
};

const std::string kMaterial =
    "material = { young = 3, poisson = 0.3, density = 2 }\nerosion = { strain = 0.05 }\n[integrator]\nend = 1\n";

struct Kind {
  const char* name;
  std::string mesh;  // of a table
  int corners = 0;   // of those that are cut
  bool second = false;
  friend void PrintTo(const Kind& p, std::ostream* out) { *out << p.name; }
};

std::vector<Kind> all_kinds() {
  const std::string block = "part = \"block\", lx = 4, ly = 2.2, lz = 1.8, divisions = [4, 2, 2]";
  return {{"hex8", block},   {"hex20", block + ", element = \"hex20\""},
          {"tet4", "", 4},   {"tet10", "", 4, true},
          {"wedge6", "", 6}, {"wedge15", "", 6, true}};
}

class ErosionOf : public testing::TestWithParam<Kind> {
 protected:
  void SetUp() override {
    const Kind& kind = GetParam();
    std::string mesh = kind.mesh;
    if (kind.corners > 0) {
      std::ofstream(folder_.path() + "/mesh.inp") << CutBlock(kind.corners, kind.second).text();
      mesh = fmt::format("file = \"{}/mesh.inp\"", folder_.path());
    }
    mechanism_ =
        built(fmt::format("gravity = [0, 0, -3]\n[bodies.b]\ntype = \"solid\"\nmesh = {{ {} }}\n{}", mesh, kMaterial));
    body_ = mechanism_->bodies.front().flexible;
    // Stretched by a tenth where x is large, and a little beside that.
    state_ = anywhere(*mechanism_, 17, 1e-3);
    double low = 1e9, high = -1e9;
    for (Index k = 0; k < body_->nodes(); ++k) {
      low = std::min(low, body_->reference()[3 * at(k)]);
      high = std::max(high, body_->reference()[3 * at(k)]);
    }
    for (Index k = 0; k < body_->nodes(); ++k)
      state_.q[at(body_->configuration(k))] += 0.1 * std::max(0.0, body_->reference()[3 * at(k)] - 0.5 * (low + high));
  }
  ScratchFolder folder_;
  std::unique_ptr<model::Mechanism> mechanism_;
  FlexibleBody* body_ = nullptr;
  State state_;
};

// Momenta stay as they are to rounding; the energy that is lost is said; what is left has the pattern and the
// derivatives that it should have.
TEST_P(ErosionOf, KeepsMomentaAndDerivatives) {
  model::Erosion& erosion = *mechanism_->erosion;
  Equations equations(mechanism_->system, {}, mechanism_->step_pool);
  ASSERT_TRUE(erosion.find_failing(state_));
  const MassProperties before = body_->mass_properties(state_.q, state_.v);
  const Energy energy = mechanism_->system.energy(state_.view());
  const Offset entries = mechanism_->system.tangent_pattern().nonzeros();
  const std::uint64_t version = mechanism_->system.pattern_version();
  erosion.fail(equations, state_);
  EXPECT_FALSE(erosion.find_failing(state_));
  const auto elements = static_cast<double>(body_->assembly().elements());
  EXPECT_EQ(*erosion.failed_elements("b"), 0.5 * elements);
  const MassProperties after = body_->mass_properties(state_.q, state_.v);
  EXPECT_NEAR(after.mass, before.mass, 1e-13 * before.mass);
  const double size = before.mass;  // velocities up to 1, arms of a few
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(after.momentum[i], before.momentum[i], 1e-12 * size);
    EXPECT_NEAR(after.angular_momentum[i], before.angular_momentum[i], 1e-11 * size);
  }
  const Energy left = mechanism_->system.energy(state_.view());
  EXPECT_NEAR(erosion.lost_energy(), energy.total() - left.total(), 1e-12 * std::abs(energy.total()));
  EXPECT_LT(left.potential, energy.potential);
  // Pairs of nodes of elements that have not failed, and each node with itself.
  std::set<std::pair<Index, Index>> pairs;
  for (Index v = 0; v < body_->vertices(); ++v) pairs.insert({v, v});
  Index number = 0;
  body_->assembly().for_each_group([&](const ElementGroup& group, std::span<const Index>) {
    for (Index e = 0; e < group.count(); ++e, ++number)
      for (const Index a : group.vertices(e))
        for (const Index b : group.vertices(e))
          if (body_->assembly().failed()[at(number)] == 0) pairs.insert({a, b});
  });
  EXPECT_EQ(mechanism_->system.tangent_pattern().nonzeros(), 9 * static_cast<Offset>(pairs.size()));
  EXPECT_LT(mechanism_->system.tangent_pattern().nonzeros(), entries);
  EXPECT_GT(mechanism_->system.pattern_version(), version);
  const JacobianCheck check = check_jacobians(mechanism_->system, state_);
  EXPECT_LT(check.largest(), 1e-6) << check.worst;
}

// Nodes that have none but failed elements fall freely.
TEST_P(ErosionOf, FreeNodesFall) {
  Equations equations(mechanism_->system, {}, mechanism_->step_pool);
  ASSERT_TRUE(mechanism_->erosion->find_failing(state_));
  mechanism_->erosion->fail(equations, state_);
  make_consistent(equations, state_);
  Index free = 0;
  const VertexPattern& pattern = body_->assembly().pattern();
  for (Index v = 0; v < body_->vertices(); ++v) {
    if (pattern.ptr[at(v) + 1] - pattern.ptr[at(v)] > 1) continue;
    ++free;
    const double* a = &state_.a[at(body_->coordinate(v))];
    EXPECT_NEAR(a[0], 0, 1e-12);
    EXPECT_NEAR(a[1], 0, 1e-12);
    EXPECT_NEAR(a[2], -3, 1e-12);
  }
  EXPECT_GE(free, 9);  // those of the last section
}

// What was saved comes back in another mechanism, with the same bits of forces and tangents.
TEST_P(ErosionOf, SavedOnesComeBack) {
  Equations equations(mechanism_->system, {}, mechanism_->step_pool);
  ASSERT_TRUE(mechanism_->erosion->find_failing(state_));
  const std::string mesh = GetParam().mesh;
  std::vector<double> none, saved;
  mechanism_->erosion->save(none);
  mechanism_->erosion->fail(equations, state_);
  mechanism_->erosion->save(saved);
  const auto evaluate = [&] {
    std::vector<double> f(state_.v.size());
    mechanism_->system.residual(state_.view(), f);
    std::vector<double> w(static_cast<std::size_t>(mechanism_->system.tangent_pattern().nonzeros()));
    mechanism_->system.tangent(state_.view(), {1, 0.3, 0.2}, w);
    f.insert(f.end(), w.begin(), w.end());
    return f;
  };
  const std::vector<double> with = evaluate();
  ConstSpan rest = none;
  mechanism_->erosion->restore(rest);
  EXPECT_TRUE(rest.empty());
  EXPECT_EQ(*mechanism_->erosion->failed_elements("b"), 0);
  EXPECT_NE(evaluate().size(), with.size());
  rest = saved;
  mechanism_->erosion->restore(rest);
  EXPECT_TRUE(rest.empty());
  EXPECT_EQ(evaluate(), with);
  for (std::size_t size = 0; size < saved.size(); ++size) {
    rest = ConstSpan(saved).first(size);
    EXPECT_THROW(mechanism_->erosion->restore(rest), Error) << size;
  }
  for (const std::size_t k : {1U, 5U})
    for (const double wrong : {-1.0, 1e9, 0.5, std::nan("")}) {
      std::vector<double> damaged = saved;
      damaged[k] = wrong;
      rest = damaged;
      EXPECT_THROW(mechanism_->erosion->restore(rest), Error) << k << " " << wrong;
    }
}

// The triangles of the page that are seen enclose the elements that have not failed: the volume is that of the block,
// and of half of it from then on.
TEST_P(ErosionOf, SeenFacesEncloseWhatIsLeft) {
  State start(mechanism_->system.sizes());
  mechanism_->system.initial(start.q, start.v);
  page::Drawn drawn(*mechanism_);
  page::Drawn::Place place;
  drawn.place(start, place);
  const std::vector<double> x = drawn.all_points(place);
  const auto point = [&](Index k) { return Eigen::Map<const Vec3>(&x[3 * at(k)]); };
  const auto volume = [&](double t) {
    const std::vector<double> times = page::times_of_triangles(*mechanism_, drawn);
    EXPECT_EQ(times.size(), 2 * drawn.triangles().size());
    double sum = 0;
    for (std::size_t k = 0; k < drawn.triangles().size(); ++k) {
      const auto& [a, b, c] = drawn.triangles()[k];
      if (times[2 * k] <= t && t < times[2 * k + 1]) sum += point(a).dot(point(b).cross(point(c))) / 6;
    }
    return sum;
  };
  const double whole = 4 * 2.2 * 1.8;
  EXPECT_NEAR(volume(0), whole, 1e-12 * whole);
  Equations equations(mechanism_->system, {}, mechanism_->step_pool);
  ASSERT_TRUE(mechanism_->erosion->find_failing(state_));
  mechanism_->erosion->fail(equations, state_);
  EXPECT_NEAR(volume(0.99 * state_.t), whole, 1e-12 * whole);
  EXPECT_NEAR(volume(state_.t), 0.5 * whole, 1e-12 * whole);
}

INSTANTIATE_TEST_SUITE_P(Erosion, ErosionOf, testing::ValuesIn(all_kinds()),
                         [](const auto& each) { return std::string(each.param.name); });

// The bar without its middle element is the bar of the set REST: the same forces, but for masses.
TEST(Erosion, WhatIsLeftIsTheBodyWithoutIt) {
  ScratchFolder folder;
  std::ofstream(folder.path() + "/bar.inp") << bar_mesh(5);
  const auto body = [&](const std::string& more) {
    return built(
        fmt::format("[bodies.b]\ntype = \"solid\"\nmesh = {{ file = \"{}/bar.inp\" }}\n{}material = {{ young = "
                    "3, poisson = 0.3, density = 2 }}\n[integrator]\nend = 1\n",
                    folder.path(), more));
  };
  const auto eroded = body("erosion = { strain = 10 }\n"), without = body("element_set = \"REST\"\n");
  FlexibleBody& b = *eroded->bodies.front().flexible;
  std::vector<char> failed(5, 0);
  failed[static_cast<std::size_t>(b.assembly().numbers_by_label().at(3))] = 1;
  b.set_failed(failed);
  eroded->system.finish();
  State s = anywhere(*eroded, 3, 0.05);
  std::fill(s.v.begin(), s.v.end(), 0.0);
  std::fill(s.a.begin(), s.a.end(), 0.0);
  std::vector<double> f(s.v.size()), truth(s.v.size());
  eroded->system.residual(s.view(), f);
  without->system.residual(s.view(), truth);
  EXPECT_EQ(f, truth);
  ASSERT_EQ(eroded->system.tangent_pattern().ind, without->system.tangent_pattern().ind);
  std::vector<double> w(static_cast<std::size_t>(without->system.tangent_pattern().nonzeros())), of_truth = w;
  eroded->system.tangent(s.view(), {0, 0, 1}, w);
  without->system.tangent(s.view(), {0, 0, 1}, of_truth);
  EXPECT_EQ(w, of_truth);
  // Stresses at nodes are means of what is left; of nodes between both, at the ends, of the whole.
  for (const char* name : {"b[node 13].stress.xx", "b[node 9].strain.xy", "b[node 1].stress.von_mises",
                           "b.stress.von_mises.max", "b.strain_energy"}) {
    const model::Sample sample{&s, {}}, of_without{&s, {}};
    const double x = model::find_quantities(*eroded, name, {}).front().value(sample);
    const double y = model::find_quantities(*without, name, {}).front().value(of_without);
    EXPECT_NEAR(x, y, 1e-13 * std::abs(y)) << name;
    EXPECT_NE(y, 0) << name;
  }
}

// Pressure goes with the element that it stands on.
TEST(Erosion, NothingPressesOnWhatIsGone) {
  const auto m = built(
      "[bodies.b]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 2, ly = 1, lz = 1, divisions = [2, 1, 1] "
      "}\nmaterial = "
      "{ young = 3, density = 2 }\nerosion = { stress = 1 }\n[forces.p]\ntype = \"pressure\"\nbody = \"b\"\nface = "
      "\"x1\"\npressure = 2\n[integrator]\nend = 1\n");
  FlexibleBody& b = *m->bodies.front().flexible;
  State s(m->system.sizes());
  m->system.initial(s.q, s.v);
  std::vector<double> f(s.v.size());
  const auto along = [&] {
    m->system.residual(s.view(), f);
    double sum = 0;
    for (Index k = 0; k < b.nodes(); ++k) sum += f[at(b.coordinate(k))];
    return sum;
  };
  EXPECT_NEAR(std::abs(along()), 2, 1e-14);
  b.set_failed({1, 0});
  m->system.finish();
  EXPECT_NEAR(std::abs(along()), 2, 1e-14);
  b.set_failed({0, 1});
  m->system.finish();
  EXPECT_EQ(along(), 0);
}

/// A block that spins itself to pieces, with a rigid one beside it and an event when something has failed.
const std::string kWheel =
    "[bodies.wheel]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 6, ly = 2, lz = 1, divisions = [12, 4, 2] }\n"
    "velocity = [0.3, -0.9, 0]\nangular_velocity = [0, 0, 0.3]\nmaterial = { young = 10, poisson = 0.3, density = 1 }\n"
    "erosion = { strain = 0.045, stress = 5, principal_stress = 3 }\n"
    "[bodies.other]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 2, ly = 1, lz = 1, divisions = [2, 1, 1] }\n"
    "position = [0, 9, 0]\nmaterial = { young = 10, density = 1 }\nerosion = { stress = 100 }\n"
    "[events.broken]\nwhen = \"wheel.failed_elements >= 1\"\nonce = true\n";
const std::string kAlpha =
    "[integrator]\nmethod = \"generalized-alpha\"\nspectral_radius = 0.8\nstep = 0.05\nend = 8\n";
const std::vector<std::string> kOfWheel = {"wheel.failed_elements", "wheel.momentum.x",      "wheel.angular_momentum.z",
                                           "energy.failed",         "other.failed_elements", "wheel.position.y"};

TEST(Erosion, BitsDoNotDependOnThreads) {
  for (const std::string& integrator :
       {kAlpha, std::string("[integrator]\nend = 8\nrelative = 1e-5\nabsolute = 1e-6\n")}) {
    std::vector<double> truth;
    for (const char* threads : {"1", "2", "7"}) {
      SimulationOptions options = kept(kOfWheel);
      options.solver = {{"threads", threads}};
      Simulation run = simulated(kWheel + integrator, options);
      EXPECT_GT(run.value("wheel.failed_elements"), 3);
      EXPECT_EQ(run.value("other.failed_elements"), 0);
      EXPECT_EQ(run.summary().event_count, 1);
      EXPECT_GT(run.summary().followed, 0);  // the analysis of Newton's matrix kept what had not changed
      EXPECT_NEAR(run.value("wheel.momentum.x"), 0, 1e-6);
      if (truth.empty()) truth = run.series().values;
      EXPECT_EQ(run.series().values, truth) << threads;
    }
  }
}

// Killed before, between and after failures, a run goes on with the same bits.
TEST(Erosion, RestartedRunsHaveTheSameBits) {
  for (const std::string& integrator :
       {kAlpha, std::string("[integrator]\nend = 8\nrelative = 1e-5\nabsolute = 1e-6\n")}) {
    Simulation first(kept(kOfWheel));
    ASSERT_TRUE(first.load_text(kWheel + integrator, "m.toml").ok());
    for (const double t : {1.0, 4.0, 6.0}) {
      ASSERT_TRUE(first.step_to(t).ok());
      const std::string state = first.save();
      Simulation second(kept(kOfWheel));
      ASSERT_TRUE(second.load_text(kWheel + integrator, "m.toml").ok());
      ASSERT_TRUE(second.restore(state).ok());
      ASSERT_TRUE(second.step_to(t + 1).ok());
      ASSERT_TRUE(first.step_to(t + 1).ok());
      for (const std::string& name : kOfWheel) EXPECT_EQ(second.value(name), first.value(name)) << name << " " << t;
    }
    EXPECT_GT(first.value("wheel.failed_elements"), 0);
  }
}

// Files say which cells have failed, and bodies without the table say nothing.
TEST(Erosion, ResultFilesShowWhatHasFailed) {
  ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path();
  const Simulation run = simulated(kWheel + kAlpha + "[output]\nvtu_interval = 4\nformat = \"vtu\"\n", options);
  const std::string csv = content_of(folder.path() + "/quantities.csv");
  EXPECT_NE(csv.find("energy.failed"), std::string::npos);
  std::size_t files = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder.path())) {
    if (file.path().extension() != ".vtu") continue;
    ++files;
    EXPECT_NE(content_of(file.path().string()).find("Name=\"failed\""), std::string::npos);
  }
  EXPECT_GE(files, 3U);
}

TEST(Erosion, MistakesSayWhatToDo) {
  const std::string body =
      "[bodies.b]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 1, ly = 1, lz = 1, divisions = [1, 1, 1] "
      "}\nmaterial = { young = 1, density = 1 }\n";
  const std::string run = "[integrator]\nend = 1\n";
  const std::string good = "erosion = { strain = 0.1 }\n";
  const std::vector<Mistake> mistakes = {
      {"none", body + "erosion = {}\n" + run, {"m.toml:", "bodies.b.erosion", "needs a limit"}},
      {"negative", body + "erosion = { strain = -0.1 }\n" + run, {"bodies.b.erosion.strain"}},
      {"zero", body + "erosion = { stress = 0 }\n" + run, {"bodies.b.erosion.stress"}},
      {"nan", body + "erosion = { principal_stress = nan }\n" + run, {"bodies.b.erosion.principal_stress"}},
      {"text", body + "erosion = { strain = \"much\" }\n" + run, {"bodies.b.erosion.strain"}},
      {"unknown", body + "erosion = { strian = 0.1 }\n" + run, {"strian", "strain"}},
      {"number", body + "erosion = 0.1\n" + run, {"bodies.b.erosion"}},
      {"statics", body + good + "[statics]\n", {"bodies.b.erosion", "[integrator]"}},
      {"reduced", body + good + "reduce = { modes = 3 }\n" + run, {"bodies.b.erosion", "reduce"}},
      {"ratio", body + good + "damping = { ratio = 0.02 }\n" + run, {"bodies.b.erosion", "frequencies"}},
      {"contact", body + good + "[surfaces.s]\nbody = \"b\"\nshape = \"faces\"\n" + run, {"surfaces.s", "erosion"}},
      {"beam",
       "[bodies.b]\ntype = \"beam\"\nstart = [0, 0, 0]\nend = [1, 0, 0]\nradius = 0.1\nmaterial = { young = 1, density "
       "= 1 }\n" +
           good + run,
       {"erosion"}}};
  for (const SensitivityMethod method : {SensitivityMethod::forward, SensitivityMethod::adjoint}) {
    SimulationOptions options;
    options.quantities = {"b.position.x"};
    const SensitivityResult r =
        sensitivities_of_text(body + good + run, "m.toml", {{"bodies.b.erosion.strain"}}, options, method);
    EXPECT_EQ(r.status.code, StatusCode::invalid_input);
    EXPECT_NE(r.status.message.find("bodies.b.erosion"), std::string::npos) << r.status.message;
  }
  for (const Mistake& m : mistakes) {
    Simulation s;
    const Status status = s.load_text(m.text, "m.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << m.name;
    for (const std::string& part : m.says)
      EXPECT_NE(status.message.find(part), std::string::npos) << m.name << ": " << part << " in: " << status.message;
  }
}

}  // namespace erosion_test
}  // namespace espalier::dynamics
