// MEDIT .mesh: also what sfepy, FreeFEM, mmg and TetGen's converters write.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <map>
#include <set>

#include "dynamics/mesh/file_elements.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/read/words.hpp"

namespace espalier::dynamics {
namespace {

constexpr std::size_t kMostMeditGroups = 256;

struct MeditKind {
  std::string_view keyword;
  ElementType type;
  const char* set;  ///< of a reference number: "ref-3"
};
constexpr MeditKind kMeditKinds[] = {
    {"Tetrahedra", ElementType::tet4, "ref"},       {"Hexahedra", ElementType::hex8, "ref"},
    {"Hexaedra", ElementType::hex8, "ref"},         {"Prisms", ElementType::wedge6, "ref"},
    {"Pentahedra", ElementType::wedge6, "ref"},     {"Pyramids", ElementType::pyramid5, "ref"},
    {"Triangles", ElementType::tri3, "surface"},    {"Quadrilaterals", ElementType::quad4, "surface"},
    {"Quadrangles", ElementType::quad4, "surface"}, {"Edges", ElementType::line2, "edge"}};

class MeditReader {
 public:
  MeditReader(std::string content, const std::string& name) : words_(std::move(content), name) { mesh_.name = name; }

  Mesh read() {
    std::string_view word;
    while (words_.next(word) && word != "End") section(std::string(word));
    if (mesh_.nodes.empty()) words_.fail("the file has no Vertices");
    elements_.finish(mesh_);
    add_vertex_sets();
    if (!passed_over_.empty())
      mesh_.notices.push_back(
          fmt::format("{}: sections that were passed over: {}", mesh_.name, fmt::join(passed_over_, ", ")));
    return std::move(mesh_);
  }

 private:
  void section(const std::string& name) {
    if (name == "MeshVersionFormatted") {
      words_.integer("the version");
    } else if (name == "Dimension") {
      dimension_ = words_.integer("the dimension");
      if (dimension_ != 2 && dimension_ != 3)
        words_.fail(fmt::format("Dimension {} is not read (2 and 3 are)", dimension_));
    } else if (name == "Vertices") {
      vertices();
    } else if (const MeditKind* kind = kind_of(name); kind != nullptr) {
      elements(*kind);
    } else if (name.find("P2") != std::string::npos || name.find("Q2") != std::string::npos) {
      words_.fail(
          fmt::format("{}: elements of second order are not read from .mesh files; save the mesh as .vtu or .msh",
                      name.substr(0, 40)));
    } else if (name.front() >= 'A' && name.front() <= 'Z') {
      passed_over_.insert(name.substr(0, 40));
      skip();
    } else {
      words_.fail(fmt::format("expected a section like Vertices, found '{}'", name.substr(0, 40)));
    }
  }

  static const MeditKind* kind_of(const std::string& name) {
    for (const MeditKind& kind : kMeditKinds)
      if (name == kind.keyword) return &kind;
    return nullptr;
  }

  /// Numbers up to the next section.
  void skip() {
    std::string_view word;
    while (words_.next(word))
      if ((word.front() >= 'A' && word.front() <= 'Z')) return words_.back();
  }

  void vertices() {
    if (!mesh_.nodes.empty()) words_.fail("Vertices stands there twice");
    const std::int64_t count = words_.count("the number of vertices");
    for (std::int64_t k = 0; k < count; ++k) {
      Point p{};
      for (std::int64_t d = 0; d < dimension_; ++d) p[at(d)] = words_.real("a coordinate");
      mesh_.nodes.push_back(p);
      references_.push_back(words_.integer("the reference of a vertex"));
    }
  }

  void elements(const MeditKind& kind) {
    const std::int64_t count = words_.count("the number of elements");
    const auto corners = at(shape_of(kind.type).nodes);
    for (std::int64_t k = 0; k < count; ++k) {
      std::array<Index, kMaxElementNodes> nodes{};
      for (std::size_t a = 0; a < corners; ++a) {
        const std::int64_t n = words_.integer("a vertex");
        if (n < 1 || n > static_cast<std::int64_t>(mesh_.nodes.size()))
          words_.fail(fmt::format("{} {} uses vertex {}; there are {} (counted from 1)", kind.keyword, k + 1, n,
                                  mesh_.nodes.size()));
        nodes[a] = static_cast<Index>(n - 1);
      }
      const std::int64_t reference = words_.integer("the reference of an element");
      const std::size_t added =
          elements_.add(kind.type, static_cast<std::int64_t>(elements_.count()) + 1, {nodes.data(), corners});
      auto& known = element_references_[kind.set];
      known.insert(reference);
      if (known.size() <= kMostMeditGroups) elements_.add_to_set(added, fmt::format("{}-{}", kind.set, reference));
    }
  }

  void add_vertex_sets() {
    const std::set<std::int64_t> different(references_.begin(), references_.end());
    if (different.size() < 2 || different.size() > kMostMeditGroups) return;
    for (std::size_t n = 0; n < references_.size(); ++n)
      mesh_.node_sets[fmt::format("vertex-{}", references_[n])].push_back(static_cast<Index>(n));
  }

  Words words_;
  Mesh mesh_;
  std::int64_t dimension_ = 3;
  std::vector<std::int64_t> references_;  // of vertices
  std::map<std::string, std::set<std::int64_t>> element_references_;
  FileElements elements_;
  std::set<std::string> passed_over_;
};

}  // namespace

Mesh parse_medit(std::string content, const std::string& name) { return MeditReader(std::move(content), name).read(); }

}  // namespace espalier::dynamics
