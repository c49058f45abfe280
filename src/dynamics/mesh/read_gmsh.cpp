#include <fmt/format.h>

#include <array>
#include <cstring>
#include <map>
#include <unordered_map>

#include "dynamics/mesh/file_elements.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {
namespace {

/// Numbers of a section, from text or from bytes.
class Source {
 public:
  Source(LineReader& reader, bool binary) : reader_(reader), binary_(binary) {}
  [[nodiscard]] bool binary() const { return binary_; }
  double real() { return binary_ ? raw<double>() : text().real("number"); }
  std::int64_t int32() { return binary_ ? raw<std::int32_t>() : text().integer("whole number"); }
  std::int64_t size() {
    return binary_ ? static_cast<std::int64_t>(raw<std::uint64_t>()) : text().integer("whole number");
  }
  /// A number of things that follow: no more than there are bytes left.
  std::int64_t count() {
    const std::int64_t n = size();
    if (n < 0 || at(n) > reader_.remaining())
      fail(fmt::format("{} entries are announced, the file has {} bytes left", n, reader_.remaining()));
    return n;
  }
  [[noreturn]] void fail(const std::string& message) const { reader_.fail(message); }

 private:
  template <class T>
  T raw() {
    T value;
    std::memcpy(&value, reader_.bytes(sizeof(T)).data(), sizeof(T));
    return value;
  }
  /// A reader of one field, over line ends.
  Fields text() {
    std::string_view line;
    while (trim(rest_).empty()) {
      if (!reader_.next(line)) reader_.fail("the file ends inside a section");
      if (!line.empty() && line.front() == '$') reader_.fail(fmt::format("section ends too early at {}", line));
      rest_ = line;
    }
    rest_ = trim(rest_);
    const std::size_t end = std::min(rest_.find_first_of(" \t"), rest_.size());
    const std::string_view field = rest_.substr(0, end);
    rest_.remove_prefix(end);
    return {reader_, field, ' '};
  }

  LineReader& reader_;
  bool binary_;
  std::string_view rest_;
};

/// Element shapes of Gmsh that are read. Those of second order count their edges in another order. Complete ones have
/// nodes in the middle of faces and of the volume behind the others, which are dropped.
struct GmshShape {
  int code;
  ElementType type;
  int dropped = 0;
  const char* complete = "";
};
constexpr GmshShape kGmshShapes[] = {{1, ElementType::line2},
                                     {2, ElementType::tri3},
                                     {3, ElementType::quad4},
                                     {4, ElementType::tet4},
                                     {5, ElementType::hex8},
                                     {6, ElementType::wedge6},
                                     {7, ElementType::pyramid5},
                                     {8, ElementType::line3},
                                     {9, ElementType::tri6},
                                     {11, ElementType::tet10},
                                     {15, ElementType::point1},
                                     {16, ElementType::quad8},
                                     {17, ElementType::hex20},
                                     {18, ElementType::wedge15},
                                     {10, ElementType::quad8, 1, "quad9"},
                                     {12, ElementType::hex20, 7, "hex27"},
                                     {13, ElementType::wedge15, 3, "wedge18"}};
// Position in Gmsh's list of our node a (Gmsh manual, "Node ordering").
constexpr int kTet10[10] = {0, 1, 2, 3, 4, 5, 6, 7, 9, 8};
constexpr int kHex20[20] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15};
constexpr int kWedge15[15] = {0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11};

const GmshShape& shape_from(const Source& source, std::int64_t code) {
  for (const GmshShape& s : kGmshShapes)
    if (s.code == code) return s;
  const char* name = code == 14 ? " (pyramid14)" : code == 19 ? " (pyramid13)" : "";
  source.fail(fmt::format(
      "element type {}{} of Gmsh is not read (points, lines, triangles, quadrilaterals, tetrahedra, "
      "hexahedra, wedges of order 1 and 2, and pyramid5 are); save the mesh with order 1, or without pyramids",
      code, name));
}

class GmshReader {
 public:
  GmshReader(std::string content, const std::string& name) : reader_(name, std::move(content)) { mesh_.name = name; }

