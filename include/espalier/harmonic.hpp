/// \file
/// Frequency response: the amplitudes and phases with which a linear system answers harmonic loads,
///
///     (K (1 + i eta) + i w C - w^2 M) x = f,   w = 2 pi frequency,
///
/// where a load Re(f e^{i w t}) moves the system by Re(x e^{i w t}).
#pragma once

#include <complex>
#include <span>
#include <string>
#include <vector>

#include "espalier/matrix.hpp"
#include "espalier/solver.hpp"

namespace espalier {

/// Where a response is wanted, and how exactly. Frequencies are cycles per unit of time, not negative.
struct HarmonicOptions {
  double from = 0;           ///< lowest frequency
  double to = 0;             ///< highest frequency, above `from`
  Index points = 101;        ///< equally spaced from `from` to `to`, at least 2
  bool logarithmic = false;  ///< equal ratios of frequencies instead of equal steps; `from` is then above 0
  /// Frequencies, rising, instead of `from`, `to` and `points`.
  std::vector<double> frequencies;
  /// 0: the system is solved at each frequency. Above it (1e-10 to 0.1): at chosen frequencies alone, and a rational
  /// function gives what lies between with about this error, relative to each response's magnitude (but not below a
  /// hundredth of its median over the solves, which gather at the peaks).
  double tolerance = 0;
  Index max_solves = 1000;        ///< most frequencies at which the system is solved for a `tolerance`
  bool seek_resonances = true;    ///< for a `tolerance`: find the modes first, and solve next to each that answers
  double loss_factor = 0;         ///< eta of structural (hysteretic) damping, not negative
  std::vector<Index> observed;    ///< unknowns whose responses are returned, 0-based; empty: all
  std::vector<double> shapes_at;  ///< frequencies at which all unknowns are returned, in `shapes`
  Options solver;                 ///< device, threads, memory, log lines, interruption; kind and precision are ours
};

/// One frequency of a response.
struct HarmonicPoint {
  double frequency = 0;
  bool solved = true;  ///< false: interpolated
  /// The status of the solution; singular: the frequency lies on a resonance without damping, responses are NaN.
  Status status;
  double backward_error =
      0;  ///< |f - Z x|_inf / (|Z|_inf |x|_inf + |f|_inf), the largest of all loads; NaN: not solved
  double error_estimate = 0;  ///< of an interpolated point, as in HarmonicOptions::tolerance; 0: solved
};

/// A resonance in the range, of the pencil (K, M) with C and eta in the space of its modes.
struct HarmonicResonance {
  double frequency = 0;
  double half_width = 0;  ///< distance in frequency at which the peak has fallen to 1 / sqrt(2)
  bool excited = false;   ///< by one of the loads, and seen in one of the observed unknowns
};

struct HarmonicSeconds {
  double total = 0;
  double modes = 0;          ///< search for resonances
  double analysis = 0;       ///< of the complex matrix, once
  double factorization = 0;  ///< all of them
  double solves = 0;
  double interpolation = 0;  ///< rational functions
};

/// What was found stands here also where the status is not ok.
struct HarmonicResult {
  Status status;
  Index n = 0;                        ///< rows of K
  Index loads = 0;                    ///< columns of f
  Index outputs = 0;                  ///< observed unknowns
  std::vector<HarmonicPoint> points;  ///< rising; for a tolerance also those solved and those that draw the peaks
  /// points() x loads x outputs, the outputs of one load next to each other.
  std::vector<std::complex<double>> responses;
  std::vector<double> shape_frequencies;      ///< of `shapes`
  std::vector<std::complex<double>> shapes;   ///< shape_frequencies x loads x n
  std::vector<HarmonicResonance> resonances;  ///< in the range, rising; with a tolerance alone
  bool complete = false;     ///< for a tolerance: the undamped resonances in the range are proven to be all
  std::string completeness;  ///< how, or why not
  double checked_error = 0;  ///< largest error of the interpolation at the last solves that were held back
  Index checks = 0;          ///< how many these were
  Index factorizations = 0;  ///< of the complex matrix
  Offset solved_columns = 0;
  HarmonicSeconds seconds;

  /// @pre indices inside points, loads, outputs
  [[nodiscard]] std::complex<double> response(std::size_t point, Index load, Index output) const {
    return responses[(point * static_cast<std::size_t>(loads) + static_cast<std::size_t>(load)) *
                         static_cast<std::size_t>(outputs) +
                     static_cast<std::size_t>(output)];
  }
};

/// Responses to `columns` loads, n complex amplitudes each, one after another. K, C and M are real, of one size, any
/// storage, 0-based; M and C may be singular. C without rows: no damping. Where all three are symmetric (to 1e-12 of
/// their largest entries) Z = L D L^T, else Z = L U; one analysis serves all frequencies. Rows of constraints, [K G^T;
/// G 0], have no entries in C and M.
///
/// With a tolerance: set-valued AAA (Y. Nakatsukasa, O. Sete, L. Trefethen, "The AAA algorithm for rational
/// approximation", SIAM J. Sci. Comput. 40, 2018; P. Lietaert, K. Meerbergen, J. Perez, B. Vandereycken, "Automatic
/// rational approximation and linearization of nonlinear eigenvalue problems", IMA J. Numer. Anal. 42, 2022). New
/// solves judge the function before they are taken into it. Resonances that are much narrower than the spacing come
/// from find_modes(), whose count is proven, with C and eta projected on the modes. That covers light damping of any
/// form; dampers that are so stiff that they hold the structure make resonances that this may not foresee.
///
/// Status invalid_input: matrices of other sizes or with numbers that are not finite; no load, or one that is all
/// zeros; frequencies that are negative, not finite or do not rise; options out of range. singular: a frequency lies
/// on a resonance without damping (that point says so, the others are given), or Z is singular everywhere.
/// accuracy_not_reached: `max_solves` were not enough, or a backward error is above 1e-10. out_of_memory,
/// device_error, cancelled: as for ComplexSolver.
HarmonicResult harmonic_response(const MatrixView& k, const MatrixView& c, const MatrixView& m,
                                 std::span<const std::complex<double>> loads, Index columns,
                                 const HarmonicOptions& options);

}  // namespace espalier
