#include <fmt/format.h>

#include <bit>
#include <limits>

#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/read/vtk_cells.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {
namespace {

/// Data types of the format: size of one value in bytes; long is that of 64-bit machines.
struct DataType {
  const char* name;
  int bytes;
  bool real, is_signed;
};
constexpr DataType kDataTypes[] = {
    {"float", 4, true, true},           {"double", 8, true, true},          {"int", 4, false, true},
    {"unsigned_int", 4, false, false},  {"short", 2, false, true},          {"unsigned_short", 2, false, false},
    {"char", 1, false, true},           {"unsigned_char", 1, false, false}, {"long", 8, false, true},
    {"unsigned_long", 8, false, false}, {"vtkidtype", 8, false, true},      {"vtktypeint64", 8, false, true},
    {"vtktypeuint64", 8, false, false}, {"vtktypeint32", 4, false, true}};
constexpr DataType kInt = {"int", 4, false, true}, kFloat = {"float", 4, true, true},
                   kByte = {"unsigned_char", 1, false, false};

class VtkReader {
 public:
  VtkReader(std::string content, const std::string& name) : reader_(name, std::move(content)) { mesh_.name = name; }

  Mesh read() {
    read_head();
    while (next_keyword()) {
      if (keyword_ == "points")
        read_points();
      else if (keyword_ == "cells")
        read_cells();
      else if (keyword_ == "cell_types")
        grid_.types = integers(count("number of cell types"), kInt);
      else if (keyword_ == "cell_data" || keyword_ == "point_data")
        begin_data();
      else if (keyword_ == "metadata")
        skip_to_blank_line();
      else if (!read_attribute())
        reader_.fail(fmt::format("unknown keyword '{}'; save the mesh as a legacy .vtk file of an unstructured grid",
                                 std::string_view(keyword_).substr(0, 40)));
    }
    if (mesh_.nodes.empty()) reader_.fail("the file has no POINTS");
    make_elements();
    return std::move(mesh_);
  }

 private:
  std::string_view need_line(const char* what) {
    std::string_view line;
    if (!reader_.next(line)) reader_.fail(fmt::format("the file ends before {}", what));
    return trim(line);
  }

  void read_head() {
    const std::string_view first = need_line("its first line");
    constexpr std::string_view kMagic = "# vtk DataFile Version ";
    if (first.substr(0, kMagic.size()) != kMagic)
      reader_.fail("a legacy .vtk file starts with '# vtk DataFile Version'");
    Fields version(reader_, first.substr(kMagic.size()), ' ');
    offsets_ = version.real("version") >= 5;
    need_line("its title");
    const std::string format = lower(need_line("ASCII or BINARY"));
    if (format != "ascii" && format != "binary")
      reader_.fail(fmt::format("the third line says ASCII or BINARY, not '{}'", format.substr(0, 40)));
    binary_ = format == "binary";
    std::string_view line;
    do line = need_line("DATASET");
    while (line.empty());
    if (lower(line) != "dataset unstructured_grid")
      reader_.fail(fmt::format("'{}' is not read; save the mesh as DATASET UNSTRUCTURED_GRID", line.substr(0, 60)));
  }

  /// Moves to the next line that is not blank and takes its first word. @return false at the end of the file
  bool next_keyword() {
    rest_ = {};
    std::string_view line;
    do {
      if (!reader_.next(line)) return false;
      line = trim(line);
    } while (line.empty());
    const std::size_t end = std::min(line.find_first_of(" \t"), line.size());
    first_word_ = line.substr(0, end);
    keyword_ = lower(first_word_);
    arguments_ = line.substr(end);
    return true;
  }

  std::string_view word(const char* what) {
    arguments_ = trim(arguments_);
    if (arguments_.empty()) reader_.fail(fmt::format("{}: {} is missing", keyword_, what));
    const std::size_t end = std::min(arguments_.find_first_of(" \t"), arguments_.size());
    const std::string_view result = arguments_.substr(0, end);
    arguments_.remove_prefix(end);
    return result;
  }
  std::size_t count(const char* what) { return checked(Fields(reader_, word(what), ' ').integer(what), what); }
  /// Every entry takes a byte at least.
  [[nodiscard]] std::size_t checked(std::int64_t n, const char* what) const {
    if (n < 0 || static_cast<std::size_t>(n) > reader_.remaining() + rest_.size())
      reader_.fail(fmt::format("{}: {} entries are announced, {} bytes are left", what, n, reader_.remaining()));
    return static_cast<std::size_t>(n);
  }
  DataType type() {
    const std::string name = lower(word("type of the data"));
    for (const DataType& t : kDataTypes)
      if (name == t.name) return t;
    reader_.fail(fmt::format("data of type '{}' are not read", name.substr(0, 40)));
  }

