// MFEM mesh v1.0 to v1.3, with straight elements or curved ones of order 2 and 3.
#include <fmt/format.h>

#include <array>
#include <map>
#include <numeric>

#include "base/at.hpp"
#include "dynamics/mesh/file_elements.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/read/words.hpp"

namespace espalier::dynamics {
namespace {

/// Geometries of MFEM: shapes of first and second order, and edges in the order of MFEM (fem/geom.cpp), which numbers
/// the edges of a mesh as they are met first.
struct MfemGeometry {
  ElementType linear, quadratic;
  std::span<const int> edges;   ///< pairs of corners
  std::span<const int> middle;  ///< the edge on which each mid-side node of ours lies
};
constexpr int kMfemLine[] = {0, 1}, kLineMiddle[] = {0};
constexpr int kMfemTri[] = {0, 1, 1, 2, 2, 0}, kTriMiddle[] = {0, 1, 2};
constexpr int kMfemQuad[] = {0, 1, 1, 2, 2, 3, 3, 0}, kQuadMiddle[] = {0, 1, 2, 3};
constexpr int kMfemTet[] = {0, 1, 0, 2, 0, 3, 1, 2, 1, 3, 2, 3}, kTetMiddle[] = {0, 3, 1, 2, 4, 5};
constexpr int kMfemHex[] = {0, 1, 1, 2, 3, 2, 0, 3, 4, 5, 5, 6, 7, 6, 4, 7, 0, 4, 1, 5, 2, 6, 3, 7},
              kHexMiddle[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
constexpr int kMfemWedge[] = {0, 1, 1, 2, 2, 0, 3, 4, 4, 5, 5, 3, 0, 3, 1, 4, 2, 5},
              kWedgeMiddle[] = {0, 1, 2, 3, 4, 5, 6, 7, 8};
constexpr int kMfemPyramid[] = {0, 1, 1, 2, 3, 2, 0, 3, 0, 4, 1, 4, 2, 4, 3, 4};
constexpr MfemGeometry kGeometries[] = {{ElementType::point1, ElementType::point1, {}, {}},
                                        {ElementType::line2, ElementType::line3, kMfemLine, kLineMiddle},
                                        {ElementType::tri3, ElementType::tri6, kMfemTri, kTriMiddle},
                                        {ElementType::quad4, ElementType::quad8, kMfemQuad, kQuadMiddle},
                                        {ElementType::tet4, ElementType::tet10, kMfemTet, kTetMiddle},
                                        {ElementType::hex8, ElementType::hex20, kMfemHex, kHexMiddle},
                                        {ElementType::wedge6, ElementType::wedge15, kMfemWedge, kWedgeMiddle},
                                        {ElementType::pyramid5, ElementType::pyramid5, kMfemPyramid, {}}};

class MfemReader {
 public:
  MfemReader(std::string content, const std::string& name) : words_(std::move(content), name) { mesh_.name = name; }

  Mesh read() {
    const std::string_view first = words_.line();
    if (!first.starts_with("MFEM mesh v1."))
      words_.fail(fmt::format("'{}' is not read; save the mesh as MFEM mesh v1.0", first.substr(0, 40)));
    std::string_view word;
    while (words_.next(word)) {
      const std::string section(word);
      if (section == "dimension")
        words_.integer("the dimension");
      else if (section == "elements")
        elements_in_file(elements_);
      else if (section == "boundary")
        elements_in_file(boundary_);
      else if (section == "vertices")
        vertices();
      else if (section == "nodes")
        nodes();
      else if (section == "attribute_sets" || section == "bdr_attribute_sets" || section == "mfem_mesh_end")
        break;  // names of attributes, and the end
      else
        words_.fail(fmt::format("expected a section like vertices, found '{}'", section.substr(0, 40)));
    }
    if (mesh_.nodes.empty()) words_.fail("the file has neither vertices nor nodes");
    for (const Listed& e : elements_) add(e, "attribute");
    for (const Listed& e : boundary_) add(e, "boundary");
    out_.finish(mesh_);
    mesh_.node_labels.resize(mesh_.nodes.size());
    std::iota(mesh_.node_labels.begin(), mesh_.node_labels.end(), 0);  // as in the file
    mesh_.drop_unused_nodes();                                         // in the middle of faces and volumes
    return std::move(mesh_);
  }

 private:
  struct Listed {
    std::int64_t attribute;
    const MfemGeometry* geometry;
    std::array<std::int64_t, 8> corners;
  };

  void elements_in_file(std::vector<Listed>& list) {
    const std::int64_t count = words_.count("the number of elements");
    for (std::int64_t k = 0; k < count; ++k) {
      Listed e{words_.integer("an attribute"), nullptr, {}};
      const std::int64_t geometry = words_.integer("a geometry");
      if (geometry < 0 || geometry > 7) words_.fail(fmt::format("geometry {} is not known (0 to 7 are)", geometry));
      e.geometry = &kGeometries[geometry];
      for (int a = 0; a < shape_of(e.geometry->linear).nodes; ++a) {
        e.corners[at(a)] = words_.integer("a vertex");
        if (e.corners[at(a)] < 0) words_.fail("a vertex has a number below 0");
      }
      list.push_back(e);
    }
  }

  void vertices() {
    vertices_ = words_.count("the number of vertices");
    std::string_view word;
    if (!words_.next(word)) return;
    words_.back();
    if (word == "nodes") return;  // which state the coordinates
    const std::int64_t dimension = words_.integer("the dimension of space");
    if (dimension < 1 || dimension > 3) words_.fail(fmt::format("vertices of dimension {} are not read", dimension));
    for (std::int64_t k = 0; k < vertices_; ++k) {
      Point p{};
      for (std::int64_t d = 0; d < dimension; ++d) p[at(d)] = words_.real("a coordinate");
      mesh_.nodes.push_back(p);
    }
  }

  void number_edges() {
    for (const Listed& e : elements_)
      for (std::size_t k = 0; k < e.geometry->edges.size(); k += 2)
        edges_.emplace(edge(e, k / 2), static_cast<std::int64_t>(edges_.size()));
  }
  static std::pair<std::int64_t, std::int64_t> edge(const Listed& e, std::size_t k) {
    const auto end = [&](std::size_t i) { return e.corners[at(e.geometry->edges[2 * k + i])]; };
    return {std::min(end(0), end(1)), std::max(end(0), end(1))};
  }

  /// A continuous finite element space of order 1 to 3: values at vertices, then on edges, then elsewhere.
  void nodes() {
    std::string_view line = words_.line();
    const auto after = [&](std::string_view key) {
      if (!line.starts_with(key)) words_.fail(fmt::format("expected '{}', found '{}'", key, line.substr(0, 40)));
      return std::string(trim(line.substr(key.size())));
    };
    after("FiniteElementSpace");
    line = words_.line();
    const std::string space = after("FiniteElementCollection:");
    order_ = space == "Linear"                                                              ? 1
             : space == "Quadratic"                                                         ? 2
             : space.size() == 8 && space.starts_with("H1_") && space.substr(4, 3) == "D_P" ? space[7] - '0'
                                                                                            : 0;
    if (order_ < 1 || order_ > 3)
      words_.fail(fmt::format("nodes of the space '{}' are not read (H1 of order 1 to 3 is)", space.substr(0, 40)));
    const auto number = [&](std::string_view key) {
      line = words_.line();
      const std::string text = after(key);
      if (text.size() != 1 || text[0] < '0' || text[0] > '3') words_.fail(fmt::format("{} {} is not read", key, text));
      return text[0] - '0';
    };
    const int dimension = number("VDim:"), interleaved = number("Ordering:");
    if (dimension < 1) words_.fail("VDim: 0 is not read");
    std::vector<double> values;
    std::string_view word;
    while (words_.next(word) && word != "mfem_mesh_end" && word != "attribute_sets") {
      words_.back();
      values.push_back(words_.real("a coordinate"));
    }
    number_edges();
    const std::size_t places = values.size() / at(dimension);
    const std::size_t needed = at(vertices_) + at(order_ - 1) * edges_.size();
    if (values.size() % at(dimension) != 0 || places < needed)
      words_.fail(fmt::format("nodes has {} numbers; {} places of {} coordinates are needed at least", values.size(),
                              needed, dimension));
    mesh_.nodes.assign(places, Point{});
    for (std::size_t k = 0; k < places; ++k)
      for (std::size_t d = 0; d < at(dimension); ++d)
        mesh_.nodes[k][d] = interleaved == 1 ? values[k * at(dimension) + d] : values[d * places + k];
    if (order_ == 3) middles_of_cubic_edges();
    if (order_ > 1)
      mesh_.notices.push_back(
          fmt::format("{}: elements of order {} are read as those of second order without nodes in the middle of faces "
                      "and volumes{}",
                      mesh_.name, order_, order_ == 3 ? "; their edges go through the same middle and ends" : ""));
  }

  /// Two nodes of an edge lie at the Gauss-Lobatto points -+1/sqrt(5); the first one's place is given to the middle.
  void middles_of_cubic_edges() {
    for (const auto& [ends, k] : edges_) {
      const std::size_t first = at(vertices_) + 2 * at(k);
      if (ends.second >= vertices_)
        words_.fail(fmt::format("an element uses vertex {}; there are {}", ends.second, vertices_));
      const Point &a = mesh_.nodes[at(ends.first)], &b = mesh_.nodes[at(ends.second)];
      for (std::size_t d = 0; d < 3; ++d)
        mesh_.nodes[first][d] = 0.625 * (mesh_.nodes[first][d] + mesh_.nodes[first + 1][d]) - 0.125 * (a[d] + b[d]);
    }
  }

  void add(const Listed& e, const char* kind) {
    std::array<Index, kMaxElementNodes> nodes{};
    const int corners = shape_of(e.geometry->linear).nodes;
    for (int a = 0; a < corners; ++a) {
      const std::int64_t n = e.corners[at(a)];
      if (n >= vertices_)
        words_.fail(fmt::format("an element uses vertex {}; there are {} (counted from 0)", n, vertices_));
      nodes[at(a)] = static_cast<Index>(n);
    }
    if (order_ > 1 && e.geometry->linear == ElementType::pyramid5)
      words_.fail("pyramids of second order are not read; save the mesh with order 1");
    const bool curved = order_ > 1 && !e.geometry->middle.empty();
    const ElementType type = curved ? e.geometry->quadratic : e.geometry->linear;
    for (std::size_t m = 0; curved && m < e.geometry->middle.size(); ++m) {
      const auto found = edges_.find(edge(e, at(e.geometry->middle[m])));
      if (found == edges_.end()) words_.fail("an edge of the boundary belongs to no element");
      nodes[at(corners) + m] = static_cast<Index>(vertices_ + (order_ - 1) * found->second);
    }
    const std::size_t added =
        out_.add(type, static_cast<std::int64_t>(out_.count()), {nodes.data(), at(shape_of(type).nodes)});
    out_.add_to_set(added, fmt::format("{}-{}", kind, e.attribute));
  }

  Words words_;
  Mesh mesh_;
  int order_ = 1;
  std::int64_t vertices_ = 0;
  std::vector<Listed> elements_, boundary_;
  std::map<std::pair<std::int64_t, std::int64_t>, std::int64_t> edges_;
  FileElements out_;
};

}  // namespace

Mesh parse_mfem(std::string content, const std::string& name) { return MfemReader(std::move(content), name).read(); }

Mesh parse_dot_mesh(std::string content, const std::string& name) {
  return trim(std::string_view(content).substr(0, 200)).starts_with("MFEM") ? parse_mfem(std::move(content), name)
                                                                            : parse_medit(std::move(content), name);
}
Mesh read_dot_mesh(const std::string& path) { return parse_dot_mesh(read_whole_file(path), path); }

}  // namespace espalier::dynamics
