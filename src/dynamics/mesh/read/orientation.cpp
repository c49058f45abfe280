#include "dynamics/mesh/read/orientation.hpp"

#include <algorithm>
#include <array>

namespace espalier::dynamics {
namespace {

// Pairs of corners, from -> to, along the three directions of a solid: their sum is the direction.
using Ways = std::array<std::span<const int>, 3>;
constexpr int kTetWays[3][2] = {{0, 1}, {0, 2}, {0, 3}};
constexpr int kHexWays[3][8] = {{0, 1, 3, 2, 4, 5, 7, 6}, {0, 3, 1, 2, 4, 7, 5, 6}, {0, 4, 1, 5, 2, 6, 3, 7}};
constexpr int kWedgeWays[3][6] = {{0, 1, 3, 4, -1, -1}, {0, 2, 3, 5, -1, -1}, {0, 3, 1, 4, 2, 5}};
constexpr int kPyramidWays[3][8] = {
    {0, 1, 3, 2, -1, -1, -1, -1}, {0, 3, 1, 2, -1, -1, -1, -1}, {0, 4, 1, 4, 2, 4, 3, 4}};

Ways ways_of(ElementType type) {
  switch (shape_of(type).corners) {
    case 8:
      return {kHexWays[0], kHexWays[1], kHexWays[2]};
    case 6:
      return {kWedgeWays[0], kWedgeWays[1], kWedgeWays[2]};
    case 5:
      return {kPyramidWays[0], kPyramidWays[1], kPyramidWays[2]};
    default:
      return {kTetWays[0], kTetWays[1], kTetWays[2]};
  }
}

// Position in the given order of node a of the mirror image: tetrahedra and pyramids turn their base, hexahedra and
// wedges change bottom and top.
constexpr int kTurnedTet[10] = {0, 2, 1, 3, 6, 5, 4, 7, 9, 8};
constexpr int kTurnedHex[20] = {4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10, 11, 16, 17, 18, 19};
constexpr int kTurnedWedge[15] = {3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8, 12, 13, 14};
constexpr int kTurnedPyramid[5] = {0, 3, 2, 1, 4};

}  // namespace

double corner_volume(ElementType type, const std::vector<Point>& places, std::span<const Index> nodes) {
  std::array<Point, 3> d{};
  const Ways ways = ways_of(type);
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t i = 0; i + 1 < ways[k].size() && ways[k][i] >= 0; i += 2)
      for (std::size_t c = 0; c < 3; ++c)
        d[k][c] += places[static_cast<std::size_t>(nodes[at(ways[k][i + 1])])][c] -
                   places[static_cast<std::size_t>(nodes[at(ways[k][i])])][c];
  return d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) + d[0][1] * (d[1][2] * d[2][0] - d[1][0] * d[2][2]) +
         d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
}

void turn_round(ElementType type, std::span<Index> nodes) {
  std::array<Index, kMaxElementNodes> given{};
  std::copy(nodes.begin(), nodes.end(), given.begin());
  const int* order = shape_of(type).corners == 8   ? kTurnedHex
                     : shape_of(type).corners == 6 ? kTurnedWedge
                     : shape_of(type).corners == 5 ? kTurnedPyramid
                                                   : kTurnedTet;
  for (std::size_t a = 0; a < nodes.size(); ++a) nodes[a] = given[at(order[a])];
}

}  // namespace espalier::dynamics
