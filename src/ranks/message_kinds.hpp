/// \file
/// A communicator's own messages; those of others have kinds from 0 on.
#pragma once

#include <cstdint>

namespace espalier::ranks {

enum MessageKind : std::int32_t {
  kPart = -1,   // of an all_gather(); number: bytes of the whole
  kAbort = -2,  // the sender has given up this call; the body says why
  kLost = -3,   // ... and knows that a rank is lost
  kSign = -4,   // of life
};

}  // namespace espalier::ranks
