#include "dynamics/output/vtkhdf.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <set>

#include "dynamics/output/hdf5_file.hpp"

namespace espalier::dynamics {
namespace {

using hdf5::NumberType;

template <class T>
std::string bytes_of_range(const T& values) {
  return {reinterpret_cast<const char*>(std::data(values)), std::size(values) * sizeof(*std::data(values))};
}

/// Rounded to 32 bits behind the leading one: exact to 1e-10, and a third shorter when packed.
std::string places(std::span<const double> values) {
  std::vector<std::uint64_t> rounded(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto bits = std::bit_cast<std::uint64_t>(values[i]);
    rounded[i] = std::isfinite(values[i]) ? (bits + (1U << 19U)) & ~((std::uint64_t{1} << 20U) - 1) : bits;
  }
  return bytes_of_range(rounded);
}

std::string singles(std::span<const double> values) {
  const std::vector<float> rounded(values.begin(), values.end());
  return bytes_of_range(rounded);
}

/// Names of arrays: HDF5 divides paths at slashes; two names must not become one.
std::vector<std::string> names_of(const std::vector<std::string>& wanted) {
  std::vector<std::string> out;
  std::set<std::string> taken;
  for (std::string name : wanted) {
    std::replace(name.begin(), name.end(), '/', '_');
    if (name.empty() || name == ".") name = "_";
    while (!taken.insert(name).second) name += '_';
    out.push_back(name);
  }
  return out;
}

}  // namespace

/// The arrays of a file.
class VtkHdf::Writer {
 public:
  Writer(const std::string& path, const VtkHdfLayout& layout) : file_(path) {
    file_.add_attribute("VTKHDF", {"Version", "", {2, 2}, false});
    file_.add_attribute("VTKHDF", {"Type", "UnstructuredGrid", {}, false});
    if (!layout.units.empty()) file_.add_attribute("VTKHDF", {"Units", layout.units, {}, false});
    file_.add_attribute("VTKHDF/Steps", {"NSteps", "", {0}, true});
    const VtuCells& cells = *layout.cells;
    const auto count = static_cast<std::uint64_t>(cells.count());
    const std::int64_t sizes[] = {static_cast<std::int64_t>(layout.points), cells.count(),
                                  static_cast<std::int64_t>(cells.connectivity().size())};
    std::vector<std::pair<int, std::string>> fixed;
    const auto add_fixed = [&](const std::string& name, NumberType type, std::uint64_t rows, std::string bytes) {
      fixed.emplace_back(file_.add_chunked("VTKHDF/" + name, type, 0, rows, true), std::move(bytes));
    };
    const char* names[] = {"NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"};
    for (int k = 0; k < 3; ++k) add_fixed(names[k], NumberType::int64, 1, bytes_of_range(std::span(&sizes[k], 1)));
    std::vector<std::int64_t> ends(1, 0);
    ends.insert(ends.end(), cells.offsets().begin(), cells.offsets().end());
    add_fixed("Offsets", NumberType::int64, count + 1, bytes_of_range(ends));
    add_fixed("Types", NumberType::uint8, count, bytes_of_range(cells.types()));
    add_fixed("Connectivity", NumberType::int64, cells.connectivity().size(), bytes_of_range(cells.connectivity()));
    const std::vector<std::int64_t> body(layout.body.begin(), layout.body.end());
    add_fixed("CellData/body", NumberType::int64, count, bytes_of_range(body));
    file_.add_texts("bodies", layout.body_names);
    times_ = file_.add_series("VTKHDF/Steps/Values", NumberType::float64);
    zeros_ = file_.add_series("VTKHDF/Steps/PartOffsets", NumberType::int64);
    for (const char* name : {"CellOffsets", "ConnectivityIdOffsets", "CellDataOffsets/body"})
      file_.add_name(std::string("VTKHDF/Steps/") + name, zeros_);
    parts_ = file_.add_series("VTKHDF/Steps/NumberOfParts", NumberType::int64);
    add_frames("Points", "PointOffsets", NumberType::float64, 3, layout.points);
    for (const VtkHdfLayout::Field& f : layout.point_fields)
      add_frames("PointData/" + f.name, "PointDataOffsets/" + f.name, NumberType::float32, f.components, layout.points);
    for (const VtkHdfLayout::Field& f : layout.cell_fields)
      add_frames("CellData/" + f.name, "CellDataOffsets/" + f.name, NumberType::float32, f.components, count);
    numbers_ = file_.add_series("frames", NumberType::int64);
    for (const std::string& name : names_of(layout.quantities)) {
      quantities_.push_back(file_.add_series("VTKHDF/FieldData/" + name, NumberType::float64));
      file_.add_name("VTKHDF/Steps/FieldDataOffsets/" + name, numbers_);
    }
    file_.begin();
    for (const auto& [array, bytes] : fixed) file_.append_rows(array, bytes);
  }