  Mesh read() {
    std::string_view line;
    while (reader_.next(line)) {
      line = trim(line);
      if (line.empty()) continue;
      if (line.front() == '(')
        reader_.fail("this looks like a mesh of Fluent, which is not read; save it as one of Gmsh, version 4.1");
      if (line.front() != '$')
        reader_.fail(fmt::format("expected a section like $Nodes, found '{}'", line.substr(0, 40)));
      const std::string section(line.substr(1));
      if (section == "NOD")
        reader_.fail(
            "this is MSH version 1, which is not read; save it as version 2.2 or 4.1 (gmsh FILE -save -format msh41)");
      if (version_ == 0 && section != "MeshFormat") reader_.fail("a .msh file starts with $MeshFormat");
      if (section == "MeshFormat")
        read_format();
      else if (section == "PhysicalNames")
        read_names();
      else if (section == "Entities")
        read_entities();
      else if (section == "Nodes")
        version_ < 4 ? read_nodes2() : read_nodes4();
      else if (section == "Elements")
        version_ < 4 ? read_elements2() : read_elements4();
      skip_to_end(section);
    }
    if (mesh_.nodes.empty()) reader_.fail("the file has no $Nodes");
    for (const auto& [element, key] : physical_) elements_.add_to_set(element, set_name(key));
    elements_.finish(mesh_);
    note_complete_kinds(mesh_, complete_);
    return std::move(mesh_);
  }

 private:
  void read_format() {
    std::string_view line;
    if (!reader_.next(line)) reader_.fail("the file ends inside $MeshFormat");
    Fields fields(reader_, line, ' ');
    version_ = fields.real("version");
    binary_ = fields.integer("file type") == 1;
    const std::int64_t data_size = fields.integer("data size");
    const bool known = (version_ >= 2 && version_ < 2.3) || (version_ >= 4 && version_ < 4.2);
    if (!known) reader_.fail(fmt::format("version {} is not read (2.0 to 2.2, 4.0 and 4.1 are)", version_));
    if (data_size != 8) reader_.fail(fmt::format("data size {} is not read (8 is)", data_size));
    if (!binary_) return;
    std::int32_t one = 0;
    std::memcpy(&one, reader_.bytes(4).data(), 4);
    if (one != 1) reader_.fail("the binary file has the other byte order; save it as ASCII");
  }

  void read_names() {
    Source source(reader_, false);
    const std::int64_t count = source.int32();
    for (std::int64_t k = 0; k < count; ++k) {
      std::string_view line;
      if (!reader_.next(line)) reader_.fail("the file ends inside $PhysicalNames");
      Fields fields(reader_, line, ' ');
      const std::int64_t dimension = fields.integer("dimension"), tag = fields.integer("tag");
      const std::size_t first = line.find('"'), last = line.rfind('"');
      if (first == std::string_view::npos || last <= first) reader_.fail("a physical name stands in double quotes");
      names_[{dimension, tag}] = std::string(line.substr(first + 1, last - first - 1));
    }
  }

  void read_entities() {
    Source source(reader_, binary_);
    std::array<std::int64_t, 4> counts{};
    for (auto& c : counts) c = source.size();
    for (int dimension = 0; dimension < 4; ++dimension)
      for (std::int64_t k = 0; k < counts[at(dimension)]; ++k) {
        const std::int64_t tag = source.int32();
        for (int i = 0; i < (dimension == 0 && !is_4_0() ? 3 : 6); ++i) source.real();
        const std::int64_t physicals = source.size();
        for (std::int64_t p = 0; p < physicals; ++p) {
          const std::int64_t physical = source.int32();
          if (p == 0) entity_physical_[{dimension, tag}] = physical;
        }
        if (dimension == 0) continue;
        const std::int64_t bounds = source.size();
        for (std::int64_t b = 0; b < bounds; ++b) source.int32();
      }
  }

  void add_node(std::int64_t label, const Point& p) {
    if (!index_.emplace(label, static_cast<Index>(mesh_.nodes.size())).second)
      reader_.fail(fmt::format("node {} is defined twice", label));
    mesh_.nodes.push_back(p);
    mesh_.node_labels.push_back(label);
  }

  void read_nodes2() {
    const std::int64_t count = Source(reader_, false).size();
    Source source(reader_, binary_);
    for (std::int64_t k = 0; k < count; ++k) {
      const std::int64_t label = source.int32();
      Point p{};
      for (double& x : p) x = source.real();
      add_node(label, p);
    }
  }

  void read_nodes4() {
    Source source(reader_, binary_);
    const std::int64_t blocks = source.size();
    for (int i = 0; i < (is_4_0() ? 1 : 3); ++i) source.size();  // number of nodes, smallest and largest tag
    for (std::int64_t b = 0; b < blocks; ++b) {
      const std::int64_t first = source.int32(), second = source.int32();  // the entity's dimension and tag
      const std::int64_t dimension = is_4_0() ? second : first, parametric = source.int32();
      if (is_4_0()) {  // each node's tag and place together
        const std::int64_t count = source.count();
        for (std::int64_t k = 0; k < count; ++k) {
          const std::int64_t label = source.int32();
          add_node(label, place(source, parametric != 0 ? dimension : 0));
        }
        continue;
      }
      std::vector<std::int64_t> labels(at(source.count()));
      for (auto& label : labels) label = source.size();
      for (const std::int64_t label : labels) add_node(label, place(source, parametric != 0 ? dimension : 0));
    }
  }

