/// \file
/// Builds hexahedral meshes of mapped blocks whose common nodes are merged.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/thread_pool.hpp"
#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// The map of a block from the unit cube; (u, v, w) and the image must have the same handedness.
using BlockMap = std::function<Point(double u, double v, double w)>;

/// Sides of a block: u = 0, u = 1, v = 0, v = 1, w = 0, w = 1.
enum class BlockSide { u0, u1, v0, v1, w0, w1 };

/// A side that becomes (part of) a face set of the mesh.
struct NamedSide {
  BlockSide side;
  std::string name;
};

/// A part of an axis, with its number of elements.
struct Stretch {
  double begin, end;
  int elements;
  [[nodiscard]] double at(double share) const { return begin + share * (end - begin); }
};

class BlockBuilder {
 public:
  /// @param type hex8 or hex20 (mid-side nodes lie on the map, so curved boundaries are curved)
  /// @param tolerance nodes nearer than this are one node; must be far below the smallest element edge
  /// @param pool threads that check the elements; null: the calling one
  BlockBuilder(std::string name, ElementType type, double tolerance, base::ThreadPool* pool = nullptr);

  /// Adds divisions[0] x divisions[1] x divisions[2] elements; they join the element set `set`. Neighbouring blocks
  /// must place the same nodes on their common side (same divisions, same points).
  /// @throws Error(out_of_memory) where the machine does not hold the mesh
  void add(const std::array<int, 3>& divisions, const BlockMap& map, const std::string& set,
           const std::vector<NamedSide>& sides = {});

  /// The mesh; node sets of the same names as the face sets are added.
  /// @throws std::logic_error that names an element with a Jacobian that is not positive
  Mesh finish();

 private:
  void check_room(const std::array<int, 3>& divisions) const;
  Index node(const Point& p);
  Index inner_node(const Point& p);

  Mesh mesh_;
  ElementType type_;
  double tolerance_;
  base::ThreadPool* pool_;
  std::unordered_map<std::uint64_t, std::vector<Index>> cells_;  // spatial hash of the nodes
};

}  // namespace espalier::dynamics
