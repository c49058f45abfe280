#include "dynamics/meshers/block_builder.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "base/memory.hpp"
#include "dynamics/elements/groups.hpp"
#include "matrix/file.hpp"

namespace espalier::dynamics {
namespace {

// Position of the nodes of hex8/hex20 within the 3 x 3 x 3 half-steps of an element.
constexpr int kNode[20][3] = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 0, 2}, {2, 0, 2}, {2, 2, 2},
                              {0, 2, 2}, {1, 0, 0}, {2, 1, 0}, {1, 2, 0}, {0, 1, 0}, {1, 0, 2}, {2, 1, 2},
                              {1, 2, 2}, {0, 1, 2}, {0, 0, 1}, {2, 0, 1}, {2, 2, 1}, {0, 2, 1}};
// Element face (order of Abaqus) on the sides u0, u1, v0, v1, w0, w1.
constexpr int kFace[6] = {5, 3, 2, 4, 0, 1};

// A node farther away than so many cells has no digits left to be told from its neighbours by.
constexpr double kMostCells = 0x1p50;

std::uint64_t cell_key(std::int64_t x, std::int64_t y, std::int64_t z) {
  // Three large odd multipliers mix the coordinates; collisions only cost comparisons.
  return static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15ULL ^ static_cast<std::uint64_t>(y) * 0xC2B2AE3D27D4EB4FULL ^
         static_cast<std::uint64_t>(z) * 0x165667B19E3779F9ULL;
}

}  // namespace

BlockBuilder::BlockBuilder(std::string name, ElementType type, double tolerance, base::ThreadPool* pool)
    : type_(type), tolerance_(tolerance), pool_(pool) {
  if (type != ElementType::hex8 && type != ElementType::hex20)
    throw std::invalid_argument(
        fmt::format("mesher '{}': element type must be hex8 or hex20, got {}", name, shape_of(type).name));
  mesh_.name = std::move(name);
}

Index BlockBuilder::node(const Point& p) {
  // A cell is much larger than the tolerance; a point near a cell's border is looked for in the neighbour too.
  const double size = 16 * tolerance_;
  for (const double x : p)
    if (!(std::abs(x) < kMostCells * size))
      throw std::invalid_argument(fmt::format(
          "mesher '{}': a node at {:.3g} m, while nodes nearer than {:.3g} m are one: the lengths of the part "
          "lie too far apart",
          mesh_.name, x, tolerance_));
  std::array<std::int64_t, 3> low{}, high{};
  for (std::size_t i = 0; i < 3; ++i) {
    low[i] = static_cast<std::int64_t>(std::floor((p[i] - tolerance_) / size));
    high[i] = static_cast<std::int64_t>(std::floor((p[i] + tolerance_) / size));
  }
  for (std::int64_t x = low[0]; x <= high[0]; ++x)
    for (std::int64_t y = low[1]; y <= high[1]; ++y)
      for (std::int64_t z = low[2]; z <= high[2]; ++z) {
        const auto cell = cells_.find(cell_key(x, y, z));
        if (cell == cells_.end()) continue;
        for (const Index n : cell->second) {
          const Point& o = mesh_.nodes[static_cast<std::size_t>(n)];
          if (std::hypot(p[0] - o[0], p[1] - o[1], p[2] - o[2]) < tolerance_) return n;
        }
      }
  const Index n = inner_node(p);
  const auto home = [&](std::size_t i) { return static_cast<std::int64_t>(std::floor(p[i] / size)); };
  cells_[cell_key(home(0), home(1), home(2))].push_back(n);
  return n;
}

// A node that no other block can have.
Index BlockBuilder::inner_node(const Point& p) {
  mesh_.nodes.push_back(p);
  return static_cast<Index>(mesh_.nodes.size()) - 1;
}

// Before any of it is taken: a part whose shape or numbers make far more elements than were thought of.
void BlockBuilder::check_room(const std::array<int, 3>& divisions) const {
  constexpr double kOfElement = 2000;  // bytes that a mesh and its body take, at least
  const double elements = static_cast<double>(mesh_.element_count()) + 1.0 * divisions[0] * divisions[1] * divisions[2];
  const Offset machine = matrix::machine_memory();
  if (kOfElement * elements <= static_cast<double>(machine)) return;
  throw Error(StatusCode::out_of_memory,
              fmt::format("mesher '{}': {:.2g} elements do not fit into this machine's {}: take fewer divisions, "
                          "unknowns, teeth or blades, or less extreme lengths",
                          mesh_.name, elements, base::format_bytes(machine)));
}

void BlockBuilder::add(const std::array<int, 3>& divisions, const BlockMap& map, const std::string& set,
                       const std::vector<NamedSide>& sides) {
  check_room(divisions);
  const std::array<int, 3> steps = {2 * divisions[0] + 1, 2 * divisions[1] + 1, 2 * divisions[2] + 1};
  std::vector<Index> grid(
      static_cast<std::size_t>(steps[0]) * static_cast<std::size_t>(steps[1]) * static_cast<std::size_t>(steps[2]), -1);
  const auto at = [&](int i, int j, int k) -> Index& {
    Index& n = grid[(static_cast<std::size_t>(k) * static_cast<std::size_t>(steps[1]) + static_cast<std::size_t>(j)) *
                        static_cast<std::size_t>(steps[0]) +
                    static_cast<std::size_t>(i)];
    if (n >= 0) return n;
    const Point p = map(i / (2.0 * divisions[0]), j / (2.0 * divisions[1]), k / (2.0 * divisions[2]));
    const bool inside = i > 0 && j > 0 && k > 0 && i + 1 < steps[0] && j + 1 < steps[1] && k + 1 < steps[2];
    return n = inside ? inner_node(p) : node(p);
  };
  const std::array<int, 3> last = {divisions[0] - 1, divisions[1] - 1, divisions[2] - 1};
  std::array<Index, 20> nodes{};
  const std::size_t count = static_cast<std::size_t>(shape_of(type_).nodes);
  for (int k = 0; k < divisions[2]; ++k)
    for (int j = 0; j < divisions[1]; ++j)
      for (int i = 0; i < divisions[0]; ++i) {
        for (std::size_t a = 0; a < count; ++a)
          nodes[a] = at(2 * i + kNode[a][0], 2 * j + kNode[a][1], 2 * k + kNode[a][2]);
        const Index e = mesh_.add_element(type_, std::span(nodes).first(count));
        mesh_.element_sets[set].push_back(e);
        const bool on[6] = {i == 0, i == last[0], j == 0, j == last[1], k == 0, k == last[2]};
        for (const NamedSide& side : sides)
          if (on[static_cast<int>(side.side)])
            mesh_.face_sets[side.name].push_back({e, kFace[static_cast<int>(side.side)]});
      }
}

Mesh BlockBuilder::finish() {
  const std::vector<SmallestJacobian> found = smallest_jacobians(mesh_, {}, pool_);
  for (std::size_t e = 0; e < found.size(); ++e)
    if (const double det = found[e].corners; !(det > 0))
      throw std::invalid_argument(
          fmt::format("mesher '{}': element {} has the Jacobian determinant {:.3g}; its shape "
                      "parameters do not make a valid part",
                      mesh_.name, e + 1, det));
  for (const auto& [set, faces] : mesh_.face_sets) mesh_.node_sets[set] = mesh_.nodes_of_faces(faces);
  cells_.clear();
  return std::move(mesh_);
}

}  // namespace espalier::dynamics
