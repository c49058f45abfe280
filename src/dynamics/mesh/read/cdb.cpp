// Ansys .cdb (CDWRITE): blocks of nodes and elements, components, isotropic materials.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <charconv>
#include <map>
#include <unordered_map>

#include "dynamics/mesh/file_elements.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {
namespace {

/// Element types of Ansys by their numbers: hexahedra and shells may be degenerate (nodes repeat). Those that are not
/// listed are passed over.
struct CdbType {
  int number;
  ElementType type;
};
constexpr CdbType kCdbTypes[] = {
    {45, ElementType::hex8},   {185, ElementType::hex8},  {70, ElementType::hex8},   {73, ElementType::hex8},
    {190, ElementType::hex8},  {64, ElementType::hex8},   {95, ElementType::hex20},  {186, ElementType::hex20},
    {90, ElementType::hex20},  {92, ElementType::tet10},  {187, ElementType::tet10}, {87, ElementType::tet10},
    {285, ElementType::tet4},  {72, ElementType::tet4},   {181, ElementType::quad4}, {63, ElementType::quad4},
    {43, ElementType::quad4},  {281, ElementType::quad8}, {93, ElementType::quad8},  {180, ElementType::line2},
    {188, ElementType::line2}, {4, ElementType::line2},   {8, ElementType::line2}};

/// Nodes of hexahedra whose corners coincide, by position among the 8 or 20 of the card.
constexpr int kCdbTet10[10] = {0, 1, 2, 4, 8, 9, 11, 16, 17, 18};
constexpr int kCdbWedge15[15] = {0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18};
constexpr int kCdbPyramid5[5] = {0, 1, 2, 3, 4};
constexpr int kCdbTri6[6] = {0, 1, 2, 4, 5, 7};

class CdbReader {
 public:
  CdbReader(std::string content, const std::string& name) : reader_(name, std::move(content)) { mesh_.name = name; }

  Mesh read() {
    std::string_view line;
    while (reader_.next(line)) command(line);
    if (mesh_.nodes.empty()) reader_.fail("the file has no NBLOCK; write it by CDWRITE,DB");
    for (const Listed& e : listed_) add(e);
    add_components();
    elements_.finish(mesh_);
    add_materials();
    add_notices();
    return std::move(mesh_);
  }

 private:
  struct Listed {
    std::int64_t material, type, number, line;
    std::vector<std::int64_t> nodes;
  };
  using Words = std::vector<std::string>;

  void command(std::string_view line) {
    const Words w = words(line);
    if (w.empty()) return;
    const std::string name = upper(w[0]);
    if (name == "ET" && w.size() > 2) types_[whole(w[1])] = element_number(w[2]);
    if (name == "ETBLOCK") type_block();
    if (name == "NBLOCK") nodes(w);
    if (name == "EBLOCK") elements(w);
    if (name == "CMBLOCK") component(w);
    if (name == "MPDATA" && w.size() > 6) material(upper(w[3]), whole(w[4]), w[6]);
    if (name == "MP" && w.size() > 3) material(upper(w[1]), whole(w[2]), w[3]);
  }

  /// Between commas, without what follows a "!".
  [[nodiscard]] Words words(std::string_view line) const {
    Words found;
    Fields fields(reader_, line.substr(0, line.find('!')), ',');
    for (std::string_view field; fields.next(field);) found.emplace_back(field);
    if (found.size() == 1 && found[0].empty()) found.clear();
    return found;
  }
  [[nodiscard]] std::int64_t whole(std::string_view text) const {
    text = trim(text);
    if (text.starts_with('+')) text.remove_prefix(1);
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc() || end != text.data() + text.size())
      reader_.fail(fmt::format("'{}' is not a whole number", text.substr(0, 40)));
    return value;
  }
  [[nodiscard]] double real(std::string_view text) const { return Fields(reader_, trim(text), ' ').real("number"); }

