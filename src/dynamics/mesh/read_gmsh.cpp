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
    if (n < 0 || static_cast<std::size_t>(n) > reader_.remaining())
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

/// Element shapes of Gmsh that are read. tet10 and hex20 count their edges in another order.
struct GmshShape {
  int code;
  ElementType type;
};
constexpr GmshShape kGmshShapes[] = {{1, ElementType::line2},    {2, ElementType::tri3},    {3, ElementType::quad4},
                                     {4, ElementType::tet4},     {5, ElementType::hex8},    {6, ElementType::wedge6},
                                     {7, ElementType::pyramid5}, {8, ElementType::line3},   {9, ElementType::tri6},
                                     {11, ElementType::tet10},   {15, ElementType::point1}, {16, ElementType::quad8},
                                     {17, ElementType::hex20},   {18, ElementType::wedge15}};
// Position in Gmsh's list of our node a (Gmsh manual, "Node ordering").
constexpr int kTet10[10] = {0, 1, 2, 3, 4, 5, 6, 7, 9, 8};
constexpr int kHex20[20] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15};
constexpr int kWedge15[15] = {0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11};

ElementType shape_from(const Source& source, std::int64_t code) {
  for (const GmshShape& s : kGmshShapes)
    if (s.code == code) return s.type;
  source.fail(
      fmt::format("element type {} of Gmsh is not read (points, lines, tri3/6, quad4/8, tet4/10, hex8/20, "
                  "wedge6/15, pyramid5 are); save the mesh with order 1, or order 2 incomplete",
                  code));
}

class GmshReader {
 public:
  GmshReader(std::string content, const std::string& name) : reader_(name, std::move(content)) { mesh_.name = name; }

  Mesh read() {
    std::string_view line;
    while (reader_.next(line)) {
      line = trim(line);
      if (line.empty()) continue;
      if (line.front() != '$')
        reader_.fail(fmt::format("expected a section like $Nodes, found '{}'", line.substr(0, 40)));
      const std::string section(line.substr(1));
      if (section == "NOD") reader_.fail("this is the old format 1; save it as version 2.2 or 4.1");
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
    for (const auto& [element, key] : physical_) elements_.put(element, set_name(key));
    elements_.finish(mesh_);
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
    const bool known = (version_ >= 2 && version_ < 2.3) || (version_ > 4.05 && version_ < 4.2);
    if (!known) reader_.fail(fmt::format("version {} is not read (2.0 to 2.2 and 4.1 are)", version_));
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
      for (std::int64_t k = 0; k < counts[static_cast<std::size_t>(dimension)]; ++k) {
        const std::int64_t tag = source.int32();
        for (int i = 0; i < (dimension == 0 ? 3 : 6); ++i) source.real();
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
    for (int i = 0; i < 3; ++i) source.size();  // number of nodes, smallest and largest tag
    for (std::int64_t b = 0; b < blocks; ++b) {
      const std::int64_t dimension = source.int32();
      source.int32();  // entity
      const std::int64_t parametric = source.int32();
      std::vector<std::int64_t> labels(static_cast<std::size_t>(source.count()));
      for (auto& label : labels) label = source.size();
      for (const std::int64_t label : labels) {
        Point p{};
        for (double& x : p) x = source.real();
        for (std::int64_t i = 0; i < (parametric != 0 ? dimension : 0); ++i) source.real();
        add_node(label, p);
      }
    }
  }

  template <class NextLabel>
  void add_element(const Source& source, ElementType type, std::int64_t label, std::int64_t physical,
                   const NextLabel& next) {
    std::array<Index, kMaxElementNodes> file{}, nodes{};
    const int count = shape_of(type).nodes;
    for (int a = 0; a < count; ++a) {
      const std::int64_t node = next();
      const auto found = index_.find(node);
      if (found == index_.end()) source.fail(fmt::format("element {} uses node {}, which is not defined", label, node));
      file[static_cast<std::size_t>(a)] = found->second;
    }
    for (int a = 0; a < count; ++a) {
      const int from = type == ElementType::tet10     ? kTet10[a]
                       : type == ElementType::hex20   ? kHex20[a]
                       : type == ElementType::wedge15 ? kWedge15[a]
                                                      : a;
      nodes[static_cast<std::size_t>(a)] = file[static_cast<std::size_t>(from)];
    }
    const std::size_t added = elements_.add(type, label, {nodes.data(), static_cast<std::size_t>(count)});
    if (physical != 0) physical_.push_back({added, {shape_of(type).dimension, physical}});
  }

  void read_elements2() {
    const std::int64_t count = Source(reader_, false).size();
    Source source(reader_, binary_);
    for (std::int64_t k = 0; k < count;) {
      // ASCII: label, type, tags; binary: type, number of elements, tags, then the elements.
      std::int64_t label = binary_ ? 0 : source.int32();
      const ElementType type = shape_from(source, source.int32());
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
    for (int i = 0; i < 3; ++i) source.size();
    for (std::int64_t b = 0; b < blocks; ++b) {
      const std::int64_t dimension = source.int32(), entity = source.int32();
      const ElementType type = shape_from(source, source.int32());
      const std::int64_t count = source.size();
      const auto physical = entity_physical_.find({dimension, entity});
      for (std::int64_t k = 0; k < count; ++k) {
        const std::int64_t label = source.size();
        add_element(source, type, label, physical == entity_physical_.end() ? 0 : physical->second,
                    [&] { return source.size(); });
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
  std::vector<std::pair<std::size_t, Key>> physical_;  // of the elements that belong to a group
};

}  // namespace

Mesh parse_gmsh(std::string content, const std::string& name) { return GmshReader(std::move(content), name).read(); }

Mesh read_gmsh(const std::string& path) { return parse_gmsh(read_whole_file(path), path); }

}  // namespace espalier::dynamics
