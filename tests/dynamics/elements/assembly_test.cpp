// Assembly by position. Truth: a loop over elements in the order of the mesh that adds what each gives, bit by bit.
#include "dynamics/elements/assembly.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

namespace espalier::dynamics::test {
namespace {

struct Kind {
  Index count;
  int vertices, lanes;
  bool folded = false;
};

/// Made-up elements: what they give depends on the position of their first vertex alone. Where that lies beyond 2,
/// they are inside out. Folded ones name vertices twice and give whole numbers, whose sums have no order.
class MadeUpGroup final : public ElementGroup {
 public:
  MadeUpGroup(const Kind& kind, Index of_body, unsigned seed)
      : n_(kind.vertices), lanes_(kind.lanes), folded_(kind.folded) {
    std::mt19937 generator(seed);
    std::uniform_int_distribution<Index> near(0, std::min<Index>(40, of_body - 1));
    for (Index e = 0; e < kind.count; ++e)
      for (int a = 0; a < n_;) {  // neighbours have vertices in common
        const Index v = (static_cast<Index>(std::int64_t{e} * of_body / kind.count) + near(generator)) % of_body;
        if (!folded_ && std::find(vertex_.end() - a, vertex_.end(), v) != vertex_.end()) continue;
        vertex_.push_back(v);
        ++a;
      }
  }
  [[nodiscard]] double number(double x, int k) const {
    const double value = std::sin(x * (k + 1));
    return folded_ ? std::round(1000 * value) : value;
  }
  [[nodiscard]] double tangent(double x, int row, int column, bool symmetric) const {
    const bool turn = symmetric && row > column;
    return number(x, 1000 + (turn ? row * 3 * n_ + column : column * 3 * n_ + row));
  }
  [[nodiscard]] Index count() const override { return static_cast<Index>(vertex_.size()) / n_; }
  [[nodiscard]] int vertices_per_element() const override { return n_; }
  [[nodiscard]] std::span<const Index> vertices(Index e) const override {
    return std::span(vertex_).subspan(static_cast<std::size_t>(e * n_), static_cast<std::size_t>(n_));
  }
  [[nodiscard]] int width() const override { return lanes_; }
  [[nodiscard]] bool evaluate(Index, const ElementInput& in, ElementOutput& out) const override {
    const BlockInput block{in.reference, in.position, in.velocity, in.damping, in.position_weight, in.velocity_weight};
    return evaluate_block(block, {out.force, out.tangent, &out.energy}) != 0;
  }
  [[nodiscard]] unsigned evaluate_block(const BlockInput& in, const BlockOutput& out) const override {
    unsigned whole = 0;
    for (int l = 0; l < lanes_; ++l) {
      const double x = in.position[l];
      const bool symmetric = in.damping == 0 || in.velocity == nullptr;
      if (x < 2) whole |= 1U << l;
      out.energy[l] = x;
      for (int k = 0; k < 3 * n_; ++k) out.force[k * lanes_ + l] = number(x, k);
      for (int k = 0; k < 9 * n_ * n_ && out.tangent != nullptr; ++k) {
        const int row = k % (3 * n_), column = k / (3 * n_);
        if (symmetric && row / 3 > column / 3) continue;  // the half that need not be written
        out.tangent[k * lanes_ + l] = tangent(x, row, column, symmetric);
      }
    }
    return whole;
  }
  void mass(Index, const double* reference, double* m) const override {
    for (int k = 0; k < n_ * n_; ++k) m[k] = number(reference[0], std::min(k, k % n_ * n_ + k / n_));
  }

