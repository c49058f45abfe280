// Flexible bodies divided among GPUs. Truth: the undivided body.
#include "dynamics/device/body_parts.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/at.hpp"
#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/device/device_common.hpp"
#include "dynamics/device/emulated_device.hpp"

namespace espalier::dynamics {
namespace body_parts_test {

/// The crank of a small engine, of hexahedra, with its tables.
struct Crank {
  std::unique_ptr<model::Mechanism> mechanism = test::built_from("engine.toml", {"parameters.unknowns=1000"}, 1);
  FlexibleBody* body = nullptr;
  DeviceBodyTables tables;
  Crank() {
    for (const auto& c : mechanism->system.components())
      if (auto* b = dynamic_cast<FlexibleBody*>(c.get()); b != nullptr && body == nullptr) body = b;
    body->assembly().for_each_group([&](const ElementGroup& group, std::span<const Index> vertices) {
      tables.groups.push_back({*group.device_law(), group.vertices_per_element(), {vertices.begin(), vertices.end()}});
    });
    tables.first = body->placement().v;
    tables.reference = body->reference();
    tables.pattern = &body->assembly().pattern();
    tables.mass = body->mass();
    weight.resize(body->reference().size());
    for (std::size_t i = 0; i < weight.size(); ++i) weight[i] = static_cast<double>(i);
    tables.weight = weight;
  }
  std::vector<double> weight;
};

std::vector<Index> in_pieces(Index vertices, Index piece, Index places) {
  std::vector<Index> place(at(vertices));
  for (Index v = 0; v < vertices; ++v) place[at(v)] = v / piece % places;
  return place;
}

TEST(BodyParts, EveryVertexAndColumnIsOwnedOnce) {
  const Crank crank;
  const Index vertices = crank.tables.vertices();
  for (const Index piece : {Index{1}, Index{7}, vertices}) {
    SCOPED_TRACE(piece);
    const std::vector<Index> place = in_pieces(vertices, piece, 3);
    const std::vector<BodySubdomain> parts = divide_body(crank.tables, place);
    EXPECT_EQ(parts.size(), piece == vertices ? 1U : 3U);
    std::multiset<Index> owned;
    std::multiset<Offset> entries;
    for (const BodySubdomain& part : parts) {
      EXPECT_TRUE(std::is_sorted(part.vertices.begin(), part.vertices.end()));
      for (const Index c : part.own) {
        owned.insert(part.vertices[at(c)]);
        EXPECT_EQ(place[at(part.vertices[at(c)])], part.place);
      }
      entries.insert(part.entries.begin(), part.entries.end());
    }
    EXPECT_EQ(owned.size(), at(vertices));
    EXPECT_EQ(std::set<Index>(owned.begin(), owned.end()).size(), at(vertices));
    EXPECT_EQ(entries.size(), crank.tables.pattern->ind.size());
    EXPECT_EQ(std::set<Offset>(entries.begin(), entries.end()).size(), crank.tables.pattern->ind.size());
  }
}

TEST(BodyParts, HaveAllElementsAroundTheirVertices) {
  const Crank crank;
  const std::vector<Index> place = in_pieces(crank.tables.vertices(), 11, 4);
  for (const BodySubdomain& part : divide_body(crank.tables, place)) {
    std::vector<Index> expected;
    Index number = 0;
    for (const DeviceElements& group : crank.tables.groups)
      for (Index e = 0; e < group.elements(); ++e, ++number) {
        const auto nodes = group.vertices.begin() + Offset{e} * group.nodes;
        if (std::any_of(nodes, nodes + group.nodes, [&](Index v) { return place[at(v)] == part.place; }))
          expected.push_back(number);
      }
    EXPECT_EQ(part.elements, expected);
    EXPECT_EQ(part.tables().elements(), static_cast<Index>(expected.size()));
  }
}

TEST(BodyParts, TablesAreThoseOfTheBody) {
  const Crank crank;
  const DeviceBodyTables& body = crank.tables;
  for (const BodySubdomain& part : divide_body(body, in_pieces(body.vertices(), 5, 2))) {
    const DeviceBodyTables own = part.tables();
    for (std::size_t c = 0; c < part.vertices.size(); ++c)
      for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(own.reference[3 * c + i], body.reference[3 * at(part.vertices[c]) + i]);
        EXPECT_EQ(own.weight[3 * c + i], body.weight[3 * at(part.vertices[c]) + i]);
      }
    for (std::size_t e = 0; e < part.entries.size(); ++e) {
      EXPECT_EQ(part.vertices[at(own.pattern->ind[e])], body.pattern->ind[at(part.entries[e])]);
      EXPECT_EQ(own.mass[e], body.mass[at(part.entries[e])]);
    }
    Index next = 0, first = 0;
    auto group = own.groups.begin();
    for (const DeviceElements& of_body : body.groups) {
      const Index last = first + of_body.elements();
      Index taken = 0;
      for (; at(next) < part.elements.size() && part.elements[at(next)] < last; ++next, ++taken)
        for (Index a = 0; a < of_body.nodes; ++a)
          EXPECT_EQ(part.vertices[at(group->vertices[at(taken * of_body.nodes + a)])],
                    of_body.vertices[at((part.elements[at(next)] - first) * of_body.nodes + a)]);
      if (taken > 0) ++group;
      first = last;
    }
    EXPECT_EQ(group, own.groups.end());
  }
}

/// A body on several GPUs whose parts say which element is turned inside out.
class NamingBody final : public DeviceBody {
 public:
  explicit NamingBody(Offset inverted) : inverted_(inverted) {}
  void bind(std::span<const Offset>, std::span<const std::int32_t>) override {}
  void start_forces(const BodyState&) override {}
  Offset finish_forces(double, const double*, double*) override { return inverted_; }
  void put_forces(double, double*) override {}
  void start_tangent(const BodyState&, const TangentWeights&, double*) override {}
  Offset finish() override { return inverted_; }

