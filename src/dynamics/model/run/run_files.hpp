/// \file
/// The files of a run and when they are written.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/integrators/integrator.hpp"
#include "dynamics/model/output/pictures.hpp"
#include "dynamics/model/output/quantities.hpp"
#include "dynamics/model/run/due_times.hpp"
#include "dynamics/output/csv.hpp"
#include "espalier/model_harmonic.hpp"

namespace espalier::dynamics::model {

/// A folder made (if it is not there) and held by one run at a time, as long as the object lives.
class HeldFolder {
 public:
  /// @throws Error(invalid_input) when it cannot be made, or another run holds it
  explicit HeldFolder(const std::string& path);
  ~HeldFolder();
  HeldFolder(const HeldFolder&) = delete;
  HeldFolder& operator=(const HeldFolder&) = delete;

 private:
  int descriptor_ = -1;
};

/// Writes into one folder: quantities.csv, results.vtkhdf (or motion.pvd with its .vtu files), state.restart. An output
/// with an interval is written at the first step that ends at or after its time (with exact_times: steps end there);
/// pictures are those of that very time, by interpolation between the ends of the step. The time of a statics run is
/// its load factor.
class RunFiles {
 public:
  /// @param folder made if it is not there; empty: nothing is written
  /// @param integrator null in a statics run, which has no restart file
  RunFiles(const OutputSpec& spec, std::string folder, Mechanism& mechanism, const std::vector<Quantity>& quantities,
           const std::unique_ptr<Integrator>& integrator);

  /// @param initial the state at the start of the motion @param restarted files in the folder are gone on with
  void begin(const Sample& s, const State& initial, bool restarted);
  /// Shapes of modes at a state (n numbers each) as modes.vtkhdf (.pvd), numbered from 1 where others have the time:
  /// the bodies displaced by 5 % of their extent, the shape itself as their velocity.
  void modes(const State& state, const std::vector<std::vector<double>>& shapes);
  /// The response as harmonic.csv, and its shapes at a state as harmonic_LOAD.vtkhdf (.pvd), where a shape's number
  /// from 1 and the part of its period, of which there are `phases`, stand for the time: the bodies displaced by up to
  /// 5 % of their extent, the response's own velocities.
  void harmonic(const State& state, const ModelHarmonicResult& response, int phases);
  void step(const Sample& s);
  void end(const Sample& s);  ///< the last; other runs may have the folder from then on
  /// Saves what can be saved when the run fails; never throws.
  void emergency(const Sample& s) noexcept;
  /// The next time at which a step has to end.
  [[nodiscard]] double next_exact_time() const;
  [[nodiscard]] const std::vector<std::string>& written() const { return written_; }
  /// Told of each row of quantities.csv; set before begin().
  using RowListener = std::function<void(double t, const std::vector<double>& values)>;
  void tell_rows(RowListener listener) { told_ = std::move(listener); }
  [[nodiscard]] std::vector<std::string> columns() const;  ///< names of the rows' numbers; empty: there is no CSV file

 private:
  void write_csv(const Sample& s);
  /// @param picture  a state with the time that stands for it @param s  of the step that it is in
  void write_picture(const State& picture, const Sample& s);
  void write_due_pictures(const Sample& s);
  void write_restart_file(const Sample& s);
  void begin_csv(const Sample& s, double keep_until);

  OutputSpec spec_;
  std::string folder_;
  std::unique_ptr<HeldFolder> held_;
  Mechanism& mechanism_;
  const std::vector<Quantity>& chosen_;
  const std::unique_ptr<Integrator>& integrator_;  // of the run, which may replace it
  std::vector<Quantity> columns_;
  std::unique_ptr<CsvWriter> csv_;
  const Sample* sample_ = nullptr;  // of the row being written
  std::vector<double> row_;         // its values
  RowListener told_;
  std::unique_ptr<Pictures> pictures_;
  State before_;  // at the end of the step before, for pictures
  DueTimes csv_clock_, vtu_clock_, restart_clock_;
  std::optional<double> csv_time_, vtu_time_, restart_time_;  // of the last that was written
  std::vector<std::string> written_;
};

}  // namespace espalier::dynamics::model