  /// Three coordinates, and so many parameters behind them, which are passed over.
  static Point place(Source& source, std::int64_t parameters) {
    Point p{};
    for (double& x : p) x = source.real();
    for (std::int64_t i = 0; i < parameters; ++i) source.real();
    return p;
  }
  [[nodiscard]] bool is_4_0() const { return version_ >= 4 && version_ < 4.05; }

  template <class NextLabel>
  void add_element(const Source& source, const GmshShape& shape, std::int64_t label, std::int64_t physical,
                   const NextLabel& next) {
    const ElementType type = shape.type;
    std::array<Index, kMaxElementNodes> file{}, nodes{};
    const int count = shape_of(type).nodes;
    for (int a = 0; a < count; ++a) {
      const std::int64_t node = next();
      const auto found = index_.find(node);
      if (found == index_.end()) source.fail(fmt::format("element {} uses node {}, which is not defined", label, node));
      file[at(a)] = found->second;
    }
    for (int a = 0; a < shape.dropped; ++a) next();
    if (shape.dropped > 0) ++complete_[shape.complete];
    for (int a = 0; a < count; ++a) {
      const int from = type == ElementType::tet10     ? kTet10[a]
                       : type == ElementType::hex20   ? kHex20[a]
                       : type == ElementType::wedge15 ? kWedge15[a]
                                                      : a;
      nodes[at(a)] = file[at(from)];
    }
    const std::size_t added = elements_.add(type, label, {nodes.data(), at(count)});
    if (physical != 0) physical_.push_back({added, {shape_of(type).dimension, physical}});
  }

  void read_elements2() {
    const std::int64_t count = Source(reader_, false).size();
    Source source(reader_, binary_);
    for (std::int64_t k = 0; k < count;) {
      // ASCII: label, type, tags; binary: type, number of elements, tags, then the elements.
      std::int64_t label = binary_ ? 0 : source.int32();
      const GmshShape& type = shape_from(source, source.int32());
      const std::int64_t followers = binary_ ? source.int32() : 1;
      const std::int64_t tags = source.int32();
      for (std::int64_t f = 0; f < followers; ++f, ++k) {
        if (binary_) label = source.int32();
        std::int64_t physical = 0;
        for (std::int64_t t = 0; t < tags; ++t) {
          const std::int64_t tag = source.int32();
          if (t == 0) physical = tag;
        }
        add_element(source, type, label, physical, [&] { return source.int32(); });
      }
    }
  }

  void read_elements4() {
    Source source(reader_, binary_);
    const std::int64_t blocks = source.size();
    for (int i = 0; i < (is_4_0() ? 1 : 3); ++i) source.size();
    for (std::int64_t b = 0; b < blocks; ++b) {
      const std::int64_t first = source.int32(), second = source.int32();
      const std::int64_t dimension = is_4_0() ? second : first, entity = is_4_0() ? first : second;
      const GmshShape& type = shape_from(source, source.int32());
      const std::int64_t count = source.size();
      const auto physical = entity_physical_.find({dimension, entity});
      for (std::int64_t k = 0; k < count; ++k) {
        const auto next = [&] { return is_4_0() ? source.int32() : source.size(); };
        const std::int64_t label = next();
        add_element(source, type, label, physical == entity_physical_.end() ? 0 : physical->second, next);
      }
    }
  }

  void skip_to_end(const std::string& section) {
    const std::string end = "$End" + section;
    std::string_view line;
    while (reader_.next(line))
      if (trim(line) == end) return;
    reader_.fail(fmt::format("{} is missing", end));
  }

  using Key = std::pair<std::int64_t, std::int64_t>;  // dimension, tag

  [[nodiscard]] std::string set_name(const Key& key) const {
    const auto found = names_.find(key);
    return found == names_.end() ? fmt::format("{}-{}", key.first, key.second) : found->second;
  }

  LineReader reader_;
  Mesh mesh_;
  double version_ = 0;
  bool binary_ = false;
  std::map<Key, std::string> names_;
  std::map<Key, std::int64_t> entity_physical_;
  std::unordered_map<std::int64_t, Index> index_;
  FileElements elements_;
  std::map<std::string, long> complete_;               // elements that lose nodes, by their kinds
  std::vector<std::pair<std::size_t, Key>> physical_;  // of the elements that belong to a group
};

}  // namespace

Mesh parse_gmsh(std::string content, const std::string& name) { return GmshReader(std::move(content), name).read(); }

Mesh read_gmsh(const std::string& path) { return parse_gmsh(read_whole_file(path), path); }

}  // namespace espalier::dynamics
