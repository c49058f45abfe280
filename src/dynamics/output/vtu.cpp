#include "dynamics/output/vtu.hpp"

#include <fmt/format.h>

#include <bit>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include "base/at.hpp"
#include "base/output_file.hpp"
#include "base/strtod.hpp"
#include "base/text_stream.hpp"
#include "matrix/file.hpp"

namespace espalier::dynamics {
namespace {

static_assert(std::endian::native == std::endian::little, "the files are declared as little-endian");

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '&')
      result += "&amp;";
    else if (c == '<')
      result += "&lt;";
    else if (c == '>')
      result += "&gt;";
    else if (c == '"')
      result += "&quot;";
    else
      result += c;
  }
  return result;
}

/// Collects arrays: their XML declarations with offsets now, their bytes at the end.
class Appended {
 public:
  std::string declare(const char* type, const std::string& name, int components, const void* data, std::size_t bytes) {
    std::string xml = fmt::format(
        "        <DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"/>\n",
        type, escaped(name), components, offset_);
    blocks_.push_back({data, bytes});
    offset_ += sizeof(std::uint64_t) + bytes;
    return xml;
  }
  void write(base::OutputFile& out) const {
    for (const Block& block : blocks_) {
      const std::uint64_t size = block.bytes;
      out.write({reinterpret_cast<const char*>(&size), sizeof size});
      out.write({static_cast<const char*>(block.data), block.bytes});
    }
  }

 private:
  struct Block {
    const void* data;
    std::size_t bytes;
  };
  std::vector<Block> blocks_;
  std::uint64_t offset_ = 0;
};

std::string declare_fields(Appended& appended, std::span<const OutputField> fields, std::size_t count,
                           const char* what) {
  std::string xml;
  for (const OutputField& field : fields) {
    if (field.values.size() != count * at(field.components))
      throw std::invalid_argument(
          fmt::format("write_vtu: field '{}' has {} numbers, {} {} times {} components are needed", field.name,
                      field.values.size(), count, what, field.components));
    xml += appended.declare("Float64", field.name, field.components, field.values.data(), field.values.size_bytes());
  }
  return xml;
}

}  // namespace

Index VtuCells::add(ElementType type, std::span<const Index> points) {
  if (points.size() != at(shape_of(type).nodes))
    throw std::invalid_argument(fmt::format("VtuCells::add: {} points given, {} has {}", points.size(),
                                            shape_of(type).name, shape_of(type).nodes));
  connectivity_.insert(connectivity_.end(), points.begin(), points.end());
  offsets_.push_back(static_cast<std::int64_t>(connectivity_.size()));
  types_.push_back(static_cast<std::uint8_t>(shape_of(type).vtk_type));
  return count() - 1;
}

void write_vtu(const std::string& path, std::span<const double> points, const VtuCells& cells,
               std::span<const OutputField> point_fields, std::span<const OutputField> cell_fields) {
  if (points.size() % 3 != 0) throw std::invalid_argument("write_vtu: points need 3 numbers each");
  const std::size_t count = points.size() / 3, cell_count = at(cells.count());
  Appended appended;
  std::string xml = fmt::format(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n  <UnstructuredGrid>\n    <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n",
      count, cell_count);
  xml += "      <Points>\n" + appended.declare("Float64", "Points", 3, points.data(), points.size_bytes());
  xml += "      </Points>\n      <Cells>\n";
  xml += appended.declare("Int64", "connectivity", 1, cells.connectivity_.data(), 8 * cells.connectivity_.size());
  xml += appended.declare("Int64", "offsets", 1, cells.offsets_.data(), 8 * cells.offsets_.size());
  xml += appended.declare("UInt8", "types", 1, cells.types_.data(), cells.types_.size());
  xml += "      </Cells>\n      <PointData>\n" + declare_fields(appended, point_fields, count, "points");
  xml += "      </PointData>\n      <CellData>\n" + declare_fields(appended, cell_fields, cell_count, "cells");
  xml += "      </CellData>\n    </Piece>\n  </UnstructuredGrid>\n  <AppendedData encoding=\"raw\">\n_";
  base::OutputFile file(path);
  file.write(xml);
  appended.write(file);
  file.write("\n  </AppendedData>\n</VTKFile>\n");
  file.commit();
}

