/// \file
/// The numbers of UMFPACK's C interface (versions 5 and 6) that we read or write, by what they say.
#pragma once

namespace espalier::hosts::umfpack {

constexpr int kInfos = 90, kControls = 20;

enum Status : int {
  kOk = 0,
  kSingular = 1,  ///< a warning
  kUnderflow = 2,
  kOverflow = 3,
  kNoMemory = -1,
  kBadNumeric = -3,
  kBadSymbolic = -4,
  kMissing = -5,  ///< a null pointer
  kBadOrder = -6,
  kBadMatrix = -8,
  kOtherPattern = -11,
  kBadSystem = -13,
  kInternal = -911,
};

/// Index of Info, from 0.
enum Info : int {
  kStatus = 0,
  kRows = 1,
  kEntries = 2,
  kSizeOfUnit = 3,
  kSizeOfInt = 4,
  kSizeOfLong = 5,
  kSizeOfPointer = 6,
  kSizeOfEntry = 7,
  kSymbolicTime = 15,
  kColumns = 16,
  kSymbolicWallTime = 17,
  kSizeEstimate = 20,
  kPeakEstimate = 21,
  kFlopsEstimate = 22,
  kLowerEstimate = 23,
  kUpperEstimate = 24,
  kSymmetricFlops = 37,  ///< of the order that a symmetric strategy takes; -1 with the other
  kSize = 40,
  kPeak = 41,
  kFlops = 42,
  kLower = 43,
  kUpper = 44,
  kFactorEntries = 64,
  kNumericTime = 65,
  kPivots = 66,  ///< that are not zero
  kRcond = 67,
  kNumericWallTime = 75,
  kAllLower = 77,
  kAllUpper = 78,
  kStepsTaken = 80,
  kStepsTried = 81,
  kOmega1 = 82,
  kOmega2 = 83,
  kSolveTime = 85,
  kSolveWallTime = 86,
};

/// Index of Control.
enum ControlPlace : int { kRefinementSteps = 7 };
constexpr int kDefaultSteps = 2;

/// The first argument of umfpack_*_solve: A, A^H, A^T, and parts of the factors up to kLastSystem.
enum System : int { kA = 0, kAt = 1, kAat = 2, kLastSystem = 14 };

}  // namespace espalier::hosts::umfpack