 private:
  Offset inverted_;
};

TEST(BodyParts, TheFirstInvertedElementIsNamedByItsNumberInTheBody) {
  const Crank crank;
  const Index unknowns = crank.mechanism->system.sizes().velocity;
  std::vector<Index> named;
  const auto divided =
      make_divided_body(crank.tables, test::dealt({0, 1, 2}, unknowns), 0, nullptr, [&](const BodySubdomain& part) {
        const Index number = part.place == 0 ? -1 : 3;
        if (number >= 0) named.push_back(part.elements[at(number)]);
        return SubdomainOnGpu{std::make_unique<NamingBody>(number), std::make_unique<test::EmulatedCarrier>(part),
                              part.place == 0};
      });
  ASSERT_NE(divided, nullptr);
  ASSERT_EQ(named.size(), 2U);
  std::vector<double> f(crank.tables.reference.size());
  EXPECT_EQ(divided->finish_forces(0, crank.weight.data(), f.data()), std::min(named[0], named[1]));
  EXPECT_EQ(divided->finish(), std::min(named[0], named[1]));
}

TEST(BodyParts, SmallBodiesAndThoseOfOneGpuStayWhole) {
  const Crank crank;
  const Index unknowns = crank.mechanism->system.sizes().velocity;
  const auto never = [](const BodySubdomain&) -> SubdomainOnGpu { throw std::logic_error("divided"); };
  const auto divided = [&](const GpuPlaces& places, Index fewest) {
    return make_divided_body(crank.tables, places, fewest, nullptr, never) != nullptr;
  };
  EXPECT_FALSE(divided(test::dealt({0, 1}, unknowns), crank.tables.elements() + 1));
  EXPECT_FALSE(divided(test::dealt({0}, unknowns), 0));
  EXPECT_FALSE(divided({{0, 1}, {}}, 0));
  EXPECT_FALSE(divided({{0, 1}, std::vector<Index>(at(unknowns), 0)}, 0));
  EXPECT_THROW((void)divided(test::dealt({0, 1}, unknowns), crank.tables.elements()), std::logic_error);
}

}  // namespace body_parts_test
}  // namespace espalier::dynamics