std::string PvdSeries::file_name(int part) const {
  const std::size_t index = at(part);
  const int number = index < next_.size() ? next_[index] : 0;
  const std::filesystem::path pvd(path_);
  return (pvd.parent_path() / fmt::format("{}_{}_{:06}.vtu", pvd.stem().string(), part, number)).string();
}

std::vector<PvdSeries::DataSet> PvdSeries::listed() const {
  std::vector<DataSet> result;
  if (std::error_code absent; !std::filesystem::exists(path_, absent)) return result;
  base::TextReader in{std::string(matrix::FileBytes(path_).bytes())};
  std::string line;
  while (std::getline(in, line)) {
    if (line.find("<DataSet ") == std::string::npos) continue;
    const auto attribute = [&](const std::string& name) {
      const std::size_t from = line.find(name + "=\"");
      const std::size_t to = from == std::string::npos ? from : line.find('"', from + name.size() + 2);
      if (to == std::string::npos) throw Error(StatusCode::invalid_input, path_ + ": not a series of this program");
      return line.substr(from + name.size() + 2, to - from - name.size() - 2);
    };
    constexpr int kMostParts = 1000000;
    const DataSet entry{base::strtod(attribute("timestep").c_str()), std::atoi(attribute("part").c_str()),
                        attribute("file")};
    if (entry.part >= 0 && entry.part < kMostParts) result.push_back(entry);
  }
  return result;
}

void PvdSeries::remove_file(const DataSet& entry) const {
  const std::filesystem::path pvd(path_);
  const std::string begin = fmt::format("{}_{}_", pvd.stem().string(), entry.part), end = ".vtu";
  const std::string& name = entry.file;
  if (name.size() <= begin.size() + end.size() || !name.starts_with(begin) || !name.ends_with(end)) return;
  const std::string number = name.substr(begin.size(), name.size() - begin.size() - end.size());
  if (number.find_first_not_of("0123456789") != std::string::npos) return;
  std::error_code ignored;  // a file that is not there, or is held, does no harm
  std::filesystem::remove(pvd.parent_path() / name, ignored);
}

bool PvdSeries::begin_anew() {
  try {
    const std::vector<DataSet> entries = listed();
    for (const DataSet& entry : entries) remove_file(entry);
    return !entries.empty();
  } catch (const Error&) {  // somebody else's file, which is about to be replaced
    return false;
  }
}

std::optional<double> PvdSeries::resume(double t) {
  for (const DataSet& entry : listed()) {
    if (!(entry.t <= t)) {
      later_.push_back(entry);
      continue;
    }
    data_sets_.push_back(entry);
    const auto part = at(entry.part);
    if (next_.size() <= part) next_.resize(part + 1, 0);
    ++next_[part];
  }
  return data_sets_.empty() ? std::nullopt : std::optional(data_sets_.back().t);
}

void PvdSeries::add(double t, int part) {
  if (part < 0) throw std::invalid_argument(fmt::format("PvdSeries::add: part {} is negative", part));
  data_sets_.push_back({t, part, std::filesystem::path(file_name(part)).filename().string()});
  if (next_.size() <= at(part)) next_.resize(at(part) + 1, 0);
  ++next_[at(part)];
  std::erase_if(later_, [&](const DataSet& e) { return e.t <= t || e.file == data_sets_.back().file; });
  write();
}

void PvdSeries::finish() {
  if (later_.empty()) return;
  const std::vector<DataSet> stale = std::move(later_);
  later_.clear();
  write();
  for (const DataSet& entry : stale) remove_file(entry);
}

void PvdSeries::write() const {
  base::OutputFile file(path_);
  file.write(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n"
      "  <Collection>\n");
  for (const auto* list : {&data_sets_, &later_})
    for (const DataSet& e : *list)
      file.write(fmt::format("    <DataSet timestep=\"{}\" part=\"{}\" file=\"{}\"/>\n", e.t, e.part, escaped(e.file)));
  file.write("  </Collection>\n</VTKFile>\n");
  file.commit();
}

}  // namespace espalier::dynamics