  /// "186", "SOLID186"
  [[nodiscard]] std::int64_t element_number(std::string_view text) const {
    const std::size_t digits = text.find_first_of("0123456789");
    return digits == std::string_view::npos ? 0 : whole(text.substr(digits));
  }

  std::string_view need_line() {
    std::string_view line;
    if (!reader_.next(line)) reader_.fail("the file ends inside a block");
    return line;
  }

  /// "(3i9,6e21.13e3)": widths of the whole numbers and of the real ones, and how many whole ones there are.
  struct Widths {
    std::size_t integers = 0, integer = 8, real = 16;
  };
  Widths format() {
    const std::string line = lower(trim(need_line()));
    Widths w;
    std::size_t at = 0;
    const auto number = [&] {
      std::size_t value = 0;
      for (; at < line.size() && line[at] >= '0' && line[at] <= '9' && value < 1000; ++at)
        value = 10 * value + static_cast<std::size_t>(line[at] - '0');
      return value;
    };
    while (at < line.size()) {
      if (line[at] < '0' || line[at] > '9') {
        ++at;
        continue;
      }
      const std::size_t repeat = number();
      if (at < line.size() && line[at] == 'i') {
        ++at;
        w.integers = repeat;
        w.integer = number();
      } else if (at < line.size() && (line[at] == 'e' || line[at] == 'f')) {
        ++at;
        w.real = number();
        break;
      }
    }
    if (w.integers == 0 || w.integer == 0 || w.integer > 64 || w.real == 0 || w.real > 64)
      reader_.fail(fmt::format("expected a format like (3i9,6e21.13e3), found '{}'", line.substr(0, 40)));
    return w;
  }

  static std::string_view piece(std::string_view line, std::size_t from, std::size_t width) {
    return from < line.size() ? trim(line.substr(from, width)) : std::string_view();
  }

  void type_block() {
    const Widths w = format();
    while (true) {
      const std::string_view line = need_line();
      if (trim(line) == "-1") return;
      const std::int64_t id = whole(piece(line, 0, w.integer));
      types_[id] = whole(piece(line, w.integer, w.integer));
    }
  }

  void nodes(const Words&) {
    const Widths w = format();
    while (true) {
      const std::string_view line = need_line();
      const std::string_view first = piece(line, 0, w.integer);
      if (trim(line) == "-1" || (!first.empty() && (first[0] == 'N' || first[0] == 'n'))) return;
      const std::int64_t label = whole(first);
      Point p{};
      for (std::size_t d = 0; d < 3; ++d) {
        const std::string_view text = piece(line, w.integers * w.integer + d * w.real, w.real);
        if (!text.empty()) p[d] = real(text);
      }
      if (!index_.emplace(label, static_cast<Index>(mesh_.nodes.size())).second)
        reader_.fail(fmt::format("node {} is defined twice", label));
      mesh_.nodes.push_back(p);
      mesh_.node_labels.push_back(label);
    }
  }

  /// EBLOCK,19,SOLID: material, type, ..., number of nodes (9th), -, element (11th), nodes; the other form is passed
  /// over.
  void elements(const Words& w) {
    const bool solid = w.size() > 2 && upper(w[2]) == "SOLID";
    const Widths widths = format();
    const auto number = [&](std::string_view line, std::size_t k) {
      const std::string_view text = piece(line, k * widths.integer, widths.integer);
      return text.empty() ? 0 : whole(text);
    };
    while (true) {
      std::string_view line = need_line();
      if (trim(line) == "-1") return;
      const std::int64_t first = number(line, 0);
      if (!solid) {
        ++others_;
        continue;
      }
      Listed e{first, number(line, 1), number(line, 10), reader_.line(), {}};
      const std::int64_t count = number(line, 8);
      if (count < 1 || count > 64) reader_.fail(fmt::format("element {} has {} nodes, it says", e.number, count));
      for (std::size_t k = 11; e.nodes.size() < static_cast<std::size_t>(count); ++k) {
        if (k == 19 || (k < 19 && e.nodes.size() >= 8 && k > 11 && k * widths.integer >= line.size())) {
          line = need_line();
          k = 0;
        }
        e.nodes.push_back(number(line, k));
      }
      listed_.push_back(std::move(e));
    }
  }

