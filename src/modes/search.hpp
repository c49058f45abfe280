/// \file
/// The search for the lowest modes of K x = l M x: which shifts, what is sought from each, and the proof that none is
/// missing.
#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/stage.hpp"
#include "modes/device_search.hpp"
#include "modes/harvest.hpp"
#include "modes/lanczos.hpp"
#include "modes/mass.hpp"
#include "modes/pencil.hpp"

namespace espalier::modes {

class Search {
 public:
  Search(SparseMatrix k, SparseMatrix m, const ModesOptions& options, Resources& shop, ModesResult& result);
  /// @throws Error where nothing can be found; what was found when it gives up is in the result all the same
  void run();
  /// What was found goes into the result, with its residuals.
  void deliver();

 private:
  // Shifts (search_shifts.cpp)
  void measure();
  [[nodiscard]] double first_shift() const;
  void refuse_count();
  double count_below_zero();
  void choose_first();
  void count_below_bound();
  bool choose_next();
  bool choose_below();
  double beyond_found() const;
  double gap_after_wanted() const;
  bool try_count(double s);
  bool count_before_wanted();
  double distance_from_shifts(double eigenvalue) const;
  Index count_at(double& s, bool movable);
  [[nodiscard]] Status impossible(Index negative, double s) const;
  [[nodiscard]] double near(double eigenvalue) const;
  [[nodiscard]] double rounding_at(double at) const;
  [[nodiscard]] bool accounts_for(const ModeCount& count) const;
  [[nodiscard]] bool contradicted() const;
  [[nodiscard]] std::optional<ModeCount> missing() const;
  [[nodiscard]] std::optional<ModeCount> proven() const;
  [[nodiscard]] bool proves_wanted(const ModeCount& count) const;
  [[nodiscard]] int most_factorizations() const;
  void look_at_mass_and_prepare();
  void seek();
  void start_anew();
  // Vectors (search.cpp)
  struct Sought {
    LanczosOptions options;
    double from;               // modes known above it are kept out
    Index known, most, least;  // so many; columns of the basis
  };
  void explore();
  LanczosResult search(const Sought& sought);
  void collect(const LanczosResult& found, const std::function<void(const Dense&, double*)>& make);
  std::vector<char> purify(Tall& batch, double rounding, std::vector<double>& eigenvalues);
  void take_modes(Tall batch, std::vector<double> eigenvalues, std::vector<double> bounds,
                  const std::vector<char>& good);
  void clear_massless(double* x, Index columns) const;
  std::optional<Workspace> device_workspace(Index most, Index least);
  [[nodiscard]] Index known_beyond(double from) const;
  [[nodiscard]] bool finished() const;
  void say_complete();

  const ModesOptions& options_;
  Resources& shop_;
  ModesResult& result_;
  base::Stage stage_{"modes", 0, "modes"};
  Pencil pencil_;
  Product stiffness_, mass_;
  std::vector<double> mass_diagonal_;
  double k_norm_, m_norm_;
  MassReport report_;
  Harvest harvest_;
  LanczosClock clock_;
  SpectralOperator op_;                      // on the host
  std::unique_ptr<DeviceSearch> on_device_;  // null: there is none, or it has no room
  bool device_asked_ = false;
  Index extra_ = 0;   // sought beyond the wanted ones, to the end of a cluster
  Index before_ = 0;  // modes that were known when those before the last one wanted were counted
  Index wanted_ = 0;  // modes to be found
  Index block_ = 8;
  double typical_ = 0;  // of the larger eigenvalues, their median; see measure()
  double unit_ = 1;     // what is small among eigenvalues
  double largest_ = 1;  // about the largest eigenvalue
  double shift_ = 0;    // of the factor that there is
  Index below_shift_ = 0;
  std::vector<ModeCount> counts_;  // rising
  double blurred_ = NAN;           // shift from which those before the last one wanted could not be counted
  std::vector<double> singular_;   // where K - s M could not be factorized
  double right_edge_ = 0;          // the next Ritz value beyond what was found; NaN: none was seen
  int attempts_ = 0;               // at this shift
  bool news_ = false;              // the last one of them found modes
  bool exact_ = true;
  std::uint64_t draws_ = 0;
};

}  // namespace espalier::modes
