// .vtu: unstructured grids of VTK in XML.
#include <fmt/format.h>

#include <bit>
#include <limits>
#include <map>
#include <stdexcept>

#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/read/vtk_cells.hpp"
#include "dynamics/mesh/read/vtu_bytes.hpp"
#include "dynamics/mesh/read/xml_tags.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {
namespace {

/// Types of values: size in bytes.
struct VtuType {
  std::string_view name;
  unsigned bytes;
  bool real, is_signed;
};
constexpr VtuType kVtuTypes[] = {{"Float32", 4, true, true}, {"Float64", 8, true, true},  {"Int8", 1, false, true},
                                 {"UInt8", 1, false, false}, {"Int16", 2, false, true},   {"UInt16", 2, false, false},
                                 {"Int32", 4, false, true},  {"UInt32", 4, false, false}, {"Int64", 8, false, true},
                                 {"UInt64", 8, false, false}};

class VtuReader {
 public:
  VtuReader(std::string content, const std::string& name) : content_(std::move(content)), tags_(content_, name) {
    mesh_.name = name;
  }

  Mesh read() {
    find_appended();
    XmlTags::Tag tag;
    if (!tags_.next(tag) || tag.name != "VTKFile") tags_.fail("a .vtu file starts with <VTKFile>");
    if (tag.get("type") != "UnstructuredGrid")
      tags_.fail(fmt::format("a VTKFile of type '{}' is not read; save the mesh as an unstructured grid (.vtu)",
                             tag.get("type").substr(0, 40)));
    coding_.big_endian = tag.get("byte_order") == "BigEndian";
    coding_.wide_header = tag.get("header_type") == "UInt64";
    coding_.compressed = !tag.get("compressor").empty();
    if (coding_.compressed && tag.get("compressor") != "vtkZLibDataCompressor")
      tags_.fail(fmt::format("arrays packed by {} are not read; save the file with zlib or without compression",
                             tag.get("compressor").substr(0, 40)));
    grid_.start = {0};
    while (tags_.next(tag)) {
      if (tag.name == "Piece") begin_piece(tag);
      if (tag.name == "Points" || tag.name == "Cells" || tag.name == "CellData" || tag.name == "PointData")
        section_ = tag.empty ? std::string_view() : tag.name;
      if (tag.name == "/Points" || tag.name == "/Cells" || tag.name == "/CellData" || tag.name == "/PointData")
        section_ = {};
      if (tag.name == "DataArray") read_array(tag);
      if (tag.name == "/Piece") end_piece();
      if (tag.name == "AppendedData") break;
    }
    if (in_piece_) tags_.fail("the file ends inside <Piece>");
    if (mesh_.nodes.empty()) tags_.fail("the file has no Points");
    for (auto& [name, data] : data_) grid_.data.push_back(std::move(data));
    add_vtk_grid(grid_, fmt::format("{}:1", mesh_.name), mesh_);
    return std::move(mesh_);
  }

 private:
  /// Appended data stand behind all tags, but are needed before.
  void find_appended() {
    const std::size_t tag = content_.find("<AppendedData");
    if (tag == std::string::npos) return;
    const std::string_view head = std::string_view(content_).substr(tag, 200);
    const std::size_t begin = content_.find('_', content_.find('>', tag));
    if (begin == std::string::npos) return;
    appended_ = std::string_view(content_).substr(begin + 1);
    appended_base64_ = head.substr(0, std::min(head.find('>'), head.size())).find("base64") != std::string_view::npos;
  }

  std::size_t number(const XmlTags::Tag& tag, std::string_view attribute, std::size_t otherwise) const {
    const std::string_view text = trim(tag.get(attribute));
    if (text.empty()) return otherwise;
    std::size_t value = 0;
    for (const char c : text) {
      if (c < '0' || c > '9' || value > std::numeric_limits<std::size_t>::max() / 20)
        tags_.fail(fmt::format("{} is '{}', which is no whole number", attribute, text.substr(0, 40)));
      value = 10 * value + static_cast<std::size_t>(c - '0');
    }
    return value;
  }

