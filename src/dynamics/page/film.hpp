/// \file
/// What the page shows of a run: pictures at even times, as many as a page can hold.
#pragma once

#include <atomic>
#include <chrono>
#include <limits>
#include <string>
#include <vector>

#include "base/background.hpp"
#include "dynamics/model/output/quantities.hpp"
#include "dynamics/model/run/due_times.hpp"
#include "dynamics/page/drawn.hpp"
#include "dynamics/page/json_text.hpp"
#include "dynamics/page/marks.hpp"
#include "dynamics/page/nodal_stress.hpp"
#include "dynamics/page/packed.hpp"
#include "dynamics/page/thin_stress.hpp"

namespace espalier::dynamics::page {

/// A shape that the bodies swing in about a state: displacements of all points, real and imaginary part.
struct Swing {
  std::string name;             ///< "mode 1", of a load
  double frequency = 0;         ///< 0: none is known
  std::vector<double> shift;    ///< per velocity coordinate: at phase 0 ...
  std::vector<double> shift90;  ///< ... and a quarter of a period later; empty: zero
};

class Film {
 public:
  /// Both outlive it. @param begin, end  of the run; end infinite, or steps of loads: every step is taken, and of too
  /// many every second one is dropped @param wished  interval of the model's own pictures; <= 0: none
  Film(const model::Mechanism& mechanism, const model::Description& model, double begin, double end, double wished);

  /// @param reference  displacements count from it
  void begin(const model::Sample& s, const State& reference);
  void step(const model::Sample& s);
  void end(const model::Sample& s);  ///< the state where the run stands, now or for good, whatever its time
  void restore(const model::Sample& s);
  /// Shapes of modes or of a response about a state.
  void swing(const State& about, const std::vector<Swing>& shapes);

  /// Waits until everything is there. The members "scene" (JSON) and what it names by number (base64 of gzip).
  struct Content {
    std::string scene;
    std::vector<std::string> pieces;
  };
  [[nodiscard]] Content content();
  /// The largest von Mises stress of each solid in the pictures.
  [[nodiscard]] std::vector<SimulationExtreme> peaks();

 private:
  struct Frame {
    double t = 0;
    Quantized numbers;
    std::string packed;  // instead of numbers.steps, of large ones
    std::vector<NodalStress::Peak> peaks;
  };
  struct Section {
    const char* name;
    std::size_t count;
  };
  struct Taken;
  [[nodiscard]] Frame frame_of(const Taken& taken);
  void take(const State& s, const State& end);
  /// Whether pictures have taken so much of the run's time that one is left out.
  [[nodiscard]] bool dear();
  void thin_out();
  [[nodiscard]] std::vector<Section> sections() const;
  void add_frames(JsonObject& scene, std::vector<std::string>& pieces) const;
  void add_shape(JsonObject& scene, std::vector<std::string>& pieces) const;

  const model::Mechanism& mechanism_;
  Drawn drawn_;
  Marks marks_;
  NodalStress stress_;
  ThinStress thin_;
  model::DueTimes times_;
  std::size_t most_;
  long stride_ = 1, seen_ = 0;  // of steps, where every step is taken
  bool fewer_ = false;          // than is usual, for their size
  State before_;
  Quantized rest_;
  std::vector<Frame> frames_;      // from take() to wait() the background's
  std::atomic<double> spent_ = 0;  // seconds
  std::chrono::steady_clock::time_point begun_;
  std::atomic<std::size_t> large_ = 0;  // bytes of the large ones
  std::size_t taken_ = 0;               // of them, by the caller's count
  std::string shapes_;                  // JSON
  std::vector<std::string> shape_pieces_;
  double last_ = std::numeric_limits<double>::quiet_NaN();
  base::Background background_;  // uses what stands above
};

}  // namespace espalier::dynamics::page
