/// \file
/// What a device does per second, measured, so that unequal devices get unequal parts.
#pragma once

#include <string>

namespace espalier::device {

struct DeviceRates {
  double flops = 0;       ///< per second, in FP64
  double copy_bytes = 0;  ///< per second, read and written, within the device's memory
  std::string refused;    ///< why the device could not be used; empty: it can
};

}  // namespace espalier::device
