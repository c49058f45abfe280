#include "dynamics/page/skin_faces.hpp"

#include <algorithm>

namespace espalier::dynamics::page {

void add_triangles(const std::vector<Index>& face, std::size_t corners, std::vector<std::array<Index, 3>>& out) {
  std::vector<Index> inner = face;
  if (face.size() == 2 * corners) {  // a triangle at each corner, between the nodes beside it; then what is left
    for (std::size_t k = 0; k < corners; ++k)
      out.push_back({face[k], face[corners + k], face[corners + (k + corners - 1) % corners]});
    inner.assign(face.begin() + static_cast<std::ptrdiff_t>(corners), face.end());
  }
  for (std::size_t k = 1; k + 1 < inner.size(); ++k) out.push_back({inner[0], inner[k], inner[k + 1]});
}

void add_outline(const std::vector<Index>& face, std::size_t corners, std::vector<std::array<Index, 2>>& out) {
  for (std::size_t k = 0; k < corners; ++k) {
    const Index a = face[k], b = face[(k + 1) % corners];
    if (face.size() == 2 * corners) {
      const Index middle = face[corners + k];
      out.push_back({a, middle});
      out.push_back({middle, b});
    } else {
      out.push_back({a, b});
    }
  }
}

void remove_repeats(std::vector<std::array<Index, 2>>& edges) {
  for (auto& edge : edges) std::sort(edge.begin(), edge.end());
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
}

}  // namespace espalier::dynamics::page
