/// \file
/// The norm of a changed matrix, by the rows that changes touch.
#pragma once

#include "changes/border.hpp"

namespace espalier::changes {

/// |M|_inf of the rows and columns that count, or a little less where changes touch thousands of rows.
double row_norm(const ChangedMatrix& matrix, Base& base, const Border& border);

}  // namespace espalier::changes
