/// \file
/// Everything public.
#pragma once

#include "espalier/batch.hpp"
#include "espalier/changed_system.hpp"
#include "espalier/complex_solver.hpp"
#include "espalier/harmonic.hpp"
#include "espalier/inverse.hpp"
#include "espalier/matrix.hpp"
#include "espalier/modes.hpp"
#include "espalier/schur.hpp"
#include "espalier/solve_rows.hpp"
#include "espalier/solver.hpp"
#include "espalier/types.hpp"
