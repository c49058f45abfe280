/// \file
/// Frequencies chosen one by one, until a rational function through the solutions says what lies between.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "harmonic/rational.hpp"
#include "harmonic/resonances.hpp"
#include "harmonic/sweep.hpp"

namespace espalier::harmonic {

/// Samples are solved at both ends, at equal steps, and next to each resonance that answers. Then, round by round, at
/// the places where the functions of this and the last round differ most, and at poles that no sample is near; each
/// new solve is compared with what the function said there. Where nothing differs by more than the tolerance, some
/// more are held against it: in the widest gaps, at the largest difference, and at random. Only if all agree, that is
/// the end.
class Adaptive {
 public:
  /// All outlive the object. @param damped  whether there is damping at all
  Adaptive(Sweep& sweep, const HarmonicOptions& options, HarmonicResult& result, double from, double to, bool damped);
  /// Solves at frequencies at which there is no sample yet. @param keep  see Sweep::solve()
  /// @param beside_too  where the system is singular, also at a frequency beside it
  void add(const std::vector<double>& frequencies, bool keep = false, bool beside_too = true);
  /// @param expected  see find_resonances()  @param excited  which of them answer, as found on the way
  /// @throws Error(accuracy_not_reached) where `max_solves` are not enough; deliver() gives what there is
  void run(const std::vector<Resonance>& expected, std::vector<char>& excited);
  /// Those asked for that lie too near to a frequency at which the system is singular to be interpolated.
  void solve_beside_singular(const std::vector<double>& wanted);
  /// All samples, and values of the function at the frequencies asked for and around peaks, into the result.
  void deliver(const std::vector<double>& wanted);

 private:
  struct Target {
    double frequency = 0, difference = 0;
  };
  /// A pole that the response shows, as a place on the axis of frequencies.
  struct Peak {
    double frequency = 0, half_width = 0;
    bool damped = true;
  };
  void fit();
  void note(const std::vector<Resonance>& expected, std::vector<char>& excited);
  [[nodiscard]] Eigen::VectorXd sizes_of(const Eigen::VectorXcd& y, const Eigen::VectorXd& floor) const;
  [[nodiscard]] double difference_at(double frequency) const;
  [[nodiscard]] std::vector<Peak> peaks(const Rational& r) const;
  [[nodiscard]] double nearest_sample(double frequency) const;  ///< distance
  [[nodiscard]] bool beside_singular(double frequency) const;
  [[nodiscard]] bool worth_a_sample(double frequency) const;
  /// The worst place of each interval between samples, and peaks without a sample; the worst first.
  [[nodiscard]] std::vector<Target> doubtful() const;
  [[nodiscard]] std::vector<double> to_check(const std::vector<Target>& all);
  /// Solves there. @return how far the function was off, relative, at the worst of them
  double try_out(const std::vector<double>& frequencies);
  /// Without those outside of the range, and those next to samples or to others before them.
  [[nodiscard]] std::vector<double> apart(const std::vector<double>& frequencies) const;
  [[nodiscard]] Eigen::VectorXd noise() const;
  [[nodiscard]] double length() const { return to_ - from_; }

  Sweep& sweep_;
  const HarmonicOptions& options_;
  HarmonicResult& result_;
  double from_, to_;
  bool damped_;
  std::vector<Solved> samples_;            // rising, without those on a resonance
  std::vector<Solved> singular_, beside_;  // rising; beside_: next to those, solved and not interpolated with
  std::vector<double> at_;                 // of samples_
  Eigen::MatrixXcd values_;                // outputs x samples
  Eigen::VectorXd floor_, sketch_floor_;   // of each output: the least size that errors are relative to
  Eigen::MatrixXcd mixing_;                // a few random sums of outputs stand for all of them in fits,
  Eigen::VectorXd unit_;                   // each output in units of its median at the start
  Rational now_, before_;
  std::uint64_t random_ = 12345;
};

}  // namespace espalier::harmonic
