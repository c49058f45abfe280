#include "dynamics/mesh/element_type.hpp"

#include <array>

namespace espalier::dynamics {
namespace {

// Faces S1, S2, ... of Abaqus ("Solid element library"), each turned so that its normal points outwards.
constexpr int kTet[4][6] = {{0, 2, 1, 6, 5, 4}, {0, 1, 3, 4, 8, 7}, {1, 2, 3, 5, 9, 8}, {2, 0, 3, 6, 7, 9}};
constexpr int kHex[6][8] = {{0, 3, 2, 1, 11, 10, 9, 8},  {4, 5, 6, 7, 12, 13, 14, 15}, {0, 1, 5, 4, 8, 17, 12, 16},
                            {1, 2, 6, 5, 9, 18, 13, 17}, {2, 3, 7, 6, 10, 19, 14, 18}, {3, 0, 4, 7, 11, 16, 15, 19}};
constexpr int kWedge[5][8] = {{0, 2, 1, 8, 7, 6, -1, -1},
                              {3, 4, 5, 9, 10, 11, -1, -1},
                              {0, 1, 4, 3, 6, 13, 9, 12},
                              {1, 2, 5, 4, 7, 14, 10, 13},
                              {2, 0, 3, 5, 8, 12, 11, 14}};
constexpr int kPyramid[5][4] = {{0, 3, 2, 1}, {0, 1, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {3, 0, 4, -1}};

using Nodes = std::span<const int>;
constexpr FaceShape tri(const int* n, bool quadratic) {
  return {quadratic ? ElementType::tri6 : ElementType::tri3, Nodes(n, quadratic ? 6 : 3)};
}
constexpr FaceShape quad(const int* n, bool quadratic) {
  return {quadratic ? ElementType::quad8 : ElementType::quad4, Nodes(n, quadratic ? 8 : 4)};
}
template <bool Q>
constexpr std::array<FaceShape, 4> kTetFaces = {tri(kTet[0], Q), tri(kTet[1], Q), tri(kTet[2], Q), tri(kTet[3], Q)};
template <bool Q>
constexpr std::array<FaceShape, 6> kHexFaces = {quad(kHex[0], Q), quad(kHex[1], Q), quad(kHex[2], Q),
                                                quad(kHex[3], Q), quad(kHex[4], Q), quad(kHex[5], Q)};
// The linear wedge's quadrilaterals list corners first, so one table serves both; its triangles do too.
template <bool Q>
constexpr std::array<FaceShape, 5> kWedgeFaces = {tri(kWedge[0], Q), tri(kWedge[1], Q), quad(kWedge[2], Q),
                                                  quad(kWedge[3], Q), quad(kWedge[4], Q)};
constexpr std::array<FaceShape, 5> kPyramidFaces = {quad(kPyramid[0], false), tri(kPyramid[1], false),
                                                    tri(kPyramid[2], false), tri(kPyramid[3], false),
                                                    tri(kPyramid[4], false)};

constexpr std::array<ElementShape, kElementTypes> kShapes = {{
    {ElementType::point1, "point1", 1, 1, 0, 1, {}},
    {ElementType::line2, "line2", 2, 2, 1, 3, {}},
    {ElementType::line3, "line3", 3, 2, 1, 21, {}},
    {ElementType::tri3, "tri3", 3, 3, 2, 5, {}},
    {ElementType::tri6, "tri6", 6, 3, 2, 22, {}},
    {ElementType::quad4, "quad4", 4, 4, 2, 9, {}},
    {ElementType::quad8, "quad8", 8, 4, 2, 23, {}},
    {ElementType::tet4, "tet4", 4, 4, 3, 10, kTetFaces<false>},
    {ElementType::tet10, "tet10", 10, 4, 3, 24, kTetFaces<true>},
    {ElementType::hex8, "hex8", 8, 8, 3, 12, kHexFaces<false>},
    {ElementType::hex20, "hex20", 20, 8, 3, 25, kHexFaces<true>},
    {ElementType::wedge6, "wedge6", 6, 6, 3, 13, kWedgeFaces<false>},
    {ElementType::wedge15, "wedge15", 15, 6, 3, 26, kWedgeFaces<true>},
    {ElementType::pyramid5, "pyramid5", 5, 5, 3, 14, kPyramidFaces},
}};
static_assert([] {
  for (std::size_t k = 0; k < kShapes.size(); ++k)
    if (static_cast<std::size_t>(kShapes[k].type) != k) return false;
  return true;
}());

}  // namespace

const ElementShape& shape_of(ElementType type) { return kShapes[static_cast<std::size_t>(type)]; }

}  // namespace espalier::dynamics