  void begin_piece(const XmlTags::Tag& tag) {
    if (in_piece_) tags_.fail("a <Piece> within another");
    in_piece_ = !tag.empty;
    points_ = number(tag, "NumberOfPoints", 0);
    cells_ = number(tag, "NumberOfCells", 0);
    first_point_ = mesh_.nodes.size();
    first_cell_ = grid_.types.size();
    connectivity_.clear();
    offsets_.clear();
  }

  void end_piece() {
    if (!in_piece_) tags_.fail("</Piece> without <Piece>");
    in_piece_ = false;
    if (mesh_.nodes.size() != first_point_ + points_)
      tags_.fail(
          fmt::format("the piece announces {} points, {} were found", points_, mesh_.nodes.size() - first_point_));
    if (offsets_.size() != cells_ || grid_.types.size() != first_cell_ + cells_)
      tags_.fail(fmt::format("the piece announces {} cells; {} offsets and {} types were found", cells_,
                             offsets_.size(), grid_.types.size() - first_cell_));
    const auto base = static_cast<std::int64_t>(grid_.connectivity.size());
    for (std::size_t k = 0; k < offsets_.size(); ++k) {
      const std::int64_t before = k == 0 ? 0 : offsets_[k - 1];
      if (offsets_[k] < before || offsets_[k] > static_cast<std::int64_t>(connectivity_.size()))
        tags_.fail(fmt::format("offset {} is {}, below its predecessor or beyond the {} entries of the connectivity", k,
                               offsets_[k], connectivity_.size()));
      grid_.start.push_back(base + offsets_[k]);
    }
    for (const std::int64_t point : connectivity_) {
      if (point < 0 || point >= static_cast<std::int64_t>(points_))
        tags_.fail(fmt::format("a cell uses point {}; there are {} (counted from 0)", point, points_));
      grid_.connectivity.push_back(point + static_cast<std::int64_t>(first_point_));
    }
  }

  void read_array(const XmlTags::Tag& tag) {
    const std::string_view name = tag.get("Name");
    const std::size_t components = number(tag, "NumberOfComponents", 1);
    const VtuType* type = nullptr;
    for (const VtuType& t : kVtuTypes)
      if (t.name == tag.get("type")) type = &t;
    const bool group =
        (section_ == "CellData" || section_ == "PointData") && type != nullptr && !type->real && components == 1;
    if (section_ != "Points" && section_ != "Cells" && !group) return;
    if (!in_piece_) tags_.fail(fmt::format("{} outside <Piece>", section_));
    if (type == nullptr) tags_.fail(fmt::format("data of type '{}' are not read", tag.get("type").substr(0, 40)));
    if (section_ == "Points") return add_points(reals(tag, *type));
    if (type->real) tags_.fail(fmt::format("'{}' must be whole numbers, not {}", name.substr(0, 40), type->name));
    std::vector<std::int64_t> values = whole_numbers(tag, *type);
    if (section_ == "Cells") {
      if (name == "connectivity")
        connectivity_ = std::move(values);
      else if (name == "offsets")
        offsets_ = std::move(values);
      else if (name == "types")
        grid_.types.insert(grid_.types.end(), values.begin(), values.end());
      return;
    }
    const bool of_cells = section_ == "CellData";
    VtkData& data = data_[std::string(of_cells ? "c" : "p") + std::string(name)];
    data.name = std::string(name);
    data.of_cells = of_cells;
    data.values.insert(data.values.end(), values.begin(), values.end());
  }

  void add_points(const std::vector<double>& x) {
    if (x.size() % 3 != 0) tags_.fail(fmt::format("Points has {} numbers, three for each point are needed", x.size()));
    for (std::size_t k = 0; k < x.size(); k += 3) mesh_.nodes.push_back({x[k], x[k + 1], x[k + 2]});
    if (mesh_.nodes.size() > static_cast<std::size_t>(std::numeric_limits<Index>::max()))
      tags_.fail("the file has more points than can be numbered");
  }

