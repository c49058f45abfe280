#!/usr/bin/env bash
# Records calls of real hosts into tests/hosts/recordings (recorder.cpp says what a line is):
#   tests/hosts/record.sh PYTHON RECORDER HSL_LIBRARY MKL_LIBRARY
# PYTHON has casadi, pypardiso and clarabel; RECORDER is build/release/tests/hosts/libespalier_recorder.so, HSL_LIBRARY our
# libespalier_hsl.so, MKL_LIBRARY Intel's libmkl_rt.so.*, whose answers become the truth of PARDISO's recordings.
set -euo pipefail
python=$1 recorder=$(realpath "$2") hsl=$(realpath "$3") mkl=$(realpath "$4")
folder=$(cd "$(dirname "$0")" && pwd)
export MKL_THREADING_LAYER=SEQUENTIAL

record() {  # NAME LIBRARY COMMAND...
  export ESPALIER_RECORD_FILE=$folder/recordings/$1.txt ESPALIER_RECORD_LIBRARY=$2
  rm -f "$ESPALIER_RECORD_FILE"
  shift 2
  "$@" >/dev/null
  wc -lc "$ESPALIER_RECORD_FILE"
}

for problem in hs013 hs071 hs118 redundant; do
  record "ipopt_$problem" "$hsl" "$python" "$folder/ipopt.py" --library "$recorder" --problems "$problem"
done

record pypardiso "$mkl" env "PYPARDISO_MKL_RT=$recorder" "$python" -c "
import numpy as np, pypardiso, scipy.sparse as sp
rng = np.random.default_rng(1)
A = (sp.random_array((40, 40), density=0.08, rng=rng) + 4 * sp.eye_array(40)).tocsr()
b = rng.standard_normal((40, 2))
solver = pypardiso.PyPardisoSolver()
pypardiso.spsolve(A, b, solver=solver)
pypardiso.spsolve(A.tocsc(), b[:, 0], solver=solver)      # rows and columns exchanged: iparm(12)
B = A.copy(); B.data *= 1.5
pypardiso.spsolve(B, b, solver=solver)
S = (A + A.T).tocsr() + 8 * sp.eye_array(40)
spd = pypardiso.PyPardisoSolver(mtype=2)
spd.factorize(sp.triu(S, format='csr')); spd.set_phase(33)
spd._call_pardiso(sp.triu(S, format='csr'), b)"

root=$(mktemp -d)
mkdir "$root/lib" && ln -s "$recorder" "$root/lib/libmkl_rt.so"
record clarabel "$mkl" env "MKLROOT=$root" "$python" "$folder/clarabel_qp.py" --run 2 mkl
rm -r "$root"