  /// The next number of a text, over line ends.
  Fields text_field() {
    std::string_view line;
    while (rest_ = trim(rest_), rest_.empty()) {
      if (!reader_.next(line)) reader_.fail("the file ends inside a list of numbers");
      rest_ = line;
    }
    const std::size_t end = std::min(rest_.find_first_of(" \t"), rest_.size());
    const std::string_view field = rest_.substr(0, end);
    rest_.remove_prefix(end);
    return {reader_, field, ' '};
  }

  /// One big-endian value, as its bits.
  std::uint64_t raw(int bytes) {
    std::uint64_t bits = 0;
    for (const char c : reader_.bytes(static_cast<std::size_t>(bytes)))
      bits = bits << 8U | static_cast<std::uint8_t>(c);
    return bits;
  }

  std::vector<double> reals(std::size_t n, const DataType& t) {
    std::vector<double> values(n);
    for (double& x : values) {
      if (!binary_)
        x = text_field().real("number");
      else if (!t.real)
        x = static_cast<double>(whole(t));
      else
        x = t.bytes == 8 ? std::bit_cast<double>(raw(8))
                         : static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw(4))));
    }
    end_list();
    return values;
  }

  std::int64_t whole(const DataType& t) {
    const std::uint64_t bits = raw(t.bytes);
    const unsigned spare = 64U - 8U * static_cast<unsigned>(t.bytes);
    return t.is_signed ? static_cast<std::int64_t>(bits << spare) >> spare : static_cast<std::int64_t>(bits);
  }

  std::vector<std::int64_t> integers(std::size_t n, const DataType& t) {
    if (t.real) reader_.fail(fmt::format("{}: whole numbers are needed, the file says {}", keyword_, t.name));
    std::vector<std::int64_t> values(n);
    for (auto& v : values) v = binary_ ? whole(t) : text_field().integer("whole number");
    end_list();
    return values;
  }

  void end_list() {
    if (!trim(rest_).empty()) reader_.fail(fmt::format("more numbers than announced: '{}'", trim(rest_).substr(0, 40)));
    rest_ = {};
  }

  void skip_to_blank_line() {
    std::string_view line;
    while (reader_.next(line) && !trim(line).empty()) {
    }
  }

  void read_points() {
    const std::size_t n = count("number of points");
    const DataType t = type();
    static_cast<void>(checked(static_cast<std::int64_t>(3 * n), "POINTS"));
    if (n > static_cast<std::size_t>(std::numeric_limits<Index>::max()))
      reader_.fail(fmt::format("{} points are more than {}", n, std::numeric_limits<Index>::max()));
    const std::vector<double> x = reals(3 * n, t);
    mesh_.nodes.clear();
    for (std::size_t k = 0; k < n; ++k) mesh_.nodes.push_back({x[3 * k], x[3 * k + 1], x[3 * k + 2]});
  }

  void read_cells() {
    const std::size_t n = count("number of cells"), size = count("size of the list");
    cells_line_ = reader_.line();
    if (offsets_) return read_cells_by_offsets(n, size);
    const std::vector<std::int64_t> list = integers(size, kInt);
    grid_.start = {0};
    grid_.connectivity.clear();
    std::size_t at = 0;
    for (std::size_t k = 0; k < n; ++k) {
      if (at >= size || list[at] < 0 || static_cast<std::size_t>(list[at]) > size - at - 1)
        reader_.fail(fmt::format("cell {} goes beyond the size {} of the list in CELLS", k, size));
      const auto first = list.begin() + static_cast<std::ptrdiff_t>(at) + 1;
      grid_.connectivity.insert(grid_.connectivity.end(), first, first + list[at]);
      at += static_cast<std::size_t>(list[at]) + 1;
      grid_.start.push_back(static_cast<std::int64_t>(grid_.connectivity.size()));
    }
    if (at != size) reader_.fail(fmt::format("CELLS announces a list of {} numbers, its cells take {}", size, at));
  }

  /// Version 5: OFFSETS (n numbers, one more than cells) and CONNECTIVITY, each with its type.
  void read_cells_by_offsets(std::size_t n, std::size_t size) {
    if (!next_keyword() || keyword_ != "offsets") reader_.fail("CELLS of version 5 needs OFFSETS");
    grid_.start = integers(n, type());
    if (!next_keyword() || keyword_ != "connectivity") reader_.fail("CELLS of version 5 needs CONNECTIVITY");
    grid_.connectivity = integers(size, type());
    for (std::size_t k = 0; k < n; ++k)
      if (grid_.start[k] < (k == 0 ? 0 : grid_.start[k - 1]) || grid_.start[k] > static_cast<std::int64_t>(size))
        reader_.fail(fmt::format("OFFSETS: entry {} is {}, below its predecessor or beyond the {} of CONNECTIVITY", k,
                                 grid_.start[k], size));
  }

  // Attributes: integers of one component become sets, all else is passed over.

  void begin_data() {
    of_cells_ = keyword_ == "cell_data";
    tuples_ = count("number of entries");
  }

  bool read_attribute() {
    if (keyword_ == "scalars") {
      const std::string name(word("name"));
      const DataType t = type();
      const std::size_t components = trim(arguments_).empty() ? 1 : count("number of components");
      if (next_keyword() && keyword_ != "lookup_table") reader_.fail("SCALARS needs a line LOOKUP_TABLE");
      read_array(name, components, tuples_, t);
    } else if (keyword_ == "field") {
      read_field();
    } else if (keyword_ == "lookup_table" || keyword_ == "color_scalars") {
      const bool table = keyword_ == "lookup_table";
      const std::string name(word("name"));
      const std::size_t n = count("size");
      read_array(name, table ? 4 : n, table ? n : tuples_, binary_ ? kByte : kFloat);
    } else if (keyword_ == "texture_coordinates") {
      const std::string name(word("name"));
      const std::size_t components = count("dimension");
      read_array(name, components, tuples_, type());
    } else {
      static constexpr std::pair<std::string_view, int> kPlain[] = {
          {"vectors", 3}, {"normals", 3}, {"tensors", 9}, {"tensors6", 6}, {"global_ids", 1}, {"pedigree_ids", 1}};
      for (const auto& [key, components] : kPlain) {
        if (keyword_ != key) continue;
        const std::string name(word("name"));
        skip_array(static_cast<std::size_t>(components), tuples_, type());
        return true;
      }
      return false;
    }
    return true;
  }

  void read_field() {
    word("name");
    const std::size_t arrays = count("number of arrays");
    for (std::size_t k = 0; k < arrays; ++k) {
      do
        if (!next_keyword()) reader_.fail(fmt::format("FIELD announces {} arrays, {} were found", arrays, k));
      while (keyword_ == "metadata" && (skip_to_blank_line(), true));
      const std::string name(first_word_);
      const std::size_t components = count("number of components"), tuples = count("number of tuples");
      read_array(name, components, tuples, type());
    }
  }

  [[nodiscard]] std::size_t length(std::size_t components, std::size_t tuples) const {
    if (components != 0 && tuples > (reader_.remaining() + rest_.size()) / components)
      reader_.fail(
          fmt::format("{} x {} numbers are announced, {} bytes are left", tuples, components, reader_.remaining()));
    return components * tuples;
  }

  void skip_array(std::size_t components, std::size_t tuples, const DataType& t) {
    static_cast<void>(reals(length(components, tuples), t));
  }

  void read_array(const std::string& name, std::size_t components, std::size_t tuples, const DataType& t) {
    if (t.real || components != 1 || tuples_ == 0 || tuples != tuples_) return skip_array(components, tuples, t);
    std::vector<std::int64_t> values = integers(length(1, tuples), t);
    grid_.data.push_back({name, of_cells_, std::move(values)});
  }

  // ---

  void make_elements() {
    const std::size_t cells = grid_.start.empty() ? 0 : grid_.start.size() - 1;
    if (grid_.types.size() != cells)
      reader_.fail(fmt::format("CELLS has {} cells, CELL_TYPES has {}; both are needed", cells, grid_.types.size()));
    add_vtk_grid(grid_, fmt::format("{}:{}", reader_.path(), cells_line_), mesh_);
  }

  LineReader reader_;
  Mesh mesh_;
  bool binary_ = false, offsets_ = false, of_cells_ = false;
  std::string_view first_word_;  // of a line that is no list
  std::string keyword_;          // the same in lower case
  std::string_view arguments_;   // of the keyword's line
  std::string_view rest_;        // of a line of numbers
  std::size_t tuples_ = 0;       // of the data section; 0: none yet
  std::int64_t cells_line_ = 0;
  VtkGrid grid_;
};

}  // namespace

Mesh parse_vtk(std::string content, const std::string& name) { return VtkReader(std::move(content), name).read(); }

Mesh read_vtk(const std::string& path) { return parse_vtk(read_whole_file(path), path); }

}  // namespace espalier::dynamics