  void write(const VtkHdfFrame& frame) {
    std::size_t k = 0;
    append(frames_[k++], places(frame.points));
    for (const auto& field : frame.point_fields) append(frames_[k++], singles(field));
    for (const auto& field : frame.cell_fields) append(frames_[k++], singles(field));
    for (std::size_t q = 0; q < quantities_.size(); ++q) file_.append(quantities_[q], frame.quantities[q]);
    end_frame(frame.t);
  }

  /// Takes frame k of another file as it is.
  void take(const hdf5::Earlier& from, std::uint64_t k) {
    for (const Frames& f : frames_) {
      const std::uint64_t pieces = file_.chunks_per_append(f.array);
      for (std::uint64_t p = 0; p < pieces; ++p) file_.append_packed(f.array, from.packed(f.array, k * pieces + p));
      note_offset(f);
    }
    for (const int q : quantities_) file_.append(q, static_cast<std::int64_t>(from.bits(q, k)));
    end_frame(time(from, k));
  }

  [[nodiscard]] double time(const hdf5::Earlier& from, std::uint64_t k) const {
    return std::bit_cast<double>(from.bits(times_, k));
  }
  [[nodiscard]] std::uint64_t frames_of(const hdf5::Earlier& from) const { return from.rows(times_); }
  [[nodiscard]] std::int64_t frames() const { return count_; }
  [[nodiscard]] double last() const { return last_; }
  hdf5::File& file() { return file_; }

 private:
  struct Frames {
    int array, offsets;
  };

  void add_frames(const std::string& name, const std::string& offsets, NumberType type, int columns,
                  std::uint64_t rows) {
    const auto each = static_cast<std::uint64_t>(columns == 1 ? 0 : columns);
    const int array = file_.add_chunked("VTKHDF/" + name, type, each, rows, false);
    frames_.push_back({array, file_.add_series("VTKHDF/Steps/" + offsets, NumberType::int64)});
  }
  void note_offset(const Frames& f) {
    file_.append(f.offsets, count_ * static_cast<std::int64_t>(file_.rows_per_append(f.array)));
  }
  void append(const Frames& f, const std::string& bytes) {
    file_.append_rows(f.array, bytes);
    note_offset(f);
  }
  void end_frame(double t) {
    file_.append(zeros_, std::int64_t{0});
    file_.append(numbers_, count_);
    file_.append(parts_, std::int64_t{1});
    file_.append(times_, t);
    file_.set_attribute("VTKHDF/Steps", "NSteps", ++count_);
    file_.commit();
    last_ = t;
  }

  hdf5::File file_;
  int times_ = 0, parts_ = 0, zeros_ = 0, numbers_ = 0;
  std::vector<int> quantities_;
  std::vector<Frames> frames_;
  std::int64_t count_ = 0;
  double last_ = 0;
};

VtkHdf::VtkHdf(std::string path, VtkHdfLayout layout, double keep_until)
    : path_(std::move(path)), layout_(std::move(layout)), writer_(std::make_unique<Writer>(path_, layout_)) {
  if (std::isnan(keep_until) || !std::filesystem::exists(path_)) return;
  const hdf5::Earlier earlier(path_, writer_->file());
  const std::uint64_t frames = writer_->frames_of(earlier);
  for (std::uint64_t k = 0; k < frames; ++k) {
    const double t = writer_->time(earlier, k);
    later_ = !(t <= keep_until);
    if (later_) break;
    writer_->take(earlier, k);
    kept_ = t;
  }
  if (later_) later_until_ = writer_->time(earlier, frames - 1);
  if (!later_ && kept_) writer_->file().publish();
}

VtkHdf::~VtkHdf() = default;

void VtkHdf::write(const VtkHdfFrame& frame) {
  writer_->write(frame);
  if (later_ && frame.t < later_until_) return;
  later_ = false;
  writer_->file().publish();
}

void VtkHdf::catch_up() {
  if (!later_ || writer_->frames() == 0) return;
  Writer both(path_ + ".both", layout_);
  {
    const hdf5::Earlier own(writer_->file().written(), writer_->file()), earlier(path_, writer_->file());
    for (std::uint64_t k = 0; k < writer_->frames_of(own); ++k) both.take(own, k);
    for (std::uint64_t k = 0; k < writer_->frames_of(earlier); ++k)
      if (writer_->time(earlier, k) > writer_->last()) both.take(earlier, k);
  }
  std::filesystem::rename(both.file().written(), path_);
}

void VtkHdf::finish() {
  later_ = false;
  if (writer_->frames() > 0) writer_->file().publish();
}

}  // namespace espalier::dynamics