  void component(const Words& w) {
    if (w.size() < 4) reader_.fail("CMBLOCK needs a name, NODE or ELEM, and a number");
    const std::string name(trim(w[1]));
    const bool of_nodes = upper(w[2]).starts_with("NODE");
    const std::int64_t count = whole(w[3]);
    const Widths widths = format();
    auto& set = (of_nodes ? node_components_ : element_components_)[name];
    for (std::int64_t k = 0; k < count;) {
      const std::string_view line = need_line();
      for (std::size_t f = 0; f < widths.integers && k < count; ++f, ++k)
        set.push_back(whole(piece(line, f * widths.integer, widths.integer)));
    }
  }

  void material(const std::string& label, std::int64_t id, std::string_view value) {
    if (trim(value).empty()) return;
    MeshMaterial& m = materials_[id];
    if (label == "EX") m.young = real(value);
    if (label == "NUXY" || label == "PRXY") m.poisson = real(value);
    if (label == "DENS") m.density = real(value);
  }

  [[noreturn]] void fail_at(const Listed& e, const std::string& message) const {
    throw Error(StatusCode::invalid_input, fmt::format("{}:{}: element {} {}", mesh_.name, e.line, e.number, message));
  }

  void add(const Listed& e) {
    const auto type = types_.find(e.type);
    if (type == types_.end()) fail_at(e, fmt::format("is of type {}, which no ET defines", e.type));
    const CdbType* known = nullptr;
    for (const CdbType& t : kCdbTypes)
      if (t.number == type->second) known = &t;
    if (known == nullptr) {
      ++passed_over_[type->second];
      return;
    }
    ElementType shape = known->type;
    std::vector<std::int64_t> n = e.nodes;
    const auto take = [&](std::span<const int> from, ElementType as) {
      std::vector<std::int64_t> taken;
      for (const int k : from) taken.push_back(n[static_cast<std::size_t>(k)]);
      n = std::move(taken);
      shape = as;
    };
    const auto one = [&](std::initializer_list<int> places) {
      for (const int k : places)
        if (n[static_cast<std::size_t>(k)] != n[static_cast<std::size_t>(*places.begin())]) return false;
      return true;
    };
    const bool second = n.size() == 20;
    if (shape == ElementType::hex20 && n.size() == 8) shape = ElementType::hex8;  // without mid-side nodes
    if (shape == ElementType::tet10 && n.size() == 4) shape = ElementType::tet4;
    if (shape == ElementType::hex8 && n.size() == 4) shape = ElementType::tet4;
    if (shape == ElementType::hex20 && n.size() == 10) shape = ElementType::tet10;
    if ((shape == ElementType::hex8 && n.size() == 8) || (shape == ElementType::hex20 && second)) {
      if (one({2, 3}) && one({4, 5, 6, 7}))
        take(std::span(kCdbTet10).first(second ? 10 : 4), second ? ElementType::tet10 : ElementType::tet4);
      else if (one({2, 3}) && one({6, 7}))
        take(std::span(kCdbWedge15).first(second ? 15 : 6), second ? ElementType::wedge15 : ElementType::wedge6);
      else if (one({4, 5, 6, 7}) && second)
        fail_at(e, "is a pyramid of second order, which is not read; mesh that place with tetrahedra or hexahedra");
      else if (one({4, 5, 6, 7}))
        take(kCdbPyramid5, ElementType::pyramid5);
    }
    if (shape == ElementType::quad4 && n.size() == 4 && one({2, 3}))
      take(std::span(kCdbTri6).first(3), ElementType::tri3);
    if (shape == ElementType::quad8 && n.size() == 8 && one({2, 3})) take(kCdbTri6, ElementType::tri6);
    const auto count = static_cast<std::size_t>(shape_of(shape).nodes);
    if (shape_of(shape).dimension < 2 && n.size() > count) n.resize(count);  // orientation nodes
    if (n.size() != count)
      fail_at(e, fmt::format("({}) has {} nodes, {} has {}", type->second, n.size(), shape_of(shape).name, count));
    std::array<Index, kMaxElementNodes> nodes{};
    for (std::size_t a = 0; a < count; ++a) {
      const auto found = index_.find(n[a]);
      if (n[a] == 0)
        fail_at(e, fmt::format("has no node at its place {}; mid-side nodes are needed on all edges", a + 1));
      if (found == index_.end()) fail_at(e, fmt::format("uses node {}, which is not defined", n[a]));
      nodes[a] = found->second;
    }
    const std::size_t added = elements_.add(shape, e.number, {nodes.data(), count});
    elements_.add_to_set(added, fmt::format("material-{}", e.material));
    elements_.add_to_set(added, fmt::format("type-{}", e.type));
    by_number_[e.number] = added;
  }