 private:
  int n_, lanes_;
  bool folded_;
  std::vector<Index> vertex_;
};

/// A body of these kinds and the sums of the truth.
struct Body {
  Index vertices;
  std::vector<MadeUpGroup> groups;
  std::vector<double> x;
  Body(Index of_vertices, const std::vector<Kind>& kinds) : vertices(of_vertices) {
    std::mt19937 generator(5);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (Index k = 0; k < 3 * vertices; ++k) x.push_back(uniform(generator));
    unsigned seed = 1;
    for (const Kind& k : kinds) groups.emplace_back(k, vertices, seed++);
  }
  [[nodiscard]] ElementAssembly assembly() const {
    std::vector<std::unique_ptr<ElementGroup>> copies;
    for (const MadeUpGroup& g : groups) copies.push_back(std::make_unique<MadeUpGroup>(g));
    return {vertices, std::move(copies)};
  }
  template <class Visit>
  void visit(const Visit& visit) const {
    for (const MadeUpGroup& g : groups)
      for (Index e = 0; e < g.count(); ++e) visit(g, g.vertices(e), x[static_cast<std::size_t>(3 * g.vertices(e)[0])]);
  }
};

/// A tangent stored by the pattern of vertices alone, three columns of each after one another.
struct Values {
  const VertexPattern& pattern;
  std::vector<Offset> column_start;
  std::vector<std::int32_t> shift;
  std::vector<double> values;
  explicit Values(const VertexPattern& p) : pattern(p), values(9 * p.ind.size(), 0.25) {
    for (Index b = 0; b < p.columns(); ++b) {
      const Offset begin = p.ptr[static_cast<std::size_t>(b)], end = p.ptr[static_cast<std::size_t>(b) + 1];
      for (Offset j = 0; j < 3; ++j) column_start.push_back(9 * begin + 3 * j * (end - begin));
      for (Offset e = begin; e < end; ++e) shift.insert(shift.end(), 3, static_cast<std::int32_t>(3 * (e - begin)));
    }
  }
  [[nodiscard]] BlockTarget target() { return {values.data(), column_start.data(), shift.data()}; }
  [[nodiscard]] double& at(Index row, Index column, int i, int j) {
    return target().place(column, pattern.entry(row, column), j)[i];
  }
};

const std::vector<std::vector<Kind>> kBodies = {
    {{1, 4, 1}}, {{7, 2, 8}}, {{1900, 8, 8}, {300, 4, 4}, {151, 20, 1}}, {{450, 20, 2}}, {{500, 8, 4, true}}};

TEST(Assembly, SumsAreThoseOfALoopOverTheElements) {
  for (const auto& kinds : kBodies)
    for (const bool damped : {false, true})
      for (const int threads : {1, 2, 5}) {
        const Body body(kinds[0].count + 60, kinds);
        ElementAssembly assembly = body.assembly();
        base::ThreadPool pool(threads);
        const AssemblyState state{body.x.data(), body.x.data(), damped ? body.x.data() : nullptr, damped ? 1.0 : 0.0};
        std::vector<double> f(body.x.size(), 0.5), f_truth = f;
        double energy = 3, energy_truth = 0;
        Values k(assembly.pattern()), k_truth(assembly.pattern());
        EXPECT_EQ(assembly.add_forces(&pool, state, f.data(), energy), -1);
        EXPECT_EQ(assembly.add_tangent(&pool, state, 1, 0, k.target()), -1);
        body.visit([&](const MadeUpGroup& g, std::span<const Index> v, double x) {
          energy_truth += x;
          for (std::size_t a = 0; a < v.size(); ++a)
            for (std::size_t i = 0; i < 3; ++i)
              f_truth[3 * static_cast<std::size_t>(v[a]) + i] += g.number(x, static_cast<int>(3 * a + i));
          const int n = static_cast<int>(v.size());
          for (int r = 0; r < 3 * n; ++r)
            for (int c = 0; c < 3 * n; ++c)
              k_truth.at(v[static_cast<std::size_t>(r / 3)], v[static_cast<std::size_t>(c / 3)], r % 3, c % 3) +=
                  g.tangent(x, r, c, !damped);
        });
        EXPECT_EQ(f, f_truth);
        EXPECT_NEAR(energy, 3 + energy_truth, 1e-12 * energy_truth);
        EXPECT_EQ(k.values, k_truth.values);
      }
}

TEST(Assembly, MassIsTheSumOverTheElements) {
  for (const auto& kinds : kBodies) {
    const Body body(kinds[0].count + 60, kinds);
    ElementAssembly assembly = body.assembly();
    std::vector<double> truth(assembly.pattern().ind.size(), 0.0);
    body.visit([&](const MadeUpGroup& g, std::span<const Index> v, double x) {
      std::vector<double> m(v.size() * v.size());
      g.mass(0, &x, m.data());
      for (std::size_t a = 0; a < v.size(); ++a)
        for (std::size_t b = 0; b < v.size(); ++b)
          truth[static_cast<std::size_t>(assembly.pattern().entry(v[a], v[b]))] += m[b * v.size() + a];
    });
    EXPECT_EQ(assembly.mass(body.x.data()), truth);
  }
}

// Truth: elements inside out spoil what they touch, nothing else, and the first of them is named.
TEST(Assembly, ElementsInsideOutSpoilTheirPlacesAlone) {
  Body body(2000, {{1900, 8, 8}, {40, 4, 1}});
  const Index bad = body.groups[0].vertices(700)[0];
  body.x[static_cast<std::size_t>(3 * bad)] = 3;
  ElementAssembly assembly = body.assembly();
  base::ThreadPool pool(3);
  const AssemblyState state{body.x.data(), body.x.data(), nullptr, 0};
  std::vector<double> f(body.x.size(), 0.0);
  double energy = 0;
  Values k(assembly.pattern());
  std::int64_t first = -1, number = 0;
  std::map<Index, bool> spoiled;
  body.visit([&](const MadeUpGroup&, std::span<const Index> v, double x) {
    ++number;
    if (x < 2) return;
    if (first < 0) first = number;
    for (const Index w : v) spoiled[w] = true;
  });
  ASSERT_GT(first, 0);
  EXPECT_EQ(assembly.add_forces(&pool, state, f.data(), energy), first);
  EXPECT_EQ(assembly.add_tangent(&pool, state, 1, 0, k.target()), first);
  EXPECT_TRUE(std::isnan(energy));
  for (Index v = 0; v < body.vertices; ++v) {
    EXPECT_EQ(std::isnan(f[static_cast<std::size_t>(3 * v)]), spoiled.contains(v)) << v;
    EXPECT_EQ(std::isnan(k.at(v, v, 0, 0)), spoiled.contains(v)) << v;
  }
}

TEST(Assembly, RefusesVerticesThatTheBodyHasNot) {
  std::vector<std::unique_ptr<ElementGroup>> groups;
  groups.push_back(std::make_unique<MadeUpGroup>(Kind{10, 4, 1}, 60, 1));
  EXPECT_THROW(ElementAssembly(20, std::move(groups)), std::invalid_argument);
}

}  // namespace
}  // namespace espalier::dynamics::test
