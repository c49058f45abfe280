/// \file
/// The page of a run that goes on: what it will show is collected, and its file is renewed from time to time.
#pragma once

#include <chrono>
#include <string>

#include "dynamics/page/page.hpp"

namespace espalier::dynamics::page {

class LivePage {
  using Clock = std::chrono::steady_clock;

 public:
  /// @param folder  of index.html; empty: no file @param begin, end, wished  as of Film
  LivePage(const model::Mechanism& mechanism, const model::Description& model, const std::string& folder, double begin,
           double end, double wished);
  [[nodiscard]] Film& film() { return film_; }
  [[nodiscard]] Rows& rows() { return rows_; }
  /// @return whether it is time to renew the file
  bool step(const model::Sample& s);
  [[nodiscard]] bool due() const { return !path_.empty() && Clock::now() >= due_; }
  void restore(const model::Sample& s);

  /// @throws Error(invalid_input) when the file cannot be written
  void write(const RunOfPage& run);
  /// As text, with the rows that are given where it has none of its own.
  [[nodiscard]] std::string text(const RunOfPage& run, const Rows& others);
  [[nodiscard]] const std::string& written() const { return written_; }  ///< the file; empty: it is not there

 private:
  Film film_;
  Rows rows_;
  std::string path_, written_;
  Clock::time_point due_;
};

}  // namespace espalier::dynamics::page