  /// The values as the bits of whole numbers, or as text for `take`.
  template <class T, class Text, class Bits>
  std::vector<T> values(const XmlTags::Tag& tag, const VtuType& type, const Text& from_text, const Bits& from_bits) {
    std::vector<T> out;
    const std::string_view format = tag.get("format");
    if (format == "ascii" || format.empty()) {
      LineReader reader(mesh_.name, std::string(tags_.content()));
      std::string_view line, field;
      while (reader.next(line)) {
        Fields fields(reader, line, ' ');
        for (Fields ahead = fields; ahead.next(field); ahead = fields) out.push_back(from_text(fields));
      }
      return out;
    }
    VtuCoding coding = coding_;
    std::string_view text;
    if (format == "appended") {
      const std::size_t offset = number(tag, "offset", 0);
      if (offset >= appended_.size())
        tags_.fail(fmt::format("offset {} lies beyond the {} bytes of AppendedData", offset, appended_.size()));
      text = appended_.substr(offset);
      coding.base64 = appended_base64_;
    } else if (format == "binary") {
      text = tags_.content();
    } else {
      tags_.fail(fmt::format("format '{}' is not read (ascii, binary and appended are)", format.substr(0, 40)));
    }
    std::string bytes;
    try {
      bytes = vtu_bytes(text, coding);
    } catch (const std::runtime_error& error) {
      tags_.fail(fmt::format("'{}': {}", tag.get("Name").substr(0, 40), error.what()));
    }
    if (bytes.size() % type.bytes != 0) tags_.fail(fmt::format("an array of {} ends within a value", type.name));
    out.reserve(bytes.size() / type.bytes);
    for (std::size_t at = 0; at < bytes.size(); at += type.bytes) {
      std::uint64_t bits = 0;
      for (std::size_t i = 0; i < type.bytes; ++i)
        bits = bits << 8U | static_cast<std::uint8_t>(bytes[at + (coding.big_endian ? i : type.bytes - 1 - i)]);
      out.push_back(from_bits(bits));
    }
    return out;
  }

  static std::int64_t to_whole(std::uint64_t bits, const VtuType& t) {
    const unsigned spare = 64U - 8U * t.bytes;
    return t.is_signed ? static_cast<std::int64_t>(bits << spare) >> spare : static_cast<std::int64_t>(bits);
  }

  std::vector<double> reals(const XmlTags::Tag& tag, const VtuType& t) {
    return values<double>(
        tag, t, [](Fields& fields) { return fields.real("coordinate"); },
        [&](std::uint64_t bits) {
          if (!t.real) return static_cast<double>(to_whole(bits, t));
          return t.bytes == 8 ? std::bit_cast<double>(bits)
                              : static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
        });
  }
  std::vector<std::int64_t> whole_numbers(const XmlTags::Tag& tag, const VtuType& t) {
    return values<std::int64_t>(
        tag, t, [](Fields& fields) { return fields.integer("whole number"); },
        [&](std::uint64_t bits) { return to_whole(bits, t); });
  }

  std::string content_;
  XmlTags tags_;
  Mesh mesh_;
  VtuCoding coding_;
  std::string_view appended_, section_;
  bool appended_base64_ = false, in_piece_ = false;
  std::size_t points_ = 0, cells_ = 0, first_point_ = 0, first_cell_ = 0;  // of the piece
  std::vector<std::int64_t> connectivity_, offsets_;                       // of the piece
  VtkGrid grid_;
  std::map<std::string, VtkData> data_;
};

}  // namespace

Mesh parse_vtu(std::string content, const std::string& name) { return VtuReader(std::move(content), name).read(); }

Mesh read_vtu(const std::string& path) { return parse_vtu(read_whole_file(path), path); }

}  // namespace espalier::dynamics
