/// \file
/// What every experiment of `espalier bench` is made of: systems, contestants, and the document of results.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "measure/document.hpp"
#include "rivals/session.hpp"

namespace espalier::bench {

/// One solver with its settings; `parameters` are the coordinates of the row in its experiment (an object).
struct Contestant {
  std::string spec;  ///< name or name:variant
  nlohmann::json parameters = nlohmann::json::object();
};

/// What the caller may choose. What is empty or 0 is chosen by the experiment (repetitions: what is not set).
struct Settings {
  std::vector<std::string> systems;  ///< generators with their sizes, matrix files, folders of matrix files
  std::vector<std::string> rivals;   ///< contestants, name or name:variant
  std::vector<std::string> points;   ///< what is swept: widths, budgets, devices
  std::string set;                   ///< peers: which systems (quick, cpu, gpu, gpus)
  std::string kind = "auto";
  Plan plan;
  std::optional<int> repetitions;  ///< timed rounds; 0: the first factorization and one solve after it alone
  int analyses = 0;                ///< rounds of analysis
  double time_seconds = 0;  ///< no system is begun later, nor one known to end later; left out is a row. 0: no limit
  bool ceilings = true;     ///< measure the machine's ceilings first (a second)
  std::string command;      ///< for the record
  std::string version;      ///< of Espalier, for the record
  std::string out;          ///< file of results, written after every system; empty: none
};

/// Where an experiment speaks to people; both may be empty.
struct Voice {
  Progress progress;                                   ///< what is about to happen
  std::function<void(const std::string& text)> print;  ///< whole lines: titles, tables
};

/// Measures contestants and keeps the document.
class Bench {
 public:
  /// Settles what plan.child lacks: folder, environment. Measures the ceilings unless told not to.
  Bench(std::string experiment, Settings settings, Voice voice);
  ~Bench();

  [[nodiscard]] const Settings& settings() const { return settings_; }
  [[nodiscard]] Plan& plan() { return settings_.plan; }
  [[nodiscard]] nlohmann::json& document() { return document_; }
  /// Systems that could be neither made nor read; their rows say why.
  [[nodiscard]] const std::vector<std::string>& unreadable() const { return unreadable_; }
  [[nodiscard]] int gpus() const;
  /// For runs outside this document: the same settings with so many timed rounds, one analysis and one right-hand side;
  /// says nothing and writes nothing.
  [[nodiscard]] Bench aside(int repetitions) const;

  /// The systems asked for, folders replaced by the matrix files in them, or `defaults`.
  /// @throws Error(invalid_input) for a folder without matrix files
  [[nodiscard]] std::vector<std::string> systems(std::vector<std::string> defaults) const;
  /// The points asked for, or `defaults`.
  [[nodiscard]] std::vector<std::string> points(std::vector<std::string> defaults) const;

  /// Runs the contestants on one system (of a folder: on the sequence of its matrices with the pattern that most of
  /// them share, one for each round), prints their table, adds their rows to the document and returns the rows. Never
  /// throws for what a system or a contestant does: a system that cannot be read, or that there is no time for, is a
  /// row of its own. `estimate`: seconds that it will take; 0: not known, and begun as long as there is time at all.
  nlohmann::json measure(const std::string& system, const std::vector<Contestant>& contestants, double estimate = 0);
  /// Adds a row that was not measured, and says why.
  void add_row(const std::string& system, const Contestant& contestant, const std::string& outcome,
               const std::string& message);
  void print(const std::string& text) const;
  void progress(const std::string& what) const;
  /// Writes the document if there is a file for it. @throws Error(invalid_input) when it cannot be written
  void save() const;

 private:
  struct Loaded;
  [[nodiscard]] double seconds_gone() const;  ///< since this object was made
  void read(const std::string& words);        ///< generator, file or folder, into loaded_
  const Loaded& load(const std::string& system);
  nlohmann::json rows_of(const std::string& system, const Loaded& loaded, const std::vector<Contestant>& contestants);

  Settings settings_;
  Voice voice_;
  nlohmann::json document_;
  std::vector<std::string> unreadable_;
  std::unique_ptr<Loaded> loaded_;  ///< the last matrix, kept for stages that ask for it again
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Where the rivals' host program lies: $ESPALIER_RIVALS_DIR, bench/rivals beside the binary (build folder), or
/// ../libexec/espalier (installed, bundle). The last one where none has it.
std::string rivals_folder();

}  // namespace espalier::bench
