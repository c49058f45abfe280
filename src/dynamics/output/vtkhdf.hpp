/// \file
/// Results in one file: VTKHDF (version 2.2), an unstructured grid over time, for ParaView and VTK.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynamics/output/vtu.hpp"

namespace espalier::dynamics {

/// What is in every frame of a file.
struct VtkHdfLayout {
  struct Field {
    std::string name;
    int components = 1;
  };
  const VtuCells* cells = nullptr;
  std::size_t points = 0;
  std::span<const Index> body;  ///< of each cell
  std::vector<std::string> body_names;
  std::vector<Field> point_fields, cell_fields;
  std::vector<std::string> quantities;  ///< one number a frame each
  std::string units = {};               ///< of all numbers, an attribute of the group VTKHDF; empty: it is not said
};

/// Numbers in the order of the layout.
struct VtkHdfFrame {
  double t = 0;
  std::span<const double> points;
  std::vector<std::span<const double>> point_fields, cell_fields;
  std::span<const double> quantities;
};

/// Cells are written once; places with 33 significant bits, fields with 24 (float32), all packed. The file can be
/// opened after the first frame, and is whole whenever the process dies (hdf5_file.hpp).
class VtkHdf {
 public:
  /// @param layout  what it points to must live as long as this
  /// @param keep_until  frames of a file of that name up to this time are kept (a restarted run); NaN: none
  VtkHdf(std::string path, VtkHdfLayout layout, double keep_until);
  ~VtkHdf();
  /// Time of the last frame that was kept; none without one.
  [[nodiscard]] std::optional<double> kept() const { return kept_; }
  /// @throws Error(invalid_input) when the disk is full or fails
  void write(const VtkHdfFrame& frame);
  /// Frames of an earlier run that this one has not reached yet stay in the file until it has. Until then what is new
  /// is in a file beside it, and this puts both together.
  void catch_up();
  /// Frames of earlier runs behind the last one are forgotten.
  void finish();

 private:
  class Writer;

  std::string path_;
  VtkHdfLayout layout_;
  std::unique_ptr<Writer> writer_;
  std::optional<double> kept_;
  double later_until_ = 0;  // last time in the earlier run's file
  bool later_ = false;      // frames of an earlier run are still to be replaced
};

}  // namespace espalier::dynamics
