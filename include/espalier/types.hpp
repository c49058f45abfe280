/// \file
/// The vocabulary shared by every public header: index types, enumerations, status.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace espalier {

/// Row and column indices, 0-based. A matrix has fewer than 2^31 rows.
using Index = std::int32_t;
/// Counts of nonzeros and positions in value arrays; may exceed 2^31.
using Offset = std::int64_t;

/// Which entries of the matrix the arrays hold.
enum class Storage {
  general,          ///< every entry, no symmetry assumed
  symmetric_lower,  ///< symmetric, entries with row >= column only
  symmetric_upper,  ///< symmetric, entries with row <= column only
  symmetric_both,   ///< symmetric, both triangles are stored
  hermitian_lower,  ///< complex: a_ji is the conjugate of a_ij; entries with row >= column only
  hermitian_upper,  ///< likewise, entries with row <= column only
  hermitian_both,   ///< likewise, both triangles are stored
};

/// The factorization. `automatic` takes llt for a symmetric matrix with a positive diagonal and falls back to ldlt
/// when a pivot is not positive; ldlt for any other symmetric matrix; lu otherwise.
enum class Kind { automatic, llt, ldlt, lu };

/// Precision of the factor. `mixed` factors in FP32 and refines to FP64 accuracy. `automatic` is mixed where the
/// devices are predicted to gain by it, and goes to FP64, until the next analysis, when FP32 does not do for the
/// matrix, when a solution is less accurate than asked for, or when two factors with their solves took longer than FP64
/// would have.
enum class Precision { fp64, fp32, mixed, automatic };

/// Which system is solved: A x = b, A^T x = b or A^H x = b (A^T of a real matrix).
enum class Transpose { no, yes, conjugate };

/// How a call ended. The numbers are stable (they are part of the C interface).
enum class StatusCode {
  ok = 0,
  invalid_input = 2,          ///< unreadable or inconsistent input (file, line or row is in the message)
  singular = 3,               ///< structurally or numerically singular
  not_positive_definite = 4,  ///< llt met a pivot that is not positive
  out_of_memory = 5,          ///< the budget or the machine's memory is too small; the message names what is needed
  device_error = 6,           ///< a device failed; the call and its error name are in the message
  accuracy_not_reached = 7,   ///< refinement stopped above the requested backward error; the solution is returned
  cancelled = 8,              ///< the caller asked to stop
};

/// An expected failure is a value of this type; misuse (wrong sizes, wrong state) throws std::invalid_argument or
/// std::logic_error.
struct [[nodiscard]] Status {
  StatusCode code = StatusCode::ok;
  std::string message;  ///< what happened, where, and what to do; empty when ok
  Index row = -1;       ///< the row of the caller's matrix concerned, 0-based; -1 when none
  [[nodiscard]] bool ok() const { return code == StatusCode::ok; }
};

/// Thrown inside the library where a failure must unwind (allocation, device call, parse error); every public entry
/// turns it into the Status that it carries.
class Error : public std::runtime_error {
 public:
  explicit Error(Status status) : std::runtime_error(status.message), status_(std::move(status)) {}
  Error(StatusCode code, std::string message, Index row = -1) : Error(Status{code, std::move(message), row}) {}
  [[nodiscard]] const Status& status() const { return status_; }

 private:
  Status status_;
};

}  // namespace espalier