  /// Calls take(number) for each member: "5, -9" are 5 to 9. Numbers that stand for nothing are passed over.
  template <class Take>
  void members(const std::string& name, const std::vector<std::int64_t>& listed, std::size_t most,
               const Take& take) const {
    std::int64_t last = 0;
    std::size_t taken = 0;
    for (const std::int64_t n : listed) {
      if (n < 0 && last > 0) {
        if (-n < last || static_cast<std::size_t>(-(n + last)) > 100 * most + 1000000 ||
            (taken += static_cast<std::size_t>(-(n + last))) > 100 * most + 1000000)
          reader_.fail(fmt::format("component {}: the range {} to {} is none of the file", name, last, -n));
        for (std::int64_t k = last + 1; k <= -n; ++k) take(k);
      } else {
        take(n);
      }
      last = n;
    }
  }

  void add_components() {
    for (const auto& [name, listed] : node_components_) {
      auto& set = mesh_.node_sets[name];
      members(name, listed, index_.size(), [&](std::int64_t n) {
        if (const auto found = index_.find(n); found != index_.end()) set.push_back(found->second);
      });
    }
    for (const auto& [name, listed] : element_components_) {
      const std::string& set = name;  // clang 14 captures no structured bindings
      members(name, listed, by_number_.size(), [&](std::int64_t n) {
        if (const auto found = by_number_.find(n); found != by_number_.end()) elements_.add_to_set(found->second, set);
      });
    }
  }

  void add_materials() {
    for (auto& [id, m] : materials_) {
      m.name = fmt::format("MP-{}", id);
      mesh_.materials.push_back(m);
      if (const std::string set = fmt::format("material-{}", id); mesh_.element_sets.contains(set))
        mesh_.section_material[set] = m.name;
    }
  }

  void add_notices() {
    std::vector<std::string> list;
    for (const auto& [number, count] : passed_over_)
      list.push_back(fmt::format("type {} of Ansys ({})", number, count));
    if (others_ > 0) list.push_back(fmt::format("elements of blocks that are not SOLID ({})", others_));
    if (!list.empty())
      mesh_.notices.push_back(fmt::format("{}: elements that were passed over: {}", mesh_.name, fmt::join(list, ", ")));
  }

  LineReader reader_;
  Mesh mesh_;
  std::map<std::int64_t, std::int64_t> types_;  // ET: local number -> number of the element type
  std::unordered_map<std::int64_t, Index> index_;
  std::unordered_map<std::int64_t, std::size_t> by_number_;
  std::vector<Listed> listed_;
  std::map<std::string, std::vector<std::int64_t>> node_components_, element_components_;
  std::map<std::int64_t, MeshMaterial> materials_;
  std::map<std::int64_t, long> passed_over_;
  long others_ = 0;
  FileElements elements_;
};

}  // namespace

Mesh parse_cdb(std::string content, const std::string& name) { return CdbReader(std::move(content), name).read(); }

Mesh read_cdb(const std::string& path) { return parse_cdb(read_whole_file(path), path); }

}  // namespace espalier::dynamics
