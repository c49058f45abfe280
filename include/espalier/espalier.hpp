/// \file
/// Everything public.
#pragma once

#include "espalier/matrix.hpp"
#include "espalier/modes.hpp"
#include "espalier/solver.hpp"
#include "espalier/types.hpp"
