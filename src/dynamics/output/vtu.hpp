/// \file
/// Results for ParaView: .vtu files (VTK XML, unstructured grid, appended raw binary) and .pvd series.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynamics/mesh/element_type.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics {

/// One named array over points or cells: `components` numbers for each.
struct OutputField {
  std::string name;
  int components = 1;
  std::span<const double> values;
};

/// The cells of a result file: fixed over a simulation.
class VtuCells {
 public:
  /// Adds a cell of these points and returns its number.
  Index add(ElementType type, std::span<const Index> points);
  [[nodiscard]] Index count() const { return static_cast<Index>(types_.size()); }
  /// Points of all cells, where those of each end, and VTK's numbers of the shapes.
  [[nodiscard]] const std::vector<std::int64_t>& connectivity() const { return connectivity_; }
  [[nodiscard]] const std::vector<std::int64_t>& offsets() const { return offsets_; }
  [[nodiscard]] const std::vector<std::uint8_t>& types() const { return types_; }

 private:
  friend void write_vtu(const std::string&, std::span<const double>, const VtuCells&, std::span<const OutputField>,
                        std::span<const OutputField>);
  std::vector<std::int64_t> connectivity_, offsets_;
  std::vector<std::uint8_t> types_;
};

/// Writes one .vtu file: points (3 numbers each), cells, fields over points and over cells. The file is written under
/// another name and then renamed, so a reader never sees half a file.
/// @throws std::invalid_argument when a field has the wrong length; Error(invalid_input) when the file cannot be
/// written
void write_vtu(const std::string& path, std::span<const double> points, const VtuCells& cells,
               std::span<const OutputField> point_fields, std::span<const OutputField> cell_fields);

/// A time series: a .pvd file that lists .vtu files. It is rewritten (and renamed) at every step, so it can be opened
/// while the simulation runs.
class PvdSeries {
 public:
  /// @param path name of the .pvd file; the .vtu files stand beside it
  explicit PvdSeries(std::string path) : path_(std::move(path)) {}
  /// The name of the .vtu file for the next step of part `part`: "<stem>_<part>_<number>.vtu" beside the .pvd file.
  [[nodiscard]] std::string file_name(int part) const;
  /// Goes on with a series that is there already (a restarted run) behind time t. Later entries stay in the list until
  /// new ones take their place: a run that dies early loses nothing. Does nothing where there is no such file.
  /// @return the time of the last entry up to t; none without one @throws Error(invalid_input) if it is not one of ours
  std::optional<double> resume(double t);
  /// Begins anew: removes the .vtu files that an earlier run has listed, which would stay beside a shorter series for
  /// ever. Files that the series does not list, or that have other names than its own, are left alone.
  /// @return whether there was such a series
  bool begin_anew();
  /// Takes up the file of that name at time t. Parts of one time are added one after the other.
  void add(double t, int part);
  /// Forgets the entries of earlier runs that no new one has replaced, and removes their files.
  void finish();

 private:
  struct DataSet {
    double t;
    int part;
    std::string file;
  };
  [[nodiscard]] std::vector<DataSet> listed() const;
  void remove_file(const DataSet& entry) const;
  void write() const;

  std::string path_;
  std::vector<DataSet> data_sets_;
  std::vector<DataSet> later_;  // of an earlier run, behind the time that this one has reached
  std::vector<int> next_;       // next number of every part
};

}  // namespace espalier::dynamics
