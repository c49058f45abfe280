#include "dynamics/model/build/body_demand.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/memory.hpp"
#include "matrix/file.hpp"

namespace espalier::dynamics::model {
namespace {

/// The size of a body, at least.
struct BodySize {
  double elements = 0, unknowns = 0;
  double bytes = 0;  ///< of one unknown
};

// What a run took beside its factor, over its unknowns: blocks of 8000 x 2 x 2 hex8 and 1500 x 2 x 2 hex20. Rows of
// lines are a third as long.
constexpr double kOfHex8 = 2e3, kOfHex20 = 3.7e3, kOfLine = 7e2;

struct BodySizes {
  BodySize operator()(const SolidSpec& solid) const {
    const auto* part = std::get_if<MesherSpec>(&solid.mesh);
    if (part == nullptr) return {};
    const bool hex20 = part->size.type == ElementType::hex20;
    constexpr int kOfElement8 = 3, kOfElement20 = 12;  // unknowns, inside of a large mesh
    BodySize demand = {0, part->size.unknowns, hex20 ? kOfHex20 : kOfHex8};
    const auto divide = [&](const int(&n)[3], double copies, const std::array<bool, 3>& closed) {
      if (n[0] == 0) return;  // by the number of unknowns
      demand.elements = copies;
      double corners = copies;
      for (std::size_t i = 0; i < 3; ++i) {
        demand.elements *= n[i];
        corners *= n[i] + (closed[i] ? 0 : 1);
      }
      demand.unknowns = hex20 ? kOfElement20 * demand.elements : kOfElement8 * corners;
    };
    if (const auto* b = std::get_if<BlockMesh>(&part->shape)) divide(b->divisions, 1, {});
    if (const auto* t = std::get_if<TyreMesh>(&part->shape)) divide(t->divisions, 1, {true, false, false});
    if (const auto* g = std::get_if<GearMesh>(&part->shape)) divide(g->divisions, g->shape.teeth, {false, true, false});
    if (demand.elements == 0) demand.elements = demand.unknowns / (hex20 ? kOfElement20 : kOfElement8);
    return demand;
  }
  BodySize operator()(const ShellSpec& shell) const {
    if (shell.file) return {};
    const double n = static_cast<double>(shell.nx) * shell.ny;
    return {n, 6 * n, kOfHex8};
  }
  BodySize operator()(const CableSpec& c) const {
    if (c.file) return {};
    return {1.0 * c.elements, 6.0 * c.elements, kOfLine};
  }
  BodySize operator()(const BeamSpec& b) const {
    if (b.file) return {};
    return {1.0 * b.elements, 12.0 * b.elements, kOfLine};
  }
  BodySize operator()(const RigidSpec& /*rigid*/) const { return {}; }
  BodySize operator()(const PointSpec& /*point*/) const { return {}; }
  BodySize operator()(const SubstructureSpec& /*its files have a size*/) const { return {}; }
};

}  // namespace

void MemoryDemand::add(const BodySpec& body) {
  const BodySize demand = std::visit(BodySizes{}, body.shape);
  bytes_ += demand.unknowns * demand.bytes;
  const Offset machine = matrix::machine_memory();
  if (bytes_ <= static_cast<double>(machine)) return;
  constexpr double kMost = 9e18;  // of 64 bits
  throw Error(
      StatusCode::out_of_memory,
      fmt::format("{}: about {:.2g} elements with {:.2g} unknowns; meshes and matrices of the bodies up to here "
                  "would take {}, and this machine has {}: take fewer divisions, unknowns or elements",
                  body.place.text(), demand.elements, demand.unknowns,
                  base::format_bytes(static_cast<std::int64_t>(std::min(bytes_, kMost))), base::format_bytes(machine)));
}

}  // namespace espalier::dynamics::model
